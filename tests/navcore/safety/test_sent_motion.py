"""What the robot has driven since an image, and that the gate without it lets the robot touch what
the image shows."""

from __future__ import annotations

import random

import numpy as np
import pytest

from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command
from navcore.robot.profile import HUSKY
from navcore.safety.gate import GateInput, gate
from navcore.safety.sent_motion import LINK_NS, SentMotion

MS = 1_000_000
LIFE_NS = DEFAULT_SAFETY.gate.command_life_ns
TURN = Twist(v_mps=0.5, w_radps=1.0)


def driven(pose: Pose2, twist: Twist, time_s: float) -> Pose2:
    x_m, y_m = arc_position(float(twist.v_mps), float(twist.w_radps), time_s)
    return pose @ Pose2(x_m=x_m, y_m=y_m, yaw_rad=twist.w_radps * time_s)


def assert_same(pose: Pose2, other: Pose2) -> None:
    assert pose.distance_to(other.x_m, other.y_m) < 1e-9
    assert pose.yaw_rad == pytest.approx(other.yaw_rad)


def test_each_velocity_holds_until_the_next_and_arcs_follow_one_another() -> None:
    sent = SentMotion().after(TURN, 0).after(Twist(v_mps=1.0, w_radps=0.0), 100 * MS)
    assert sent.twist == Twist(v_mps=1.0, w_radps=0.0)
    expected = driven(driven(IDENTITY, TURN, 0.06), sent.twist, 0.05)
    assert_same(sent.since(40 * MS + LINK_NS, 150 * MS), expected)
    assert_same(sent.since(LINK_NS - 50 * MS, 100 * MS), driven(IDENTITY, TURN, 0.1))
    assert SentMotion().since(0, 100 * MS) == IDENTITY and SentMotion().twist == STANDSTILL


def test_a_velocity_that_has_expired_in_the_driver_moves_nothing() -> None:
    sent = SentMotion().after(TURN, 0)
    assert_same(sent.since(0, 10 * LIFE_NS), driven(IDENTITY, TURN, LIFE_NS / 1e9))


def test_what_no_image_needs_is_forgotten_and_a_clock_that_is_set_back_leaves_nothing() -> None:
    sent = SentMotion()
    for number in range(1000):
        sent = sent.after(TURN, number * 50 * MS)
    assert len(sent.commands) < 20
    now_ns, life_ns = 999 * 50 * MS, DEFAULT_SAFETY.gate.frame_life_ns
    seconds = (life_ns + LINK_NS) / 1e9
    assert_same(sent.since(now_ns - life_ns, now_ns), driven(IDENTITY, TURN, seconds))
    assert sent.after(TURN, 0).commands == (Command(twist=TURN, stamp_ns=0),)


def touched(seed: int, *, link_s: float, moved: bool) -> bool:
    """Drive for 15 s by hand, another command each second, among posts that images of 10 Hz show
    80 ms late; return whether the body has touched one."""
    rng, posts = random.Random(seed), np.random.default_rng(seed).uniform(-3, 3, (12, 2))
    pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=rng.uniform(-3, 3))
    posts = posts[HUSKY.distances_m(pose.from_parent(posts)) > 0.2]
    asked = wheels = target = STANDSTILL
    sent, link, images = SentMotion(), list[tuple[int, Twist]](), list[tuple[int, Pose2]]()
    for now_ns in range(0, 15_000 * MS, 10 * MS):
        if now_ns % (100 * MS) == 0:
            images.append((now_ns, pose))
        if now_ns % (1000 * MS) == 0:
            v_mps, w_radps = rng.choice([(1.0, 0), (-1.0, 0), (0.5, 0.9), (0.5, -0.9), (0, 0.9)])
            asked = Twist(v_mps=v_mps, w_radps=w_radps)
        if now_ns % (50 * MS) == 0 and now_ns >= 80 * MS:
            frame_ns, then = next(one for one in reversed(images) if one[0] <= now_ns - 80 * MS)
            facts = GateInput(
                now_ns=now_ns,
                frame_ns=frame_ns,
                stopped_by=None,
                command=Command(twist=asked, stamp_ns=now_ns),
                obstacles=np.repeat(then.from_parent(posts), 4, axis=0).astype(np.float32),
                moved=sent.since(frame_ns, now_ns) if moved else IDENTITY,
            )
            verdict = gate(facts, sent=sent.twist, period_s=0.05, profile=HUSKY)
            sent = sent.after(verdict.twist, now_ns)
            link.append((now_ns + round(link_s * 1e9), verdict.twist))
        while link and link[0][0] <= now_ns:
            target = link.pop(0)[1]
        step, turn = HUSKY.max_accel_mps2 * 0.01, HUSKY.max_yaw_accel_radps2 * 0.01
        wheels = Twist(
            v_mps=wheels.v_mps + min(max(target.v_mps - wheels.v_mps, -step), step),
            w_radps=wheels.w_radps + min(max(target.w_radps - wheels.w_radps, -turn), turn),
        )
        pose = driven(pose, wheels, 0.01)
        if HUSKY.distances_m(pose.from_parent(posts)).min() < -0.002:
            return True
    return False


@pytest.mark.parametrize("link_s", [0.0, 0.03, 0.05])
def test_among_posts_that_late_images_show_the_robot_touches_none(link_s: float) -> None:
    assert not any(touched(seed, link_s=link_s, moved=True) for seed in range(6))


def test_from_the_pose_of_the_image_it_touches_some() -> None:
    """The control of the test above."""
    assert any(touched(seed, link_s=0.03, moved=False) for seed in range(6))
