"""The camera of the console where none is asked for."""

from __future__ import annotations

import pytest

from app.runtime.start.camera_choice import ENOUGH_PROCESSORS, FAST_MS, choose_stream
from navcore.robot.camera_stream import CameraStream


@pytest.mark.parametrize(
    ("image_ms", "processors", "size"),
    [
        (FAST_MS, ENOUGH_PROCESSORS, (848, 480)),
        (FAST_MS + 1, ENOUGH_PROCESSORS, (424, 240)),
        (FAST_MS, ENOUGH_PROCESSORS - 1, (424, 240)),
        (None, 64, (424, 240)),
    ],
)
def test_only_enough_processors_with_a_fast_network_make_the_images_fine(
    image_ms: float | None, processors: int, size: tuple[int, int]
) -> None:
    default = CameraStream(rate_hz=15.0)
    chosen = choose_stream(image_ms, default, processors=processors)
    assert chosen.stream.size == size
    assert chosen.stream.rate_hz == default.rate_hz
    assert chosen.text().startswith(f"{size[0]} × {size[1]} at 15 Hz: ")
