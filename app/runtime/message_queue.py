"""A non-blocking sender over a pipe that keeps only the newest message per key."""

from __future__ import annotations

import threading
from collections import OrderedDict
from multiprocessing.connection import Connection

MAX_WAITING = 1000
"""Largest number of messages that wait; the oldest is dropped."""
JOIN_S = 1.0
"""Longest wait for the end of the thread, seconds."""


class LatestMessageQueue:
    """A thread that sends messages; a receiver that hangs never blocks `post`."""

    def __init__(self, link: Connection, name: str) -> None:
        self._link = link
        self._waiting: OrderedDict[str, bytes] = OrderedDict()
        self._news = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._send, name=name, daemon=True)
        self._thread.start()

    def post(self, key: str, message: bytes) -> None:
        """Send a message as soon as the pipe takes it, replacing a waiting one under its key."""
        with self._news:
            self._waiting[key] = message
            while len(self._waiting) > MAX_WAITING:
                self._waiting.popitem(last=False)
            self._news.notify()

    def close(self) -> None:
        """Send the waiting messages if the pipe takes them, and end the thread."""
        with self._news:
            self._ended = True
            self._news.notify()
        self._thread.join(JOIN_S)

    def _send(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or self._ended)
                if not self._waiting:
                    return
                _, message = self._waiting.popitem(last=False)
            try:
                self._link.send_bytes(message)
            except (OSError, ValueError):
                return  # the receiver is gone: frames stop coming, so the gate stops the robot
