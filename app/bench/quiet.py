"""Repetition until two runs agree: the guard against other work on the machine."""

from __future__ import annotations

from collections.abc import Callable

AGREEMENT = 0.05
"""Largest relative difference of two runs that agree."""
MOST_RUNS = 6
"""Number of runs after which a measurement counts as noisy."""


class QuietGuard:
    """Repeats measurements, takes the fastest run of each, and counts those that never agreed."""

    def __init__(self) -> None:
        self.measured = 0
        """Number of measurements."""
        self.noisy = 0
        """Number of them whose two fastest of `MOST_RUNS` runs still differed by more than
        `AGREEMENT`."""

    def fastest(self, run: Callable[[], float]) -> float:
        """Return the least duration that `run` returns, once the two least ones agree."""
        self.measured += 1
        durations = sorted((run(), run()))
        while durations[1] > (1 + AGREEMENT) * durations[0]:
            if len(durations) == MOST_RUNS:
                self.noisy += 1
                break
            durations = sorted((*durations, run()))
        return durations[0]

    @property
    def verdict(self) -> str:
        """Whether the machine was quiet, in words for the title of a table."""
        if not self.noisy:
            return f"the two fastest runs agree within {AGREEMENT:.0%}"
        return (
            f"NOISY: in {self.noisy} of {self.measured} measurements no two of {MOST_RUNS} runs "
            f"agree within {AGREEMENT:.0%}"
        )
