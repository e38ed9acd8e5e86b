"""Stops that recur are one line with their count; nothing of their time is lost."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.referee.stops import SAME_STOP_S, StopLog


def test_dozens_of_stops_for_one_reason_are_one_entry_with_count_and_sum() -> None:
    log = StopLog()
    for second in range(30):
        log.note("stale_command", second)
        log.note("boxed_in" if second == 7 else None, second + 0.25)
        log.note(None, second + 0.5)
    assert log.intervals(31.0) == [
        {
            "t_s": 0.0,
            "duration_s": 7.5,
            "reason": "stale_command",
            "count": 30,
            "until_s": 29.25,
        },
        {"t_s": 7.25, "duration_s": 0.25, "reason": "boxed_in", "count": 1, "until_s": 7.5},
    ]


def test_a_stop_long_after_the_last_is_another_entry_and_one_goes_on() -> None:
    log = StopLog()
    log.note("no_path", 1.0)
    log.note(None, 2.0)
    log.note("no_path", 2.5 + SAME_STOP_S)
    counts = [(stop["t_s"], stop["count"]) for stop in log.intervals(20.0)]
    assert counts == [(1.0, 1), (2.5 + SAME_STOP_S, 1)]
    assert log.intervals(20.0)[-1]["until_s"] == 20.0


@given(
    st.lists(st.tuples(st.floats(0.01, 30.0), st.sampled_from([None, "a", "b", "c"])), max_size=40)
)
def test_the_time_held_for_each_reason_is_that_of_all_its_stops(
    steps: list[tuple[float, str | None]],
) -> None:
    log, now_s, held_s, reason = StopLog(), 0.0, dict.fromkeys("abc", 0.0), None
    for step_s, after in steps:
        log.note(after, now_s)
        reason = after
        now_s += step_s
        if reason is not None:
            held_s[reason] += step_s
    for name, seconds in held_s.items():
        found = [stop["duration_s"] for stop in log.intervals(now_s) if stop["reason"] == name]
        assert sum(found) == pytest.approx(seconds, abs=0.05)
