"""Camera stream of the console where none is asked for: as fine as this machine can follow."""

from __future__ import annotations

import os
from dataclasses import dataclass

from navcore.robot.camera_stream import CameraStream

FINE = CameraStream(width=848, height=480)
"""Stream of a fast machine: the image size that the shipped network was trained for."""
ENOUGH_PROCESSORS = 4
"""Number of processors from which simulator, control loop, network and page have one each."""
FAST_MS = 50.0
"""Time of the network per image in milliseconds up to which half of the time between two images is
left for everything else, which takes three to four times as long for the fine ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """A camera stream, and why it was chosen."""

    stream: CameraStream
    """Size and rate of the images."""
    why: str
    """Reason, for the operator."""

    def text(self) -> str:
        """Return one line."""
        width, height = self.stream.size
        return f"{width} × {height} at {self.stream.rate_hz:g} Hz: {self.why}"


def choose_stream(
    image_ms: float | None, default: CameraStream, *, processors: int | None = None
) -> CameraChoice:
    """Return the fine stream for a machine with enough processors and a fast network, else the
    default one. `image_ms`: time of the network per image in milliseconds, None without one;
    `processors`: those of this machine when left out."""
    processors = processors or os.cpu_count() or 1
    if image_ms is None:
        return CameraChoice(stream=default, why="no network runs that finer images would help")
    here = f"{processors} processors, and {image_ms:.0f} ms of the network for an image"
    if processors >= ENOUGH_PROCESSORS and image_ms <= FAST_MS:
        fine = CameraStream(width=FINE.width, height=FINE.height, rate_hz=default.rate_hz)
        return CameraChoice(stream=fine, why=here)
    needs = f"{FINE.width} × {FINE.height} needs {ENOUGH_PROCESSORS} and up to {FAST_MS:.0f} ms"
    return CameraChoice(stream=default, why=f"{here}; {needs}")
