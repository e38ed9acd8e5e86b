"""Camera frames of the last minutes: few, and none too old."""

from __future__ import annotations

import dataclasses
import sys
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from app.console.beware.recent_frames import (
    MAX_AGE_S,
    MAX_FRAMES,
    SHOWN_S,
    STANDING_S,
    STEP_M,
    RecentFrames,
)
from navcore.errors import Refused
from navcore.geometry.transform import IDENTITY, Pose2
from tests.navcore.scene import picture


def noted(count: int, *, step_m: float, period_s: float) -> RecentFrames:
    """Note frames of a robot that drives straight on."""
    frames, seen = RecentFrames(), picture()
    for number in range(count):
        pose = Pose2(x_m=number * step_m, y_m=0.0, yaw_rad=0.0)
        stamp_ns = round(number * period_s * 1e9)
        frames.note(dataclasses.replace(seen, pose=pose, stamp_ns=stamp_ns), 0, IDENTITY)
    return frames


def test_a_robot_that_drives_fast_leaves_no_more_than_the_largest_number_of_frames() -> None:
    frames = noted(5 * MAX_FRAMES, step_m=2 * STEP_M, period_s=0.1)
    assert len(frames.all) == MAX_FRAMES
    assert frames.newest is frames.all[0]


@pytest.fixture
def quick_switches() -> Iterator[None]:
    """Threads that take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("quick_switches")
def test_frames_may_be_forgotten_and_read_while_others_are_noted() -> None:
    frames, seen, failed = RecentFrames(), picture(), list[Exception]()
    ended = threading.Event()

    def repeat(act: Callable[[], object]) -> None:
        try:
            while not ended.is_set():
                act()
        except Exception as error:
            failed.append(error)

    others = [
        threading.Thread(target=repeat, args=(act,)) for act in (frames.forget, lambda: frames.all)
    ]
    for thread in others:
        thread.start()
    try:
        for number in range(10_000):
            stamped = dataclasses.replace(seen, stamp_ns=number * 10**8)
            frames.note(stamped, 0, IDENTITY)
    finally:
        ended.set()
        for thread in others:
            thread.join()
    assert not failed


def test_of_finer_images_fewer_are_kept_in_the_same_memory() -> None:
    frames, fine = (
        RecentFrames(),
        dataclasses.replace(picture(), depth_m=np.ones((480, 848), np.float32)),
    )
    for number in range(3 * MAX_FRAMES):
        pose = Pose2(x_m=number * STEP_M, y_m=0.0, yaw_rad=0.0)
        frames.note(dataclasses.replace(fine, pose=pose), 0, IDENTITY)
    assert len(frames.kept) == MAX_FRAMES // 4


def test_a_robot_that_stands_leaves_a_frame_now_and_then_and_forgets_those_of_minutes_ago() -> None:
    frames = noted(6000, step_m=0.0, period_s=0.1)
    stamps_s = [one.frame.stamp_ns / 1e9 for one in frames.all]
    assert len(frames.all) <= MAX_AGE_S / STANDING_S + 2
    assert max(stamps_s) - min(stamps_s) <= MAX_AGE_S


def test_every_image_that_may_still_be_on_a_screen_is_found_by_its_name() -> None:
    frames = noted(100, step_m=0.0, period_s=0.2)
    newest_ns = 99 * 200_000_000
    for steps in range(int(SHOWN_S / 0.2)):
        stamp_ns = newest_ns - steps * 200_000_000
        assert frames.named(str(stamp_ns)).frame.stamp_ns == stamp_ns
    assert frames.named(None) is frames.newest
    with pytest.raises(Refused, match="the picture has moved on"):
        frames.named(str(newest_ns - 5_000_000_000))
    frames.forget()
    with pytest.raises(Refused, match="no image yet"):
        frames.named(None)
