"""Pinhole camera: projection inverts back-projection, and the compiled functions agree with
both."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from navcore.compiled import compiled
from navcore.geometry.camera import (
    Intrinsics,
    Pinhole,
    back_project,
    back_project_pixels,
    column_slope,
    pixel_rays,
    point_on_ray,
    project,
    row_slope,
)
from navcore.geometry.transform import camera_mount, transform_points
from tests.navcore.laws import law

LENS = Intrinsics(width=16, height=12, fx=9.5, fy=8.5, cx=7.3, cy=5.1)
MOUNT = camera_mount(x_m=0.3, y_m=0.0, z_m=0.6, pitch_down_rad=0.25)
FINE = Intrinsics(width=848, height=480, fx=440.0, fy=440.0, cx=423.5, cy=239.5)
ROWS, COLS = np.mgrid[0 : LENS.height, 0 : LENS.width]


def depths(seed: int) -> npt.NDArray[np.float32]:
    return np.asarray(np.random.default_rng(seed).uniform(0.1, 9.0, ROWS.shape), dtype=np.float32)


@compiled
def _points(
    depth_m: npt.NDArray[np.float32], t: npt.NDArray[np.float64], lens: Pinhole
) -> npt.NDArray[np.float64]:
    height, width = depth_m.shape
    points = np.empty((height, width, 3))
    for i in range(height):
        for j in range(width):
            x, y, z = point_on_ray(t, column_slope(j, lens), row_slope(i, lens), depth_m[i, j])
            points[i, j, 0], points[i, j, 1], points[i, j, 2] = x, y, z
    return points


@law(50)
@given(st.integers(0, 2**32 - 1))
def test_projection_inverts_back_projection(seed: int) -> None:
    pixels = project(back_project(depths(seed), LENS), LENS)
    np.testing.assert_allclose(pixels, np.column_stack([COLS.ravel(), ROWS.ravel()]), atol=1e-9)


@law(20)
@given(st.integers(0, 2**32 - 1))
def test_the_compiled_functions_give_the_same_points(seed: int) -> None:
    depth_m = depths(seed)
    expected = transform_points(MOUNT, back_project(depth_m, LENS))
    np.testing.assert_allclose(
        _points(depth_m, MOUNT, LENS.pinhole).reshape(-1, 3), expected, atol=1e-9
    )


def test_a_ray_is_the_point_at_depth_1() -> None:
    np.testing.assert_allclose(
        pixel_rays(ROWS, COLS, LENS),
        back_project_pixels(ROWS, COLS, np.ones(ROWS.shape), LENS),
        rtol=1e-15,
    )


def test_a_point_behind_the_camera_has_no_pixel() -> None:
    pixels = project(np.array([[0.1, 0.2, -1.0], [0.1, 0.2, 0.0], [0.0, 0.0, 2.0]]), LENS)
    assert np.isnan(pixels[:2]).all()
    np.testing.assert_array_equal(pixels[2], [LENS.cx, LENS.cy])


def test_thresholds_cover_the_same_angle_in_finer_images_and_as_many_pixels_in_coarse_ones() -> (
    None
):
    assert (FINE.length_px(5), FINE.area_px(12)) == (10, 48)
    assert (LENS.length_px(5), LENS.area_px(12)) == (5, 12)
