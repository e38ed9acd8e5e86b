"""Edges, slopes and bumps beyond the limits of the robot are obstacles of the true map; what is
within them is floor."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely

from navcore.grid.grid import GridSpec
from navcore.robot.profile import HUSKY
from sim.models.ground import Ground, Relief
from sim.models.raised_ground import RaisedGround
from sim.referee.referee import Referee
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario
from sim.truth.clearance import grown_obstacles
from sim.truth.random_missions import draw_mission, draw_zones
from sim.truth.untraversable import untraversable_ground
from tests.sim.worlds import blind, open_floor

TERRAIN = load_scenario("terrain")
INFLATION_M = HUSKY.width_m / 2 + 0.15
SEEDS = (0, 1, 16, 18)
"""The goal of 16 and the start of 18 are on the platform."""


def raised(*parts: RaisedGround) -> Scenario:
    return dataclasses.replace(open_floor(), raised=parts)


def block(height_m: float, *, at: tuple[float, float] = (0.0, 0.0)) -> RaisedGround:
    return RaisedGround(at=at, size_m=(2.0, 2.0), height_m=(height_m, height_m))


def ramp(rise_m: float, length_m: float = 2.0) -> RaisedGround:
    return RaisedGround(at=(0.0, 0.0), size_m=(length_m, 2.0), height_m=(0.0, rise_m))


def area(scenario: Scenario, kind: str) -> shapely.Geometry:
    """Return the untraversable ground of a kind."""
    outlines = [
        outline
        for found in untraversable_ground(scenario, HUSKY)
        for outline in found.outlines
        if found.kind == kind
    ]
    return shapely.union_all([shapely.Polygon(one) for one in outlines])


def path_m(scenario: Scenario, goal: tuple[float, float]) -> float | None:
    spec = GridSpec.centred(size_m=scenario.size_m, resolution_m=0.05)
    return Referee(scenario).shortest_m(spec, INFLATION_M, [goal])


@pytest.mark.parametrize(
    ("part", "kinds"),
    [
        (block(HUSKY.max_step_m), []),
        (block(HUSKY.max_step_m + 0.01), ["edge"]),
        (ramp(2.0 * HUSKY.max_slope), ["edge"]),  # its sides and its end
        (ramp(2.0 * HUSKY.max_slope + 0.02), ["edge", "steep slope"]),
        (ramp(HUSKY.max_step_m, length_m=0.1), []),  # a wedge as high as a step
        (dataclasses.replace(block(0.0), bumps_m=HUSKY.max_step_m), []),
        (dataclasses.replace(block(0.0), bumps_m=0.15), ["edge", "rough ground"]),
    ],
)
def test_what_is_beyond_the_limits_of_the_profile_is_untraversable(
    part: RaisedGround, kinds: list[str]
) -> None:
    assert [found.kind for found in untraversable_ground(raised(part), HUSKY)] == kinds


def test_an_edge_is_a_strip_where_the_height_changes_and_not_within_or_at_a_flush_end() -> None:
    upper = dataclasses.replace(block(0.4), at=(2.0, 0.0))
    edges = area(raised(ramp(0.4), upper), "edge")
    assert shapely.distance(edges, shapely.Point(3.0, 0.0)) < 1e-9  # the far end of the platform
    for flush in ((-1.0, 0.0), (1.0, 0.0), (0.0, 0.0), (2.0, 0.0)):
        assert shapely.distance(edges, shapely.Point(flush)) > 0.5
    # A side of the ramp is an edge from where it is higher than a step.
    low_m = 2.0 * HUSKY.max_step_m / 0.4
    assert shapely.distance(edges, shapely.Point(-1.0, 1.0)) == pytest.approx(low_m, abs=0.06)
    inside = area(raised(block(0.4), block(0.2)), "edge")
    assert shapely.equals(inside, area(raised(block(0.4)), "edge"))


def test_a_turned_edge_is_where_the_turned_part_ends() -> None:
    turned = dataclasses.replace(block(0.3), yaw_deg=45.0)
    edges = area(raised(turned), "edge")
    middle = math.cos(math.pi / 4)
    assert shapely.distance(edges, shapely.Point(middle, middle)) < 1e-9
    assert shapely.distance(edges, shapely.Point(1.0, 0.0)) > 0.2


def test_a_steep_slope_below_a_platform_is_none() -> None:
    steep = ramp(1.0)
    whole = area(raised(steep), "steep slope")
    covered = area(raised(steep, dataclasses.replace(block(1.0), at=(1.0, 0.0))), "steep slope")
    assert shapely.area(whole) == pytest.approx(4.0)
    assert shapely.area(covered) == pytest.approx(2.0)
    assert shapely.equals(area(raised(steep, steep), "steep slope"), whole)


def test_hills_steeper_than_the_limit_are_untraversable_where_they_are() -> None:
    relief = Relief(slope=HUSKY.max_slope, wave_m=10.0)
    hilly = dataclasses.replace(open_floor(), relief=relief)
    assert untraversable_ground(hilly, HUSKY) == ()
    weak = dataclasses.replace(HUSKY, max_slope=0.1)
    (steep,) = untraversable_ground(hilly, weak)
    assert steep.kind == "steep slope"
    points = np.random.default_rng(0).uniform(-10.0, 10.0, size=(2000, 2))
    slopes = np.hypot(*Ground(relief).slopes(points).T)
    where = shapely.union_all([shapely.Polygon(one) for one in steep.outlines])
    marked = shapely.intersects_xy(where, points[:, 0], points[:, 1])
    assert 0.02 < marked.mean() < 0.98
    assert not marked[slopes < weak.max_slope - 0.03].any()
    assert marked[slopes > weak.max_slope + 0.03].all()


def test_the_shortest_path_leads_round_a_kerb_and_up_the_ramp_within_the_limit() -> None:
    across = dataclasses.replace(TERRAIN, start=(-1.6, -2.0, 0.0))
    round_it_m = path_m(across, (1.4, -2.0))
    assert round_it_m is not None and round_it_m > 4.5  # 3 m across it
    up = dataclasses.replace(TERRAIN, start=(0.0, 1.6, 0.0))
    up_m = path_m(up, (5.0, 1.6))
    assert up_m is not None and up_m > 6.0  # 5 m up the steep ramp
    without = tuple(part for part in TERRAIN.raised if part.at != (1.5, 4.3))
    assert path_m(dataclasses.replace(up, raised=without), (5.0, 1.6)) is None


def test_the_baselines_and_the_referee_have_the_same_ground() -> None:
    spec = GridSpec.centred(size_m=TERRAIN.size_m, resolution_m=0.05)
    referee = Referee(TERRAIN)
    _, low, _ = referee.true_cells(spec)
    blocked = referee.true_blocked(spec, INFLATION_M)
    for kerb_or_steep in ((0.15, -2.0), (2.7, 1.6), (7.0, 3.0)):
        assert low[spec.cell(*kerb_or_steep)] and blocked[spec.cell(*kerb_or_steep)]
    for floor in ((1.5, 4.3), (5.5, 3.0), (-5.0, -2.0), (-7.0, 3.0)):
        assert not low[spec.cell(*floor)] and not blocked[spec.cell(*floor)]


def test_random_missions_keep_off_edges_and_reach_raised_ground_by_the_ramp() -> None:
    ground = Ground(raised=TERRAIN.raised)
    spec = GridSpec.centred(size_m=TERRAIN.size_m, resolution_m=0.05)
    obstacles = [shapely.Polygon(one) for one in grown_obstacles(TERRAIN, {}, HUSKY)]
    goals_m = []
    for seed in SEEDS:
        placed = draw_mission(
            TERRAIN,
            seed,
            robot=HUSKY,
            margin_m=0.15,
            start_clear_m=0.9,
            start_ahead_m=1.2,
            margins_m={},
        )
        footprint = shapely.Polygon(placed.start_pose.to_parent(HUSKY.footprint()))
        assert shapely.distance(obstacles, footprint).min() > 0.05
        goal = shapely.Point(placed.goals[0])
        assert shapely.distance(obstacles, goal).min() > INFLATION_M
        zones = draw_zones(placed, seed, 1, robot=HUSKY, inflation_m=INFLATION_M, margins_m={})
        referee = Referee(placed)
        referee.set_zones([np.array(zone) for zone in zones])
        assert referee.shortest_m(spec, INFLATION_M, placed.goals) is not None
        goals_m.append(ground.height_m(*placed.goals[0]))
    assert max(goals_m) > 0.1 and min(goals_m) == 0.0


def test_a_robot_that_starts_on_the_platform_stands_at_its_height() -> None:
    with blind(dataclasses.replace(TERRAIN, start=(5.5, 4.0, 1.0))) as simulator:
        pose = simulator.true_pose()
        assert simulator.ground.standing_m(pose) == pytest.approx(0.75)
        assert pose.distance_to(5.5, 4.0) < 0.02 and not simulator.referee.fell
        simulator.step()
        assert simulator.referee.violations() == 0
