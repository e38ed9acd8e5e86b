"""From a click in an image to an outline on the floor, in an image whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from navcore.errors import BadGeometry
from navcore.geometry.camera import project
from navcore.perception.region_growing import Region, region_at
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
