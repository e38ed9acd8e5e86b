"""Localisation follows logs of laser scanners: one that is made here, and a real one."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.main import cli
from app.evaluation.laser_log.carmen_log import LaserLog, Relation, load_carmen_log
from app.evaluation.laser_log.run import (
    drive_of,
    follow_log,
    laser_config,
    picture_of,
    relation_errors,
)
from navcore.geometry.transform import IDENTITY, Pose2
from tests.navcore.localisation.plan_worlds import PlanWorld
from tests.shared_data import beside

ROOT = Path(__file__).parents[4]
LIDAR = ROOT.parent / "shared/data/lidar"
BEARINGS = np.radians(np.arange(180) - 90.0)
FORWARD = Pose2(x_m=0.6, y_m=0.0, yaw_rad=0.0)
LEFT = Pose2(x_m=0.1, y_m=0.0, yaw_rad=math.radians(22.5))


def hall() -> PlanWorld:
    """A ring of corridors, 2 m wide and 10 m long, with niches that differ."""
    world = PlanWorld()
    for low, high in ((-1.0, 11.0), (1.0, 9.0)):
        world.wall((low, low), (high, low))
        world.wall((low, high), (high, high))
        world.wall((low, low), (low, high))
        world.wall((high, low), (high, high))
    for k, x in enumerate((1.5, 3.2, 6.1, 8.4)):
        world.box(x, -1.0, x + 0.3 + 0.1 * k, -0.6)
        world.box(10.6, x, 11.0, x + 0.5)
        world.box(x, 10.7, x + 0.4, 11.0)
        world.box(-1.0, x + 0.4, -0.7, x + 0.7 + 0.1 * k)
    return world


def round_trip(rounds: int = 2) -> list[Pose2]:
    """Poses of a robot that drives round the hall."""
    side = [FORWARD] * 16 + [LEFT] * 4
    steps = (side * 4 * rounds)[:-4]
    return list(itertools.accumulate(steps, lambda pose, step: pose @ step, initial=IDENTITY))


def made_log(poses: list[Pose2]) -> LaserLog:
    """The log of a robot whose wheels err by 5° and 6 cm from scan to scan."""
    rng, world = np.random.default_rng(5), hall()
    directions = np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS)])
    rows, odometry = [], [IDENTITY]
    for pose in poses:
        turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad)
        ranges = world.ranges(np.array([pose.x_m, pose.y_m]), turn.to_parent(directions))
        rows.append(np.where(np.isfinite(ranges), ranges, 80.0) + 0.01 * rng.normal(size=180))
    for before, after in itertools.pairwise(poses):
        x, y, yaw = (rng.normal(size=3) * (0.06, 0.02, math.radians(5.0))).tolist()
        odometry.append(odometry[-1] @ before.inverse() @ after @ Pose2(x_m=x, y_m=y, yaw_rad=yaw))
    return LaserLog(
        stamps_s=np.array([1.5 * k for k in range(len(poses))]),
        bearings_rad=BEARINGS,
        ranges_m=np.array(rows),
        odometry=tuple(odometry),
        logged=tuple(poses),
    )


def test_poor_wheels_and_loops_lead_to_the_true_poses() -> None:
    poses = round_trip()
    log = made_log(poses)
    relations = [
        Relation(first=k, second=k + 40, T_first_second=poses[k].inverse() @ poses[k + 40])
        for k in range(0, len(poses) - 40, 5)
    ]
    drive = drive_of(log, view_rad=math.pi, range_m=15.0)
    followed = follow_log(drive, laser_config())
    found = relation_errors(followed.poses, relations)
    assert followed.loops > 10
    way_m = sum(a.distance_to(b.x_m, b.y_m) for a, b in itertools.pairwise(poses[:41]))
    assert found["m_mean"] < 0.01 * way_m and found["deg_mean"] < 1.0, found
    assert relation_errors(log.odometry, relations)["m_mean"] > 0.5  # control
    picture = cv2.imdecode(np.frombuffer(picture_of(drive, followed.poses), np.uint8), 1)
    assert picture is not None and min(picture.shape[:2]) > 12.0 / 0.05


def test_scans_are_cropped_to_a_view_and_a_range() -> None:
    log = made_log(round_trip()[:3])
    whole, part = (
        drive_of(log, view_rad=math.radians(view), range_m=far).scans[1]
        for view, far in ((180.0, 15.0), (87.0, 5.0))
    )
    away = np.hypot(*part.points_base.T)
    assert len(part) < len(whole) and away.max() < 5.0
    assert np.abs(np.arctan2(part.points_base[:, 1], part.points_base[:, 0])).max() < 0.76
    assert np.arctan2(whole.points_base[:, 1], whole.points_base[:, 0]).argmax() == 0


def test_a_real_log_is_followed_as_another_program_followed_it() -> None:
    path = beside(LIDAR / "intel.gfs.log", "the log of the Intel Research Lab is")
    log = load_carmen_log(path)
    drive = drive_of(log, view_rad=math.pi, range_m=15.0)
    first = 160
    poses = follow_log(drive.first(first), laser_config()).poses
    away = [
        (log.logged[0].inverse() @ log.logged[k]).distance_to(moved.x_m, moved.y_m)
        for k, moved in ((k, poses[0].inverse() @ poses[k]) for k in range(first))
    ]
    by_odometry = [
        (log.logged[0].inverse() @ log.logged[k]).distance_to(moved.x_m, moved.y_m)
        for k, moved in ((k, log.odometry[0].inverse() @ log.odometry[k]) for k in range(first))
    ]
    assert max(away) < 0.3
    assert max(by_odometry) > 2.0  # control


@pytest.mark.long
def test_the_command_judges_a_real_log_by_its_relations(tmp_path: Path) -> None:
    path = beside(LIDAR / "intel.gfs.log", "the log of the Intel Research Lab is")
    relations = path.with_name("intel.relations")
    result = CliRunner().invoke(
        cli, ["laser-log", str(path), "--relations", str(relations), "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    assert "over 119 relations" in result.output
    assert (tmp_path / "laser-log.png").exists() and (tmp_path / "laser-log.json").exists()


def test_the_figures_of_the_page_are_those_of_the_kept_report() -> None:
    page = (ROOT / "app/evaluation/README.md").read_text(encoding="utf-8")
    report = json.loads((ROOT / "app/evaluation/laser_log/intel.json").read_text(encoding="utf-8"))
    for name in ("localisation", "as logged", "odometry"):
        errors = report[name]
        assert (
            f"| {errors['m_mean']:.3f} ± {errors['m_std']:.3f} m | {errors['m_median']:.3f} m | "
            f"{errors['deg_mean']:.2f} ± {errors['deg_std']:.2f}° | {errors['deg_median']:.2f}° |"
        ) in page


def test_a_file_that_is_no_log_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("nothing\n", encoding="utf-8")
    result = CliRunner().invoke(cli, ["laser-log", str(path)])
    assert result.exit_code != 0
    assert "has 0 FLASER lines" in f"{result.output}{result.exception}"
