"""Sends over a pipe from a thread of its own, so that whoever has something to say never waits for
whoever should listen."""

from __future__ import annotations

import threading
from collections import OrderedDict
from multiprocessing.connection import Connection

MAX_WAITING = 1000
JOIN_S = 1.0


class LatestMessageQueue:
    """Of the messages under one key only the newest waits; a listener that hangs costs memory for
    one of each, not time."""

    def __init__(self, link: Connection, name: str) -> None:
        self._link = link
        self._waiting: OrderedDict[str, bytes] = OrderedDict()
        self._news = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._send, name=name, daemon=True)
        self._thread.start()

    def post(self, key: str, message: bytes) -> None:
        """Send a message as soon as the pipe takes it, instead of any that still waits under the
        same key."""
        with self._news:
            self._waiting[key] = message
            while len(self._waiting) > MAX_WAITING:
                self._waiting.popitem(last=False)
            self._news.notify()

    def close(self) -> None:
        """Send what waits if that is possible at once, and end."""
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
                return  # The other side is gone; frames stop coming, and the gate stops the robot for that reason.
