"""How often somebody may try a password: a few times at once, then once in a few seconds; per
address and for all together."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

BURST, PERIOD_S = 5, 6.0
FOR_ALL = 10
"""So many times as much for all addresses together; whoever has many does not get much farther."""
MAX_ADDRESSES = 10_000
_ALL = ""


class RateLimiter:
    """A leaky bucket per address. A try that succeeds gives its own back. Safe to use from any
    thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._full_until: OrderedDict[str, float] = OrderedDict()

    def wait_s(self, address: str) -> int:
        """0 and one try fewer, or whole seconds after which the next is allowed."""
        now = self._clock()
        with self._lock:
            waits = [
                self._over_s(address, PERIOD_S, now),
                self._over_s(_ALL, PERIOD_S / FOR_ALL, now),
            ]
            if max(waits) > 0:
                return math.ceil(max(waits))
            self._pour(address, PERIOD_S, now)
            self._pour(_ALL, PERIOD_S / FOR_ALL, now)
            while len(self._full_until) > MAX_ADDRESSES:
                self._full_until.popitem(last=False)
        return 0

    def refund(self, address: str) -> None:
        """The password was right."""
        with self._lock:
            self._full_until.pop(address, None)

    def _over_s(self, key: str, every_s: float, now: float) -> float:
        return (
            self._full_until.get(key, now)
            - now
            - (BURST - 1) * every_s * (FOR_ALL if key == _ALL else 1)
        )

    def _pour(self, key: str, every_s: float, now: float) -> None:
        self._full_until[key] = max(self._full_until.get(key, now), now) + every_s
        self._full_until.move_to_end(key)
