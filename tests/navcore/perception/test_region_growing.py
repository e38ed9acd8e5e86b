"""From a click in an image to an outline on the floor, in an image whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from navcore.errors import BadGeometry, Refused
from navcore.geometry.camera import project
from navcore.perception.region_growing import Region, alike_at, grown, region_at
from tests.navcore.scene import Box, picture

CRATE = Box(x=(2.0, 2.5), y=(-0.3, 0.3), z=(0.0, 0.4))
FRAME = picture(CRATE)
LENS = FRAME.intrinsics


def pixel(x: float, y: float, z: float) -> tuple[int, int]:
    """Return the (row, col) that shows a position of the map frame."""
    seen = np.linalg.inv(FRAME.T_map_camera) @ np.array([x, y, z, 1.0])
    ((col, row),) = project(seen[None, :3], LENS)
    return round(row), round(col)


def region(row: int, col: int, labels: np.ndarray | None = None) -> Region:
    nothing = np.zeros(FRAME.depth_m.shape, dtype=np.uint8)
    return region_at(
        row,
        col,
        class_ids=nothing if labels is None else labels,
        depth_m=FRAME.depth_m,
        intrinsics=LENS,
        T_map_camera=FRAME.T_map_camera,
    )


def test_an_unlabelled_object_is_separated_by_its_depth_and_outlined_where_it_stands() -> None:
    found = region(*pixel(2.0, 0.0, 0.2))
    assert found.class_id == 0
    seen, front = Polygon(found.footprint), box(2.0, -0.3, 2.05, 0.3)
    assert seen.buffer(0.02).contains(front)
    assert box(1.9, -0.4, 2.6, 0.4).contains(seen)


def test_a_labelled_object_is_taken_by_its_pixels_though_it_is_flat() -> None:
    labels = np.zeros(FRAME.depth_m.shape, dtype=np.uint8)
    (top, left), (low, right) = pixel(1.8, 0.2, 0.0), pixel(1.5, -0.2, 0.0)
    labels[top:low, left:right] = 3
    found = region((top + low) // 2, (left + right) // 2, labels)
    assert found.class_id == 3
    np.testing.assert_array_equal(found.pixels, labels == 3)
    assert Polygon(found.footprint).area == pytest.approx(0.3 * 0.4, rel=0.4)


def test_floor_and_pixels_outside_the_image_are_refused_with_a_reason() -> None:
    with pytest.raises(BadGeometry, match="only floor"):
        region(*pixel(1.5, 0.0, 0.0))
    with pytest.raises(BadGeometry, match="outside the image"):
        region(-1, 0)


BLOCK = (slice(30, 45), slice(20, 40))
"""Pixels of a block on a floor."""


def floor_with_a_block() -> tuple[np.ndarray, np.ndarray]:
    """Return colours and depth of a grey floor with a red block on it."""
    rgb = np.repeat(np.linspace(120, 150, 60)[:, None, None], 80, axis=1).repeat(3, axis=2)
    depth_m = np.repeat(np.linspace(4.0, 1.0, 60)[:, None], 80, axis=1).astype(np.float32)
    rgb[BLOCK], depth_m[BLOCK] = (200, 30, 30), 1.2
    return rgb.astype(np.uint8), depth_m


def block_from(rgb: np.ndarray, depth_m: np.ndarray, row: int = 35) -> np.ndarray:
    return alike_at(
        row,
        30,
        rgb=rgb,
        depth_m=depth_m,
        tolerance=18.0,
        depth_step_m=0.03,
        max_share=0.5,
    )


def test_a_region_grows_by_colour_and_stops_at_a_step_of_depth() -> None:
    rgb, depth_m = floor_with_a_block()
    expected = np.zeros(depth_m.shape, dtype=np.bool_)
    expected[BLOCK] = True
    np.testing.assert_array_equal(block_from(rgb, depth_m), expected)
    plain = np.full_like(rgb, 120)  # no colour tells the block from the floor, depth does
    np.testing.assert_array_equal(block_from(plain, depth_m), expected)
    flat = np.ones_like(depth_m)  # depth does not, colour does
    np.testing.assert_array_equal(block_from(rgb, flat), expected)
    unmeasured = np.zeros_like(flat)
    np.testing.assert_array_equal(block_from(rgb, unmeasured), expected)
    with pytest.raises(Refused, match="of the image"):
        block_from(plain, flat)
    with pytest.raises(BadGeometry, match="outside"):
        block_from(plain, flat, row=len(plain))


def test_pixels_that_touch_at_a_corner_are_neighbours_where_that_is_asked_for() -> None:
    corner = np.eye(4, dtype=np.bool_)
    assert grown(0, 0, corner).sum() == 4
    assert grown(0, 0, corner, diagonal=False).sum() == 1
    step = np.repeat([[0.0, 0.1, 0.2, 0.9]], 4, axis=0)
    assert grown(0, 0, np.ones((4, 4), dtype=np.bool_), step, 0.15)[0].tolist() == [1, 1, 1, 0]
    assert not grown(0, 0, np.ones((4, 4), dtype=np.bool_), step, 0.05)[0, 1:].any()
