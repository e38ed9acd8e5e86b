"""The base of a taller object is no low object of the list; an object beside it, or on it, stays
one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.overhang_filter import overhung_regions
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, DepthSensor
from tests.navcore.perception.test_depth_filter import PINK, noisy
from tests.navcore.scene import RED, RED_ID, RED_LIST, SPEC, Box, Paint, picture

MINE = BewareClass(name="landmine", class_id=8, max_height_m=0.25)
ANY = BewareClass(name="sign", class_id=10)


class SeesMines:
    """A network that takes everything pink for a landmine."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        pink = (frame.rgb == PINK).all(axis=2)
        return Labels(
            class_ids=np.where(pink, np.uint8(MINE.class_id), np.uint8(0)),
            confidence=np.full(pink.shape, 0.95, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


def judged(
    frame: Frame, entry: BewareClass = MINE
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return (N,) which of the pink pixels are rejected, and which are undecided, when a network
    labels all of them `entry`."""
    pink = (frame.rgb == PINK).all(axis=2)
    assert pink.sum() > 12
    ids = np.where(pink, np.uint8(entry.class_id), np.uint8(0)).astype(np.uint8)
    rejected, undecided = overhung_regions(
        ids, frame, heights_above_floor(frame), BewareList(classes=(entry,)), HUSKY.depth_sensor
    )
    assert not rejected[~pink].any() and not undecided[~pink].any()
    return rejected[pink], undecided[pink]


def kept(frame: Frame, entry: BewareClass = MINE) -> bool:
    """Return whether no pink pixel is rejected or undecided."""
    rejected, undecided = judged(frame, entry)
    return not rejected.any() and not undecided.any()


def chair(x: float) -> tuple[Box, ...]:
    """A seat and a back on a low, broad foot that looks like a landmine."""
    foot = Box(x=(x, x + 0.45), y=(-0.22, 0.22), z=(0.0, 0.09), colour=PINK)
    seat = Box(x=(x, x + 0.48), y=(-0.24, 0.24), z=(0.42, 0.5))
    return foot, seat, Box(x=(x + 0.41, x + 0.48), y=(-0.24, 0.24), z=(0.5, 0.9))


def mine(x: float, z_m: float = 0.0) -> Box:
    return Box(x=(x, x + 0.3), y=(-0.15, 0.15), z=(z_m, z_m + 0.08), colour=PINK)


@pytest.mark.parametrize("x", [0.8, 1.1, 1.4])
def test_the_foot_of_a_chair_is_no_landmine(x: float) -> None:
    assert judged(picture(*chair(x)))[0].all()
    assert judged(noisy(picture(*chair(x))))[0].all()


@pytest.mark.parametrize("x", [3.0, 3.4, 4.0])
def test_far_away_where_depth_scatters_the_foot_is_undecided_and_nothing_is_rejected(
    x: float,
) -> None:
    for frame in (picture(*chair(x)), noisy(picture(*chair(x)))):
        rejected, undecided = judged(frame)
        assert not rejected.any()
        assert undecided.all()


@pytest.mark.parametrize("x", [3.0, 3.6])
def test_far_away_an_object_without_a_tall_one_nearby_is_decided(x: float) -> None:
    wall = Box(x=(x + 0.9, x + 1.0), y=(-3.0, 3.0), z=(0.0, 1.2))
    assert kept(picture(mine(x))) and kept(noisy(picture(mine(x)), seed=1))
    assert kept(picture(mine(x), wall)) and kept(noisy(picture(mine(x), wall), seed=1))


def test_a_coarser_camera_leaves_undecided_what_a_finer_one_decides() -> None:
    beware, near, far = BewareList(classes=(MINE,)), picture(*chair(1.1)), picture(*chair(3.0))
    coarse, fine = DepthSensor(disparity_error_px=1.0), DepthSensor(disparity_error_px=0.02)
    for sensor, frame, decided in ((coarse, near, False), (fine, far, True)):
        labels = FusedSegmenter(SeesMines(), sensor).segment(frame, beware)
        assert (labels.class_ids == NOTHING).all() == decided
        assert not labels.mask(beware).any()


def test_an_undecided_label_is_below_a_confidence_of_one_half() -> None:
    beware, frame = BewareList(classes=(MINE,)), picture(*chair(3.0))
    assert (
        not FusedSegmenter(SeesMines(), HUSKY.depth_sensor)
        .segment(frame, beware)
        .mask(beware)
        .any()
    )
    assert (
        FusedSegmenter(SeesMines(), HUSKY.depth_sensor)
        .segment(picture(mine(3.0)), beware)
        .mask(beware)
        .any()
    )


def test_an_undecided_object_is_on_the_map_once_it_was_seen_from_nearer() -> None:
    beware, rules = BewareList(classes=(MINE,)), ObservationConfig()

    def bound(*frames: Frame) -> bool:
        world, joint = (
            PointMap(SPEC, MappingConfig()),
            FusedSegmenter(SeesMines(), HUSKY.depth_sensor),
        )
        for frame in frames:
            labels = joint.segment(frame, beware)
            world.insert(observe(frame, labels, beware, SPEC, rules), frame, labels)
        return bool(layer_grid(world, beware, ()).beware[MINE.class_id].any())

    def at(x_m: float) -> Pose2:
        return Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)

    posts = [Box(x=(3.3, 3.6), y=y, z=(0.0, 0.9)) for y in ((-0.3, -0.2), (0.2, 0.3))]
    far, near = picture(mine(3.3), *posts), picture(mine(3.3), *posts, pose=at(2.0))
    assert judged(far)[1].all() and kept(near)
    assert not bound(far, far, far)
    assert bound(far, near)
    assert bound(near, *[far] * 40), "what was found from near is not lost when it is undecided"
    assert not bound(*[picture(*chair(3.2))] * 5, picture(*chair(3.2), pose=at(1.6)))


def test_an_object_without_a_greatest_height_stays_under_a_chair_too() -> None:
    assert kept(picture(*chair(1.6)), ANY)


@pytest.mark.parametrize("x", [1.0, 1.8, 3.0])
def test_a_low_object_stays_by_itself_and_beside_a_tall_one(
    x: float,
) -> None:
    wall = Box(x=(x + 0.36, x + 0.5), y=(-2.0, 2.0), z=(0.0, 1.2))
    post = Box(x=(x + 0.1, x + 0.2), y=(0.2, 0.3), z=(0.0, 1.2))
    for beside in ((), (wall,), (post,)):
        for frame in (picture(mine(x), *beside), noisy(picture(mine(x), *beside), seed=1)):
            rejected, undecided = judged(frame)
            assert not rejected.any()
            assert not undecided.any() or (x == 3.0 and beside), "only from afar, and not by itself"


def test_an_object_on_another_stays_and_so_does_a_flat_marking() -> None:
    assert kept(picture(Box(x=(1.4, 2.2), y=(-0.5, 0.5), z=(0.0, 0.4)), mine(1.6, 0.4)))
    assert kept(picture(Paint(x=(1.4, 1.7), y=(-0.15, 0.15), colour=PINK)))


def test_an_object_above_the_robot_does_not_count() -> None:
    lamp = Box(x=(1.2, 2.4), y=(-0.6, 0.6), z=(1.7, 1.8))
    assert kept(picture(mine(1.6), lamp))


def test_without_depth_nothing_is_rejected() -> None:
    frame = picture(*chair(1.6))
    blind = np.zeros_like(frame.depth_m)
    blind.flags.writeable = False
    ids = np.full(frame.depth_m.shape, MINE.class_id, dtype=np.uint8)
    blank = Frame(
        **{**{name: getattr(frame, name) for name in Frame.__dataclass_fields__}, "depth_m": blind}
    )
    assert not any(
        found.any()
        for found in overhung_regions(
            ids, blank, heights_above_floor(blank), BewareList(classes=(MINE,)), HUSKY.depth_sensor
        )
    )


def test_the_shipped_list_states_the_height_of_its_low_objects() -> None:
    heights = {
        entry.name: entry.max_height_m
        for entry in default_beware_list().classes
        if entry.max_height_m is not None
    }
    assert heights == {"bottle": 0.4, "box": 0.45, "landmine": 0.25}


def red(*objects: Box | Paint, seed: int | None = None) -> npt.NDArray[np.bool_]:
    """Return the (H, W) pixels that the colour rule labels as red floor."""
    frame = picture(*objects) if seed is None else noisy(picture(*objects), seed)
    found: npt.NDArray[np.bool_] = ColourSegmenter().segment(frame, RED_LIST).class_ids == RED_ID
    return found


def cupboard(x: float) -> Box:
    return Box(x=(x, x + 0.4), y=(-0.4, 0.4), z=(0.0, 1.2), colour=RED)


@pytest.mark.parametrize("x", [1.5, 3.0, 5.0])
def test_the_foot_of_a_red_cupboard_is_no_red_floor(x: float) -> None:
    for seed in range(5):
        assert not red(cupboard(x), seed=seed).any()


@pytest.mark.parametrize("x", [2.0, 3.0])
def test_red_floor_that_leads_up_to_a_red_cupboard_stays_whole(x: float) -> None:
    paint = Paint(x=(x - 0.8, x), y=(-0.4, 0.4))
    for seed in range(5):
        alone = red(paint, Box(x=(x, x + 0.4), y=(-0.4, 0.4), z=(0.0, 1.2)), seed=seed)
        assert (red(paint, cupboard(x), seed=seed) | ~alone).all()


@pytest.mark.parametrize(
    ("tape", "wall"),
    [
        (
            Paint(x=(2.0, 3.0), y=(-0.025, 0.025)),
            Box(x=(3.0, 3.2), y=(-4.0, 4.0), z=(0.0, 1.0), colour=RED),
        ),
        (
            Paint(x=(1.7, 2.0), y=(-0.15, 0.15)),
            Box(x=(2.0, 2.4), y=(-1.0, 1.0), z=(0.0, 1.0), colour=RED),
        ),
    ],
)
def test_a_narrow_marking_that_leads_up_to_a_wide_red_object_stays(tape: Paint, wall: Box) -> None:
    """Most of the low red pixels are then those of the foot of the wall."""
    grey = Box(x=wall.x, y=wall.y, z=wall.z)
    for seed in range(5):
        alone = red(tape, grey, seed=seed)
        assert alone.sum() > 12
        assert (
            red(tape, wall, seed=seed) & alone
        ).sum() > 0.95 * alone.sum()  # noise parts single pixels from it


def test_red_floor_around_a_red_post_and_one_beside_a_red_cupboard_stay_whole() -> None:
    around, post = (
        Paint(x=(1.5, 2.5), y=(-0.5, 0.5)),
        Box(x=(1.95, 2.05), y=(-0.05, 0.05), z=(0.0, 1.0), colour=RED),
    )
    grey = Box(x=post.x, y=post.y, z=post.z)
    assert (red(around, post) | ~red(around, grey)).all()
    beside = Paint(x=(1.6, 1.9), y=(-1.0, -0.6))
    assert red(beside).sum() > 12
    assert (red(beside, cupboard(2.0)) | ~red(beside)).all()


def test_a_red_object_no_higher_than_a_kerb_makes_no_base() -> None:
    """The depth error is as large: only a certain obstacle may overrule the operator's rule."""
    assert red(
        Paint(x=(1.5, 1.6), y=(-0.4, 0.4)),
        Box(x=(1.6, 1.9), y=(-0.4, 0.4), z=(0.0, 0.12), colour=RED),
    ).any()
