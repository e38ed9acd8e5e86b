"""The explanation of a real navigator's decision, and the images that operators correct."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from app.console.mission.path_preview import kept_zones
from app.runtime.control.robot_controller import RobotController
from app.storage import Store
from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.supervisor import Behaviour
from navcore.errors import Refused
from navcore.learning.data.dataset import load_dataset
from navcore.mission.mission import Mission
from navcore.mission.zone import OWN_COLOUR, Zone
from navcore.mission.zone_growth import grow
from navcore.perception.labels import Labels
from tests.app.insight.test_event_log import insight_of
from tests.reliability.fault_runs import first_frame, standing_controller


def test_a_keep_out_of_the_robot_itself_is_among_the_reasons_for_its_path(
    tmp_path: Path,
) -> None:
    controller, store = standing_controller(), Store(tmp_path)
    insight = insight_of(store, tmp_path, controller)
    frame = first_frame()
    x, y = frame.pose.x_m, frame.pose.y_m
    controller.change_mission(
        lambda mission: mission.add(x + 5.0, y, controller.navigator.map.spec).start()
    )
    across = ((x + 2.0, y - 0.5), (x + 2.4, y - 0.5), (x + 2.4, y + 0.5), (x + 2.0, y + 0.5))
    lane = Zone(
        id="lane 0", name="where a person walks to and fro", polygon=across, colour=OWN_COLOUR
    )
    controller.navigator.behaviour = Behaviour(lanes=LaneKeepOut(zones=(lane,)))
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None and decision.closed == (lane,)
    insight.note_decision(decision)
    [rule] = [rule for rule in insight.explain().rules if rule.name == lane.name]
    assert rule.along_m > 0 and rule.saves_m is not None and rule.saves_m > 0.05
    assert insight.without([rule.key]).difference_m == -rule.saves_m
    store.close()


def zone_ahead(controller: RobotController, ahead_m: tuple[float, float], aside_m: float) -> Zone:
    """Have the robot drive 5 m ahead, past a zone."""
    frame = first_frame()
    x, y = frame.pose.x_m, frame.pose.y_m
    controller.change_mission(
        lambda mission: mission.add(x + 5.0, y, controller.navigator.map.spec).start()
    )
    near, far = (x + distance_m for distance_m in ahead_m)
    corners = ((near, y - aside_m), (far, y - aside_m), (far, y + aside_m), (near, y + aside_m))
    zone = Zone(id="z", name="wet floor", polygon=corners)
    controller.change(lambda state: dataclasses.replace(state, zones=(zone,)))
    return zone


def test_a_path_is_explained_by_the_zones_as_the_robot_keeps_out_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller, store = standing_controller(), Store(tmp_path)
    insight, frame = insight_of(store, tmp_path, controller), first_frame()
    drawn = zone_ahead(controller, (2.0, 2.4), 0.1)
    grown = grow(drawn, np.eye(2) * 0.4)
    follow = controller.navigator.zone_margins.follow
    monkeypatch.setattr(
        controller.navigator.zone_margins, "follow", lambda *given: (follow(*given), (grown,))[1]
    )
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None
    insight.note_decision(decision)
    [rule] = [rule for rule in insight.explain().rules if rule.name == drawn.name]
    assert rule.along_m > 0 and rule.saves_m is not None and rule.saves_m > 0.2
    assert kept_zones((drawn,), decision.request.zones) == (grown,)
    edited = dataclasses.replace(drawn, version=2)
    assert kept_zones((edited,), decision.request.zones) == (edited,)
    store.close()


def test_another_price_of_unseen_floor_or_other_zones_are_explained_at_once(tmp_path: Path) -> None:
    controller, store = standing_controller(), Store(tmp_path)
    insight, frame = insight_of(store, tmp_path, controller), first_frame()
    zone = zone_ahead(controller, (2.0, 2.4), 0.1)
    controller.change_mission(Mission.pause)
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None and decision.request.zones == (zone,)
    insight.note_decision(decision)
    before = insight.explain()
    assert insight.explain() is before
    controller.change(lambda state: dataclasses.replace(state, unknown_price=8.0))
    dearer = insight.explain()
    assert dearer is not before
    request = dataclasses.replace(decision.request, zones=())
    insight.note_decision(dataclasses.replace(decision, request=request))
    assert "wet floor" in {rule.name for rule in dearer.rules}
    assert "wet floor" not in {rule.name for rule in insight.explain().rules}
    store.close()


def test_a_path_that_ends_beside_its_goal_is_explained_and_not_called_blocked(
    tmp_path: Path,
) -> None:
    controller, store = standing_controller(), Store(tmp_path)
    insight, frame = insight_of(store, tmp_path, controller), first_frame()
    zone_ahead(controller, (5.45, 6.0), 0.1)
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None and decision.route is not None
    goal = controller.intent.mission.queue[0]
    beside_m = np.hypot(*(decision.route.points[-1] - (goal.x_m, goal.y_m)))
    assert decision.route.reaches_goal and 0.0 < beside_m < 0.2  # control
    insight.note_decision(decision)
    driven = insight.explain()
    assert driven.reason is None
    assert driven.length_m == pytest.approx(decision.route.length_m, abs=0.1)
    controller.change_mission(Mission.pause)
    later = dataclasses.replace(
        frame,
        stamp_ns=frame.stamp_ns + 10**8,
        depth_m=frame.depth_m + np.float32(1e-4),
        rgb=frame.rgb ^ np.uint8(1),
    )
    paused = controller.think(later, clock=lambda: later.stamp_ns)
    assert paused is not None and paused.route is None
    insight.note_decision(paused)
    assert insight.explain().reason is None
    store.close()


def test_an_example_of_a_renamed_class_is_trained_as_the_class_that_detects_it(
    tmp_path: Path,
) -> None:
    controller, store = standing_controller(), Store(tmp_path / "data")
    insight, frame = insight_of(store, tmp_path / "labelling", controller), first_frame()
    controller.change(
        lambda state: dataclasses.replace(state, beware=state.beware.renamed("cup", "mug"))
    )
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None
    # The clock of a robot that has run for half a year: JavaScript must not round the id.
    late = dataclasses.replace(frame, stamp_ns=2**54 + 1)
    insight.note_decision(dataclasses.replace(decision, frame=late))
    snapshot = insight.snapshot()
    assert int(float(snapshot)) == snapshot < 2**53 and insight.snapshot_image(snapshot)
    insight.add_example(snapshot, "mug", (10, 10, 60, 60))
    stored = load_dataset(tmp_path / "labelling")
    names = [name.casefold() for name in stored.card.class_names]
    assert "mug" not in names
    assert names.index("cup") + 1 in np.unique(stored.read("train", 0).labels)
    store.close()


def test_a_detection_is_told_by_its_label_and_corrected_once(tmp_path: Path) -> None:
    controller, store = standing_controller(), Store(tmp_path / "data")
    insight, frame = insight_of(store, tmp_path / "labelling", controller), first_frame()
    controller.change(
        lambda state: dataclasses.replace(
            state,
            beware=state.beware.edited("cup", label="Tasse", min_confidence=0.5).edited(
                "book", label="Buch"
            ),
        )
    )
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None
    cup = controller.intent.beware.named("cup").class_id
    class_ids = np.zeros(frame.depth_m.shape, np.uint8)
    rows, cols = frame.intrinsics.height, frame.intrinsics.width
    class_ids[rows * 3 // 4 : rows * 7 // 8, cols // 2 : cols * 5 // 8] = cup
    labels = Labels(class_ids=class_ids, confidence=np.full(class_ids.shape, 0.9, np.float32))
    insight.note_decision(dataclasses.replace(decision, labels=labels))
    insight._update()
    (seen,) = insight.detections.all()
    entries = insight.event_log.page(kinds=(), since=0, limit=9).entries
    texts = [entry.text for entry in entries if entry.kind == "seen"]
    assert texts == ["First sight of “Tasse” here, 90% sure."]
    assert insight.mark_wrong(seen.id, "book").pictures == 1
    entries = insight.event_log.page(kinds=(), since=0, limit=9).entries
    texts = [entry.text for entry in entries if entry.kind == "labelled"]
    assert texts == [f"Sighting {seen.id} was called wrong: it is “Buch”."]
    with pytest.raises(Refused, match="corrected or rejected before"):
        insight.mark_wrong(seen.id, None)
    assert insight.labelling.state().pictures == 1
    # A tick that is noted and not yet processed when its map is forgotten leaves nothing.
    insight.note_decision(dataclasses.replace(decision, labels=labels))
    insight.forget_place()
    insight._update()
    assert insight.detections.all() == ()
    store.close()


def test_candidate_motions_end_at_what_the_local_planner_keeps_from(tmp_path: Path) -> None:
    controller, store, frame = standing_controller(), Store(tmp_path), first_frame()
    insight = insight_of(store, tmp_path, controller)
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None
    nothing, ahead = np.empty((0, 2)), np.array([[0.9, y] for y in np.arange(-1.0, 1.01, 0.1)])
    free = []
    for forbidden in (nothing, ahead):
        insight.note_decision(dataclasses.replace(decision, obstacles=(nothing, forbidden)))
        shown = insight.candidates()
        assert shown is not None
        free.append(int(shown.free.max()))
    assert free[0] > 2 * free[1] > 0
    store.close()
