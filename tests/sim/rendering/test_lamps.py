"""Lamps and their shadows, and the mirror of a polished floor, against rays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from navcore.geometry.camera import Intrinsics, pixel_rays
from navcore.geometry.transform import Matrix, camera_mount
from sim.models.solids import box
from sim.physics.bodies import pose_matrix
from sim.rendering.lamps import FLOOR_M, FRESNEL, LampLight
from sim.rendering.light import Light
from sim.rendering.lighting import DISTURBANCES, PLAIN, Lighting, random_lighting
from sim.rendering.visible_world import Image, VisibleWorld
from sim.rendering.visual import flat_polygon, solid_visuals

Floats = npt.NDArray[np.float64]
FLAT_LIGHT = Light(ambient=1.0, diffuse=0.0)
LENS = Intrinsics(width=212, height=120, fx=110.0, fy=110.0, cx=105.5, cy=59.5)
BOX_M = np.array([[1.7, -0.3, 0.0], [2.3, 0.3, 0.8]])
"""Least and greatest corner of a red box on a grey floor."""
LAMP = Lighting(lamp_spacing_m=40.0, lamp_offset_m=(1.0, 0.9), shade=0.3)
VIEWS = [
    camera_mount(x_m=0.0, y_m=-0.6, z_m=0.9, pitch_down_rad=0.35),
    camera_mount(x_m=0.2, y_m=0.8, z_m=1.4, pitch_down_rad=0.6),
]


def world() -> tuple[VisibleWorld, int]:
    """Return the floor with the box, and the number of the box."""
    made = VisibleWorld()
    made.add([flat_polygon([(-9, -9), (9, -9), (9, 9), (-9, 9)], (150, 150, 150))])
    middle, size = BOX_M.mean(axis=0), BOX_M[1] - BOX_M[0]
    solid = box((float(size[0]), float(size[1]), float(size[2])), (0.0, 0.0), (200, 20, 20))
    return made, made.add(
        solid_visuals([solid]), pose_matrix([middle[0], middle[1], 0.0], [0.0, 0.0, 0.0, 1.0])
    )


def looked_at(made: VisibleWorld, view: Matrix) -> tuple[Image, Floats]:
    """Return an image in light that is even, and the (H, W, 3) points that its pixels show."""
    seen = made.image(view, LENS, FLAT_LIGHT)
    rows, cols = np.mgrid[0 : LENS.height, 0 : LENS.width]
    optical = pixel_rays(rows, cols, LENS) * seen.depth_m[..., None]
    return seen, optical @ view[:3, :3].T + view[:3, 3]


def hit(start: Floats, way: Floats, *, wider_m: float = 0.0) -> npt.NDArray[np.bool_]:
    """Return whether the way from each point, (..., 3), meets the box (slabs)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (np.stack([BOX_M[0] - wider_m, BOX_M[1] + wider_m])[:, None, None] - start) / way
    first, last = np.nanmax(ends.min(axis=0), axis=-1), np.nanmin(ends.max(axis=0), axis=-1)
    return np.asarray((last > np.maximum(first, 1e-6)) & (first < 1.0))


@pytest.mark.parametrize("view", VIEWS)
def test_a_point_is_in_the_shade_where_the_box_stands_between_it_and_the_lamp(view: Matrix) -> None:
    made, _ = world()
    seen, points = looked_at(made, view)
    relit = LampLight(made, LAMP).relight(seen, view, LENS, FLAT_LIGHT)
    lamp = np.array([1.0, 0.9, LAMP.lamp_height_m])
    to_lamp = lamp - points
    floor = seen.objects == 0
    surely, perhaps = hit(points, to_lamp, wider_m=-0.06), hit(points, to_lamp, wider_m=0.06)
    shade, lit = floor & surely, floor & ~perhaps
    tone = relit[..., 1].astype(float) / 150
    assert shade.sum() > 30 and lit.sum() > 1000
    assert np.abs(tone[shade] - LAMP.shade).max() < 0.01
    distance = np.linalg.norm(to_lamp, axis=-1)
    # The inverse square of the distance, and the cosine at the lamp.
    received = LAMP.lamp_height_m**2 / distance**2 * (LAMP.lamp_height_m / distance)
    inside = np.hypot(to_lamp[..., 0], to_lamp[..., 1]) < 2.2 * LAMP.lamp_height_m
    expected = LAMP.shade + (1 - LAMP.shade) * received
    assert np.abs(tone - expected)[lit & inside].max() < 0.02


def test_the_shadow_moves_with_the_box() -> None:
    made, number = world()
    lamps = LampLight(made, LAMP)
    seen, _ = looked_at(made, VIEWS[0])
    before = lamps.relight(seen, VIEWS[0], LENS, FLAT_LIGHT)
    made.place(number, pose_matrix([2.0, 20.0, 0.0], [0.0, 0.0, 0.0, 1.0]))
    seen, points = looked_at(made, VIEWS[0])
    after = lamps.relight(seen, VIEWS[0], LENS, FLAT_LIGHT)
    beside = np.hypot(points[..., 0] - 1.0, points[..., 1] - 0.9) < 2.0
    was_shade = beside & (before[..., 1] == round(LAMP.shade * 150))
    assert was_shade.sum() > 100 and (after[was_shade][:, 1] > 0.6 * 150).all()


@pytest.mark.parametrize("view", VIEWS)
def test_the_floor_shows_the_box_where_the_mirrored_line_of_sight_meets_it(view: Matrix) -> None:
    made, _ = world()
    polished = Lighting(polish=0.8)
    seen, points = looked_at(made, view)
    relit = LampLight(made, polished).relight(seen, view, LENS, FLAT_LIGHT).astype(float)
    sight = points - view[:3, 3]
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    floor = seen.objects == 0
    mirrored = 50.0 * sight * [1.0, 1.0, -1.0]
    on_box = floor & hit(points, mirrored, wider_m=-0.03)
    off_box = floor & ~hit(points, mirrored, wider_m=0.03)
    share = polished.polish * (1 + sight[..., 2]) ** FRESNEL
    assert on_box.sum() > 50 and off_box.sum() > 1000
    red = np.array([200.0, 20.0, 20.0])
    expected = 150 + share[..., None] * (red - 150)
    assert np.abs(relit - expected)[on_box].max() < 1.5
    assert (relit[off_box][:, 0] <= relit[off_box][:, 2] + 1).all(), "no red where no box is"
    above = points[..., 2] > FLOOR_M + 0.01
    assert (relit[above] == seen.rgb[above]).all()


def test_without_lamps_and_polish_nothing_changes() -> None:
    made, _ = world()
    seen, _ = looked_at(made, VIEWS[0])
    assert LampLight(made, PLAIN).relight(seen, VIEWS[0], LENS) is seen.rgb


def test_lamps_glare_on_a_polished_floor() -> None:
    made, _ = world()
    seen, points = looked_at(made, VIEWS[1])
    relit = LampLight(made, Lighting(lamp_spacing_m=40.0, lamp_offset_m=(4.0, 0.8), polish=1.0))
    rgb = relit.relight(seen, VIEWS[1], LENS, FLAT_LIGHT)
    floor = np.abs(points[..., 2]) < FLOOR_M
    row, col = np.unravel_index(np.where(floor, rgb.sum(axis=2), 0).argmax(), floor.shape)
    # Where a ray from the camera is thrown to the lamp: heights above the floor as the distances.
    x_m = 0.2 + (4.0 - 0.2) * 1.4 / (1.4 + 2.5)
    assert points[row, col, :2] == pytest.approx([x_m, 0.8], abs=0.15)


def test_a_random_light_is_that_of_its_seed_and_every_disturbance_occurs() -> None:
    drawn = [random_lighting(np.random.default_rng(seed)) for seed in range(40)]
    assert drawn == [random_lighting(np.random.default_rng(seed)) for seed in range(40)]
    for name in ("lamp_spacing_m", "polish", "exposure", "exposure_ms", "white_k"):
        changed = sum(getattr(one, name) != getattr(PLAIN, name) for one in drawn)
        assert 8 <= changed <= 32
    assert len(set(map(repr, DISTURBANCES.values()))) == len(DISTURBANCES)
