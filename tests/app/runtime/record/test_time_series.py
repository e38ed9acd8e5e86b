"""The measurements of a drive are bounded, however long it takes."""

from __future__ import annotations

from itertools import pairwise

from app.runtime.record.time_series import COLUMNS, TimeSeries

MEASURED = dict.fromkeys(COLUMNS[1:], 0.0)


def fed(series: TimeSeries, seconds: int) -> list[float | None]:
    """Offer a row per second and return the times that the table keeps."""
    for t_s in range(seconds):
        if series.is_due(t_s):
            series.add(t_s, MEASURED)
    return series.after()["t_s"]


def test_a_clock_that_was_set_back_does_not_stop_the_table() -> None:
    series = TimeSeries(max_rows=100)
    series.add(3600.0, MEASURED)
    assert series.is_due(0.0) and not series.is_due(3600.5)


def test_a_full_table_drops_its_oldest_rows() -> None:
    assert fed(TimeSeries(max_rows=100), 1000) == [float(t_s) for t_s in range(900, 1000)]


def test_a_thinning_table_keeps_the_whole_drive_in_fewer_rows() -> None:
    kept = [t_s for t_s in fed(TimeSeries(max_rows=100, thinning=True), 10_000) if t_s is not None]
    steps = {later - earlier for earlier, later in pairwise(kept)}
    assert len(kept) < 100
    assert kept[0] == 0 and kept[-1] > 9_000
    assert len(steps) == 1
