"""Drives over raised ground: up a ramp to a goal behind it, and round a kerb."""

from __future__ import annotations

import pytest

from app.episode.episode import Episode, EpisodeSettings
from navcore.config.mapping import MappingConfig, TerrainConfig
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import default_beware_list
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario

UP_THE_RAMP = (Pose2(x_m=-3.0, y_m=4.2, yaw_rad=0.0), (4.6, 4.2))
ACROSS_THE_KERB = (Pose2(x_m=-1.6, y_m=-2.0, yaw_rad=0.0), (1.4, -2.0))
OFF = NavigatorConfig(map=MappingConfig(terrain=TerrainConfig(enabled=False)))


def driven(
    way: tuple[Pose2, tuple[float, float]], config: NavigatorConfig | None, max_time_s: float
) -> tuple[bool, list[tuple[float, float]]]:
    """Return whether the goal was reached, and the true positions of the robot, one a second."""
    start, goal = way
    episode = Episode(
        load_scenario("terrain"),
        EpisodeSettings(
            beware=default_beware_list(),
            goals=(goal,),
            start=start,
            config=config,
            max_time_s=max_time_s,
            odometry=OdometryGrade.IDEAL,
        ),
        seed=0,
    )
    try:
        report = episode.run()
    finally:
        episode.close()
    return report["success"], list(
        zip(report["series"]["x_m"], report["series"]["y_m"], strict=True)
    )


def touches_kerb(x_m: float, y_m: float) -> bool:
    """Return whether a wheel stands on the kerb or at its side."""
    return abs(x_m) < 0.45 and -4.4 < y_m < -0.1


@pytest.mark.long
@pytest.mark.parametrize("config", [None, OFF], ids=["with terrain", "control"])
def test_a_ramp_within_the_limit_is_driven_to_the_goal_behind_it(
    config: NavigatorConfig | None,
) -> None:
    reached, _ = driven(UP_THE_RAMP, config, max_time_s=14.0)
    assert reached == (config is None)


@pytest.mark.long
@pytest.mark.parametrize("config", [None, OFF], ids=["with terrain", "control"])
def test_a_kerb_that_is_no_obstacle_by_its_height_is_driven_round(
    config: NavigatorConfig | None,
) -> None:
    _, positions = driven(ACROSS_THE_KERB, config, max_time_s=8.0)
    assert any(touches_kerb(x, y) for x, y in positions) == (config is OFF)
