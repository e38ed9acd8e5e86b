"""How the laws of these tests are searched for counter-examples: the same examples on every run, by
work and not by time."""

from __future__ import annotations

from hypothesis import HealthCheck, settings


def law(max_examples: int) -> settings:
    """Settings for `@law(n)`: deterministic, without a deadline and without a data base on the
    disk."""
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
