"""The measurement of a promise."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """The outcome of some trials."""

    trials: int
    """Number of trials."""
    measured: str
    """Summary of the outcome, with the number that the promise is about."""
    met: bool
    """Whether the promise was kept in every trial."""
