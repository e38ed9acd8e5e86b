"""Sizes and rates of the camera, as an operator writes them."""

from __future__ import annotations

import dataclasses
import itertools

import pytest

from navcore.errors import BadConfiguration
from navcore.robot.camera_stream import RATES_HZ, SIZES, CameraStream, stream_of
from navcore.robot.profile import HUSKY


@pytest.mark.parametrize(("size", "rate_hz"), [*itertools.product(SIZES, RATES_HZ)])
def test_every_stream_is_read_as_it_is_written(size: tuple[int, int], rate_hz: int) -> None:
    for colour_lens in (False, True):
        stream = CameraStream(
            width=size[0], height=size[1], rate_hz=rate_hz, colour_lens=colour_lens
        )
        assert stream_of(str(stream)) == stream


def test_what_is_left_out_is_as_in_the_profile() -> None:
    own = CameraStream(width=640, height=480, rate_hz=15.0)
    assert stream_of("848x480", own) == CameraStream(width=848, height=480, rate_hz=15.0)
    assert stream_of("+colour", own) == dataclasses.replace(own, colour_lens=True)
    assert stream_of("@30", own) == CameraStream(width=640, height=480, rate_hz=30.0)
    assert HUSKY.stream == CameraStream(width=424, height=240, rate_hz=10.0)


@pytest.mark.parametrize(
    "text", ["", "@", "fine", "848", "848x480@", "640x360", "848x480@90", "0x0"]
)
def test_what_a_d455_does_not_offer_is_refused_with_what_it_does(text: str) -> None:
    with pytest.raises(BadConfiguration, match="expected one of 424x240, 640x480, 848x480"):
        stream_of(text)
