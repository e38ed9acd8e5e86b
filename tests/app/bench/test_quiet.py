"""The guard repeats a measurement until two runs agree, and says when none do."""

from __future__ import annotations

from itertools import count

from app.bench.quiet import MOST_RUNS, QuietGuard


def test_two_runs_that_agree_are_enough() -> None:
    guard, runs = QuietGuard(), iter([10.2, 10.0])
    assert guard.fastest(lambda: next(runs)) == 10.0
    assert guard.verdict.startswith("the two fastest runs agree")


def test_a_disturbed_run_is_repeated_and_left_out() -> None:
    guard, runs = QuietGuard(), iter([25.0, 10.0, 17.0, 10.3])
    assert guard.fastest(lambda: next(runs)) == 10.0
    assert next(runs, None) is None
    assert not guard.noisy


def test_a_machine_that_never_agrees_is_called_noisy() -> None:
    guard, runs = QuietGuard(), count(1)
    assert guard.fastest(lambda: 2.0 ** next(runs)) == 2.0
    assert next(runs) == MOST_RUNS + 1
    assert guard.verdict.startswith("NOISY: in 1 of 1")
