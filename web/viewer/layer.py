"""The scene, one class per layer. A layer looks at the newest snapshot and sends only what has changed since the last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from navcore.beware import BewareList
from navcore.zones import Zone
from web.port import Picture, State


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """What all layers look at."""

    state: State
    """Newest state."""
    picture: Picture
    """Newest tick's values."""
    zones: tuple[Zone, ...]
    """All stored zones."""
    beware: BewareList
    """The list in force."""


class Layer(Protocol):
    """A part of the scene below one node, whose name is the layer's."""

    name: str
    period_s: float
    """Shortest time between two looks: what costs much to draw is drawn less often."""

    def push(self, snapshot: Snapshot) -> None:
        """Send what has changed."""
