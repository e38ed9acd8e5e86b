"""What operators ask of a running robot."""

from __future__ import annotations

import dataclasses
import uuid
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.console.back_off import BACK
from app.console.operations import LiveOperations
from app.storage import Store
from navcore.errors import OtherSite, Refused
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2
from navcore.localisation.map_correction import AppliedCorrection
from navcore.mission.mission import Goal, Mission, Phase
from navcore.robot.driver import Command
from navcore.safety.gate import Cause
from tests.app.console.test_changing_site import operations_of
from tests.navcore.mapping.points.moved_poses import move
from tests.reliability.fault_runs import BenchRobot, first_frame, standing_controller
from web.interface.drafts import ZoneDraft
from web.interface.operations import MissionAction

PAUSED = Mission(phase=Phase.PAUSED, queue=(Goal(id=1, x_m=3.0, y_m=0.0),))


@pytest.fixture
def operations(tmp_path: Path) -> Iterator[LiveOperations]:
    controller = standing_controller()
    controller.navigator.map.pose_ids.name_numberings(lambda: uuid.uuid4().hex)
    with closing(Store(tmp_path)) as store:
        yield operations_of(controller, first_frame(), store)


@pytest.mark.parametrize("mission", [Mission(), PAUSED])
def test_a_robot_that_looks_round_can_be_paused_and_is_not_said_to_stand(
    operations: LiveOperations, mission: Mission
) -> None:
    controller = operations._controller
    controller.change_mission(lambda _: mission)
    with pytest.raises(Refused, match="only a driving mission"):
        operations.mission("pause")
    controller.search_place()
    turning = operations.state()
    assert turning.place.searching
    assert Cause.PAUSED not in [reason.cause for reason in turning.reasons]
    operations.mission("pause")
    state = operations.state()
    assert not state.place.searching and state.phase is mission.phase
    is_paused = Cause.PAUSED in [reason.cause for reason in state.reasons]
    assert is_paused == (mission.phase is Phase.PAUSED)


def test_poses_that_were_meant_for_the_map_of_another_site_are_not_corrected(
    operations: LiveOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = operations._controller

    def enters_meanwhile(*_: object) -> None:
        controller.change(lambda intent: dataclasses.replace(intent, site_id="another"))

    monkeypatch.setattr("app.runtime.control.robot_controller.check_movable", enters_meanwhile)
    with pytest.raises(OtherSite):
        operations.correct_poses({0: IDENTITY})
    assert not controller._requests.poses


def test_a_reset_releases_no_stop_that_its_sender_has_not_seen(
    operations: LiveOperations,
) -> None:
    operations.stop("key of A")
    seen = operations.state().stops
    operations.stop("key of B")
    with pytest.raises(Refused, match="pressed again"):
        operations.reset_stop(seen)
    assert operations.state().stop_pressed
    operations.reset_stop(seen + 1)
    assert not operations.state().stop_pressed
    operations.stop("key of B")
    operations.reset_stop()
    assert not operations.state().stop_pressed


def show(operations: LiveOperations, *, x_m: float = 0.0, age_s: float = 0.0) -> None:
    """Let the camera send an image, by which no tick runs."""
    robot = operations._robot
    assert isinstance(robot, BenchRobot)
    stamp_ns = robot.now_ns() - round(age_s * 1e9)
    pose = Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)
    robot.newest = dataclasses.replace(first_frame(), pose=pose, stamp_ns=stamp_ns)


def test_backing_off_is_measured_by_the_newest_image_also_while_the_planner_hangs(
    operations: LiveOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.console.back_off.MAX_STEPS", 10**6)
    with pytest.raises(Refused, match="no images"):
        operations.back_off()
    show(operations, age_s=1.0)
    with pytest.raises(Refused, match="no images"):
        operations.back_off()
    show(operations)
    operations.back_off()
    show(operations, x_m=-0.6)
    thread = operations._back_off._thread
    assert thread is not None
    thread.join(30.0)
    assert not operations.state().backs_off
    assert operations._controller.intent.by_hand is None


@pytest.mark.parametrize("mission", [Mission(), PAUSED])
def test_a_robot_that_backs_off_without_a_mission_can_be_paused(
    operations: LiveOperations, mission: Mission
) -> None:
    controller = operations._controller
    controller.change_mission(lambda _: mission)
    operations.drive(BACK)
    with pytest.raises(Refused, match="only a driving mission"):
        operations.mission("pause")  # an operator drives by hand
    show(operations)
    operations.back_off()
    assert operations.state().backs_off
    operations.mission("pause")
    assert controller.intent.by_hand is None and controller.intent.mission == mission
    operations._back_off.stop()
    assert not operations.state().backs_off
    with pytest.raises(Refused, match="only a driving mission"):
        operations.mission("pause")


@pytest.mark.parametrize("action", ["pause", "cancel", "leave"])
def test_every_action_on_the_mission_ends_driving_by_hand_and_so_backing_off(
    operations: LiveOperations, action: MissionAction
) -> None:
    controller = operations._controller
    command = Command(twist=STANDSTILL, stamp_ns=0)
    mission = dataclasses.replace(PAUSED, goes_on=True)
    controller.change(lambda now: dataclasses.replace(now, by_hand=command, mission=mission))
    operations.mission(action)
    assert controller.intent.by_hand is None
    assert not controller.intent.mission.goes_on


def test_zones_belong_to_no_pose_of_a_map_that_was_taken_back(operations: LiveOperations) -> None:
    controller, scene = operations._controller, first_frame()
    pose_ids = controller.navigator.map.pose_ids
    saved = pose_ids.array()
    pose_ids.restore(saved, "before")  # as of a map that was loaded
    decision = controller.think(scene, clock=lambda: scene.stamp_ns)
    assert decision is not None
    here, before = decision.frame.pose, pose_ids.poses
    assert len(before) > len(saved)
    corners = ((1.0, 0.0), (2.0, 0.0), (2.0, 1.0))
    beside = tuple((here.x_m + x, here.y_m + y) for x, y in corners)
    operations.zones.add(ZoneDraft(name="wet", polygon=beside))
    operations.note_decision(decision)

    def corrected() -> AppliedCorrection:
        old = pose_ids.poses
        move(pose_ids, {n: dataclasses.replace(p, x_m=p.x_m + 0.5) for n, p in enumerate(old)})
        return AppliedCorrection(before=old, after=pose_ids.poses, motion=IDENTITY, loops=1)

    of_trial = corrected()
    pose_ids.restore(saved, pose_ids.numbering)
    operations.note_decision(dataclasses.replace(decision, correction=of_trial, taken_back=True))
    assert operations.zones.stored[0].polygon == beside, "the correction is taken back as well"
    elsewhere = Pose2(x_m=here.x_m + 30.0, y_m=here.y_m, yaw_rad=0.0)
    pose_ids.extend([elsewhere] * len(before))
    operations.note_decision(dataclasses.replace(decision, correction=corrected()))
    assert operations.zones.stored[0].polygon == beside
