"""A robot whose estimate excludes what fits the saved map beside it: who is right."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.localiser import Localiser
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.pose_matcher import PoseMatcher
from navcore.localisation.tracking.refused_matches import RefusedMatches
from navcore.mapping.points.pose_ids import PoseIds
from tests.navcore.localisation.plan_worlds import (
    Drive,
    PlanWorld,
    colonnade,
    drive,
    office,
    turn_on_spot,
)
from tests.navcore.localisation.tracking.test_localiser import away_m, frame_at

CORRIDOR = drive([(3.0, 0.0), (9.0, 0.0)])
SURE = np.diag([0.02, 0.02, 0.005]) ** 2
ASIDE = (Pose2(x_m=0.0, y_m=0.16, yaw_rad=0.0), Pose2(x_m=0.0, y_m=-0.2, yaw_rad=0.0))


def driven(
    world: PlanWorld,
    route: Drive,
    off: Pose2 = IDENTITY,
    *,
    mapped: PlanWorld | None = None,
    covariance: object = SURE,
) -> list[tuple[LocalisationEstimate, Pose2]]:
    """Estimates and true poses of a robot that drives through a world, of which a map is saved or
    of what was `mapped`, and that begins `off` the true place, of which it is sure; it stands as
    long as a correction waits for that."""
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    saved = [
        Keyframe(pose_id=ids.id_of(pose), T_map_base=pose, scan=(mapped or world).scan(pose, rng))
        for pose in route
    ]
    robot, pairs = Localiser(ids, LocalisationConfig()), list[tuple[LocalisationEstimate, Pose2]]()
    robot.load(saved)
    first = route[0]
    there = Pose2(
        x_m=first.x_m + off.x_m, y_m=first.y_m + off.y_m, yaw_rad=first.yaw_rad + off.yaw_rad
    )
    robot.place(there, np.asarray(covariance), frame_at(first, 0))
    for pose in route:
        for _ in range(3):
            frame = frame_at(pose, len(pairs) + 1)
            pairs.append((robot.follow(frame, world.scan(pose, rng)), pose))
            if robot.pending is None:
                break
    return pairs


def corrections(pairs: Sequence[tuple[LocalisationEstimate, Pose2]]) -> list[float]:
    """Lengths in metres of the corrections that were told."""
    told = [one.place_correction for one, _ in pairs]
    assert all(one.source is None for one in told if one is not None)
    return [one.shift_m for one in told if one is not None]


@pytest.mark.parametrize("off", ASIDE)
def test_a_robot_that_is_sure_of_a_wrong_place_is_corrected(off: Pose2) -> None:
    pairs = driven(office(3), CORRIDOR, off)
    assert away_m(*pairs[0]) > 0.15
    assert corrections(pairs) == [pytest.approx(math.hypot(off.x_m, off.y_m), abs=0.05)]
    assert away_m(*pairs[-1]) < 0.05
    assert all(one.is_known for one, _ in pairs)


def test_meanwhile_it_is_as_uncertain_as_the_matches_are_away() -> None:
    pairs = driven(office(3), CORRIDOR, ASIDE[0])
    at = next(k for k, (one, _) in enumerate(pairs) if one.place_correction is not None)
    assert away_m(*pairs[at - 1]) < 2.0 * pairs[at - 1][0].sigma_m


def test_one_that_is_right_is_not_corrected() -> None:
    assert not corrections(driven(office(3), CORRIDOR))


def test_a_match_confirms_the_estimate_unless_the_scan_fits_better_at_the_refused_place() -> None:
    config, rng, world = LocalisationConfig(), np.random.default_rng(1), office(3)
    saved = ScanMap(config.match)
    saved.replace(
        Keyframe(pose_id=k, T_map_base=pose, scan=world.scan(pose, rng))
        for k, pose in enumerate(CORRIDOR)
    )
    refused = RefusedMatches(config, PoseMatcher(config), 0.06 * np.eye(3))
    true, near = CORRIDOR[20], 1e-4 * np.eye(2)
    here, away = world.scan(true, rng), world.scan(CORRIDOR[40], rng)
    own = PoseFilter(Pose2(x_m=true.x_m, y_m=true.y_m + 0.2, yaw_rad=true.yaw_rad))
    own.place(own.pose, SURE)
    assert refused.look(here, saved, own, IDENTITY)
    assert refused.are_contradicted(np.zeros(2), near)
    assert not refused.are_contradicted(np.array([0.0, -0.2]), near)
    assert refused.look(here, saved, own, IDENTITY)  # of another match at the estimate
    own.place(CORRIDOR[40], SURE)
    assert refused.look(away, saved, own, IDENTITY) is False


def shelves(pitch_m: float) -> PlanWorld:
    """Two parallel shelves with an upright every `pitch_m`."""
    world = PlanWorld()
    for side in (-1.0, 1.0):
        for x in np.arange(-8.0, 20.0, pitch_m):
            world.box(x, side * 1.0, x + 0.08, side * 1.6)
        world.wall((-8.0, side * 1.6), (20.0, side * 1.6))
    return world


@pytest.mark.parametrize("along_m", [0.16, 0.4])
@pytest.mark.parametrize("pitch_m", [0.25, 0.5, 0.65, 0.9])
def test_among_equal_shelves_none_is_taken_for_the_next(pitch_m: float, along_m: float) -> None:
    off = Pose2(x_m=along_m, y_m=0.0, yaw_rad=0.0)
    pairs = driven(shelves(pitch_m), CORRIDOR, off)
    if corrections(pairs):
        assert away_m(*pairs[-1]) < 0.05


def test_beside_pillars_it_does_not_slide() -> None:
    for along_m in (0.0, 0.16):
        pairs = driven(colonnade(), CORRIDOR, Pose2(x_m=along_m, y_m=0.0, yaw_rad=0.0))
        assert not corrections(pairs)


def room(left: float, front: float) -> PlanWorld:
    """A room with a sideboard whose corner is at `left` and `front`."""
    world = PlanWorld()
    for start, end in (((0, 0), (7, 0)), ((7, 0), (7, 5)), ((0, 5), (7, 5)), ((0, 0), (0, 5))):
        world.wall(start, end)
    world.box(left, front, left + 2.4, front + 0.6)
    world.box(5.8, 0.2, 6.6, 1.2)
    return world


@pytest.mark.parametrize("moved_m", [0.16, 0.25])
def test_what_was_moved_moves_nothing(moved_m: float) -> None:
    mapped, world = room(2.0, 4.0), room(2.0 + moved_m, 4.0 - moved_m)
    route = drive([(1.0, 1.0), (3.0, 3.0), (5.5, 3.0), (1.0, 2.6)])
    route += turn_on_spot((1.0, 2.6), route[-1].yaw_rad, 6.0)
    pairs = driven(world, route, mapped=mapped)
    assert not corrections(pairs)
    assert away_m(*pairs[-1]) < 0.05
