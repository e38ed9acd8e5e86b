"""The foot of something higher is no low thing of the list; what stands beside it, or on it, still is one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from navcore.beware import BewareClass, BewareList, default_beware_list
from navcore.frame import Frame
from navcore.overhung import without_overhung
from navcore.relief import heights_above_floor
from tests.navcore.scene import Box, Paint, picture
from tests.navcore.test_relief import PINK, noisy

MINE = BewareClass(name="landmine", class_id=8, max_height_m=0.25)
ANY = BewareClass(name="sign", class_id=10)


def kept(frame: Frame, entry: BewareClass = MINE) -> npt.NDArray[np.bool_]:
    """(N,) which of the pink pixels stay when a network calls all of them `entry`."""
    pink = (frame.rgb == PINK).all(axis=2)
    assert pink.sum() > 12
    ids = np.where(pink, np.uint8(entry.class_id), np.uint8(0)).astype(np.uint8)
    keep = without_overhung(ids, frame, heights_above_floor(frame), BewareList(classes=(entry,)))
    assert keep[~pink].all()
    return np.asarray(keep[pink])


def chair(x: float) -> tuple[Box, ...]:
    """A seat and a back on a low, broad foot that looks like a landmine."""
    foot = Box(x=(x, x + 0.45), y=(-0.22, 0.22), z=(0.0, 0.09), colour=PINK)
    seat = Box(x=(x, x + 0.48), y=(-0.24, 0.24), z=(0.42, 0.5))
    return foot, seat, Box(x=(x + 0.41, x + 0.48), y=(-0.24, 0.24), z=(0.5, 0.9))


def mine(x: float, z_m: float = 0.0) -> Box:
    return Box(x=(x, x + 0.3), y=(-0.15, 0.15), z=(z_m, z_m + 0.08), colour=PINK)


@pytest.mark.parametrize("x", [0.8, 1.1, 1.4])
def test_the_foot_of_a_chair_is_no_landmine(x: float) -> None:
    assert not kept(picture(*chair(x))).any()
    assert not kept(noisy(picture(*chair(x)))).any()


def test_from_where_depth_scatters_more_than_a_hand_nothing_is_dismissed() -> None:
    assert kept(picture(*chair(3.2))).all()


def test_a_thing_that_may_be_as_high_as_any_is_one_under_a_chair_too() -> None:
    assert kept(picture(*chair(1.6)), ANY).all()


@pytest.mark.parametrize("x", [1.0, 1.8, 3.0])
def test_what_stands_by_itself_stays_and_so_does_what_stands_beside_something_high(x: float) -> None:
    wall = Box(x=(x + 0.36, x + 0.5), y=(-2.0, 2.0), z=(0.0, 1.2))
    post = Box(x=(x + 0.1, x + 0.2), y=(0.2, 0.3), z=(0.0, 1.2))
    for beside in ((), (wall,), (post,)):
        assert kept(picture(mine(x), *beside)).all()
        assert kept(noisy(picture(mine(x), *beside), seed=1)).all()


def test_what_lies_on_something_stays_and_a_flat_marking_by_itself_does() -> None:
    assert kept(picture(Box(x=(1.4, 2.2), y=(-0.5, 0.5), z=(0.0, 0.4)), mine(1.6, 0.4))).all()
    assert kept(picture(Paint(x=(1.4, 1.7), y=(-0.15, 0.15), colour=PINK))).all()


def test_what_hangs_above_the_robot_says_nothing_about_what_lies_below() -> None:
    lamp = Box(x=(1.2, 2.4), y=(-0.6, 0.6), z=(1.7, 1.8))
    assert kept(picture(mine(1.6), lamp)).all()


def test_nothing_measured_is_nothing_dismissed() -> None:
    frame = picture(*chair(1.6))
    blind = np.zeros_like(frame.depth_m)
    blind.flags.writeable = False
    ids = np.full(frame.depth_m.shape, MINE.class_id, dtype=np.uint8)
    blank = Frame(**{**{name: getattr(frame, name) for name in Frame.__dataclass_fields__}, "depth_m": blind})
    assert without_overhung(ids, blank, heights_above_floor(blank), BewareList(classes=(MINE,))).all()


def test_the_list_that_is_shipped_knows_how_high_its_low_things_are() -> None:
    heights = {entry.name: entry.max_height_m for entry in default_beware_list().classes if entry.max_height_m is not None}
    assert heights == {"bottle": 0.4, "box": 0.45, "landmine": 0.25}
