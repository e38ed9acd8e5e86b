"""Settings of the laws in these tests: the same examples on every run, bounded by work and not by
time."""

from __future__ import annotations

from hypothesis import HealthCheck, settings


def law(max_examples: int) -> settings:
    """Return settings for `@law(n)`: deterministic, without a deadline and without a database on
    the disk."""
    return settings(
        max_examples=max_examples,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=[
            HealthCheck.too_slow,
            HealthCheck.data_too_large,
            HealthCheck.filter_too_much,
        ],
    )
