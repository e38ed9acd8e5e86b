"""Observation: the paper's equations, and which points count as obstacles."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.camera import Intrinsics, back_project
from navcore.geometry.transform import Pose2, transform_points
from navcore.mapping.views.observation import Observation, observe
from navcore.mapping.views.voxels import BIN_M, LOWEST_M
from navcore.mission.beware_list import LARGEST_CLASS_ID, NOTHING, BewareClass, BewareList
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.laws import law
from tests.navcore.scene import LENS, RED, RED_FLOOR, RED_ID, RED_LIST, SPEC, Box, Paint, picture

TALL = Box(x=(2.0, 2.6), y=(0.3, 0.9), z=(0.0, 0.5))
STEP = Box(x=(1.6, 2.2), y=(-0.9, -0.4), z=(0.0, 0.08))
PATCH = Paint(x=(2.0, 2.8), y=(-0.2, 0.2))
RULES = ObservationConfig()


def look(
    frame: Frame, beware: BewareList = RED_LIST, rules: ObservationConfig = RULES
) -> Observation:
    return observe(frame, ColourSegmenter().segment(frame, beware), beware, SPEC, rules)


def labelled(frame: Frame, class_id: int, rules: ObservationConfig = RULES) -> Observation:
    """Observe with everything red labelled as a class without a colour rule, as from a network."""
    ids = np.where(frame.rgb[..., 0] > 200, class_id, NOTHING).astype(np.uint8)
    entry = BewareClass(name="thing", class_id=class_id)
    labels = Labels(class_ids=ids, confidence=np.full(ids.shape, 0.7, dtype=np.float32))
    return observe(frame, labels, BewareList(classes=(entry,)), SPEC, rules)


def inside(
    points: npt.NDArray[np.float32], thing: Box | Paint, room_m: float = 0.02
) -> npt.NDArray[np.bool_]:
    x, y = points[:, 0], points[:, 1]
    on_x = (thing.x[0] - room_m <= x) & (x <= thing.x[1] + room_m)
    return np.asarray(on_x & (thing.y[0] - room_m <= y) & (y <= thing.y[1] + room_m))


@law(100)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_back_projection_is_the_papers_equations(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.1, 9.0, (height, width)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0.0
    lens = Intrinsics(width=width, height=height, fx=7.5, fy=6.5, cx=width / 3, cy=height / 4)
    expected = [
        (
            (j - lens.cx) * float(depth[i, j]) / lens.fx,
            (i - lens.cy) * float(depth[i, j]) / lens.fy,
            float(depth[i, j]),
        )
        for i in range(height)
        for j in range(width)
        if depth[i, j] > 0
    ]
    np.testing.assert_allclose(
        back_project(depth, lens), np.array(expected).reshape(-1, 3), rtol=1e-12
    )


def test_pixels_without_a_measurement_make_no_points() -> None:
    depth = np.array([[0.0, np.nan, np.inf], [-1.0, -np.inf, 2.0]], dtype=np.float32)
    lens = Intrinsics(width=3, height=2, fx=2.0, fy=2.0, cx=1.0, cy=0.0)
    np.testing.assert_allclose(back_project(depth, lens), [[1.0, 1.0, 2.0]])


@law(20)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-math.pi, math.pi))
def test_a_back_projected_wall_and_floor_are_where_they_were_drawn(
    x: float, y: float, yaw: float
) -> None:
    frame = picture(TALL, pose=Pose2(x_m=x, y_m=y, yaw_rad=yaw))
    points = transform_points(frame.T_map_camera, back_project(frame.depth_m, LENS))
    on_box = inside(points.astype(np.float32), TALL, 0.001) & (points[:, 2] < 0.501)
    assert (on_box | (np.abs(points[:, 2]) < 1e-4)).all()


def test_geometric_points_are_on_objects_higher_than_ten_centimetres_and_nowhere_else() -> None:
    observation = look(picture(TALL, STEP, PATCH))
    geometric = observation.points_map[observation.class_ids == NOTHING]
    assert len(geometric) > 20
    assert (geometric[:, 2] > 0.10).all()
    assert inside(geometric, TALL).all()
    assert (observation.confidence[observation.class_ids == NOTHING] == 1).all()


def test_a_low_step_is_an_obstacle_once_the_obstacle_height_is_below_it() -> None:
    """Control: the step above is measured, and left out for its height alone."""
    observation = look(picture(STEP), rules=ObservationConfig(obstacle_height_m=0.05))
    assert inside(observation.points_map, STEP).sum() > 5
    assert len(look(picture(STEP)).points_map) == 0


def test_a_red_patch_makes_beware_points_at_the_height_of_the_floor() -> None:
    observation = look(picture(TALL, STEP, PATCH))
    beware = observation.points_map[observation.class_ids == RED_ID]
    assert len(beware) > 10
    assert inside(beware, PATCH).all()
    assert (np.abs(beware[:, 2]) < 0.01).all()
    assert set(observation.class_ids.tolist()) == {NOTHING, RED_ID}
    assert RED_ID not in look(picture(TALL, STEP)).class_ids


def test_a_patch_covers_every_cell_it_fills() -> None:
    observation = look(picture(PATCH))
    cells = {
        SPEC.cell(float(x), float(y))
        for x, y, _ in observation.points_map[observation.class_ids == RED_ID]
    }
    # Beyond that, the rows of this small picture lie further apart than cells.
    first, last = SPEC.cell(2.05, -0.15), SPEC.cell(2.35, 0.15)
    assert cells >= {
        (row, col) for row in range(first[0], last[0] + 1) for col in range(first[1], last[1] + 1)
    }


def test_a_red_box_is_no_red_floor_above_the_height_of_its_rule_and_stays_an_obstacle() -> None:
    observation = look(picture(dataclasses.replace(TALL, colour=RED)))
    red = observation.points_map[observation.class_ids == RED_ID]
    assert RED_FLOOR.colour is not None
    assert np.all(red[:, 2] <= RED_FLOOR.colour.max_height_m)
    assert (observation.class_ids == NOTHING).sum() > 20


def test_a_beware_object_above_ten_centimetres_is_geometric_as_well() -> None:
    observation = labelled(picture(dataclasses.replace(TALL, colour=RED)), 9)
    geometric, beware = observation.class_ids == NOTHING, observation.class_ids == 9
    tall = {
        tuple(point)
        for point in observation.points_map[beware & (observation.points_map[:, 2] > 0.13)].tolist()
    }
    assert len(tall) > 20
    lowest = np.array([0.0, 0.0, LOWEST_M])
    voxels = {
        tuple(np.floor((point - lowest) / [0.1, 0.1, 0.05]))
        for point in observation.points_map[geometric]
    }
    assert {
        tuple(np.floor((np.array(point) - lowest) / [0.1, 0.1, 0.05])) for point in tall
    } <= voxels
    assert observation.confidence[beware] == pytest.approx(0.7)


@pytest.mark.parametrize("class_id", [1, 62, LARGEST_CLASS_ID])
def test_every_allowed_class_id_makes_points(class_id: int) -> None:
    observation = labelled(picture(PATCH), class_id)
    assert (observation.class_ids == class_id).sum() > 10


def test_nothing_above_the_ceiling_is_an_obstacle() -> None:
    lamp = Box(x=(2.5, 3.0), y=(-0.5, 0.5), z=(0.7, 1.2))
    assert (look(picture(lamp)).points_map[:, 2] > 0.7).sum() > 20
    assert len(look(picture(lamp), rules=ObservationConfig(ceiling_m=0.7)).points_map) == 0


def test_nothing_beyond_the_largest_range_is_an_obstacle() -> None:
    far = Box(x=(4.0, 4.5), y=(-1, 1), z=(0, 1))
    assert len(look(picture(far)).points_map) > 20
    assert len(look(picture(far), rules=ObservationConfig(max_range_m=3.2)).points_map) == 0


def test_a_voxel_needs_as_many_pixels_as_min_support_says() -> None:
    def speckled(count: int) -> Observation:
        frame = picture()
        depth = frame.depth_m.copy()
        row = 40  # above the horizon of the floor at this depth: 1 m ahead, about half a metre high
        depth[row, 60 : 60 + count] = 1.0
        return look(
            dataclasses.replace(frame, depth_m=depth), rules=ObservationConfig(min_support=3)
        )

    assert len(speckled(1).points_map) == 0
    assert len(speckled(2).points_map) == 0
    assert len(speckled(3).points_map) >= 1


@law(20)
@given(st.integers(1, 6), st.integers(1, 6))
def test_more_support_asked_for_never_adds_points(low: int, more: int) -> None:
    frame = picture(TALL, PATCH)
    few, many = (look(frame, rules=ObservationConfig(min_support=n)) for n in (low + more, low))
    rows = {(*p, int(c)) for p, c in zip(few.points_map.tolist(), few.class_ids, strict=True)}
    assert rows <= {
        (*p, int(c)) for p, c in zip(many.points_map.tolist(), many.class_ids, strict=True)
    }
    np.testing.assert_array_equal(few.cells_seen, many.cells_seen)
    np.testing.assert_array_equal(few.heights_seen, many.heights_seen)


def test_each_voxel_holds_one_point_of_a_class_and_the_floor_is_seen() -> None:
    # No side of the box lies on the border of a voxel, where rounding would decide.
    observation = look(picture(Box(x=(2.03, 2.6), y=(0.33, 0.87), z=(0.0, 0.52))))
    voxels = np.floor(
        (observation.points_map.astype(np.float64) - [0.0, 0.0, LOWEST_M]) / [0.1, 0.1, BIN_M]
    )
    assert len(np.unique(voxels, axis=0)) == len(voxels) > 20
    seen = {divmod(int(cell), SPEC.cols) for cell in observation.cells_seen}
    assert SPEC.cell(1.5, 0.0) in seen
    assert SPEC.cell(-1.5, 0.0) not in seen
    assert (
        len(observation.cells_seen) == len(observation.heights_seen)
        and observation.heights_seen.all()
    )


def test_the_cells_seen_are_on_the_grid_and_in_the_box_though_the_image_shows_more() -> None:
    observation = look(
        picture(pose=Pose2(x_m=SPEC.cols * SPEC.resolution_m / 2 - 1.0, y_m=0.0, yaw_rad=0.0))
    )
    rows, cols = np.divmod(observation.cells_seen, SPEC.cols)
    top, left, bottom, right = observation.box
    assert len(rows) > 20 and rows.max() < SPEC.rows
    assert top <= rows.min() and rows.max() < bottom and left <= cols.min() and cols.max() < right


def test_surfaces_off_the_grid_make_no_points() -> None:
    edge = Pose2(x_m=7.5, y_m=0.0, yaw_rad=0.0)
    beyond = Box(x=(8.5, 9.0), y=(-1, 1), z=(0, 1))
    assert len(look(picture(beyond, pose=edge)).points_map) == 0
    assert (
        len(
            look(
                picture(
                    dataclasses.replace(beyond, x=(7.9, 9.0)), pose=Pose2(x_m=5, y_m=0, yaw_rad=0)
                )
            ).points_map
        )
        > 0
    )


def test_the_rim_of_a_stair_down_is_an_obstacle_and_an_uneven_floor_is_not() -> None:
    def lowered(by_m: float) -> Frame:
        flat = picture()
        z = flat.T_map_camera[2]
        rows, cols = np.mgrid[0 : flat.intrinsics.height, 0 : flat.intrinsics.width]
        a, b = (
            (cols - flat.intrinsics.cx) / flat.intrinsics.fx,
            (rows - flat.intrinsics.cy) / flat.intrinsics.fy,
        )
        # Beyond 2 m the floor lies deeper, along the same rays.
        deeper = np.where(
            flat.depth_m > 2.0,
            (z[3] + by_m) / np.maximum(-(z[0] * a + z[1] * b + z[2]), 1e-6),
            flat.depth_m,
        )
        depth = np.where(flat.depth_m > 0, deeper, 0.0).astype(np.float32)
        return dataclasses.replace(flat, depth_m=depth)

    assert len(look(lowered(0.05)).points_map) == 0
    for by_m in (0.3, 0.44, 0.6):  # deeper still, the ground there is beyond the range
        seen = look(lowered(by_m))
        # The rim, the last of the upper floor; the lower one may be reached by another way.
        assert len(seen.points_map) > 20, by_m
        assert np.all(np.abs(seen.points_map[:, 2]) < 0.01)
        assert np.all(seen.range_m > 1.8)
