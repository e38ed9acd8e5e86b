"""Rate limit of log-ins: a few tries at once, then one per period; by address and for all
together."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

BURST, PERIOD_S = 5, 6.0
"""Tries at once, and seconds per further try, of one address."""
FOR_ALL = 10
"""Factor of the rate of all addresses together: many addresses gain little."""
MAX_ADDRESSES = 10_000
"""Largest number of remembered addresses."""
_ALL = ""


class RateLimiter:
    """Leaky bucket per address; a successful try is refunded. Safe from any thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._full_until: OrderedDict[str, float] = OrderedDict()

    def wait_s(self, address: str) -> int:
        """Return 0 and count a try, or the whole seconds until the next try is allowed."""
        now = self._clock()
        with self._lock:
            waits = [
                self._excess_s(address, PERIOD_S, now),
                self._excess_s(_ALL, PERIOD_S / FOR_ALL, now),
            ]
            if max(waits) > 0:
                return math.ceil(max(waits))
            self._fill(address, PERIOD_S, now)
            self._fill(_ALL, PERIOD_S / FOR_ALL, now)
            while len(self._full_until) > MAX_ADDRESSES:
                self._full_until.popitem(last=False)
        return 0

    def refund(self, address: str) -> None:
        """Empty the bucket of an address after a successful try."""
        with self._lock:
            self._full_until.pop(address, None)

    def _excess_s(self, key: str, every_s: float, now: float) -> float:
        return (
            self._full_until.get(key, now)
            - now
            - (BURST - 1) * every_s * (FOR_ALL if key == _ALL else 1)
        )

    def _fill(self, key: str, every_s: float, now: float) -> None:
        self._full_until[key] = max(self._full_until.get(key, now), now) + every_s
        self._full_until.move_to_end(key)
