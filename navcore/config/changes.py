"""Configuration of the comparison of a map with its accepted state."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangesConfig:
    """When a difference between two maps counts as a change, and which ones belong together."""

    tolerance_m: float = ranged(0.0, 1.0, default=0.1)
    """Distance in metres up to which an occupied cell of one map explains one of the other:
    localisation and depth move surfaces by some centimetres."""
    join_m: float = ranged(0.0, 5.0, default=0.3)
    """Gap in metres between two changes up to which they form one area."""
    min_cells: int = ranged(1, 1000, default=4)
    """Smallest number of cells of an area; smaller ones are noise of the depth."""


DEFAULT_CHANGES = ChangesConfig()
