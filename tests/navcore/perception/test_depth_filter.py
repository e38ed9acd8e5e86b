"""Depth refutes labels: a print of an object is rejected, and undecided regions stay."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.perception.perception import DepthFilterConfig
from navcore.mission.beware_list import BewareClass, BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.depth_filter import (
    heights_above_floor,
    reject_flat_regions,
    remove_small_regions,
    trim_label_bleed,
)
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.scene import LENS, RED, Box, Paint, picture

PINK = (250, 60, 200)
CUP = BewareClass(name="cup", class_id=3, min_height_m=0.05)
SIGN = BewareClass(name="wet-floor sign", class_id=4, min_height_m=0.3)
BOOK = BewareClass(name="book", class_id=5)
CABLE = BewareClass(name="cable", class_id=6, min_size_m=0.3)
PARCEL = BewareClass(name="box", class_id=7, max_size_m=1.0)
Ids = npt.NDArray[np.uint8]
CONFIG = DepthFilterConfig()


def kept(frame: Frame, entry: BewareClass) -> float:
    """Return the share of the pink pixels that stay when a network labels all of them `entry`."""
    pink = (frame.rgb == PINK).all(axis=2)
    assert pink.sum() > 12
    ids = np.where(pink, np.uint8(entry.class_id), np.uint8(0)).astype(np.uint8)
    keep = reject_flat_regions(
        ids, frame, heights_above_floor(frame), BewareList(classes=(entry,)), HUSKY.depth_sensor
    )
    assert keep[~pink].all()
    return float(keep[pink].mean())


def noisy(frame: Frame, seed: int = 0) -> Frame:
    """Return the frame with the depth error of the stereo camera."""
    z = frame.depth_m
    error = 0.08 * z**2 / (LENS.fx * 0.095) * np.random.default_rng(seed).standard_normal(z.shape)
    return dataclasses.replace(
        frame, depth_m=np.where(z > 0, z + error, 0).clip(0).astype(np.float32)
    )


def a_print(x: float, side: float = 0.15) -> Paint:
    return Paint(x=(x, x + side), y=(-side / 2, side / 2), colour=PINK)


def a_box(x: float, height: float, side: float = 0.15) -> Box:
    return Box(x=(x, x + side), y=(-side / 2, side / 2), z=(0.0, height), colour=PINK)


def test_a_small_region_of_a_long_class_is_rejected_and_a_long_one_stays_in_any_direction() -> None:
    assert kept(picture(a_print(1.5, side=0.15)), CABLE) == 0.0
    assert kept(noisy(picture(a_print(2.0, side=0.2))), CABLE) == 0.0
    assert kept(picture(a_print(1.5, side=0.15)), BOOK) == 1.0
    across = Paint(x=(1.4, 1.46), y=(-0.25, 0.25), colour=PINK)
    away = Paint(x=(1.2, 2.0), y=(0.1, 0.14), colour=PINK)
    assert kept(noisy(picture(across)), CABLE) == kept(noisy(picture(away)), CABLE) == 1.0


def test_pieces_of_a_thing_that_is_thinner_than_a_pixel_are_as_long_as_the_thing() -> None:
    def pieces(gap_m: float) -> list[Paint]:
        left = (-0.25 + (0.05 + gap_m) * k for k in range(7))
        return [Paint(x=(1.4, 1.46), y=(y, y + 0.05), colour=PINK) for y in left]

    broken = picture(*pieces(0.03))
    pink = (broken.rgb == PINK).all(axis=2).view(np.uint8)
    assert cv2.connectedComponents(pink, connectivity=8)[0] == 8  # the floor and seven
    assert kept(noisy(broken), CABLE) == 1.0
    assert kept(noisy(picture(*pieces(0.1))), CABLE) == 0.0  # control: things apart


def test_a_surface_longer_than_its_class_is_rejected_also_where_the_image_cuts_it() -> None:
    table = Box(x=(1.0, 1.6), y=(-0.7, 0.7), z=(0.3, 0.35), colour=PINK)
    beside = dataclasses.replace(table, y=(-0.4, 1.4))
    for seed, one in enumerate([table, beside]):
        assert kept(picture(one), PARCEL) < 0.1
        assert kept(noisy(picture(one), seed), PARCEL) < 0.3
        assert kept(picture(one), BOOK) == 1.0


def test_boxes_that_are_one_region_only_in_the_image_stay() -> None:
    near = Box(x=(1.2, 1.6), y=(-0.5, 0.1), z=(0.0, 0.3), colour=PINK)
    behind = Box(x=(2.2, 2.6), y=(0.0, 0.7), z=(0.0, 0.4), colour=PINK)
    frame = picture(near, behind)
    pink = (frame.rgb == PINK).all(axis=2)
    count, _ = cv2.connectedComponents(pink.view(np.uint8), connectivity=8)
    assert count == 2  # the floor and one region
    assert kept(frame, PARCEL) == kept(noisy(frame), PARCEL) == 1.0


def test_a_region_that_the_border_of_the_image_cuts_may_be_long() -> None:
    frame = picture(a_print(1.5, side=0.15))
    cols = np.flatnonzero((frame.rgb == PINK).all(axis=2).any(axis=0))
    lens = dataclasses.replace(LENS, width=int(cols[len(cols) // 2]) + 1)
    cut = dataclasses.replace(
        frame,
        rgb=frame.rgb[:, : lens.width],
        depth_m=frame.depth_m[:, : lens.width],
        intrinsics=lens,
    )
    assert kept(cut, CABLE) == 1.0


@pytest.mark.parametrize(
    ("objects", "share"),
    [
        ([a_print(1.5, side=0.05), a_print(2.2, side=0.06)], 0.0),
        ([a_print(1.5, side=0.2)], 1.0),
        ([Paint(x=(1.4, 1.44), y=(-0.25, 0.25), colour=PINK)], 1.0),
        ([Paint(x=(1.2, 2.0), y=(0.1, 0.14), colour=PINK)], 1.0),
        (
            [Paint(x=(1.5, 1.55), y=(0.08 * k, 0.08 * k + 0.05), colour=PINK) for k in range(4)],
            1.0,
        ),  # worn, but a line
    ],
)
def test_small_regions_of_a_colour_are_removed_and_long_ones_stay_however_thin(
    objects: list[Paint], share: float
) -> None:
    frame = noisy(picture(*objects))
    pink = (frame.rgb == PINK).all(axis=2)
    assert pink.sum() > 4
    assert remove_small_regions(pink, frame, 0.1)[pink].mean() == share
    assert not remove_small_regions(pink, frame, 0.1)[~pink].any()
    assert remove_small_regions(
        pink, dataclasses.replace(frame, depth_m=np.zeros_like(frame.depth_m)), 0.1
    )[pink].all()


def test_a_floor_with_red_grains_is_no_red_floor_and_a_red_field_on_it_is() -> None:
    field = Paint(x=(1.2, 1.7), y=(-0.3, 0.2), colour=RED)
    frame = picture(field)
    grains = np.random.default_rng(0).random(frame.depth_m.shape) < 0.01
    grains[:, :4] = grains[:, -4:] = grains[:4] = grains[-4:] = False
    spotted = dataclasses.replace(
        frame, rgb=np.where(grains[..., None], np.array(RED, dtype=np.uint8), frame.rgb)
    )
    red, near = (frame.rgb == RED).all(axis=2), (frame.depth_m > 0) & (frame.depth_m < 1.5)
    beside = near & ~cv2.dilate(red.view(np.uint8), np.ones((9, 9), np.uint8)).astype(np.bool_)
    assert (grains & beside).sum() > 50
    for segmenter in (ColourSegmenter(), FusedSegmenter(ColourSegmenter(), HUSKY.depth_sensor)):
        found = segmenter.segment(spotted, default_beware_list()).class_ids == 1
        assert found[red].mean() > 0.99
        assert found[beside].mean() < 1e-3


def test_heights_are_those_of_the_objects_and_missing_where_depth_is() -> None:
    frame = picture(a_box(1.2, 0.4, side=0.5))
    depth = frame.depth_m.copy()
    depth[100] = 0.0
    heights = heights_above_floor(dataclasses.replace(frame, depth_m=depth))
    pink = (frame.rgb == PINK).all(axis=2)
    pink[100] = False
    assert np.isnan(heights[100]).all()
    assert heights[pink].max() == pytest.approx(0.4, abs=0.01)
    floor = ~pink & (frame.depth_m > 0)
    floor[100] = False
    assert np.abs(heights[floor]).max() < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_a_print_on_the_floor_is_rejected_and_the_object_itself_is_not(seed: int) -> None:
    assert kept(noisy(picture(a_print(0.9)), seed), CUP) == 0.0
    assert kept(noisy(picture(a_box(0.9, 0.07)), seed), CUP) == 1.0


def test_far_away_where_depth_cannot_decide_nothing_is_rejected() -> None:
    assert kept(picture(a_print(2.6, side=0.6)), CUP) == 1.0


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_a_print_without_enough_depth_stays(share: float) -> None:
    frame = picture(a_print(0.9))
    pink = (frame.rgb == PINK).all(axis=2)
    gone = pink & (np.random.default_rng(1).random(pink.shape) >= share)
    assert (
        kept(dataclasses.replace(frame, depth_m=np.where(gone, np.float32(0), frame.depth_m)), CUP)
        == 1.0
    )


def test_a_class_that_may_be_flat_is_never_rejected() -> None:
    assert kept(picture(a_print(0.9)), BOOK) == 1.0


def test_a_sign_that_has_fallen_over_is_still_a_sign() -> None:
    assert kept(picture(a_box(0.9, CONFIG.max_flat_m + 0.01, side=0.4)), SIGN) == 1.0
    assert kept(picture(a_print(0.9, side=0.4)), SIGN) == 0.0


def test_a_nod_of_the_robot_neither_makes_a_print_real_nor_a_cup_a_print() -> None:
    for item, share in ((a_print(0.9), 0.0), (a_box(0.9, 0.07), 1.0)):
        frame = picture(item)
        nod = np.eye(4)
        nod[:3, :3] = [[np.cos(0.02), 0, np.sin(0.02)], [0, 1, 0], [-np.sin(0.02), 0, np.cos(0.02)]]
        assert (
            kept(dataclasses.replace(frame, T_base_camera=nod @ frame.T_base_camera), CUP) == share
        )


def test_the_floor_at_the_foot_of_a_tall_object_is_released_and_the_rest_stays() -> None:
    frame = picture(a_box(1.2, 0.9, side=0.3), a_print(1.0, side=0.3))
    pink = (frame.rgb == PINK).all(axis=2)
    ids = np.where(pink, np.uint8(4), np.uint8(0)).astype(np.uint8)
    heights = heights_above_floor(frame)
    keep = reject_flat_regions(ids, frame, heights, BewareList(classes=(SIGN,)), HUSKY.depth_sensor)
    np.testing.assert_array_equal(keep, ~(pink & (heights < CONFIG.ground_m)))
    assert 0.3 < keep[pink].mean() < 1.0


def test_a_few_pixels_are_too_few_to_reject() -> None:
    frame = picture()
    ids: Ids = np.zeros(frame.depth_m.shape, dtype=np.uint8)
    ids[100:103, 80:83] = CUP.class_id
    assert reject_flat_regions(
        ids, frame, heights_above_floor(frame), BewareList(classes=(CUP,)), HUSKY.depth_sensor
    ).all()


@pytest.mark.parametrize("x", [1.2, 2.0, 3.0])
def test_a_label_beyond_the_outline_of_an_object_on_the_floor_behind_is_trimmed(
    x: float,
) -> None:
    frame = picture(a_box(x, height=0.3, side=0.3))
    pink = (frame.rgb == PINK).all(axis=2)
    labelled = cv2.dilate(pink.view(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    keep = trim_label_bleed(np.where(labelled, np.uint8(3), np.uint8(0)).astype(np.uint8), frame)
    behind = labelled & ~pink & (frame.depth_m > x + 0.5)
    assert behind.sum() > 3 and not keep[behind].any()
    assert keep[pink].all() and keep[~labelled].all()


def test_a_label_of_an_object_that_lies_flat_or_leads_away_is_not_trimmed() -> None:
    for item in (
        a_print(1.5),
        a_print(3.0, side=0.4),
        Paint(x=(1.2, 4.0), y=(0.1, 0.2), colour=PINK),
    ):
        frame = picture(item)
        pink = (frame.rgb == PINK).all(axis=2)
        assert trim_label_bleed(
            np.where(pink, np.uint8(6), np.uint8(0)).astype(np.uint8), frame
        ).all()
