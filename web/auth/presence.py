"""Looks about once a second who is still there: accounts that have changed, and an operator who has
gone silent."""

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING, Literal

from navcore.errors import Refused
from navcore.mission.mission import Phase
from web.interface.operations import RobotService

if TYPE_CHECKING:
    from web.auth.access import Access

log = logging.getLogger(__name__)

Unattended = Literal["go on", "pause"]
PERIOD_S = 0.5
JOIN_S = 2.0


class PresenceMonitor:
    """A thread of its own; `look` is what it does."""

    def __init__(self, operations: RobotService, access: Access, unattended: Unattended) -> None:
        self._operations, self._access, self._unattended = operations, access, unattended
        self._attended = False
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to look."""
        self._thread = threading.Thread(target=self._run, name="attendance", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Look no more."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)

    def check(self) -> None:
        """Once."""
        self._access.authenticator.refresh()
        attended = self._access.control.now.holder is not None
        left, self._attended = self._attended and not attended, attended
        if left and self._unattended == "pause" and self._operations.state().phase is Phase.DRIVING:
            log.warning("whoever was in control has gone; the mission is paused")
            try:
                self._operations.mission("pause")
            except Refused:
                log.info("it had ended meanwhile")

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            try:
                self.check()
            except Exception:
                log.exception("the attendance goes on")
