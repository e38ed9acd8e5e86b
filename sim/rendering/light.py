"""The light of a world: a directional lamp and ambient light."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """A directional lamp and ambient light."""

    from_m: tuple[float, float, float] = (400.0, 300.0, 1000.0)
    """Position of the lamp, so far away that its light is parallel."""
    ambient: float = 0.5
    """Ambient share of the light."""
    diffuse: float = 0.5
    """Diffuse share of the light on a surface that faces the lamp."""


DAYLIGHT = Light()
"""The light of every scenario."""
