"""Segmentation beside the tick: overlap, lists that change meanwhile, errors, durations."""

from __future__ import annotations

import dataclasses
import threading
from typing import Any

import pytest

from app.runtime.control.loop import ControlLoop
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.control.segmentation_ahead import SegmentationAhead, SegmentedFrame
from app.runtime.control.stage_timer import TICK
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission
from navcore.navigator import Navigator, TickResult
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels, Segmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from tests.navcore.scene import RED_LIST, SPEC, Paint, picture

OPEN = picture(stamp_ns=1_000_000_000)
RED = picture(Paint(x=(1.5, 2.5), y=(-0.5, 0.5)), stamp_ns=1_000_000_000)
PATIENCE_S = 20.0


class CountingSegmenter(ColourSegmenter):
    """The colour rules, counting how often they run at the same time."""

    def __init__(self) -> None:
        super().__init__()
        self.running = self.most = self.count = 0
        self.broken = False

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label by the colour rules."""
        self.running += 1
        self.count += 1
        self.most = max(self.most, self.running)
        try:
            if self.broken:
                raise RuntimeError("the network is gone")
            return super().segment(frame, beware)
        finally:
            self.running -= 1


def controller(segmenter: ColourSegmenter, stages: Stages | None = None) -> RobotController:
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=segmenter, config=NavigatorConfig(), stages=stages
    )
    return RobotController(
        navigator=navigator, profile=HUSKY, intent=OperatorState(mission=Mission(), beware=RED_LIST)
    )


def ahead_of(driver: RobotController, frame: Frame, took_ms: float = 0.0) -> SegmentedFrame:
    beware = driver.intent.beware
    return SegmentedFrame(
        frame=frame, beware=beware, labels=driver.segment(frame, beware), took_ms=took_ms
    )


def think(driver: RobotController, ahead: SegmentedFrame) -> TickResult:
    decision = driver.think(ahead.frame, clock=lambda: ahead.frame.stamp_ns, ahead=ahead)
    assert decision is not None
    return decision


def test_a_frame_labelled_ahead_is_not_labelled_again_and_gives_the_same_motion() -> None:
    segmenter = CountingSegmenter()
    driver, sequential = controller(segmenter), controller(ColourSegmenter())
    decision = think(driver, ahead_of(driver, RED))
    same = sequential.think(RED, clock=lambda: RED.stamp_ns)
    assert segmenter.count == 1
    assert same is not None
    assert (decision.labels.class_ids == same.labels.class_ids).all()
    assert (decision.occupancy.blocked == same.occupancy.blocked).all()
    assert decision.labels.mask(RED_LIST).any()


def test_an_edit_of_the_list_meanwhile_has_the_frame_labelled_again_by_the_new_list() -> None:
    segmenter = CountingSegmenter()
    driver = controller(segmenter)
    old = ahead_of(driver, RED)
    nothing = BewareList(classes=())
    driver.change(lambda intent: dataclasses.replace(intent, beware=nothing))
    decision = think(driver, old)
    assert segmenter.count == 2
    assert not decision.labels.class_ids.any()


def test_the_duration_of_a_tick_counts_the_segmentation_beside_it() -> None:
    driver = controller(ColourSegmenter())
    think(driver, ahead_of(driver, OPEN, took_ms=5_000.0))
    assert driver.timer.ms[TICK][-1] > 5_000.0


def test_an_error_reaches_the_tick_which_meets_it_again() -> None:
    segmenter = CountingSegmenter()
    driver = controller(segmenter)
    ahead = SegmentationAhead(driver.segment)
    ahead.start()
    segmenter.broken = True
    ahead.begin(OPEN, RED_LIST)
    unlabelled = ahead.take(60.0)
    ahead.stop()
    assert unlabelled is not None and unlabelled.labels is None
    with pytest.raises(RuntimeError, match="the network is gone"):
        think(driver, unlabelled)


class FastCamera:
    """A camera that always has a newer image."""

    def __init__(self) -> None:
        self.count = 0

    def now_ns(self) -> int:
        return OPEN.stamp_ns + self.count * 50_000_000

    def newest_frame(self) -> Frame:
        self.count += 1
        rgb = OPEN.rgb.copy()
        rgb[0, 0, 0] = self.count % 256  # else the camera would be called stuck
        return dataclasses.replace(OPEN, stamp_ns=self.now_ns(), rgb=rgb, twist=STANDSTILL)

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame:
        return self.newest_frame()

    def send(self, twist: Twist) -> None:
        pass

    def close(self) -> None:
        pass


def test_the_next_frame_is_labelled_while_the_tick_runs_and_one_at_a_time() -> None:
    in_tick, labelled, decided = threading.Event(), threading.Event(), threading.Event()
    overlaps: list[bool] = []
    segmenter = CountingSegmenter()

    def segment(own: Segmenter, frame: Frame, beware: BewareList) -> Labels:
        labels = own.segment(frame, beware)
        if segmenter.count > 1:  # the second frame is not done before the first one's tick runs
            in_tick.wait(PATIENCE_S)
            labelled.set()
        return labels

    def supervise(*arguments: Any, **named: Any) -> Any:
        in_tick.set()
        overlaps.append(labelled.wait(PATIENCE_S))
        return Stages().supervise(*arguments, **named)

    driver = controller(segmenter, Stages(segment=segment, supervise=supervise))
    loop = ControlLoop(
        FastCamera(),
        driver,
        on_decision=lambda decision: decided.set(),
        on_verdict=lambda verdict: None,
    )
    loop.start()
    try:
        assert decided.wait(2 * PATIENCE_S)
    finally:
        loop.stop()
    assert overlaps[0]
    assert segmenter.most == 1
