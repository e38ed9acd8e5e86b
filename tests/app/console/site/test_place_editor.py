"""The operator shows the robot its place: checked by the newest scan, then taken."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from app.console.site.place_editor import PlaceEditor, require_known
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadGeometry, OtherSite, Refused
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.scene import SPEC, Box, picture

ROOM = (
    Box(x=(3.0, 3.2), y=(-3.0, 3.0), z=(0.0, 2.0)),
    Box(x=(-1.0, 3.0), y=(2.0, 2.2), z=(0.0, 2.0)),
    Box(x=(-1.0, 3.0), y=(-2.6, -2.4), z=(0.0, 2.0)),
    Box(x=(2.5, 3.0), y=(0.8, 1.6), z=(0.0, 2.0)),
)
HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)


class Desk:
    """A controller that looks at the room, and the editor of its place."""

    def __init__(self) -> None:
        navigator = Navigator(
            spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )
        intent = OperatorState(mission=Mission(), beware=BewareList(classes=()))
        self.controller = RobotController(navigator=navigator, profile=HUSKY, intent=intent)
        self.told: list[str] = []
        self.editor = PlaceEditor(self.controller, self.told.append)
        self._frames = 0

    def see(self, pose: Pose2 = HERE) -> Frame:
        """Run one tick on an image of the room."""
        self._frames += 1
        frame = picture(*ROOM, pose=pose, stamp_ns=self._frames * 100_000_000)
        # A camera that works never shows the same image twice.
        noisy = (frame.depth_m + np.float32(1e-4) * (self._frames % 7)).astype(np.float32)
        rgb = np.roll(frame.rgb, self._frames, axis=2) + np.uint8(self._frames % 7)
        frame = dataclasses.replace(frame, depth_m=noisy, rgb=rgb)
        self.controller.think(frame, clock=lambda: frame.stamp_ns)
        return frame


@pytest.fixture(scope="module")
def desk() -> Desk:
    opened = Desk()
    for step in (*range(15), *range(15, -1, -1)):
        opened.see(Pose2(x_m=0.02 * step, y_m=0.0, yaw_rad=0.01 * step))
    return opened


def test_a_place_near_the_true_one_is_refined_to_it(desk: Desk) -> None:
    checked = desk.editor.check(Pose2(x_m=0.4, y_m=-0.3, yaw_rad=0.2))
    assert checked.fits, checked.text
    assert checked.match_share is not None and checked.match_share > 0.85
    assert checked.pose.distance_to(0.0, 0.0) < 0.05
    assert abs(checked.pose.yaw_rad) < 0.02
    assert len(checked.scan) > 40


def test_a_corrected_map_is_searched_as_it_is_now(desk: Desk) -> None:
    searched = desk.controller.navigator.localisation.searched_map
    before = desk.editor.check(HERE).pose
    shift = Pose2(x_m=0.0, y_m=0.8, yaw_rad=0.0)
    moved = {one.pose_id: shift @ one.T_map_base for one in searched.keyframes}
    back = {one.pose_id: one.T_map_base for one in searched.keyframes}
    searched.correct(moved)
    after = desk.editor.check(Pose2(x_m=0.0, y_m=0.8, yaw_rad=0.0)).pose
    searched.correct(back)
    assert after.y_m - before.y_m == pytest.approx(0.8, abs=0.02)


def test_a_place_that_contradicts_the_map_is_refused_unless_forced(desk: Desk) -> None:
    elsewhere = Pose2(x_m=-3.0, y_m=4.0, yaw_rad=2.0)
    with pytest.raises(Refused):
        desk.editor.place(elsewhere, force=False)
    desk.see()
    assert desk.controller.place.T_map_base.distance_to(0.0, 0.0) < 0.1
    desk.editor.place(elsewhere, force=True)
    desk.see()
    assert desk.controller.place.T_map_base.distance_to(-3.0, 4.0) < 0.3
    assert desk.editor.status().major_m > 0.3
    desk.editor.place(HERE, force=False)
    desk.see()
    assert desk.controller.place.T_map_base.distance_to(0.0, 0.0) < 0.1


@pytest.mark.parametrize("is_saved", [True, False])
def test_what_is_seen_from_a_forced_place_is_taken_back_if_another_one_is_shown(
    is_saved: bool,
) -> None:
    used = Desk()
    used.see()
    if is_saved:
        saved, used = used.controller.navigator.map.state(), Desk()
        used.controller.navigator.map.restore(saved)
        used.controller.navigator.adopt_map()
        used.see()
        used.editor.place(HERE, force=False)
    used.see()
    navigator = used.controller.navigator
    before = navigator.map.state()
    used.editor.place(Pose2(x_m=-3.0, y_m=4.0, yaw_rad=2.0), force=True)
    used.see()
    assert used.editor.status().on_trial
    assert "not confirmed" in used.editor.status().text
    wrong = navigator.map.state()
    assert len(wrong.poses) > len(before.poses)
    assert (wrong.visible.bools & ~before.visible.bools).sum() > 300
    # Once more the same place: nothing new is known.
    used.editor.place(used.controller.place.T_map_base, force=True)
    used.see()
    assert used.editor.status().on_trial
    assert len(navigator.map.state().poses) >= len(wrong.poses)
    used.editor.place(HERE, force=False)
    used.see()
    after = navigator.map.state()
    assert not used.editor.status().on_trial
    assert (after.visible.bools & ~before.visible.bools).sum() < 100
    np.testing.assert_array_equal(after.poses, before.poses)
    # What the robot has seen in this session before is still what its place is found by.
    np.testing.assert_array_equal(after.scans.pose_ids, before.scans.pose_ids)
    assert len(before.scans.pose_ids)
    assert navigator.localisation.has_saved_map is is_saved, "loops are closed in a new map"


def test_what_was_seen_from_a_place_on_trial_that_is_confirmed_by_the_operator_is_kept(
    desk: Desk,
) -> None:
    again = Desk()
    navigator = again.controller.navigator
    navigator.map.restore(desk.controller.navigator.map.state())
    navigator.adopt_map()
    for _ in range(16):
        again.see()
    assert again.editor.status().on_trial
    version = navigator.map.version
    again.editor.place(HERE, force=False)
    again.see()
    assert not again.editor.status().on_trial
    assert navigator.map.version < version + 10, "nothing was replaced"


def test_a_place_to_which_the_map_cannot_grow_is_refused(desk: Desk) -> None:
    with pytest.raises(BadGeometry):
        desk.editor.place(Pose2(x_m=5e5, y_m=0.0, yaw_rad=0.0), force=True)


def test_a_search_forgets_the_place_and_says_so(desk: Desk) -> None:
    desk.editor.search()
    desk.see()
    assert desk.controller.place.state in (LocalisationState.LOST, LocalisationState.AMBIGUOUS)
    status = desk.editor.status()
    assert status.searching and "map" in status.text
    for _ in range(3):
        desk.see()
    # What the search lacks is told beside the advice.
    assert "on the map. So far: " in desk.editor.status().text
    desk.editor.place(HERE, force=False)
    desk.see()
    desk.see()
    assert not desk.editor.status().searching
    assert desk.controller.place.is_known


def test_a_place_in_a_saved_map_is_said_to_be_confirmed_by_the_first_metres(desk: Desk) -> None:
    again = Desk()
    again.controller.navigator.map.restore(desk.controller.navigator.map.state())
    again.controller.navigator.adopt_map()
    again.see()
    assert not again.editor.status().on_trial  # not believed yet
    for _ in range(15):
        again.see()
    assert again.editor.status().on_trial
    again.editor.place(HERE, force=False)
    again.see()
    assert not again.editor.status().on_trial
    assert not desk.editor.status().on_trial


def test_the_log_says_that_a_place_was_shown_and_what_spoke_against_it() -> None:
    desk = Desk()
    desk.see()
    desk.editor.place(HERE, force=False)
    desk.editor.place(Pose2(x_m=-1.5, y_m=-1.0, yaw_rad=1.0), force=True)
    shown, forced = desk.told
    assert shown == "An operator has shown the robot its place."
    assert "spoke against it: " in forced and forced.endswith("fits there.")


def test_a_mission_is_refused_with_a_word_of_patience_while_the_first_looks_are_not_over() -> None:
    for state, words in (
        (LocalisationState.CHECKING, "still comparing"),
        (LocalisationState.LOST, "show its place"),
    ):
        with pytest.raises(Refused, match=words):
            require_known(LocalisationEstimate(state=state))
    require_known(LocalisationEstimate(state=LocalisationState.DEAD_RECKONING))


def test_a_place_that_was_checked_on_the_map_of_another_site_is_not_taken(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    checked = desk.editor._checked

    def enters_meanwhile(*given: Any) -> Any:
        desk.controller.change(lambda intent: dataclasses.replace(intent, site_id="another"))
        return checked(*given)

    monkeypatch.setattr(desk.editor, "_checked", enters_meanwhile)
    with pytest.raises(OtherSite):
        desk.editor.place(HERE, force=True)
    assert desk.controller._requests.place is None


def test_a_search_that_was_meant_for_the_map_of_another_site_does_not_begin(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def enters_meanwhile() -> None:
        desk.controller.change(lambda intent: dataclasses.replace(intent, site_id="a third"))

    monkeypatch.setattr("app.console.site.place_editor.require_meant_site", enters_meanwhile)
    with pytest.raises(OtherSite):
        desk.editor.search()
    assert not desk.controller.intent.searching


def test_a_robot_that_is_driven_while_its_place_is_checked_is_placed_where_it_is_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    desk = Desk()
    desk.see()
    checked = desk.editor._checked

    def drives_meanwhile(*given: Any) -> Any:
        found = checked(*given)
        for step in range(1, 11):
            desk.see(Pose2(x_m=0.02 * step, y_m=0.0, yaw_rad=0.0))
        return found

    monkeypatch.setattr(desk.editor, "_checked", drives_meanwhile)
    desk.editor.place(HERE, force=True)
    desk.see(Pose2(x_m=0.2, y_m=0.0, yaw_rad=0.0))
    assert desk.controller.place.T_map_base.distance_to(0.2, 0.0) < 0.03


@pytest.mark.parametrize("is_bare", [True, False], ids=["nothing in view", "no map"])
def test_a_robot_whose_place_nothing_tells_is_placed_on_the_operators_word(is_bare: bool) -> None:
    desk, shown = Desk(), Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)
    seen = picture(*(() if is_bare else ROOM), pose=HERE, stamp_ns=50_000_000)
    desk.controller.think(seen, clock=lambda: seen.stamp_ns)
    if not is_bare:
        desk.controller.navigator.localisation.return_to(())
    with pytest.raises(Refused, match="is seen"):
        desk.editor.place(shown, force=False)
    desk.editor.place(shown, force=True)
    desk.see()
    assert desk.controller.place.T_map_base.distance_to(1.0, 0.0) < 0.1
