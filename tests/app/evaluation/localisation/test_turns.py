"""A turn on the spot before a drive, as a robot that looks for its place drives it."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.localisation.drives import FRAME_NS, Drive
from app.evaluation.localisation.turns import kept_turn, turned_first
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.scan import Scan
from navcore.mission.beware_list import default_beware_list
from sim.scenario.load import load_scenario

EMPTY = Scan(
    points_base=np.zeros((0, 2)),
    variance_m2=np.zeros(0),
    normals=np.zeros((0, 2)),
    origin=np.zeros(2),
)


def recorded(poses: list[Pose2], odometry: list[Pose2]) -> Drive:
    return Drive(
        stamps_ns=tuple(FRAME_NS * (k + 1) for k in range(len(poses))),
        by_odometry=tuple(odometry),
        pitch_rad=(0.0,) * len(poses),
        true_poses=tuple(poses),
        scans=(EMPTY,) * len(poses),
    )


def test_the_odometry_of_a_drive_goes_on_from_that_of_the_turn() -> None:
    turn_true = [Pose2(x_m=2.0, y_m=1.0, yaw_rad=0.5 * k) for k in range(13)]
    turn = recorded(turn_true, [Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.5 * k) for k in range(13)])
    way = [Pose2(x_m=2.0 + 0.1 * k, y_m=1.0, yaw_rad=0.0) for k in range(-5, 6)]
    drive = recorded(way, [Pose2(x_m=7.0, y_m=3.0, yaw_rad=1.0) @ pose for pose in way])
    joined = turned_first(turn, drive, 5)
    assert len(joined) == 13 + 6
    assert joined.true_poses[13] == drive.true_poses[5]
    assert all(later > sooner for sooner, later in pairwise(joined.stamps_ns))
    for k in range(1, len(joined)):
        true = joined.true_poses[k - 1].inverse() @ joined.true_poses[k]
        measured = joined.by_odometry[k - 1].inverse() @ joined.by_odometry[k]
        assert measured.distance_to(true.x_m, true.y_m) < 1e-9
        assert abs(wrap_angle(measured.yaw_rad - true.yaw_rad)) < 1e-9


@pytest.mark.long
def test_a_turn_is_driven_once_round_and_kept(tmp_path: Path) -> None:
    world, config = load_scenario("empty_room"), NavigatorConfig()
    here = Pose2(x_m=-1.5, y_m=-2.0, yaw_rad=0.3)
    drive = recorded([here, here], [here, here])

    def driven() -> Drive:
        beware = default_beware_list()
        return kept_turn(tmp_path, world, beware, seed=3, config=config, drive=drive, start=1)

    turn = driven()
    turned = sum(
        wrap_angle(after.yaw_rad - before.yaw_rad) for before, after in pairwise(turn.true_poses)
    )
    assert math.degrees(turned) == pytest.approx(360.0, abs=25.0)
    assert max(pose.distance_to(here.x_m, here.y_m) for pose in turn.true_poses) < 0.2
    assert min(len(scan) for scan in turn.scans) > 0
    (kept,) = tmp_path.glob("*-turn-1-*.npz")
    written = kept.stat().st_mtime_ns
    assert driven().true_poses == turn.true_poses and kept.stat().st_mtime_ns == written
