"""What was measured of a promise."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """The outcome of some trials."""

    trials: int
    """How many there were."""
    measured: str
    """What came of them, with the figure that the promise is about."""
    met: bool
    """Whether the promise was kept in every one."""
