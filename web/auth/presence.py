"""Periodic check of changed accounts and of operators who have become silent."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
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
    """Threads that call `check`, and refresh the accounts, twice a second: the accounts may wait
    for a disk, and the pause for nothing."""

    def __init__(self, operations: RobotService, access: Access, unattended: Unattended) -> None:
        self._operations, self._access, self._unattended = operations, access, unattended
        self._attended = False
        self._ended = threading.Event()
        self._threads: tuple[threading.Thread, ...] = ()

    def start(self) -> None:
        """Start the threads."""
        acts = {"presence": self.check, "accounts": self._access.authenticator.refresh}
        self._threads = tuple(
            threading.Thread(target=self._run, args=(act,), name=name, daemon=True)
            for name, act in acts.items()
        )
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the threads, if they were started."""
        self._ended.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(JOIN_S)

    def check(self) -> None:
        """Pause the mission if the operator in control has left."""
        attended = self._access.control.now.holder is not None
        left, self._attended = self._attended and not attended, attended
        if left and self._unattended == "pause":
            try:
                self._operations.mission("pause")
            except Refused:
                return  # no mission drives, or is about to go on
            log.warning("the operator in control has left; the mission is paused")

    def _run(self, act: Callable[[], None]) -> None:
        while not self._ended.wait(PERIOD_S):
            try:
                act()
            except Exception:
                log.exception("a periodic check of the operators failed; it continues")
