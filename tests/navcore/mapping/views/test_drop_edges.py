"""The rim of a drop is on the map from where it is seen, and the path leads round it; crests of
hills are no rims."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.camera import pixel_rays
from navcore.geometry.transform import Pose2
from navcore.mapping.views import observation
from navcore.mapping.views.drop_edges import DropEdges, drop_edges
from navcore.mapping.views.voxels import depth_view
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.ground import ground_heights
from navcore.planning.path import Path
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.mapping.small_maps import drive
from tests.navcore.scene import LENS, MOUNT, RED_ID, RED_LIST, SPEC, Box, picture

Points = npt.NDArray[np.float64]
RULES = ObservationConfig()
NO_EDGES = DropEdges(np.empty(0, dtype=np.int32), np.full(LENS.width, -1, dtype=np.int32))


def with_pit(flat: Frame, x_m: tuple[float, float], deep_m: float, half_m: float = np.inf) -> Frame:
    """The frame with a pit in its floor, between two x and as far to either side of y = 0."""
    eye, rays, depth, x, y = cast_rays(flat)
    hole = (x_m[0] <= x) & (x <= x_m[1]) & (abs(y) <= half_m) & floor_of(flat, depth)
    with np.errstate(divide="ignore"):
        ends = [(-deep_m - eye[2]) / rays[..., 2], (x_m[1] - eye[0]) / rays[..., 0]]
    return dataclasses.replace(
        flat, depth_m=np.where(hole, np.minimum(*ends), flat.depth_m).astype(np.float32)
    )


def with_slope(flat: Frame, x_m: float, slope: float) -> Frame:
    """The frame with a floor that falls from x on, by `slope` a metre."""
    eye, rays, depth, x, _ = cast_rays(flat)
    falling = -(rays[..., 2] + slope * rays[..., 0])
    with np.errstate(divide="ignore"):
        far = np.where(falling > 0, (eye[2] + slope * (eye[0] - x_m)) / falling, 0.0)
    falls = ((x >= x_m) | (rays[..., 2] >= 0)) & (floor_of(flat, depth) | (rays[..., 2] >= 0))
    far = np.where(far < 30.0, far, 0.0)
    return dataclasses.replace(flat, depth_m=np.where(falls, far, flat.depth_m).astype(np.float32))


def cast_rays(frame: Frame) -> tuple[Points, Points, Points, Points, Points]:
    """Camera, rays, and depth, x and y at which they meet the plane of the floor."""
    camera = frame.pose.matrix() @ MOUNT
    rows, cols = np.mgrid[0 : LENS.height, 0 : LENS.width]
    rays = pixel_rays(rows, cols, LENS) @ camera[:3, :3].T
    eye = camera[:3, 3]
    depth = np.where(rays[..., 2] < 0, -eye[2] / np.minimum(rays[..., 2], -1e-9), np.inf)
    with np.errstate(invalid="ignore"):
        return eye, rays, depth, eye[0] + rays[..., 0] * depth, eye[1] + rays[..., 1] * depth


def floor_of(frame: Frame, depth: Points) -> npt.NDArray[np.bool_]:
    """Pixels that show the floor, and no object before it."""
    return np.asarray(np.isfinite(depth) & ((frame.depth_m == 0) | (frame.depth_m > depth - 1e-3)))


def rims(frame: Frame) -> Points:
    """(N, 2) positions x, y of the rims that the frame shows."""
    view = depth_view(frame, SPEC, RULES.max_range_m, ground_heights(frame, RULES.max_slope))
    rows, cols = np.divmod(drop_edges(view, SPEC.resolution_m, RULES).pixels, LENS.width)
    _, _, _, x, y = cast_rays(frame)
    return np.column_stack([x[rows, cols], y[rows, cols]])


@pytest.mark.parametrize("rim_m", [1.2, 1.8, 2.4])
@pytest.mark.parametrize("deep_m", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("wide_m", [2.0, 10.0])
def test_the_rim_is_the_last_ground_before_a_drop_however_deep(
    rim_m: float, deep_m: float, wide_m: float
) -> None:
    found = rims(with_pit(picture(), (rim_m, rim_m + wide_m), deep_m))
    assert len(found) > 5
    assert (found[:, 0] <= rim_m).all() and (found[:, 0] > rim_m - 0.2).all()
    assert np.ptp(found[:, 1]) > 1.0


def test_flat_ground_and_a_floor_that_is_a_little_lower_have_no_rim() -> None:
    assert len(rims(picture())) == 0
    assert len(rims(with_pit(picture(), (1.8, 12.0), 0.08))) == 0


@pytest.mark.parametrize("crest_m", [1.0, 2.0, 3.5, 4.5])
@pytest.mark.parametrize("slope", [0.05, 0.1, 0.18])
def test_a_slope_that_the_robot_can_drive_has_no_rim_even_where_its_crest_hides_it(
    crest_m: float, slope: float
) -> None:
    assert len(rims(with_slope(picture(), crest_m, slope))) == 0


def test_an_object_that_hides_the_ground_is_no_rim() -> None:
    tall = Box(x=(1.5, 1.8), y=(-4.0, 4.0), z=(0.0, 0.3))
    assert len(rims(with_pit(picture(tall), (2.2, 12.0), 3.0))) == 0


def deep_points(frame: Frame) -> Points:
    """(N, 3) points below the ground that the frame adds to the map."""
    labels = ColourSegmenter().segment(frame, RED_LIST)
    ground = ground_heights(frame, RULES.max_slope)
    points = observation.observe(frame, labels, RED_LIST, SPEC, RULES, ground).points_map
    return points[points[:, 2] < -0.1].astype(np.float64)


def test_the_bottom_of_a_pit_is_an_obstacle_and_a_lower_level_is_none() -> None:
    pit = deep_points(with_pit(picture(), (1.8, 3.2), 0.3))
    assert len(pit) > 50 and ((pit[:, 0] > 1.8) & (pit[:, 0] < 3.3)).all()
    assert len(rims(with_pit(picture(), (1.8, 3.2), 0.3))) > 5
    assert len(deep_points(with_pit(picture(), (1.8, 12.0), 0.3))) == 0
    # What stands on the lower level shows some of its height at that of the upper floor.
    wall = Box(x=(4.0, 4.4), y=(-6.0, 6.0), z=(-0.3, 0.5))
    assert len(deep_points(with_pit(picture(wall), (1.8, 12.0), 0.3))) == 0


def test_where_the_rim_is_below_the_image_a_strip_of_the_lower_level_is_an_obstacle() -> None:
    frame = with_pit(picture(), (-1.0, 12.0), 0.3)
    strip = deep_points(frame)
    assert len(rims(frame)) == 0 and len(strip) > 50
    _, _, _, x, _ = cast_rays(frame)
    first = strip[:, 0].min()
    assert (strip[np.abs(strip[:, 1]) < 0.2, 0] < first + 0.6).all()
    assert (frame.depth_m > 0).any() and x.max() > first + 1.0  # control: more of it is in view


def test_what_was_a_drop_from_above_is_ground_for_a_robot_that_has_come_down() -> None:
    there = Pose2(x_m=0.3, y_m=0.3, yaw_rad=0.0)  # not so near that points are replaced
    pit = (2.0, 3.0)
    cloud = drive(with_pit(picture(), pit, 0.3))
    before = layer_grid(cloud, RED_LIST, ()).occupied()
    drive(with_pit(picture(pose=there), pit, 0.3), cloud=cloud)
    assert not (before & ~layer_grid(cloud, RED_LIST, ()).occupied()).any()  # control
    drive(picture(pose=there), cloud=cloud)
    (top, left), (bottom, _) = SPEC.cell(pit[0] + 0.1, -1.5), SPEC.cell(0.0, 1.5)  # still in view
    assert before[top:bottom, left:].sum() > 50
    assert layer_grid(cloud, RED_LIST, ()).occupied()[top:bottom, left:].sum() == 0


def test_a_marking_that_was_seen_below_is_not_cleared_as_a_drop() -> None:
    pit = with_pit(picture(), (2.0, 3.0), 0.3)
    red = np.where((pit.depth_m != picture().depth_m)[..., None], (220, 20, 20), pit.rgb)
    cloud = drive(dataclasses.replace(pit, rgb=red.astype(np.uint8)))
    before = layer_grid(cloud, RED_LIST, ()).beware[RED_ID]
    drive(picture(pose=Pose2(x_m=0.3, y_m=0.3, yaw_rad=0.0)), cloud=cloud)
    assert before.sum() > 50
    np.testing.assert_array_equal(layer_grid(cloud, RED_LIST, ()).beware[RED_ID], before)


@pytest.mark.parametrize("wide_m", [0.5, 0.8])
@pytest.mark.parametrize("deep_m", [0.3, 1.0])
@pytest.mark.parametrize("x_m", [-2.2, -1.3, -0.6])
def test_a_trench_stays_on_the_map_when_it_is_seen_from_farther_away(
    wide_m: float, deep_m: float, x_m: float
) -> None:
    trench = (1.2, 1.2 + wide_m)
    cloud = drive(with_pit(picture(), trench, deep_m))
    before = layer_grid(cloud, RED_LIST, ()).occupied()
    drive(with_pit(picture(pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)), trench, deep_m), cloud=cloud)
    after = layer_grid(cloud, RED_LIST, ()).occupied()
    edge = SPEC.cell(trench[1] - 0.1, 0.0)[1]  # behind it is ground
    assert before.sum() > 40
    assert not (before & ~after)[:, :edge].any()


def offsets_m(navigator: Navigator) -> list[float]:
    """Look at a pit from afar, then from so near that its rim is below the image; return how far
    beside its middle the two paths cross the line of the rim."""
    goal = NavigationRequest(goal=(7.6, 0.0), beware=RED_LIST, zones=())
    found = []
    for number, x_m in enumerate((0.0, 1.3)):
        pose = Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)
        frame = with_pit(picture(pose=pose, stamp_ns=number), (2.2, 7.0), 6.0, half_m=1.5)
        route = navigator.tick(frame, goal).route
        assert route is not None and isinstance(route.outcome, Path)
        found.append(abs(route.points[route.points[:, 0] > 2.2][0, 1]))
    return found


def test_the_path_leads_round_the_rim_of_a_pit_whose_bottom_is_out_of_range(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def navigator() -> Navigator:
        return Navigator(
            spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )

    assert min(offsets_m(navigator())) > 1.5
    # Control: without the rim the pit is floor that was not seen, which is free to the planner.
    monkeypatch.setattr(observation, "drop_edges", lambda *_: NO_EDGES)
    assert max(offsets_m(navigator())) < 0.5
