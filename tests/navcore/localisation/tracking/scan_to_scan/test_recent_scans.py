"""Whether a scan continues those of the last metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.scans.matching import match
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.odometry_model import OdometryStep
from navcore.localisation.tracking.scan_to_scan import recent_scans
from navcore.localisation.tracking.scan_to_scan.recent_scans import RecentScans, is_elsewhere
from tests.navcore.localisation.plan_worlds import PlanWorld, drive, office

WORLD = office(3)
ROUTE = drive([(1.5, 0.0), (8.0, 0.0)])
HERE = ROUTE[-1]
ROOM = Pose2(x_m=8.0, y_m=3.0, yaw_rad=2.5)


def step_by(turn_rad: float = 0.0) -> OdometryStep:
    turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=turn_rad)
    return OdometryStep.between(Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), turned, 0.2)


def seen_from(pose: Pose2, seed: int = 1) -> Scan:
    return WORLD.scan(pose, np.random.default_rng(seed))


def with_person(scan: Scan, share: float) -> Scan:
    """The scan with a person close by who hides all points behind in a share of the view."""
    points = scan.points_base.copy()
    hidden = np.arctan2(*(points - scan.origin).T[::-1]) > np.quantile(
        np.arctan2(*(points - scan.origin).T[::-1]), 1.0 - share
    )
    sight = points[hidden] - scan.origin
    points[hidden] = scan.origin + sight / np.linalg.norm(sight, axis=1)[:, None]
    return Scan(
        points_base=points,
        variance_m2=scan.variance_m2.copy(),
        normals=scan.normals.copy(),
        origin=scan.origin.copy(),
    )


@pytest.fixture(scope="module")
def recent() -> RecentScans:
    scans = RecentScans(LocalisationConfig())
    for k, pose in enumerate(ROUTE):
        scans.add(seen_from(pose, k), pose)
    return scans


def test_the_next_view_continues_the_last_ones_and_another_place_does_not(
    recent: RecentScans,
) -> None:
    assert recent.are_continued(seen_from(HERE), HERE, step_by()) is True
    assert recent.are_continued(seen_from(ROOM), HERE, step_by()) is False


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_a_person_who_steps_in_ends_nothing(recent: RecentScans, share: float) -> None:
    view = with_person(seen_from(HERE), share)
    assert recent.are_continued(view, HERE, step_by()) is not False


def test_between_two_frames_nothing_hides_all_that_was_in_view(recent: RecentScans) -> None:
    """A robot that was put before a wall sees nothing of before, and nothing that should be seen;
    the control takes that for a person who has stepped in."""
    wall = PlanWorld()
    wall.box(0.7, -2.0, 0.8, 2.0)
    view = wall.scan(Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), np.random.default_rng(1))
    assert recent.are_continued(view, HERE, step_by()) is False
    rules = LocalisationConfig()
    patient = RecentScans(replace(rules, tracking=replace(rules.tracking, replaced_share=0.0)))
    for k, pose in enumerate(ROUTE):
        patient.add(seen_from(pose, k), pose)
    assert patient.are_continued(view, HERE, step_by()) is None


def test_a_post_that_the_robot_has_come_past_is_not_missed() -> None:
    world = PlanWorld()
    world.box(0.8, -0.45, 0.9, -0.05)  # fills a third of the first view, and is beside the second
    world.box(5.4, -5.0, 5.5, 5.0)  # comes into range between the two
    rng, before = np.random.default_rng(1), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    scans = RecentScans(LocalisationConfig())
    scans.add(world.scan(before, rng), before)

    after = Pose2(x_m=0.55, y_m=0.1, yaw_rad=0.2)
    assert scans.are_continued(world.scan(after, rng), after, step_by()) is None
    # Control: from where it should be in view the post is missed.
    world.boxes[0] = (0.0, 9.0, 0.1, 9.1)
    ahead = Pose2(x_m=0.25, y_m=0.0, yaw_rad=0.0)
    assert scans.are_continued(world.scan(ahead, rng), ahead, step_by()) is False


def test_nothing_is_said_without_scans_with_few_points_and_over_large_turns(
    recent: RecentScans,
) -> None:
    there = seen_from(ROOM)
    assert RecentScans(LocalisationConfig()).are_continued(there, HERE, step_by()) is None
    few = there.part(np.arange(len(there)) < 10)
    assert recent.are_continued(few, HERE, step_by()) is None
    assert recent.are_continued(there, HERE, step_by(turn_rad=1.0)) is None


@pytest.mark.parametrize(
    ("share", "share_of_near", "blocked", "elsewhere"),
    [
        (0.2, 0.6, 0.3, True),
        (0.2, 0.6, 0.05, False),  # a place that is new
        (0.36, 0.98, 0.14, False),  # all that is near fits, the scatter of far walls is crossed
        (0.36, 0.85, 0.14, True),
        (0.06, 0.94, 0.6, True),  # few points fit, by chance
        (0.6, 0.7, 0.3, False),
    ],
)
def test_a_place_where_all_that_is_near_fits_is_not_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
    share: float,
    share_of_near: float,
    blocked: float,
    elsewhere: bool,
) -> None:
    config = LocalisationConfig()
    scan, surfaces = seen_from(HERE), ScanMap(config.match)
    near = 200
    found = replace(
        match(scan, surfaces, HERE, None, config=config.match),
        points=round(near * share_of_near / share),
        near=near,
        fitting=round(near * share_of_near),
    )
    monkeypatch.setattr(recent_scans, "lines_blocked_share", lambda *_, **__: blocked)
    assert is_elsewhere(found, scan, surfaces, config) == elsewhere


def test_surfaces_that_were_left_behind_take_no_memory_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    most = 3_000
    monkeypatch.setattr(recent_scans, "_MOST_HELD", most)
    scans, held, far = RecentScans(LocalisationConfig()), [], 0.0
    for k in range(60):
        far += 0.5
        there = Pose2(x_m=far, y_m=0.0, yaw_rad=0.0) @ HERE
        scans.add(seen_from(HERE, k), there)
        held.append(scans._map.held)
    assert max(held) < 2 * most and min(held[30:]) < most / 2
