"""AprilTags of a world: rendered, found in the image, and judged by the true pose."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.fixes import fixes_of
from navcore.perception.tags import detect_tags
from navcore.robot.fix import check_fix
from sim.models.ground import Ground, Relief
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario
from sim.scenario.tags import Tag, given_tags
from sim.simulator import Simulator
from tests.sim.worlds import open_floor, wait

HILLS = Relief(slope=0.12, wave_m=30.0, seed=3)


def with_tags(*tags: Tag) -> Scenario:
    return dataclasses.replace(open_floor(), tags=tags)


def watching(world: Scenario, seed: int = 0) -> Simulator:
    return Simulator(world, seed=seed, camera_rate_hz=0.001)


def test_fixes_by_a_tag_are_as_near_to_the_truth_as_they_say() -> None:
    """Within 4 m and 50° of its front, without the smoothing of a lens. NEES: squared error in
    units of the covariance, 3 on average for three numbers."""
    rng, nees, errors_m, shown = np.random.default_rng(0), [], [], 0
    world = with_tags(Tag(id=7, at=(0.0, 0.0), yaw_deg=0.0))
    tags = given_tags(world.tags)
    with watching(world) as simulator:
        for _ in range(40):
            range_m, angle = rng.uniform(1.2, 4.0), rng.uniform(-0.85, 0.85)
            x, y = range_m * math.cos(angle), range_m * math.sin(angle)
            towards = math.atan2(-y, -x) + rng.uniform(-0.4, 0.4)
            simulator.teleport(Pose2(x_m=x, y_m=y, yaw_rad=towards))
            fixes = fixes_of(simulator.capture(), tags)
            shown += len(fixes)
            for fix in fixes:
                check_fix(fix)
                assert fix.yaw_rad is not None
                true = simulator.true_pose()
                error = np.array(
                    [fix.x_m - true.x_m, fix.y_m - true.y_m, wrap_angle(fix.yaw_rad - true.yaw_rad)]
                )
                errors_m.append(float(np.hypot(*error[:2])))
                nees.append(float(error @ np.linalg.solve(fix.covariance, error)))
    assert shown >= 24, shown
    assert np.median(errors_m) < 0.1
    assert np.mean(nees) < 4 and max(nees) < 30, f"NEES {np.mean(nees):.1f}, {max(nees):.1f}"


def test_far_and_oblique_tags_are_less_certain() -> None:
    world = with_tags(Tag(id=7, at=(0.0, 0.0), yaw_deg=0.0))
    with watching(world) as simulator:
        sigmas = []
        for x in (1.2, 2.0, 3.0):
            simulator.teleport(Pose2(x_m=x, y_m=0.7 * x, yaw_rad=math.atan2(-0.7, -1.0)))
            (fix,) = fixes_of(simulator.capture(), given_tags(world.tags))
            sigmas.append(math.sqrt(np.trace(fix.covariance[:2, :2])))
    assert sigmas == sorted(sigmas) and sigmas[2] > 2 * sigmas[0]


def test_from_the_front_a_far_tag_says_that_it_does_not_know_which_way_it_faces() -> None:
    world = with_tags(Tag(id=7, at=(0.0, 0.0), yaw_deg=3.0))
    with watching(world) as simulator:
        simulator.teleport(Pose2(x_m=4.0, y_m=0.0, yaw_rad=math.pi))
        (tag,) = detect_tags(simulator.capture(), lambda number: 0.3)
    assert math.degrees(math.sqrt(tag.covariance[2, 2])) > 3.0
    assert math.sqrt(tag.covariance[0, 0]) < 0.15


def test_on_a_slope_roll_and_pitch_put_the_tag_where_it_is() -> None:
    """Control: without them the height of the tag comes out wrong."""
    spot = max(
        ((float(x), float(y)) for x in range(-7, 8) for y in range(-7, 8)),
        key=lambda at: abs(Ground(HILLS).gradient(Pose2(x_m=at[0], y_m=at[1], yaw_rad=0.0))[0]),
    )
    start, tag = (*spot, 0.0), Tag(id=3, at=(spot[0] + 2.5, spot[1] + 0.6), yaw_deg=200.0)
    world = dataclasses.replace(open_floor(start=start), relief=HILLS, tags=(tag,))
    with watching(world, seed=HILLS.seed) as simulator:
        wait(simulator, 0.1)
        frame, true, ground = simulator.capture(), simulator.true_pose(), simulator.ground
    size_of = given_tags(world.tags).size_of
    (seen,) = detect_tags(frame, size_of)
    flat = detect_tags(dataclasses.replace(frame, roll_rad=0.0, pitch_rad=0.0), size_of)
    height_m = ground.height_m(*tag.at) + tag.height_m - ground.height_m(true.x_m, true.y_m)
    assert abs(ground.gradient(true)[0]) > 0.06
    assert seen.z_m == pytest.approx(height_m, abs=0.04)
    assert not flat or abs(flat[0].z_m - height_m) > 0.1


def test_a_world_without_tags_shows_none_and_a_tag_of_unknown_size_is_left_out() -> None:
    with watching(open_floor()) as simulator:
        assert detect_tags(simulator.capture(), lambda number: 0.3) == ()
    with watching(with_tags(Tag(id=7, at=(2.0, 0.0), yaw_deg=180.0))) as simulator:
        frame = simulator.capture()
    assert len(detect_tags(frame, lambda number: 0.3)) == 1
    assert detect_tags(frame, lambda number: None) == ()


@pytest.mark.parametrize(
    "lines, why",
    [
        ("id = 587\nat = [0, 0]\nyaw_deg = 0", r"tags\[0\].id"),
        ("id = 1\nat = [9, 0]\nyaw_deg = 0", "outside the world"),
        ("id = 1\nat = [1, 0]\nyaw_deg = 0\nfamily = '25h9'", "family"),
        (
            "id = 1\nat = [1, 0]\nyaw_deg = 0\n[[tags]]\nid = 1\nat = [2, 0]\nyaw_deg = 0",
            r"tags\[1\].id: 1 is that of tags\[0\]",
        ),
    ],
)
def test_a_bad_tag_is_refused_by_key(tmp_path: Path, lines: str, why: str) -> None:
    file = tmp_path / "room.toml"
    file.write_text(
        'name = "room"\nsize_m = [9, 9]\nstart = [0, 0, 0]\n'
        f"[map]\nsize_m = [9, 9]\n[[tags]]\n{lines}\n"
    )
    with pytest.raises(BadConfiguration, match=why):
        load_scenario(file)
