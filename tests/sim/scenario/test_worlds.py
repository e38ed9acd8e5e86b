"""The large built-in worlds: each seed makes a different one, always the same, with its required
contents and a path to every goal."""

from __future__ import annotations

import dataclasses
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely

from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.robot.profile import HUSKY
from sim.models.floor_paint import PaintPattern
from sim.models.ground import FLAT, Ground, Relief
from sim.models.solids import Polygon
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.physics.terrain_mesh import drape
from sim.referee.referee import Referee
from sim.scenario.layout import PlacedObject, doors, items, obstacles
from sim.scenario.load import WORLDS, load_scenario
from sim.scenario.scenery import Room, RoomKind, Scatter
from sim.scenario.schema import Marking, Scenario, Wall
from sim.scenario.variation import randomise
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import Simulator
from tests.sim.worlds import blind, drive, open_floor, wait

NAMES = ("indoor", "forest", "clutter")
SEEDS = (0, 1, 2)
INFLATION_M = 0.5
"""Half the width of the Husky plus the margin of the navigator."""
VIEW_M = 5.0
"""Range within which the navigator maps measurements."""
HILLS = Relief(slope=0.12, wave_m=80.0, seed=3)


@cache
def found(name: str, seed: int) -> Scenario:
    return randomise(load_scenario(name), seed)


def area(objects: tuple[PlacedObject, ...]) -> shapely.Geometry:
    return shapely.union_all(
        [shapely.Polygon(outline) for entry in objects for outline in entry.outlines()]
    )


def world(name: str) -> str:
    return (WORLDS / f"{name}.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_makes_one_world_and_another_seed_another(name: str) -> None:
    assert randomise(load_scenario(name), 1) == found(name, 1)
    assert len({(found(name, seed).furniture, found(name, seed).items) for seed in SEEDS}) == len(
        SEEDS
    )
    assert {found(name, seed).goals for seed in SEEDS} == {load_scenario(name).goals}


@pytest.mark.parametrize(
    "name, size_m",
    [("indoor", (100.0, 100.0)), ("forest", (150.0, 150.0)), ("clutter", (10.0, 8.0))],
)
def test_worlds_have_their_size_and_the_map_covers_them(
    name: str, size_m: tuple[float, float]
) -> None:
    scenario = load_scenario(name)
    assert (
        scenario.size_m == size_m and len(scenario.goals) == 3 and scenario.map.resolution_m == 0.05
    )
    assert all(grid >= side for grid, side in zip(scenario.map.size_m, size_m, strict=True))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_indoor_world_holds_what_the_paper_names(seed: int) -> None:
    indoor = found("indoor", seed)
    kinds, lying = (
        Counter(piece.kind for piece in indoor.furniture),
        Counter(item.kind for item in indoor.items),
    )
    assert len(indoor.rooms) > 40 and len(doors(indoor)) > 60
    assert min(kinds[kind] for kind in ("desk", "chair", "shelf", "sofa")) >= 15
    assert (
        min(
            lying[kind]
            for kind in ("book", "cup", "bottle", "cable", "box", "keyboard", "wet-floor sign")
        )
        >= 1
    )
    assert any(mark.name == "red square" and mark.beware for mark in indoor.markings)
    assert {"cup", "book"} <= {sheet.shows for sheet in indoor.prints if sheet.on == "wall"}
    assert {len(person.points) for person in indoor.people} == {1, 2}


@pytest.mark.parametrize("seed", SEEDS)
def test_the_forest_holds_what_the_paper_names(seed: int) -> None:
    forest = found("forest", seed)
    kinds = Counter(piece.kind for piece in forest.furniture)
    girths = [
        piece.size_m[0]
        for piece in forest.furniture
        if piece.kind in ("tree", "conifer") and piece.size_m
    ]
    assert len(girths) >= 400 and min(girths) < 0.2 and max(girths) > 0.7
    assert kinds["bush"] >= 80 and kinds["house"] >= 5 and kinds["rock"] >= 30
    assert Counter(item.kind for item in forest.items)["landmine"] >= 25
    assert any(mark.name == "red zone" and mark.beware for mark in forest.markings)


def test_the_clutter_holds_its_hazards_and_narrow_passages() -> None:
    clutter = found("clutter", 0)
    assert {"bottle", "cable", "box", "cup", "book", "keyboard"} == {
        item.kind for item in clutter.items
    }
    (mark,), (parcel,) = clutter.markings, [item for item in clutter.items if item.kind == "box"]
    assert shapely.Polygon(mark.polygon).contains(shapely.Point(parcel.at))
    spec = GridSpec.centred(size_m=clutter.map.size_m, resolution_m=0.05)
    lengths = [
        Referee(clutter).shortest_m(spec, inflation_m, clutter.goals)
        for inflation_m in (INFLATION_M, 0.65)
    ]
    # wide enough for the Husky, and for nothing wider than 1.3 m
    assert lengths[0] is not None and lengths[1] is None


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name, longest", [("indoor", 1.7), ("forest", 1.3), ("clutter", 1.7)])
def test_every_mission_can_be_driven(name: str, longest: float, seed: int) -> None:
    scenario = found(name, seed)
    spec = GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
    path_m = Referee(scenario).shortest_m(spec, INFLATION_M, scenario.goals)
    legs = np.diff(np.array([scenario.start[:2], *scenario.goals]), axis=0)
    assert path_m is not None
    assert 1.0 < path_m / np.hypot(*legs.T).sum() < longest


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", NAMES)
def test_nothing_stands_on_the_start_a_goal_an_item_or_the_line_of_a_walker(
    name: str, seed: int
) -> None:
    scenario = found(name, seed)
    standing, lying = area(obstacles(scenario)), area(items(scenario))
    for point in (scenario.start[:2], *scenario.goals):
        assert (
            shapely.distance(shapely.Point(point), shapely.union(standing, lying))
            > HUSKY.circumscribed_radius_m
        ), point
    assert shapely.distance(standing, lying) > 0.05
    for person in scenario.people:
        line = (
            shapely.LineString(person.points)
            if len(person.points) > 1
            else shapely.Point(person.points[0])
        )
        assert shapely.distance(line, standing) > BODY_DIAMETER_M / 2, person.points
    for point in doors(scenario):
        assert shapely.distance(shapely.Point(point), standing) > INFLATION_M, point


@pytest.mark.parametrize("seed", range(8))
def test_the_ground_keeps_its_slope_and_near_the_robot_its_plane(seed: int) -> None:
    relief = found("forest", 0).relief
    assert relief is not None
    ground = Ground(dataclasses.replace(relief, seed=seed))
    points = np.random.default_rng(seed).uniform(-70, 70, (2000, 2))
    slopes = ground.slopes(points)
    assert 0.03 < np.hypot(*slopes.T).max() <= relief.slope
    assert np.ptp(ground.heights(points)) > 1.0  # not flat
    for turn in np.arange(12) * np.pi / 6:
        step = VIEW_M * np.array([np.cos(turn), np.sin(turn)])
        assert (
            np.abs(ground.heights(points + step) - ground.heights(points) - slopes @ step).max()
            < 0.06
        )
    assert np.hypot(*(ground.slopes(points + 1e-4) - slopes).T).max() < 1e-5  # no edges


def test_a_body_on_a_slope_is_raised_and_tilted_like_the_slope() -> None:
    ground, pose = Ground(HILLS), Pose2(x_m=12.0, y_m=-7.0, yaw_rad=0.8)
    surface_pose = ground.surface_pose(pose)
    for ahead, left in ((0.2, 0.0), (0.0, 0.2), (-0.2, 0.1)):
        x, y, z, _ = surface_pose @ (ahead, left, 0.0, 1.0)
        assert z == pytest.approx(ground.height_m(float(x), float(y)), abs=1e-3)
    assert np.allclose(surface_pose[:3, :3] @ surface_pose[:3, :3].T, np.eye(3))
    assert (FLAT.surface_pose(pose) == pose.matrix()).all()


def test_paint_lies_on_the_hills() -> None:
    ground, square = Ground(HILLS), ((2.0, 2.0), (9.0, 2.0), (9.0, 8.0), (2.0, 8.0))
    mesh = drape(ground, square, 0.003)
    above = mesh.corners[:, 2] - ground.heights(mesh.corners[:, :2])
    triangles = mesh.corners.reshape(-1, 3, 3)[:, :, :2]
    assert sum(shapely.Polygon(triangle).area for triangle in triangles) == pytest.approx(42.0)
    assert above.min() > -0.003 and above.max() < 0.01


def on_hills() -> Scenario:
    steepest = max(
        range(-9, 10),
        key=lambda x: Ground(HILLS).gradient(Pose2(x_m=float(x), y_m=0.0, yaw_rad=0.0))[0],
    )
    return dataclasses.replace(
        open_floor(start=(float(steepest) * 0.5, 0.0, 0.0)), relief=HILLS, size_m=(40.0, 40.0)
    )


def test_the_robot_climbs_the_hills_straight_and_does_not_creep_down() -> None:
    with blind(on_hills(), seed=HILLS.seed, odometry="ideal") as simulator:
        start = simulator.true_pose()
        wait(simulator, 2.0)
        assert simulator.true_pose().distance_to(start.x_m, start.y_m) < 0.01
        drive(simulator, 0.8, 0.0, 3.0)
        wait(simulator, 1.0)
        pose, belief = simulator.true_pose(), simulator.odometry()
        assert (
            pose.x_m - start.x_m == pytest.approx(2.4, abs=0.25)
            and abs(pose.y_m - start.y_m) < 0.06
        )
        assert pose.distance_to(belief.x_m, belief.y_m) < 0.05
        assert simulator.referee.collisions == 0


def test_on_the_hills_the_camera_sees_the_ground_where_the_robot_stands() -> None:
    with Simulator(on_hills(), seed=HILLS.seed, camera_size=(106, 60), errors=PERFECT) as simulator:
        frame = simulator.capture()
    points = back_project(np.where(frame.depth_m < VIEW_M, frame.depth_m, 0.0), frame.intrinsics)
    heights = points @ frame.T_base_camera[2, :3] + frame.T_base_camera[2, 3]
    assert len(points) > 1500 and np.abs(heights).max() < 0.08


@pytest.mark.parametrize("name", NAMES)
def test_every_world_can_be_built_and_driven_in(name: str) -> None:
    with blind(load_scenario(name), seed=1) as simulator:
        start = simulator.true_pose()
        drive(simulator, 0.4, 0.0, 1.0)
        assert 0.25 < simulator.true_pose().distance_to(start.x_m, start.y_m) < 0.45
        assert simulator.referee.violations() == 0 and simulator.referee.min_clearance_m > 0.1


def test_a_simulator_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    with blind(load_scenario("empty_room")) as simulator:
        drive(simulator, 0.4, 0.0, 0.1)
        simulator.capture()
    assert capfd.readouterr() == ("", "")


def boxes_of(wall: Wall) -> list[Polygon]:
    (entry,) = obstacles(dataclasses.replace(open_floor(), walls=(wall,)))
    return list(entry.outlines())


def test_doors_are_gaps_in_a_wall() -> None:
    corner = Wall(points=((0.0, 0.0), (6.0, 0.0), (6.0, 4.0)), doors_m=(2.0, 8.0), door_m=1.0)
    union = shapely.union_all([shapely.Polygon(outline) for outline in boxes_of(corner)])
    assert len(boxes_of(corner)) == 4 and union.area == pytest.approx(8.0 * 0.12, abs=0.02)
    for door in doors(dataclasses.replace(open_floor(), walls=(corner,))):
        assert shapely.distance(shapely.Point(door), union) == pytest.approx(0.5, abs=1e-6)
    assert len(boxes_of(dataclasses.replace(corner, doors_m=()))) == 2  # the control


def test_scattered_objects_keep_their_distance() -> None:
    bushes = Scatter(
        kind="bush", count=60, least_m=(0.5, 0.5, 0.5), most_m=(1.0, 1.0, 1.0), gap_m=1.2
    )
    scattered = randomise(dataclasses.replace(open_floor(), scatter=(bushes,)), 0)
    points = np.array([piece.at for piece in scattered.furniture])
    radii = np.array([piece.size_m[0] / 2 for piece in scattered.furniture if piece.size_m])
    apart = (
        np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        - radii[:, None]
        - radii[None]
    )
    assert 20 < len(points) <= 60 and apart[~np.eye(len(points), dtype=bool)].min() >= 1.2 - 1e-3
    assert np.hypot(*points.T).min() > 2.5  # the start


@pytest.mark.parametrize(
    "name, old, new, key",
    [
        ("indoor", "doors_m = [10, 28]", "doors_m = [10, 68]", "doors_m[1]"),
        (
            "indoor",
            "corners = [[-49.94, 1.5], [-40.2, 11.5]]",
            "corners = [[-40.2, 1.5], [-49.94, 11.5]]",
            "rooms[0].corners",
        ),
        ("indoor", 'kind = "office"', 'kind = "cellar"', "rooms[0].kind"),
        ("forest", "slope = 0.12", "slope = 1.2", "relief.slope"),
        (
            "forest",
            "least_m = [0.24, 0.24, 0.08]",
            "least_m = [0.4, 0.24, 0.08]",
            "scatter[0].most_m",
        ),
        ("forest", "corners = [[4.0, -24.0]", "corners = [[4.0, -99.0]", "scatter[0].corners[0]"),
    ],
)
def test_a_bad_room_door_or_scatter_is_refused_by_key(
    name: str, old: str, new: str, key: str, tmp_path: Path
) -> None:
    assert old in world(name)
    path = tmp_path / "bad.toml"
    path.write_text(world(name).replace(old, new, 1), encoding="utf-8")
    with pytest.raises(BadConfiguration) as refusal:
        load_scenario(path)
    assert key in str(refusal.value)


@pytest.mark.parametrize("kind", ["office", "meeting", "lounge", "store", "hall"])
def test_a_room_with_walls_too_short_for_its_furniture_is_left_with_what_fits(
    kind: RoomKind,
) -> None:
    narrow = Room(kind=kind, corners=((-4.0, 4.0), (4.0, 5.2)))
    narrow_floor = shapely.box(-4.0, 4.0, 4.0, 5.2)
    for seed in range(8):
        made = randomise(dataclasses.replace(open_floor(), rooms=(narrow,)), seed)
        assert shapely.within(area(obstacles(made)), narrow_floor) or not made.furniture


@pytest.mark.parametrize("pattern", ["tape", "red-white-tape", "radiation", "hatched"])
def test_a_marking_smaller_than_its_stripes_is_built(pattern: PaintPattern) -> None:
    piece = Marking(name="tape", polygon=((0.0, 1.0), (0.03, 1.0), (0.03, 1.03)), pattern=pattern)
    with blind(open_floor(markings=(piece,))):
        pass
