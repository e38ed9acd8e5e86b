"""What the console knows of one site does not come along to the next."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.console.beware.recent_frames import RecentFrames
from app.console.mission.anchored_items import AnchoredItems
from app.console.mission.expiry_dates import ExpiryDates
from app.console.operations import LiveOperations
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.recorder import Recorder
from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import colour_perception, compose
from app.storage import Store
from app.storage.site_store import SiteStore
from navcore.config.navigator import NavigatorConfig
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.app.runtime.control.controlled import forget_frames
from tests.reliability.fault_runs import BenchRobot, first_frame, standing_controller
from web.interface.drafts import ZoneDraft

SECOND = 1_000_000_000


def operations_of(controller: RobotController, scene: Frame, store: Store) -> LiveOperations:
    """Return the operations of a console whose robot stands."""
    return LiveOperations(
        robot=BenchRobot(scene=scene, controller=controller),
        controller=controller,
        store=store,
        recorder=Recorder(controller=controller, store=store, referee=None, scenario="bench"),
        robot_urdf=None,
        perception=LivePerception(colour_perception()),
        data=store.path.parent,
        config=NavigatorConfig(),
        compose=functools.partial(compose, sensor=HUSKY.depth_sensor),
    )


def test_a_tick_that_ends_after_a_change_of_site_leaves_nothing_of_its_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recent, noted = RecentFrames(), list[str]()

    class Recorded(AnchoredItems):
        def note_tick(self, *given: Any, **named: Any) -> tuple[str, ...]:
            noted.append("anchored")
            return super().note_tick(*given, **named)

        def begin(self, *, is_new: bool) -> None:
            noted.append("begun" if is_new else "gone on")
            super().begin(is_new=is_new)

    monkeypatch.setattr("app.console.operations.RecentFrames", lambda: recent)
    monkeypatch.setattr("app.console.operations.AnchoredItems", Recorded)
    controller, scene = standing_controller(), first_frame()
    with closing(Store(tmp_path)) as store:
        operations = operations_of(controller, scene, store)
        stamps, ended, entering = itertools.count(1), threading.Event(), threading.Lock()

        def tick() -> None:
            frame = dataclasses.replace(scene, stamp_ns=next(stamps) * SECOND)
            with entering:
                forget_frames(controller)  # the image is the same, again
                decision = controller.think(frame, clock=lambda: frame.stamp_ns)
            assert decision is not None
            operations.note_decision(decision)

        def ticking() -> None:
            while not ended.is_set():
                tick()

        tick()
        (old,) = recent.all
        operations.sites.make("hall")
        stale, enter = controller.tick_state.decision, operations.enter_site
        assert stale is not None

        def enter_and_end_the_tick(site: SiteStore) -> None:
            with entering:
                enter(site)
                noted.clear()
                operations.note_decision(stale)
                assert old.frame in [one.frame for one in recent.all] and "anchored" in noted

        monkeypatch.setattr(operations, "enter_site", enter_and_end_the_tick)
        thread = threading.Thread(target=ticking)
        thread.start()
        operations.sites.choose("hall")
        ended.set()
        thread.join()
        tick()
        assert old.frame not in [one.frame for one in recent.all]
        assert "begun" in noted and "gone on" not in noted


def test_zones_follow_the_map_also_where_the_record_of_a_tick_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted = list[object]()

    def note_tick(_: AnchoredItems, *given: object, **named: object) -> tuple[str, ...]:
        noted.append(named)
        return ()

    monkeypatch.setattr(AnchoredItems, "note_tick", note_tick)
    monkeypatch.setattr(Recorder, "note_decision", lambda *_: 1 / 0)
    controller, scene = standing_controller(), first_frame()
    with closing(Store(tmp_path)) as store:
        operations = operations_of(controller, scene, store)
        decision = controller.think(scene, clock=lambda: scene.stamp_ns)
        assert decision is not None
        with pytest.raises(ZeroDivisionError):
            operations.note_decision(decision)
    assert noted == [{"has_moved": False}]


def test_a_zone_drawn_for_an_hour_lasts_an_hour_also_after_a_visit_to_another_site(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s, set_by_s = [1e9], [0.0]
    dates = ExpiryDates(lambda: now_s[0] + set_by_s[0], lambda: now_s[0])
    monkeypatch.setattr("app.console.operations.ExpiryDates", lambda: dates)
    controller, scene = standing_controller(), first_frame()
    with closing(Store(tmp_path)) as store:
        operations = operations_of(controller, scene, store)
        home = store.site
        square = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0))
        operations.zones.add(ZoneDraft(name="wet", polygon=square, expires_in_s=3600.0))
        set_by_s[0] = 1e8
        operations.enter_site(store.sites.make("hall"))
        operations.enter_site(home)
        for past_s, is_on in ((3599.0, True), (3601.0, False)):
            now_s[0] = 1e9 + past_s
            operations.zones.expire()
            assert home.zones()[0].enabled is is_on
