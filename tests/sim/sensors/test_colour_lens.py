"""The colour lens of its own: colours lie on the depth that they belong to, and what the lens does
not see has none."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest

from navcore.geometry.camera import Intrinsics, pixel_rays, project
from navcore.robot.camera_stream import SIZES, CameraStream
from navcore.robot.frame import check_frame
from navcore.robot.profile import HUSKY
from sim.scenario.schema import Furniture
from sim.sensors.camera import d455_intrinsics
from sim.sensors.colour_lens import (
    OFFSET_M,
    PARALLAX_PX,
    UNMEASURED_M,
    colour_intrinsics,
    register_colour,
)
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import Simulator
from tests.sim.worlds import open_floor

NEAR_BOX = Furniture(kind="box", at=(1.3, 0.1), size_m=(0.2, 0.2, 0.9), colour=(210, 20, 20))
FAR_BOX = Furniture(kind="box", at=(3.0, -0.4), size_m=(0.5, 0.5, 0.8), colour=(20, 20, 210))
STREAM = CameraStream(colour_lens=True)


def brute_force(
    colour: npt.NDArray[np.uint8], colour_lens: Intrinsics, depth_m: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Return column and row in the colour image of each pixel, (H, W, 2), and whether the colour
    lens does not see it, by comparing it with all others."""
    lens = d455_intrinsics((depth_m.shape[1], depth_m.shape[0]))
    rows, cols = np.mgrid[0 : depth_m.shape[0], 0 : depth_m.shape[1]]
    z = np.where(depth_m > 0, depth_m, UNMEASURED_M).astype(np.float64)
    points = (pixel_rays(rows, cols, lens) * z[..., None]).reshape(-1, 3) - [OFFSET_M, 0.0, 0.0]
    at, z = project(points, colour_lens), z.ravel()
    measured = np.flatnonzero(depth_m.ravel() > 0)
    height, width = colour.shape[:2]
    inside = ((at >= -0.5) & (at < (width - 0.5, height - 0.5))).all(axis=1)
    unseen = np.asarray(~inside, dtype=np.bool_)
    for pixel in np.flatnonzero(inside):
        shown = np.rint(at[pixel])
        start = np.floor(at[measured])
        covers = ((shown >= start) & (shown <= start + 1)).all(axis=1)
        nearer = 1 / z[measured][covers] - 1 / z[pixel]
        unseen[pixel] = bool((colour_lens.fx * OFFSET_M * nearer > PARALLAX_PX).any())
    return at.reshape(*depth_m.shape, 2), unseen.reshape(depth_m.shape)


@pytest.mark.parametrize("seed", range(3))
def test_registration_agrees_with_comparing_every_pixel_with_every_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = (48, 27)
    lens, own = d455_intrinsics(size), colour_intrinsics(size, narrow=False)
    depth_m = np.full((27, 48), 4.0, dtype=np.float32)
    depth_m[4:22, 10 + 8 * seed : 16 + 8 * seed] = 0.4
    depth_m[:, 40:] = 1.2
    depth_m[rng.random(depth_m.shape) < 0.1] = 0.0
    rows, cols = np.mgrid[0:27, 0:48]
    # Levels that tell column and row, so that bilinear colours are those of the exact place.
    colour = np.stack([5 * cols, 9 * rows, np.full_like(cols, 77)], axis=2).astype(np.uint8)
    rgb, unseen = register_colour(colour, own, depth_m, lens)
    at, hidden = brute_force(colour, own, depth_m)
    np.testing.assert_array_equal(unseen, hidden)
    assert 10 < unseen.sum() < 400 and (rgb[unseen] == 0).all()
    inner = ~unseen & (at >= 0).all(axis=2) & (at <= (47, 26)).all(axis=2)
    expected = at[inner] * (5, 9)
    assert np.abs(rgb[inner][:, :2] - expected).max() <= 0.51
    assert (rgb[inner][:, 2] == 77).all()


@pytest.mark.parametrize("size", SIZES)
def test_the_colour_lens_sees_more_than_depth_with_square_pixels(size: tuple[int, int]) -> None:
    depth, colour = d455_intrinsics(size), colour_intrinsics(size, narrow=size[0] / size[1] < 1.5)
    assert colour.fx == colour.fy < min(depth.fx, depth.fy * 1.02)
    if size != (640, 480):
        assert 2 * math.degrees(math.atan(size[0] / 2 / colour.fx)) == pytest.approx(90.0)


def test_colours_lie_on_their_objects_and_hidden_background_has_none() -> None:
    world = open_floor(furniture=(NEAR_BOX, FAR_BOX))
    robot = dataclasses.replace(HUSKY, stream=STREAM)
    with Simulator(world, seed=0, robot=robot, errors=PERFECT) as simulator:
        frame, truth = simulator.capture(), simulator.image()
    with Simulator(world, seed=0, errors=PERFECT) as simulator:
        same_lens = simulator.capture()
    check_frame(frame)
    assert frame.uncoloured is not None and same_lens.uncoloured is None
    np.testing.assert_array_equal(frame.depth_m, same_lens.depth_m)
    differs = np.abs(frame.rgb.astype(int) - same_lens.rgb).max(axis=2) > 60
    measured = frame.depth_m > 0
    # But for the hidden ones, the colours are those that the depth lens would see, to a pixel at
    # the edges.
    wrong = differs & ~frame.uncoloured & measured
    assert wrong.sum() < 0.25 * frame.uncoloured.sum()
    assert 100 < frame.uncoloured.sum() < 0.06 * frame.uncoloured.size
    # The colour lens stands to the right: it does not see what is left of a near object.
    row, middle = 120, int(np.argmin(np.where(measured[120], frame.depth_m[120], np.inf)))
    near = np.flatnonzero(truth.objects[row] == truth.objects[row, middle])
    assert frame.uncoloured[row, near[0] - 3] and not frame.uncoloured[row, near[-1] + 3]


def test_without_depth_the_background_would_take_the_colour_of_what_hides_it() -> None:
    world = open_floor(furniture=(NEAR_BOX,))
    robot = dataclasses.replace(HUSKY, stream=STREAM)
    with Simulator(world, seed=0, robot=robot, errors=PERFECT) as simulator:
        frame, camera = simulator.capture(), simulator.camera
        colour = camera.colour_image(simulator.true_pose(), 0.0)
    assert frame.uncoloured is not None and camera.colour_lens is not None
    far = (frame.depth_m > 1.6) & ~frame.uncoloured
    assert (is_red(frame.rgb) & far).sum() == 0
    nowhere = np.zeros_like(frame.depth_m)
    laid_over, _ = register_colour(colour, camera.colour_lens, nowhere, camera.intrinsics)
    assert (is_red(laid_over) & far).sum() > 50


def is_red(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    return rgb[..., 0].astype(int) - rgb[..., 2] > 100
