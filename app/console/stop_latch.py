"""The emergency stop outlives the console: what was stopped before a restart is stopped after it,
until an operator resets it."""

from __future__ import annotations

import logging
from pathlib import Path

from app.runtime.control.operator_state import StateHolder
from navcore.errors import StorageFailed
from navcore.files import remove_drafts, write_whole

log = logging.getLogger(__name__)
PERIOD_S = 0.2
"""Time between two looks at the stop, seconds: what a kill loses at most, but for the writing."""


class StopLatch:
    """Keeps who has stopped the robot in a file of the data folder."""

    def __init__(self, file: Path, holder: StateHolder) -> None:
        self._file, self._holder = file, holder
        remove_drafts(file)
        self._kept: str | None = read_latch(file)
        self._is_known = True  # whether the file holds that, and not perhaps what could not be kept
        self._warning: str | None = None

    @property
    def warning(self) -> str | None:
        """Why the stop, or its reset, would not hold over a restart, for the operator; None while
        it would."""
        return self._warning

    def keep(self) -> None:
        """Write the file if the stop was latched or reset; tried again the next time if it cannot
        be written."""
        stopped_by = self._holder.intent.stopped_by
        if self._is_known and stopped_by == self._kept:
            self._warning = None
            return
        try:
            if stopped_by is None:
                self._file.unlink(missing_ok=True)
            else:
                write_whole(self._file, stopped_by.encode())
        except (OSError, StorageFailed) as error:
            warning = (
                f"the emergency stop cannot be stored, a restart would release it: {error}"
                if stopped_by is not None
                else f"the reset cannot be stored, after a restart the robot stands again: {error}"
            )
            if warning != self._warning:
                log.error("%s", warning)
            self._warning, self._is_known = warning, False
            return
        self._kept, self._warning, self._is_known = stopped_by, None, True


def read_latch(file: Path) -> str | None:
    """Return who had stopped the robot when the console ended; None if it was not stopped. A file
    that cannot be read counts as a stop."""
    try:
        return file.read_text(encoding="utf-8") or "an operator"
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError):
        log.exception("the stored emergency stop cannot be read; it counts as latched")
        return "an operator"
