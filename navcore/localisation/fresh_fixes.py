"""Position fixes that are new, with the number of those whose errors are the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from navcore.robot.fix import FixSource, PositionFix

Source = tuple[FixSource, int | None]


def source_of(fix: PositionFix) -> Source:
    """Return what the fix comes from: its kind, and which one of that."""
    return fix.source, fix.source_id


class FreshFixes:
    """Remembers the newest fix of each source: a frame repeats those of the last second."""

    def __init__(self) -> None:
        self._newest_ns: dict[Source, int] = {}

    def of(self, fixes: Iterable[PositionFix], now_ns: int) -> Iterator[tuple[PositionFix, float]]:
        """Yield the fixes that are newer than any before of their source, each with a number ≥ 1.
        One that is dated after the frame that brings it, at `now_ns`, is left out: it would make
        all that follow look old.

        Errors that stay alike for a time would count once for every fix; the covariance of a fix is
        to be multiplied by the number of fixes in that time, so that together they count once.
        """
        for fix in fixes:
            source = source_of(fix)
            before_ns = self._newest_ns.get(source)
            if fix.stamp_ns > now_ns or (before_ns is not None and fix.stamp_ns <= before_ns):
                continue
            self._newest_ns[source] = fix.stamp_ns
            since_s = 0.0 if before_ns is None else (fix.stamp_ns - before_ns) / 1e9
            alike = fix.correlation_s / since_s if since_s > 0 else 1.0
            yield fix, max(alike, 1.0)
