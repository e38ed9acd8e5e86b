"""World files: the built-in ones are valid, bad ones are refused by key, seeds vary them within
bounds."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pybullet as p
import pytest
from shapely import Polygon

from navcore.errors import BadConfiguration
from navcore.grid.grid import GridSpec
from navcore.robot.profile import load_profile
from sim.models.items import ITEM_SIZES, item_shapes
from sim.referee.referee import Referee
from sim.scenario.layout import obstacles
from sim.scenario.load import WORLDS, load_scenario, scenario_names
from sim.scenario.schema import Furniture, Item, Marking, Print, Scenario, Wall
from sim.scenario.variation import randomise
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import Simulator
from sim.truth.true_objects import true_objects
from tests.sim.worlds import blind, open_floor, wait

ROOM = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")


def test_the_built_in_worlds_load() -> None:
    assert {"office", "empty_room"} <= set(scenario_names())
    for name in scenario_names():
        assert load_scenario(name).name == name


@pytest.mark.parametrize(
    "old, new, key",
    [
        ("name = ", 'colour = "red"\nname = ', "colour"),
        ("size_m = [8.0, 8.0]\n", "", "size_m"),
        ("[8.0, 8.0]", "[8.0, -8.0]", "size_m[1]"),
        ("goals = [[2.8, 2.8]]", "goals = [[2.8]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[2.8, 9.0]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[3.7, 2.8]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[0.0, 0.0]]", "goals[0]"),
        ("start = [-2.5, -2.5, 0.0]", "start = [-3.5, -2.5, 0.0]", "start"),
        ("start = [-2.5, -2.5, 0.0]", "start = [0.5, -2.2, 0.0]", "furniture[0]"),
        ("start = [-2.5, -2.5, 0.0]", "start = [nan, -2.5, 0.0]", "start[0]"),
        ('kind = "box"', 'kind = "dragon"', "furniture[0].kind"),
        ("[0.9, -0.4], [0.9, 1.2]", "[0.9, 1.2], [0.9, -0.4]", "markings[0].polygon"),
        (
            "[[-0.7, -0.4], [0.9, -0.4], [0.9, 1.2], [-0.7, 1.2]]",
            "[[-0.7, -0.4], [0.9, -0.4]]",
            "markings[0].polygon",
        ),
        ("[3.94, -3.94], [3.94, 3.94]", "[3.94, -3.94], [3.94, -3.94]", "walls[0].points[2]"),
        ("[3.94, -3.94], [3.94, 3.94]", "[5.0, -3.94], [3.94, 3.94]", "walls[0].points[1]"),
        (ROOM[-1:], '\n[[items]]\nkind = "cup"\nat = [1, 1]\nshape = "round"\n', "items[0].shape"),
        (ROOM[-1:], "\n[[people]]\npoints = [[1, 1], [1, 1], [2, 1]]\n", "people[0].points[1]"),
        (ROOM[-1:], '\n[[items]]\nkind = "dragon"\nat = [1, 1]\n', "items[0].kind"),
        (ROOM[-1:], '\n[[prints]]\nshows = "cup"\nat = [9, 1]\n', "prints[0].at"),
        (ROOM[-1:], '\n[[prints]]\nshows = "person"\nat = [1, 1]\n', "prints[0].shows"),
        ('name = "red floor"', 'name = "red floor"\nsurface = "lava"', "markings[0].surface"),
    ],
)
def test_a_bad_world_is_refused_by_key(old: str, new: str, key: str, tmp_path: Path) -> None:
    assert old in ROOM
    path = tmp_path / "bad.toml"
    path.write_text(ROOM + new if old == ROOM[-1:] else ROOM.replace(old, new), encoding="utf-8")
    with pytest.raises(BadConfiguration) as refusal:
        load_scenario(path)
    assert key in str(refusal.value) and "bad.toml" in str(refusal.value)


def test_the_unchanged_file_is_the_control(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_text(ROOM, encoding="utf-8")
    assert load_scenario(str(path)) == load_scenario("empty_room")


def test_a_world_is_judged_with_the_body_of_the_robot_that_is_to_drive_in_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "narrow.toml"
    path.write_text(ROOM.replace("[2.8, 2.8]", "[3.6, 2.8]"), encoding="utf-8")
    assert load_scenario(path, load_profile("jackal")).goals == ((3.6, 2.8),)
    with pytest.raises(BadConfiguration, match=r"goals\[0\]"):
        load_scenario(path)


@pytest.mark.parametrize("name", ["nowhere", "../worlds/office", "", "missing.toml"])
def test_an_unknown_world_is_refused(name: str) -> None:
    with pytest.raises(BadConfiguration, match=r"office|no such file"):
        load_scenario(name)


def office_path_m(scenario: Scenario) -> float | None:
    spec = GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
    return Referee(scenario).shortest_m(spec, 0.45, scenario.goals)


def test_the_office_mission_is_drivable_with_every_seed() -> None:
    office = load_scenario("office")
    assert all(45 < (office_path_m(randomise(office, seed)) or 0.0) < 60 for seed in range(10))


def test_the_red_floor_lies_on_the_shortest_path_and_can_be_bypassed() -> None:
    office = load_scenario("office")
    unpainted = office_path_m(dataclasses.replace(office, markings=()))
    painted = office_path_m(office)
    assert unpainted is not None and painted is not None
    assert unpainted + 0.3 < painted < unpainted + 3.0


def test_seeds_move_loose_objects_a_little_and_walls_never() -> None:
    office = load_scenario("office")
    found = [randomise(office, seed) for seed in range(10)]
    assert len({run.furniture for run in found}) == len({run.items for run in found}) == 10
    assert randomise(office, 7) == found[7]
    for run in found:
        assert run.walls == office.walls
        for piece, planned in zip(run.furniture, office.furniture, strict=True):
            assert max(abs(a - b) for a, b in zip(piece.at, planned.at, strict=True)) <= 0.06 + 1e-9


def every_item() -> tuple[Item, ...]:
    kinds = [(kind, shape) for kind in ITEM_SIZES for shape in item_shapes(kind)]
    at = [(3.0 + 1.6 * (i % 5), -4.0 + 1.6 * (i // 5)) for i in range(len(kinds))]
    return tuple(
        Item(kind=kind, shape=shape, at=spot)  # type: ignore[arg-type]
        for (kind, shape), spot in zip(kinds, at, strict=True)
    )


def test_every_shape_of_every_item_lies_on_the_floor_within_its_extent() -> None:
    for item in every_item():
        solids, (length, width, height) = item.solids(), item.extent_m()
        corners = np.concatenate([solid.outline() for solid in solids])
        tolerance_m = 0.15 if item.kind in ("cup", "box") else 0.05  # handles and flaps
        assert np.abs(corners).max(axis=0) == pytest.approx(
            (length / 2, width / 2), abs=tolerance_m
        ), item
        assert min(solid.bottom_m for solid in solids) == pytest.approx(0.0, abs=0.006), item
        top = max(solid.centre_m[2] + solid.extent_m[2] / 2 for solid in solids)
        assert (
            top == pytest.approx(height, rel=0.35 if item.kind == "box" else 0.12, abs=0.006)
            or item.shape == "open"
        ), item


def test_items_of_every_kind_stay_where_they_were_put() -> None:
    with blind(open_floor(items=every_item(), start=(-8.0, 0.0, 0.0))) as simulator:
        client, bodies = {"physicsClientId": simulator.client}, simulator.world.item_bodies
        assert all(p.getDynamicsInfo(body, -1, **client)[0] > 0 for body in bodies)
        before = np.array([p.getBasePositionAndOrientation(body, **client)[0] for body in bodies])
        wait(simulator, 1.0)
        after = np.array([p.getBasePositionAndOrientation(body, **client)[0] for body in bodies])
    assert len(bodies) == len(every_item())
    assert np.abs(after - before).max() < 0.002


def test_a_cables_outline_is_its_run_and_not_the_box_around_it() -> None:
    cable = Item(kind="cable", at=(0.0, 0.0), shape="arc")
    length, width, _ = cable.extent_m()
    run = sum(Polygon(solid.outline()).area for solid in cable.solids())
    assert 0.008 < run < 0.05 * length * width


def test_a_print_is_neither_an_obstacle_nor_a_beware_object() -> None:
    world = dataclasses.replace(open_floor(), prints=(Print(shows="cup", at=(2.0, 0.0)),))
    assert not obstacles(world) and not true_objects(world)


def test_prints_and_spills_are_seen_with_their_textures_and_without_height() -> None:
    wall = Wall(points=((4.0, -2.0), (4.0, 2.0)))
    prints = (
        Print(shows="cup", at=(1.8, 0.5), yaw_deg=270, size_m=(0.6, 0.6)),
        Print(
            shows="book", at=(3.92, -0.6), yaw_deg=180, size_m=(0.6, 0.6), on="wall", height_m=0.8
        ),
    )
    spill = Marking(
        name="spill", polygon=((1.4, -1.0), (2.4, -1.0), (2.4, 0.0), (1.4, 0.0)), surface="water"
    )
    bare = dataclasses.replace(
        open_floor(furniture=(Furniture(kind="desk", at=(3.5, 1.5)),)), walls=(wall,)
    )
    full = dataclasses.replace(bare, prints=prints, markings=(spill,))
    views = []
    for world in (bare, full):
        with Simulator(world, seed=0, camera_size=(424, 240), errors=PERFECT) as simulator:
            frame = simulator.capture()
            views.append((frame.rgb.astype(int), frame.depth_m))
    (bare_rgb, bare_m), (rgb, depth_m) = views
    red, green, blue = np.moveaxis(rgb, 2, 0)
    changed = (rgb != bare_rgb).any(axis=2)
    ys, xs = np.nonzero(
        changed & (blue > red + 80) & (blue > green + 60)
    )  # the cup's blue, on the floor, left
    assert len(ys) > 300 and ys.min() > 120 and xs.max() < 212
    ys, xs = np.nonzero(
        changed & (green > red + 40) & (green > blue + 40)
    )  # the book's green, on the wall, right
    assert len(ys) > 150 and ys.max() < 120 and xs.min() > 212
    water = changed & (np.arange(424) > 230) & (np.arange(240)[:, None] > 140)
    assert water.sum() > 2000 and rgb[water].std(axis=0).max() > 3  # with highlights
    assert np.abs(depth_m - bare_m)[changed].max() < 0.03
