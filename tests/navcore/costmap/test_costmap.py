"""The costmap follows the map, the beware list and the zones bit for bit."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.costmap.costmap import Costmap, layer_grid
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.transform import Pose2
from navcore.grid.grid import inflate_layers
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL, FIRST, SECOND, SMALL, random_step

BODY = {"vehicle_width_m": 0.4, "safety_margin_m": 0.1}
SQUARE = ((0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5))
ZONES = (
    Zone(id="a", name="a", polygon=SQUARE),
    Zone(id="b", name="b", polygon=SQUARE, margin_m=0.3),
    Zone(id="c", name="c", polygon=((-2.0, -2.0), (-1.0, -2.0), (-1.0, 0.0)), enabled=False),
)


def random_list(rng: np.random.Generator) -> BewareList:
    return BewareList(
        classes=tuple(
            dataclasses.replace(
                entry,
                enabled=bool(rng.random() < 0.7),
                margin_m=float(rng.choice([0.0, 0.25])),
                min_confidence=float(rng.choice([0.0, 0.5])),
            )
            for entry in (FIRST, SECOND)
        )
    )


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_following_any_sequence_of_frames_and_edits_equals_a_rebuild_from_scratch(
    seed: int,
) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    live, beware, zones = LiveCostmap(cloud, **BODY), ALL, ()
    for _ in range(10):
        match int(rng.integers(0, 4)):
            case 0:
                beware = random_list(rng)
            case 1:
                zones = tuple(zone for zone in ZONES if rng.random() < 0.5)  # type: ignore[assignment]
            case _:
                frame, observation = random_step(rng, confident=False)
                cloud.insert(observation, frame)
        seen = live.follow(beware, zones)
        grid = layer_grid(cloud, beware, zones)
        np.testing.assert_array_equal(seen.blocked, inflate_layers(grid, **BODY))
        np.testing.assert_array_equal(seen.blocked, live.space.blocked())
        np.testing.assert_array_equal(seen.grid.geometric, grid.geometric)
        assert seen.grid.beware.keys() == grid.beware.keys()
        for class_id, layer in grid.beware.items():
            np.testing.assert_array_equal(seen.grid.beware[class_id], layer)
        np.testing.assert_array_equal(seen.grid.zones, grid.zones)


def test_a_snapshot_stays_as_it_was_when_the_map_goes_on() -> None:
    rng, cloud = np.random.default_rng(1), PointMap(SMALL, MappingConfig())
    live = LiveCostmap(cloud, **BODY)
    frame, observation = random_step(rng, confident=True)
    cloud.insert(observation, frame)
    first = live.follow(ALL, ())
    before = first.blocked.copy()
    assert live.follow(ALL, ()) is first
    untouched = Costmap.of(first.grid, first.blocked, version=0)
    for _ in range(6):
        frame, observation = random_step(rng, confident=True)
        cloud.insert(observation, frame)
        live.follow(ALL, ZONES)
    np.testing.assert_array_equal(first.free.bools, ~before)
    np.testing.assert_array_equal(first.grid.geometric, untouched.grid.geometric)


def test_the_part_around_a_pose_is_the_same_part_of_the_whole() -> None:
    rng, cloud = np.random.default_rng(2), PointMap(SMALL, MappingConfig())
    for _ in range(5):
        frame, observation = random_step(rng, confident=True)
        cloud.insert(observation, frame)
    whole = LiveCostmap(cloud, **BODY).follow(ALL, ZONES)
    for x_m, y_m in ((0.0, 0.0), (-2.9, 2.9), (40.0, 0.0)):
        part = whole.around(Pose2(x_m=x_m, y_m=y_m, yaw_rad=0.0), 1.0)
        top, left = SMALL.cell(part.spec.origin_x_m + 0.01, part.spec.origin_y_m + 0.01)
        rows, cols = slice(top, top + part.spec.rows), slice(left, left + part.spec.cols)
        np.testing.assert_array_equal(part.geometric, whole.grid.geometric[rows, cols])
        np.testing.assert_array_equal(part.zones, whole.grid.zones[rows, cols])
