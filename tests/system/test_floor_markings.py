"""Patterns on the floor, from the simulated camera to the beware cells of the map."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.costmap.local_costmap import beware_cells
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor
from sim.models.floor_paint import PaintPattern
from sim.models.solids import Colour
from sim.rendering.lighting import Lighting
from sim.scenario.schema import FLOOR_COLOUR, Furniture, Marking, Scenario
from sim.simulator import Simulator
from tests.sim.worlds import open_floor

CELL_M = 0.05
SPEC = GridSpec.centred(size_m=(10.0, 10.0), resolution_m=CELL_M)
SQUARE = ((-0.48, -0.48), (0.48, -0.48), (0.48, 0.48), (-0.48, 0.48))
TAPE = ((-0.08, -0.62), (0.08, -0.62), (0.08, 0.62), (-0.08, 0.62))
POLYGONS: dict[PaintPattern, tuple[tuple[float, float], ...]] = {
    "tape": TAPE,
    "red-white-tape": TAPE,
    "hatched": SQUARE,
    "bay": SQUARE,
    "white-bay": SQUARE,
    "high-voltage": ((-0.25, -0.4), (0.45, 0.0), (-0.25, 0.4)),
    "radiation": SQUARE,
    "yellow": SQUARE,
    "blue": SQUARE,
    "green": SQUARE,
    "white-line": TAPE,
}
DISTANCES_M = (1.5, 2.25, 3.0)
_SHIPPED = default_beware_list()
OFF = _SHIPPED.replaced(dataclasses.replace(one, enabled=False) for one in _SHIPPED.classes)
PAPER, RED = (250, 250, 248), (200, 20, 20)
BRIGHT, DARK = (236, 236, 234), (110, 108, 104)
WHITE = ("white line", "white-lined bay")


def looks(world: Scenario, seed: int = 4) -> list[Frame]:
    """Return what the camera sees of the origin of a world from each distance."""
    frames = []
    with Simulator(world, seed=seed, camera_rate_hz=0.001, camera_size=(640, 480),
                   start=Pose2(x_m=-5.0, y_m=0.0, yaw_rad=0.0)) as simulator:  # fmt: skip
        ahead_m = simulator.profile.camera.T_base_camera[0, 3]
        for distance_m in DISTANCES_M:
            pose = Pose2(x_m=-distance_m - ahead_m, y_m=0.0, yaw_rad=0.0)
            simulator.teleport(pose)
            frames.append(dataclasses.replace(simulator.capture(), pose=simulator.true_pose()))
    return frames


def cells(frame: Frame, beware: BewareList) -> Points:
    """Return the centres of the beware cells after one look."""
    cloud = PointMap(SPEC, MappingConfig())
    labels = ColourSegmenter().segment(frame, beware)
    cloud.insert(observe(frame, labels, beware, SPEC, ObservationConfig()), frame, labels)
    return beware_cells(layer_grid(cloud, beware, ()))[0]


@pytest.mark.parametrize("pattern", POLYGONS)
def test_a_marking_becomes_beware_cells_that_cover_it_and_nothing_else(
    pattern: PaintPattern,
) -> None:
    marking = Marking(name="marking", polygon=POLYGONS[pattern], pattern=pattern)
    area = shapely.Polygon(marking.polygon)
    on = OFF.edited(marking.beware_class, enabled=True)
    centres = SPEC.centres(np.argwhere(np.ones((SPEC.rows, SPEC.cols))))
    inside = {tuple(cell) for cell in centres[shapely.contains_xy(area, *centres.T)].round(3)}
    # White is told from the floor by its brightness alone.
    floor = DARK if "white" in pattern else FLOOR_COLOUR
    world = dataclasses.replace(open_floor(markings=(marking,)), floor_colour=floor)
    for distance_m, frame in zip(DISTANCES_M, looks(world), strict=True):
        found = cells(frame, on)
        covered = len(inside & {tuple(cell) for cell in found.round(3)}) / len(inside)
        # A cell that the outline crosses belongs to the marking, within the error of depth.
        squares = shapely.box(*(found - CELL_M / 2).T, *(found + CELL_M / 2).T)
        error_m = DepthSensor().depth_error_m(distance_m, frame.intrinsics.fx)
        outside = int((shapely.distance(squares, area) > error_m).sum()) / len(inside)
        assert covered >= 0.8, (distance_m, covered)
        assert outside < 0.02, (distance_m, outside)
        assert len(cells(frame, OFF)) == 0  # control


def painted(
    colour: Colour, *, sides_m: tuple[float, float] = (0.96, 0.96), turn_rad: float = 0.3
) -> Scenario:
    """Return a floor with a plain rectangle, which is turned so that no edge lies along a cell."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    corners = (
        np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2 * sides_m @ [[cos, sin], [-sin, cos]]
    )
    return open_floor(
        markings=(Marking(name="plain", polygon=tuple(map(tuple, corners)), colour=colour),)
    )


WALL = Furniture(kind="box", at=(0.3, 0.0), size_m=(0.1, 3.0, 1.2), colour=PAPER)
LAMPS = Lighting(lamp_spacing_m=4.0, shade=0.35)


@pytest.mark.parametrize(
    ("world", "names"),
    [
        (open_floor(), WHITE),
        (dataclasses.replace(open_floor(), floor_colour=PAPER), WHITE),
        (dataclasses.replace(painted(PAPER), floor_colour=DARK), WHITE),
        (dataclasses.replace(painted(PAPER, sides_m=(0.21, 0.3)), floor_colour=DARK), WHITE),
        (dataclasses.replace(open_floor(furniture=(WALL,)), floor_colour=DARK), WHITE),
        (dataclasses.replace(open_floor(), floor_colour=DARK, lighting=LAMPS), WHITE),
        (painted(RED), ("red-white tape",)),
        (dataclasses.replace(painted(RED), floor_colour=BRIGHT), ("red-white tape",)),
        (dataclasses.replace(painted(RED), floor_colour=PAPER), ("red-white tape",)),
        (painted((245, 200, 10)), ("yellow-black tape", "hatched area", "green floor")),
        (painted((25, 85, 205)), ("reserved bay", "green floor")),
        (painted((196, 160, 120)), ("yellow floor", "red floor")),
    ],
    ids=[
        *("grey floor", "white floor", "large white area", "sheet of paper", "white wall"),
        *("light of lamps", "red", "red on a bright floor", "red on a white floor"),
        *("yellow", "blue", "wood"),
    ],
)  # fmt: skip
def test_what_only_has_the_colour_of_a_marking_is_none(
    world: Scenario, names: tuple[str, ...]
) -> None:
    on = OFF
    for name in names:
        on = on.edited(name, enabled=True)
    for distance_m, frame in zip(DISTANCES_M, looks(world), strict=True):
        assert len(cells(frame, on)) == 0, distance_m


def test_red_floor_takes_the_red_of_red_white_tape_and_not_its_white() -> None:
    marking = Marking(name="tape", polygon=TAPE, pattern="red-white-tape")
    red, tape = (OFF.edited(name, enabled=True) for name in ("red floor", "red-white tape"))
    for frame in looks(open_floor(markings=(marking,))):
        assert 0 < len(cells(frame, red)) < len(cells(frame, tape))
        colours = frame.rgb[ColourSegmenter().segment(frame, red).mask(red)].astype(np.int64)
        assert (colours[:, 0] > 2 * colours[:, 1]).all()


def rounds(world: Scenario) -> list[Frame]:
    """Return what the camera sees on two ways along and across the origin of a world."""
    ways = [(-0.9 - 0.15 * k, 0.25 * np.sin(k), 0.2 * np.cos(2 * k)) for k in range(12)]
    ways += [
        (0.25 * np.sin(k), -0.9 - 0.15 * k, np.pi / 2 + 0.2 * np.cos(2 * k)) for k in range(12)
    ]
    frames = []
    with Simulator(world, seed=5, camera_rate_hz=0.001, camera_size=(424, 240),
                   start=Pose2(x_m=-5.0, y_m=0.0, yaw_rad=0.0)) as simulator:  # fmt: skip
        for x_m, y_m, yaw_rad in ways:
            ahead = Pose2(x_m=simulator.profile.camera.T_base_camera[0, 3], y_m=0.0, yaw_rad=0.0)
            simulator.teleport(Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad) @ ahead.inverse())
            frames.append(dataclasses.replace(simulator.capture(), pose=simulator.true_pose()))
    return frames


@pytest.mark.parametrize("lighting", [Lighting(), LAMPS], ids=["even light", "lamps"])
def test_a_white_line_stays_as_long_as_it_is_there_and_fades_when_it_is_gone(
    lighting: Lighting,
) -> None:
    line = Marking(name="line", polygon=TAPE, pattern="white-line")
    on = OFF.edited("white line", enabled=True)
    floor = dataclasses.replace(open_floor(), floor_colour=DARK, lighting=lighting)
    painted_floor = dataclasses.replace(floor, markings=(line,))
    cloud, held = PointMap(SPEC, MappingConfig()), []
    cloud.use(on)
    for world, times in ((painted_floor, 3), (floor, 2)):
        for frame in rounds(world) * times:
            labels = ColourSegmenter().segment(frame, on)
            cloud.insert(observe(frame, labels, on, SPEC, ObservationConfig()), frame, labels)
            held.append(len(beware_cells(layer_grid(cloud, on, ()))[0]))
    there = held[24:72]
    assert min(there) >= 0.9 * max(there) > 20
    assert held[-1] < 0.1 * max(there)
