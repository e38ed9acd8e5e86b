"""Ticks whose camera images were given out last, by name: a click is made on one of them."""

from __future__ import annotations

from collections import deque

from navcore.errors import Refused
from web.interface.snapshots import TickSnapshot

MAX_PIXELS = 16 * 424 * 240
"""Largest number of pixels of all ticks; of finer images fewer ticks are held."""


class ShownTicks:
    """Safe from any thread."""

    def __init__(self) -> None:
        self._ticks: deque[TickSnapshot] = deque()

    def note(self, tick: TickSnapshot) -> None:
        """Note a tick whose image is given out."""
        if tick in tuple(self._ticks):
            return
        self._ticks.append(tick)
        while len(self._ticks) > max(1, MAX_PIXELS // tick.labels.size):
            self._ticks.popleft()

    def named(self, name: str) -> TickSnapshot:
        """Return the tick whose image has a name; raises `Refused` where it is no longer held."""
        for tick in tuple(self._ticks):
            if name_of(tick) == name:
                return tick
        raise Refused("that image is no longer kept: the picture has moved on; click again")


def name_of(tick: TickSnapshot) -> str:
    """Return the name of a tick's camera image, by which a click refers to it."""
    return str(tick.serial)
