"""Position fixes count once, and alike ones no more than one."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.localisation.fresh_fixes import FreshFixes
from navcore.robot.fix import FixSource, PositionFix

NOW_NS = round(60e9)
"""Time of the frame that brings the fixes, nanoseconds."""


def fix(stamp_s: float, *, tag: int | None = None, correlation_s: float = 0.0) -> PositionFix:
    return PositionFix(
        stamp_ns=round(stamp_s * 1e9),
        x_m=0.0,
        y_m=0.0,
        covariance=0.01 * np.eye(2),
        source=FixSource.GNSS if tag is None else FixSource.TAG,
        source_id=tag,
        correlation_s=correlation_s,
    )


def test_a_fix_that_frames_repeat_counts_once_and_tags_of_one_image_all_count() -> None:
    fresh = FreshFixes()
    assert len(list(fresh.of([fix(1.0), fix(1.2)], NOW_NS))) == 2
    assert len(list(fresh.of([fix(1.0), fix(1.2), fix(1.4)], NOW_NS))) == 1
    assert len(list(fresh.of([fix(2.0, tag=3), fix(2.0, tag=4)], NOW_NS))) == 2


def test_errors_that_stay_alike_count_once_over_the_time_for_which_they_do() -> None:
    fresh = FreshFixes()
    information = 0.0
    for step in range(150):
        ((found, alike),) = fresh.of([fix(0.2 * step, correlation_s=30.0)], NOW_NS)
        if step:
            information += 1.0 / (alike * found.covariance[0, 0])
    assert information == pytest.approx(1.0 / 0.01, rel=0.02)


def test_a_fix_from_the_future_keeps_none_of_its_source_out() -> None:
    fresh = FreshFixes()
    assert not list(fresh.of([fix(3600.0)], NOW_NS))
    assert len(list(fresh.of([fix(1.0)], NOW_NS))) == 1
