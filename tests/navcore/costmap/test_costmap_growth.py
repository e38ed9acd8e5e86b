"""A costmap that has grown equals one made on the larger grid; zones count wherever they lie."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.costmap.live_costmap import LiveCostmap
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import GridSpec
from navcore.grid.growth import growth_into
from navcore.mapping.point_map import PointMap
from navcore.mission.zone import Zone, ZoneKind
from tests.navcore.grid.test_free_space import assert_same_space
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL
from tests.navcore.mapping.test_map_growth import WIDE, WIDER, growth, step


def live(cloud: PointMap) -> LiveCostmap:
    return LiveCostmap(cloud, vehicle_width_m=0.6, safety_margin_m=0.15)


def random_zones(rng: np.random.Generator, spec: GridSpec) -> tuple[Zone, ...]:
    """Return zones on both sides of the border and beyond it."""
    zones = []
    size_m = spec.cols * spec.resolution_m
    for number in range(int(rng.integers(1, 5))):
        inside = rng.random() < 0.4
        x, y = rng.uniform(-0.8, 0.8, 2) * size_m
        reach = rng.uniform(0.6, 1.2) * size_m if inside else rng.uniform(0.2, 4.0)
        angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
        corners = np.column_stack([x + reach * np.cos(angles), y + reach * np.sin(angles)])
        zones.append(
            Zone(
                id=f"z{number}",
                name="z",
                polygon=tuple((float(x), float(y)) for x, y in corners),
                margin_m=float(rng.choice([0.0, 0.4])),
                kind=ZoneKind.STAY_INSIDE if inside else ZoneKind.KEEP_OUT,
            )
        )
    return tuple(zones)


@law(30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.integers(0, 2))
def test_a_grown_costmap_blocks_what_one_on_the_larger_grid_blocks(
    seed: int, before: int, after: int
) -> None:
    clouds = PointMap(WIDE, MappingConfig()), PointMap(WIDER, MappingConfig())
    zones = random_zones(np.random.default_rng(seed), WIDE)
    grown, large = (live(cloud) for cloud in clouds)
    for number in range(before):
        for cloud in clouds:
            step(cloud, seed + number)
        version = grown.follow(ALL, zones).version
    clouds[0].grow(growth())
    grown.grow(growth())
    for number in range(after):
        for cloud in clouds:
            step(cloud, seed + before + number)
    one, other = grown.follow(ALL, zones), large.follow(ALL, zones)
    assert before == 0 or one.version > version
    assert one.spec == WIDER
    np.testing.assert_array_equal(one.blocked, other.blocked)
    np.testing.assert_array_equal(one.grid.occupied(), other.grid.occupied())
    assert_same_space(grown.space, FreeSpace.of(other.blocked))


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_zones_close_the_same_cells_whether_the_grid_contains_them_or_not(seed: int) -> None:
    zones = random_zones(np.random.default_rng(seed), WIDE)
    part = WIDE.part(10, 20, 110, 100)
    within = growth_into(part, part.part(-192, -192, 292, 272))
    assert within is not None
    small = live(PointMap(part, MappingConfig())).follow(ALL, zones).blocked
    large = live(PointMap(within.new, MappingConfig())).follow(ALL, zones).blocked
    np.testing.assert_array_equal(small, large[192:292, 192:272])


def test_a_zone_just_outside_the_grid_closes_cells_of_it_and_none_when_it_is_off() -> None:
    """Control: the cells of the zone itself are not on the grid."""
    x = WIDE.origin_x_m + WIDE.cols * WIDE.resolution_m + 0.1
    zone = Zone(id="z", name="z", polygon=((x, -1.0), (x + 1, -1.0), (x + 1, 1.0), (x, 1.0)))
    costmap, off = live(PointMap(WIDE, MappingConfig())), dataclasses.replace(zone, enabled=False)
    now = costmap.follow(ALL, (zone,))
    assert now.blocked.any() and not now.grid.occupied().any()
    assert not costmap.follow(ALL, (off,)).blocked.any()
    assert costmap.follow(ALL, (zone,)).blocked.sum() == now.blocked.sum()
