"""The renderer: each pixel shows what a ray through it hits first, with the right texture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import Delaunay

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from sim.models.mesh import Mesh
from sim.rendering.light import Light
from sim.rendering.visible_world import FAR_M, NEAR_M, NO_OBJECT, VisibleWorld
from sim.rendering.visual import Visual, flat_polygon, rectangle

Floats = npt.NDArray[np.float64]
LENS = Intrinsics(width=40, height=30, fx=20.0, fy=21.0, cx=19.5, cy=14.5)
FLAT_LIGHT = Light(ambient=1.0, diffuse=0.0)
DOWN: Matrix = np.diag([1.0, -1.0, -1.0, 1.0])
"""T_map_camera of a camera that looks down, its image's upper edge towards +y."""


def above(height_m: float) -> Matrix:
    pose = DOWN.copy()
    pose[2, 3] = height_m
    return pose


def triangle(corners: Floats) -> Visual:
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normals = np.tile(normal / np.linalg.norm(normal), (3, 1))
    return Visual(mesh=Mesh(corners=corners, normals=normals), colour=(200, 100, 50))


def first_hits(triangles: Floats, T_map_camera: Matrix) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return depth and number of the first front that the ray of each pixel hits, by the method of
    Möller and Trumbore for all pairs of rays and triangles."""
    v, u = np.indices((LENS.height, LENS.width))
    rays = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones(u.shape)], axis=-1)
    rays = rays @ T_map_camera[:3, :3].T
    a, along, across = (
        triangles[:, 0],
        triangles[:, 1] - triangles[:, 0],
        triangles[:, 2] - triangles[:, 0],
    )
    p = np.cross(rays[:, :, None], across)
    facing = (p * along).sum(axis=-1)
    from_corner = T_map_camera[:3, 3] - a
    q = np.cross(from_corner, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (p * from_corner).sum(axis=-1) / facing
        t = (rays[:, :, None] * q).sum(axis=-1) / facing
        z = (across * q).sum(axis=-1) / facing
    hit = (facing > 1e-12) & (s >= 0) & (t >= 0) & (s + t <= 1) & (z >= NEAR_M) & (z < FAR_M)
    z = np.where(hit, z, FAR_M)
    number = np.where(hit.any(axis=-1), z.argmin(axis=-1), NO_OBJECT)
    return z.min(axis=-1), number


@pytest.mark.parametrize("seed", range(8))
def test_each_pixel_shows_what_its_ray_hits_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    middles = rng.uniform(-6, 6, (150, 1, 3))
    # Some are large and reach behind the camera or through its near plane.
    triangles = middles + rng.normal(0, rng.choice([0.3, 2.0, 8.0], (150, 1, 1)), (150, 3, 3))
    world = VisibleWorld()
    for corners in triangles:
        world.add([triangle(corners)])
    T_map_camera = np.eye(4)
    T_map_camera[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    if np.linalg.det(T_map_camera[:3, :3]) < 0:
        T_map_camera[:3, 0] *= -1
    image = world.image(T_map_camera, LENS)
    depth_m, number = first_hits(triangles, T_map_camera)
    assert (number != NO_OBJECT).mean() > 0.2
    assert np.array_equal(image.objects, number)
    assert np.allclose(image.depth_m, depth_m, rtol=1e-6)


def test_the_image_is_the_same_after_an_object_went_away_and_came_back() -> None:
    world, away = VisibleWorld(), np.eye(4)
    world.add([flat_polygon(((-9, -9), (9, -9), (9, 9), (-9, 9)), (90, 90, 90))])
    cube = world.add([triangle(np.array([(0.0, 0.0, 0.5), (1.0, 0.0, 0.5), (0.0, 1.0, 0.5)]))])
    before = world.image(above(3.0), LENS)
    away[0, 3] = 5.0
    world.place(cube, away)
    gone = world.image(above(3.0), LENS)
    world.place(cube, np.eye(4))
    after = world.image(above(3.0), LENS)
    assert (before.objects == cube).sum() > 10 and not (gone.objects == cube).any()
    assert np.array_equal(before.rgb, after.rgb) and np.array_equal(before.depth_m, after.depth_m)


def test_neighbouring_triangles_leave_no_gap() -> None:
    rng = np.random.default_rng(3)
    world, ground = VisibleWorld(), ((-9, -9), (9, -9), (9, 9), (-9, 9))
    points = rng.uniform(-9, 9, (300, 2)).tolist()
    corners = np.array([*points, *ground])
    for piece in Delaunay(corners).simplices:
        flat = np.column_stack([corners[piece], np.zeros(3)])
        world.add([triangle(flat), triangle(flat[::-1])])
    for seed in range(5):
        pose = above(1.0 + 0.5 * seed)
        turn = np.linalg.qr(np.eye(3) + 0.05 * rng.normal(size=(3, 3)))[0]
        pose[:3, :3] = pose[:3, :3] @ (turn * np.sign(np.diag(turn)))
        seen = world.image(pose, LENS)
        assert (seen.objects != NO_OBJECT).all()


def test_a_texture_has_its_first_row_at_the_upper_edge_and_its_first_column_at_the_left() -> None:
    texture = np.zeros((2, 2, 3), dtype=np.uint8)
    texture[0, 0], texture[0, 1], texture[1, 0] = (250, 0, 0), (0, 250, 0), (0, 0, 250)
    world = VisibleWorld()
    world.add([rectangle((2.0, 2.0), texture)])
    rgb = world.image(above(1.6), LENS, FLAT_LIGHT).rgb.astype(int)
    upper, lower, left, right = 8, 21, 13, 26
    assert rgb[upper, left].argmax() == 0 and rgb[upper, left].max() > 150
    assert rgb[upper, right].argmax() == 1 and rgb[lower, left].argmax() == 2
    assert rgb[lower, right].max() < 60


def test_a_fine_texture_is_grey_from_afar_and_black_and_white_from_near() -> None:
    y, x = np.indices((64, 64))
    board = np.repeat((255 * ((x + y) % 2)).astype(np.uint8)[:, :, None], 3, axis=2)
    world = VisibleWorld()
    polygon = ((-20, -20), (20, -20), (20, 20), (-20, 20))
    world.add([flat_polygon(polygon, (255, 255, 255), board, side_m=4.0)])
    near = world.image(above(0.5), LENS, FLAT_LIGHT).rgb
    far = world.image(above(10.0), LENS, FLAT_LIGHT).rgb
    assert near.std() > 35
    assert far.std() < 3 and abs(float(far.mean()) - 127.5) < 3


def test_a_surface_is_the_brighter_the_more_it_faces_the_lamp() -> None:
    levels = []
    for tilt in (0.0, 0.6, 1.2):
        rotation = np.eye(4)
        rotation[:3, :3] = [
            [np.cos(tilt), 0, np.sin(tilt)],
            [0, 1, 0],
            [-np.sin(tilt), 0, np.cos(tilt)],
        ]
        world = VisibleWorld()
        square = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        world.add([flat_polygon(square, (200, 200, 200))], rotation)
        image = world.image(above(4.0), LENS, Light(from_m=(0.0, 0.0, 100.0)))
        levels.append(int(image.rgb[14, 19, 0]))
    assert levels[0] == 200 and levels[0] > levels[1] > levels[2] > 100
