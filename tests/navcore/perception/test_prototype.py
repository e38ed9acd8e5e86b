"""From clicks to a class by example: what is taken, what is found again, and what is not."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.perception.perception import DEFAULT_PERCEPTION
from navcore.errors import BadConfiguration, Refused
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareClass, BewareList, as_toml, parse_beware_list
from navcore.mission.prototype import Prototype
from navcore.perception.prototype import (
    background_of,
    describe,
    example_of,
    fitted,
    prototype_labels,
    prototype_pixels,
)
from navcore.perception.region_growing import object_at
from navcore.robot.frame import Frame
from tests.navcore.perception.colour_network import features_of
from tests.navcore.scene import Box, Colour, Paint, picture

TOY: Colour = (200, 120, 40)
CONFIG = DEFAULT_PERCEPTION.prototype
THING = Box(x=(1.7, 2.0), y=(-0.15, 0.15), z=(0.0, 0.3), colour=TOY)
WALL = Box(x=(4.0, 4.2), y=(-3.0, 3.0), z=(0.0, 2.0), colour=(190, 185, 170))
SHELF = Box(x=(2.2, 2.6), y=(0.5, 1.2), z=(0.0, 0.9), colour=(90, 110, 160))
FRAME = picture(THING, WALL, SHELF)
MIDDLE = (62, 79)


def described(frame: Frame) -> npt.NDArray[np.float32]:
    return describe(frame, features_of(frame))


def prototype(frame: Frame = FRAME, *, background: Frame | None = None) -> Prototype:
    example = example_of(frame, described(frame), object_at(frame, *MIDDLE))
    surroundings = [
        background_of(one, described(one), [example]) for one in (frame, background or frame)
    ]
    return fitted("abc", [example], np.concatenate(surroundings))


def found(frame: Frame, wanted: Prototype) -> npt.NDArray[np.bool_]:
    pixels, _ = prototype_pixels(frame, described(frame), wanted)
    return pixels


def test_a_click_takes_the_thing_and_neither_its_floor_nor_what_touches_it() -> None:
    neighbour = Box(x=(1.7, 2.0), y=(0.15, 0.5), z=(0.0, 0.3), colour=(30, 60, 190))
    frame = picture(THING, neighbour, WALL)
    pixels = object_at(frame, *MIDDLE)
    is_toy = (frame.rgb[..., 0] > 120) & (frame.rgb[..., 2] < 90)
    assert pixels[is_toy].mean() > 0.85
    assert (pixels & ~is_toy).sum() < 0.05 * pixels.sum()


@pytest.mark.parametrize(
    ("frame", "row", "col", "reason"),
    [
        (FRAME, 118, 80, "only floor"),
        (picture(Paint(x=(1.0, 3.0), y=(-1.0, 1.0))), 90, 80, "only floor"),
        (dataclasses.replace(FRAME, depth_m=np.zeros_like(FRAME.depth_m)), 62, 79, "no distance"),
        (FRAME, 20, 100, "m wide: furniture or a wall"),
    ],
)
def test_a_click_on_nothing_of_its_own_is_refused_with_the_reason(
    frame: Frame, row: int, col: int, reason: str
) -> None:
    with pytest.raises(Refused, match=reason):
        object_at(frame, row, col)


def test_a_thing_that_is_only_a_few_pixels_large_is_refused() -> None:
    far = picture(Box(x=(5.3, 5.4), y=(-0.05, 0.05), z=(0.0, 0.3), colour=TOY))
    row, col = np.argwhere((far.rgb[..., 2] < 90) & (far.rgb[..., 0] > 90))[0]
    with pytest.raises(Refused, match="too small or too far"):
        example_of(far, described(far), object_at(far, int(row), int(col)))


def test_the_thing_is_found_from_elsewhere_and_what_stands_beside_it_is_not() -> None:
    wanted = prototype()
    moved = picture(THING, WALL, SHELF, pose=Pose2(x_m=-0.6, y_m=0.4, yaw_rad=-0.2))
    is_toy = (moved.rgb[..., 0] > 120) & (moved.rgb[..., 2] < 90)
    assert found(moved, wanted)[is_toy].mean() > 0.7
    assert (found(moved, wanted) & ~is_toy).sum() <= 0.1 * is_toy.sum()


def test_a_thing_of_another_kind_that_no_click_or_background_showed_is_not_taken_for_it() -> None:
    wanted = prototype()
    other = picture(dataclasses.replace(THING, colour=(20, 20, 20)), WALL, SHELF)
    assert not found(other, wanted).any()
    # Told from the background alone, without nearness to what was clicked, it would be.
    anywhere = dataclasses.replace(wanted, radius=1e5)
    assert found(other, anywhere).any()


def test_what_is_larger_or_lower_than_the_thing_is_not_taken_for_it() -> None:
    wanted = prototype()
    wide = picture(dataclasses.replace(THING, y=(-0.6, 0.6)), WALL, SHELF)
    low = picture(dataclasses.replace(THING, z=(0.0, 0.12)), WALL, SHELF)
    assert not found(wide, wanted).any()
    assert not found(low, wanted).any()
    any_size = dataclasses.replace(wanted, max_size_m=9.0, min_height_m=0.0)
    assert found(wide, any_size).any()
    assert found(low, any_size).any()


def test_the_threshold_is_that_of_the_background() -> None:
    alike = dataclasses.replace(SHELF, y=(-1.2, -0.7), colour=(205, 126, 44))
    with pytest.raises(Refused, match="too much like what is around it"):
        prototype(background=picture(alike, dataclasses.replace(SHELF, colour=TOY), WALL))


def test_other_things_near_what_was_clicked_are_no_background() -> None:
    beside = dataclasses.replace(THING, y=(0.2, 0.4))
    frame = picture(THING, beside, WALL, SHELF)
    example = example_of(frame, described(frame), object_at(frame, *MIDDLE))
    assert fitted("abc", [example], background_of(frame, described(frame), [example]))
    config = dataclasses.replace(CONFIG, clear_m=0.0, twin_share=0.0)
    nearer = dataclasses.replace(example, size_m=0.0)
    with pytest.raises(Refused, match="too much like"):
        fitted("abc", [nearer], background_of(frame, described(frame), [nearer], config), config)


def test_labels_hold_the_class_that_fits_best_with_a_confidence_above_a_half() -> None:
    wanted = prototype()
    entry = BewareClass(name="toy", class_id=7, prototype=wanted)
    foreign = BewareClass(
        name="other",
        class_id=8,
        prototype=dataclasses.replace(
            wanted, centre=(1.0,) * 5, spread=(1.0,) * 5, weights=(1.0,) * 5
        ),
    )
    labels = prototype_labels(FRAME, described(FRAME), [foreign, entry])
    taken = labels.class_ids == 7
    assert taken.any()
    assert set(np.unique(labels.class_ids)) == {0, 7}
    assert labels.confidence[taken].min() >= 0.49
    assert np.median(labels.confidence[taken]) > 0.85


def test_a_prototype_survives_the_file_of_the_list() -> None:
    beware = BewareList(classes=(BewareClass(name="toy", class_id=7, prototype=prototype()),))
    assert parse_beware_list(as_toml(beware), "file").classes == beware.classes


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"weights": (1.0,) * 600}, "one number a channel"),
        ({"centre": (1.0,)}, "one number a channel"),
        ({"typical": -1e5}, "above threshold"),
        ({"network": "../etc"}, "letters and digits"),
    ],
)
def test_a_damaged_prototype_is_refused_by_what_is_wrong(
    changes: dict[str, object], reason: str
) -> None:
    with pytest.raises(BadConfiguration, match=reason):
        dataclasses.replace(prototype(), **changes)  # type: ignore[arg-type]


def test_the_same_clicks_give_the_same_prototype() -> None:
    assert prototype() == prototype()
