"""Periodic check of changed accounts and of operators who have become silent."""

from __future__ import annotations

import logging
import threading
from typing import Literal

from navcore.errors import Refused
from web.auth.access import Access
from web.interface.operations import RobotService

log = logging.getLogger(__name__)

Unattended = Literal["go on", "pause"]
"""Treatment of a mission without an operator in control."""
PERIOD_S = 0.5
JOIN_S = 2.0


class PresenceMonitor:
    """Thread that calls `check` twice a second."""

    def __init__(self, operations: RobotService, access: Access, unattended: Unattended) -> None:
        self._operations, self._access, self._unattended = operations, access, unattended
        self._attended = False
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="presence", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)

    def check(self) -> None:
        """Refresh the accounts, and pause the mission if the operator in control has left."""
        self._access.authenticator.refresh()
        attended = self._access.control.now.holder is not None
        left, self._attended = self._attended and not attended, attended
        if left and self._unattended == "pause":
            try:
                self._operations.mission("pause")
            except Refused:
                return  # no mission drives, or is about to go on
            log.warning("the operator in control has left; the mission is paused")

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            try:
                self.check()
            except Exception:
                log.exception("the presence check failed; it continues")
