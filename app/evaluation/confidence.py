"""How sure a figure of some episodes is: 95 % intervals of rates and means."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

Z = 1.959964
"""Of the normal distribution, two-sided 95 %."""
RESAMPLES = 4000


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's score interval of a rate; honest for few trials and for rates of 0 and 1. Raises
    `ValueError` without trials."""
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes of {trials} trials")
    share, spread = successes / trials, Z**2 / trials
    middle = (share + spread / 2) / (1 + spread)
    reach = Z / (1 + spread) * math.sqrt(share * (1 - share) / trials + spread / (4 * trials))
    low, high = max(0.0, middle - reach), min(1.0, middle + reach)
    return (0.0 if successes == 0 else low), (1.0 if successes == trials else high)


def bootstrap(values: Sequence[float]) -> tuple[float, float] | None:
    """Percentile interval of a mean by drawing again, always the same draws; None for fewer than
    two values."""
    if len(values) < 2:
        return None
    sample = np.array(values, dtype=np.float64)
    means = np.random.default_rng(0).choice(sample, size=(RESAMPLES, len(sample))).mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)
