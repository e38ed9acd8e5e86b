"""Drives over raised ground: up and down a ramp to a goal behind it, and round a kerb."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from app.episode.episode import Episode, EpisodeSettings
from navcore.config.mapping import MappingConfig, TerrainConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.transform import Pose2
from navcore.mapping.views import observation
from navcore.mapping.views.drop_edges import DropEdges, drop_edges
from navcore.mapping.views.voxels import DepthView
from navcore.mission.beware_list import default_beware_list
from navcore.perception.ground_memory import GroundMemory
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario

UP_THE_RAMP = (Pose2(x_m=-3.0, y_m=4.2, yaw_rad=0.0), (4.6, 4.2))
DOWN_THE_RAMP = (Pose2(x_m=5.4, y_m=3.0, yaw_rad=0.0), (9.0, 0.0))
UP_FROM_THE_SIDE = (Pose2(x_m=-3.0, y_m=-1.85, yaw_rad=1.0), (5.75, 3.0))
ACROSS_THE_KERB = (Pose2(x_m=-1.6, y_m=-2.0, yaw_rad=0.0), (1.4, -2.0))
OFF = NavigatorConfig(map=MappingConfig(terrain=TerrainConfig(enabled=False)))


def driven(
    way: tuple[Pose2, tuple[float, float]], config: NavigatorConfig | None, max_time_s: float
) -> dict[str, Any]:
    """Return the report of a drive from a start to a goal."""
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
        return episode.run()
    finally:
        episode.close()


@pytest.mark.long
@pytest.mark.parametrize("config", [None, OFF], ids=["with terrain", "control"])
def test_a_ramp_within_the_limit_is_driven_to_the_goal_behind_it(
    config: NavigatorConfig | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    if config is OFF:
        monkeypatch.setattr(GroundMemory, "_remember", lambda *_: None)
    report = driven(UP_THE_RAMP, config, max_time_s=14.0)
    assert report["success"] == (config is None)
    if config is None:
        assert report["causes"] == [] and report["ground_intrusions"] == 0
        assert report["spl"] > 0.9 and report["ideal_m"] >= report["shortest_m"] > 7.5


@pytest.mark.long
@pytest.mark.parametrize("is_control", [False, True], ids=["memory", "control"])
def test_a_ramp_that_the_robot_passes_at_its_side_is_driven(
    is_control: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if is_control:  # beside the ramp, whose foot is out of view, its surface is an obstacle
        monkeypatch.setattr(GroundMemory, "_remember", lambda *_: None)
    report = driven(UP_FROM_THE_SIDE, None, max_time_s=70.0)
    assert report["ground_intrusions"] == 0 and not report["fell"]
    assert report["success"] == (not is_control)


@pytest.mark.long
@pytest.mark.parametrize("is_control", [False, True], ids=["lower level", "control"])
def test_a_goal_below_the_platform_on_which_the_robot_stands_is_reached_by_the_ramp(
    is_control: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if is_control:  # all that is deep is an obstacle, wherever a path leads there
        monkeypatch.setattr(observation, "drop_edges", without_lower_level)
    report = driven(DOWN_THE_RAMP, None, max_time_s=10.0 if is_control else 60.0)
    assert report["ground_intrusions"] == 0 and not report["fell"]
    assert report["success"] == (not is_control)
    assert (report["distance_m"] < 0.1) == is_control


def without_lower_level(
    view: DepthView, resolution_m: float, rules: ObservationConfig
) -> DropEdges:
    edges = drop_edges(view, resolution_m, rules)
    return edges._replace(lower_level=np.full_like(edges.lower_level, -1))


@pytest.mark.long
@pytest.mark.parametrize("config", [None, OFF], ids=["with terrain", "control"])
def test_a_kerb_that_is_no_obstacle_by_its_height_is_driven_round(
    config: NavigatorConfig | None,
) -> None:
    report = driven(ACROSS_THE_KERB, config, max_time_s=8.0 if config is OFF else 25.0)
    assert report["shortest_m"] > 4.5  # 3 m across the kerb
    if config is OFF:
        assert report["ground_intruded"] == {"edge": 1} and not report["success"]
        assert report["causes"][0] == "over edge"
    else:
        assert report["success"] and report["ground_intrusions"] == 0
