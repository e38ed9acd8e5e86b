"""Branch and bound finds what a search of everything finds; a place that the operator gives is
refined or refused."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.relocalisation import PlaceSearchConfig, RelocalisationConfig
from navcore.geometry.arrays import Points
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.relocalisation.place_check import check_place
from navcore.localisation.relocalisation.place_fit import (
    doubt_of,
    evaluate_place,
    fit_place,
)
from navcore.localisation.relocalisation.place_map import PlaceMap, place_map_of
from navcore.localisation.relocalisation.place_search import (
    PlaceSearch,
    SearchWindow,
    search_places,
)
from navcore.localisation.relocalisation.search_tables import CLEAR, FULL, TILE, UNIFORM, UNKNOWN
from navcore.localisation.relocalisation.submap import Submap, submap_of
from navcore.localisation.relocalisation.walls import seen_through_walls
from navcore.localisation.scans.scan import Keyframe, Scan
from tests.navcore.laws import law
from tests.navcore.localisation.plan_worlds import (
    Drive,
    PlanWorld,
    drive,
    office,
    room_doors,
    surfaces_of,
    tour,
    turn_on_spot,
)

CONFIG = RelocalisationConfig(
    search=PlaceSearchConfig(
        levels=3, least_score=0.1, least_evidence=0.0, least_points=5, max_points=40
    )
)
ROOMS = 3


def submap(points: Points, normals: Points | None = None) -> Submap:
    return Submap(
        points=points,
        normals=np.zeros_like(points) if normals is None else normals,
        origins=np.zeros_like(points),
        T_odom_base=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
    )


def values_of(place_map: PlaceMap, table: int) -> npt.NDArray[np.uint8]:
    """Return the (directions + 1, rows, cols) values of a search table, one for each cell."""
    numbers, tiles = place_map.tables
    parts, side = tiles[numbers[table]], 1 << max(table - 1, 0)
    (channels, down, across), (rows, cols) = parts.shape[:3], place_map.clear.shape
    values = parts.transpose(0, 1, 3, 2, 4).reshape(channels, down * TILE, across * TILE)
    return np.asarray(values.repeat(side, axis=1).repeat(side, axis=2)[:, :rows, :cols])


@law(25)
@given(seed=st.integers(0, 2**31))
def test_branch_and_bound_finds_the_most_evidence_of_all_positions(seed: int) -> None:
    """What fits speaks for a position, what is not known less, and clear floor against it."""
    rng = np.random.default_rng(seed)
    surfaces = rng.uniform(0.0, 4.0, (40, 2))
    angles = rng.uniform(-math.pi, math.pi, 40)
    normals = np.column_stack([np.cos(angles), np.sin(angles)]) * (rng.random((40, 1)) < 0.7)
    looks = [
        Keyframe(
            pose_id=i,
            T_map_base=Pose2(x_m=float(x), y_m=float(y), yaw_rad=0.0),
            scan=Scan(
                points_base=surfaces - (x, y),
                variance_m2=np.full(40, 1e-4),
                normals=np.array(normals),
                origin=np.zeros(2),
            ),
        )
        for i, (x, y) in enumerate(rng.uniform(1.0, 3.0, (4, 2)))
    ]
    place_map = place_map_of(surfaces, normals, CONFIG.search, looks)
    chosen = rng.choice(40, 12, replace=False)
    seen = submap(surfaces[chosen] + rng.normal(scale=0.1, size=(12, 2)), np.array(normals[chosen]))
    search = PlaceSearch(seen, place_map, CONFIG)
    while not search.advance():
        pass
    table = values_of(place_map, 0).astype(np.int64)
    assert {CLEAR, UNKNOWN} < set(np.unique(table).tolist())
    worth = np.maximum(np.arange(FULL + 1) / FULL, CONFIG.fit.unknown_worth)
    worth[CLEAR], worth[UNKNOWN] = -CONFIG.fit.contradicted_cost, CONFIG.fit.unknown_worth
    rows, cols = table.shape[1:]
    best = -math.inf
    for cells, channels in zip(search._cells, search._channels, strict=True):
        likelihood, evidence = np.zeros((2, rows, cols))
        for (r, c), channel in zip(cells.tolist(), channels.tolist(), strict=True):
            shifted = np.full((rows, cols), UNKNOWN)
            part = table[channel][max(r, 0) : rows + min(r, 0), max(c, 0) : cols + min(c, 0)]
            shifted[max(-r, 0) : rows - max(r, 0), max(-c, 0) : cols - max(c, 0)] = part
            likelihood += shifted / FULL / 12
            evidence += worth[shifted] / 12
        likely = likelihood >= CONFIG.search.least_score
        best = max(best, float(evidence[likely].max(initial=-math.inf)))
    assert search._best == pytest.approx(max(best, CONFIG.search.least_evidence), abs=0.005)


@law(25)
@given(seed=st.integers(0, 2**31), level=st.integers(2, 3))
def test_a_bound_is_the_largest_position_of_the_blocks_that_begin_at_its_cells(
    seed: int, level: int
) -> None:
    rng = np.random.default_rng(seed)
    surfaces = rng.uniform(0.0, 3.0, (20, 2))
    made = place_map_of(surfaces, np.zeros((20, 2)), CONFIG.search)
    cells, bounds = values_of(made, 0), values_of(made, level - 1)
    side, step = 2**level, 2 ** (level - 2)
    for row, col in rng.integers(0, np.array(cells.shape[1:]) - 2 * side, (20, 2)).tolist():
        top, left = row // step * step, col // step * step
        block = cells[:, top : top + side + step - 1, left : left + side + step - 1]
        assert (bounds[:, row, col] == block.max(axis=(1, 2))).all()


def test_the_tables_of_a_larger_map_grow_by_its_walls_and_not_by_its_area() -> None:
    """Two rooms 200 m apart: no table of what lies between them but the numbers of its tiles."""
    wall = np.column_stack([np.linspace(0.0, 4.0, 80), np.zeros(80)])
    facing = np.tile([0.0, 1.0], (80, 1))
    one = place_map_of(wall, facing, CONFIG.search)
    far = np.vstack([wall, wall + 200.0])
    two = place_map_of(far, np.vstack([facing, facing]), CONFIG.search)
    assert len(two.tables.tiles) - UNIFORM < 2.5 * (len(one.tables.tiles) - UNIFORM)
    parts = (*two.tables, two.walls.numbers, two.walls.tiles, two.clear)
    dense = (9 * len(two.tables.numbers) + 64 + 1) * two.clear.size
    assert sum(part.nbytes for part in parts) < 0.1 * dense


def wall_between() -> PlaceMap:
    """A wall along x = 1 from y = -2 to 2."""
    y = np.arange(-2.0, 2.0, 0.05)
    surfaces = np.column_stack([np.full(len(y), 1.03), y])
    normals = np.column_stack([np.full(len(y), -1.0), np.zeros(len(y))])
    return place_map_of(surfaces, normals, CONFIG.search)


@law(40)
@given(x=st.floats(1.5, 4.0), y=st.floats(-1.5, 1.5), start_y=st.floats(-1.5, 1.5))
def test_lines_of_sight_through_a_wall_are_counted_and_those_to_it_are_not(
    x: float, y: float, start_y: float
) -> None:
    walls = wall_between()
    camera = np.array([[-1.0, start_y]])
    for end, crossings in (((x, y), 1), ((1.03, y), 0), ((0.5, y), 0), ((-3.0, y), 0)):
        found = seen_through_walls(walls.walls, walls.lattice, camera, np.array([end]), 0.3, 0.35)
        assert found == crossings


@cache
def place_map() -> PlaceMap:
    rng, world = np.random.default_rng(99), office(1, rooms=ROOMS)
    views = [(at, world.scan(at, rng)) for at in tour(1, rooms=ROOMS)[::2]]
    return place_map_of(*surfaces_of(views), RelocalisationConfig().search)


def looked_round(
    world: PlanWorld, position: tuple[float, float], seed: int
) -> tuple[Submap, Drive]:
    """What a turn at a position shows, and its poses."""
    rng = np.random.default_rng(seed)
    true = turn_on_spot(position, 0.4, 2.0 * math.pi)
    return submap_of([(at, world.scan(at, rng)) for at in true]), true


def in_room(number: int) -> tuple[float, float]:
    x, side, depth = room_doors(1, rooms=ROOMS)[number]
    return x, side * (1.0 + 0.4 * depth)


@law(10)
@given(
    room=st.integers(0, 2 * ROOMS - 1),
    x=st.floats(-0.7, 0.7),
    y=st.floats(-0.7, 0.7),
    turn_deg=st.floats(-20.0, 20.0),
)
def test_a_click_beside_the_robot_is_refined(
    room: int, x: float, y: float, turn_deg: float
) -> None:
    seen, true = looked_round(office(1, rooms=ROOMS), in_room(room), room)
    at = true[-1]
    given_pose = Pose2(x_m=at.x_m + x, y_m=at.y_m + y, yaw_rad=at.yaw_rad + math.radians(turn_deg))
    check = check_place(seen, given_pose, place_map())
    error = at.inverse() @ check.fit.T_map_base
    assert check.is_accepted, check.reason
    assert math.hypot(error.x_m, error.y_m) < 0.05
    assert abs(error.yaw_rad) < math.radians(1.0)
    assert check.fit.fit_share > 0.9


@pytest.mark.parametrize("room", range(2 * ROOMS))
def test_a_click_into_another_room_is_refused(room: int) -> None:
    seen, true = looked_round(office(1, rooms=ROOMS), in_room(room), room)
    x, y = in_room((room + 1) % (2 * ROOMS))
    check = check_place(seen, Pose2(x_m=x, y_m=y, yaw_rad=true[-1].yaw_rad), place_map())
    assert not check.is_accepted
    assert check.reason


def test_a_click_in_a_corridor_without_features_is_refused_as_uncertain() -> None:
    world = PlanWorld()
    world.wall((-30.0, 1.0), (30.0, 1.0))
    world.wall((-30.0, -1.0), (30.0, -1.0))
    rng = np.random.default_rng(0)
    straight = drive([(-20.0, 0.0), (20.0, 0.0)])
    corridor = place_map_of(
        *surfaces_of([(at, world.scan(at, rng)) for at in straight[::3]]), CONFIG.search
    )
    seen = submap_of([(at, world.scan(at, rng)) for at in straight[200:215:3]])
    check = check_place(seen, straight[205], corridor)
    assert not check.is_accepted
    along, across = np.sqrt(np.diag(check.fit.covariance)[:2])
    assert along > 5.0 * across


def test_a_search_within_a_window_finds_nothing_outside_of_it() -> None:
    seen, true = looked_round(office(1, rooms=ROOMS), in_room(0), 3)
    here = SearchWindow(T_map_base=true[-1], reach_m=0.5, reach_rad=0.3)
    (best, *_) = search_places(seen, place_map(), RelocalisationConfig(), here)
    assert best.T_map_base.distance_to(true[-1].x_m, true[-1].y_m) < 0.05
    x, y = in_room(5)
    there = SearchWindow(T_map_base=Pose2(x_m=x, y_m=y, yaw_rad=0.0), reach_m=0.5, reach_rad=0.3)
    for place in search_places(seen, place_map(), RelocalisationConfig(), there):
        assert place.T_map_base.distance_to(x, y) < 0.5 * math.sqrt(2.0)


def test_a_better_place_beside_a_window_hides_none_within_it() -> None:
    """Half of what is seen fits in the window, and all of it 0.7 m beside."""
    points = np.random.default_rng(0).uniform(-8.0, 8.0, (60, 2))
    seen, rules = submap(points), RelocalisationConfig(search=PlaceSearchConfig(kept_margin=0.1))
    beside = points[:30] + np.array([0.7, 0.0])
    place_map = place_map_of(np.vstack([points, beside]), np.zeros((90, 2)), rules.search)
    there = Pose2(x_m=0.7, y_m=0.0, yaw_rad=0.0)
    evidence = [evaluate_place(seen, at, place_map, rules.fit).evidence for at in (IDENTITY, there)]
    assert evidence[0] > evidence[1] + rules.search.kept_margin  # the control
    window = SearchWindow(T_map_base=there, reach_m=0.5, reach_rad=0.2)
    (found, *_) = search_places(seen, place_map, rules, window)
    assert found.T_map_base.distance_to(0.7, 0.0) < 0.05


@pytest.mark.parametrize("turn_deg", [-28.0, 28.0])
@pytest.mark.parametrize(("x", "y"), [(0.9, 0.9), (-0.9, 0.9), (0.9, -0.9), (-0.9, -0.9)])
def test_a_click_at_the_edge_of_the_window_is_refined_by_one_scan_of_what_is_ahead(
    x: float, y: float, turn_deg: float
) -> None:
    """A turn about the robot swings the middle of what it sees, 3 m ahead, out of the window."""
    robot = Pose2(x_m=in_room(0)[0], y_m=0.0, yaw_rad=0.0)
    scan = office(1, rooms=ROOMS).scan(robot, np.random.default_rng(1))
    given = Pose2(x_m=robot.x_m + x, y_m=robot.y_m + y, yaw_rad=math.radians(turn_deg))
    fit = check_place(submap_of([(IDENTITY, scan)]), given, place_map()).fit
    assert fit.T_map_base.distance_to(robot.x_m, robot.y_m) < 0.1


def test_the_same_search_gives_the_same_places() -> None:
    seen, _ = looked_round(office(1, rooms=ROOMS), in_room(2), 1)
    one, two = (search_places(seen, place_map(), RelocalisationConfig()) for _ in range(2))
    assert [p.T_map_base for p in one] == [p.T_map_base for p in two]


def test_a_fit_far_from_everything_matches_nothing() -> None:
    seen, _ = looked_round(office(1, rooms=ROOMS), in_room(2), 1)
    far = Pose2(x_m=500.0, y_m=500.0, yaw_rad=0.0)
    assert fit_place(seen, far, place_map(), RelocalisationConfig().fit).fit_share == 0.0
    assert evaluate_place(seen, far, place_map(), RelocalisationConfig().fit).score == 0.0


def test_what_the_map_itself_was_seen_through_is_no_wall() -> None:
    """A table that most lines of sight pass above; a wall that two of them cross by chance."""
    y = np.arange(-2.0, 2.0, 0.05)
    surfaces = np.column_stack([np.full(len(y), 1.03), y])
    normals = np.column_stack([np.full(len(y), -1.0), np.zeros(len(y))])
    sight = np.array([[-1.0, 0.5]]), np.array([[3.0, 0.5]])
    for lines, crossings in ((0, 1), (2, 1), (40, 0)):
        scan = Scan(
            points_base=np.tile([4.0, 0.0], (lines, 1)),
            variance_m2=np.full(lines, 1e-4),
            normals=np.zeros((lines, 2)),
            origin=np.zeros(2),
        )
        shown = Keyframe(pose_id=0, T_map_base=Pose2(x_m=-1.0, y_m=0.5, yaw_rad=0.0), scan=scan)
        made = place_map_of(surfaces, normals, CONFIG.search, [shown])
        assert seen_through_walls(made.walls, made.lattice, *sight, 0.3, 0.35) == crossings


def test_what_stands_where_the_map_is_clear_contradicts_a_place() -> None:
    """A wall that fits, and before it a box: on floor that the map has seen, on floor that it has
    not (the control), and where the map has a surface that faces another way."""
    y = np.arange(-2.0, 2.0, 0.05)
    wall, facing = np.column_stack([np.full(len(y), 3.0), y]), np.tile([-1.0, 0.0], (len(y), 1))
    box = np.column_stack([np.full(20, 1.5), np.linspace(-0.4, 0.4, 20)])
    seen = Submap(
        points=np.vstack([wall, box]),
        normals=np.vstack([facing, np.tile([-1.0, 0.0], (20, 1))]),
        origins=np.zeros((len(y) + 20, 2)),
        T_odom_base=IDENTITY,
    )
    wall_scan = Scan(
        points_base=wall,
        variance_m2=np.full(len(y), 1e-4),
        normals=facing,
        origin=np.zeros(2),
    )
    looks = [Keyframe(pose_id=k, T_map_base=IDENTITY, scan=wall_scan) for k in range(3)]
    behind = (
        np.vstack([wall, box + np.array([0.1, 0.0])]),
        np.vstack([facing, np.tile([1.0, 0.0], (20, 1))]),
    )
    rules = RelocalisationConfig()
    for surfaces, normals, keyframes, share in (
        (wall, facing, looks, 20 / (len(y) + 20)),
        (wall, facing, [], 0.0),
        (*behind, looks, 0.0),
    ):
        place_map = place_map_of(surfaces, normals, rules.search, keyframes)
        fit = evaluate_place(seen, IDENTITY, place_map, rules.fit)
        assert fit.contradicted_share == pytest.approx(share)
        assert ("clear" in doubt_of([fit], rules)) is (share > 0.0)
        # What the map does not show speaks for a place rather than against it.
        assert fit.evidence < fit.score if share else fit.evidence > fit.score
