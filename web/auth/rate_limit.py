"""Rate limit of passwords: a few tries at once, then one per period; by address and for all
together."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import TypeVar

from starlette.types import Scope

from navcore.errors import Refused

BURST, PERIOD_S = 5, 6.0
"""Tries at once, and seconds per further try, of one address."""
FOR_ALL = 10
"""Factor of the rate of all addresses together: many addresses gain little."""
MAX_ADDRESSES = 10_000
"""Largest number of remembered addresses."""
_ALL = ""
_Found = TypeVar("_Found")


def address_of(scope: Scope) -> str:
    """Return the address that a request comes from."""
    return str((scope.get("client") or ("?", 0))[0])


def network_of(address: str) -> str:
    """Return what counts as one address: of IPv6 the network of 64 bits, which one host may have to
    itself."""
    try:
        host = ip_address(address)
    except ValueError:
        return address
    if isinstance(host, IPv4Address):
        return address
    return str(host.ipv4_mapped or IPv6Address(int(host) >> 64 << 64))


class TooManyTries(Refused):
    """Refusal of a try before its time."""

    def __init__(self, wait_s: int) -> None:
        """`wait_s`: time until the next try is allowed, seconds."""
        super().__init__(f"Too many tries; wait {wait_s} s.")
        self.wait_s = wait_s


class RateLimiter:
    """Leaky bucket per address, and one for all addresses together, but for the account that a try
    from an address was successful for before; a successful try is refunded. Safe from any thread.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._full_until: OrderedDict[str, float] = OrderedDict()
        self._known: OrderedDict[tuple[str, str], None] = OrderedDict()

    def wait_s(self, address: str, account: str = "") -> int:
        """Return 0 and count a try of an account's password, or the whole seconds until the next
        try is allowed."""
        address, now = network_of(address), self._clock()
        with self._lock:
            buckets = self._buckets(address, account)
            wait_s = max(self._excess_s(key, every_s, now) for key, every_s in buckets)
            if wait_s > 0:
                return math.ceil(wait_s)
            for key, every_s in buckets:
                self._fill(key, every_s, now)
            while len(self._full_until) > MAX_ADDRESSES:
                self._full_until.popitem(last=False)
        return 0

    def refund(self, address: str, account: str = "") -> None:
        """Take back the count of a try, because it was none."""
        with self._lock:
            for key, every_s in self._buckets(network_of(address), account):
                if key in self._full_until:
                    self._full_until[key] -= every_s

    def succeed(self, address: str, account: str = "") -> None:
        """Take back the count of a try, because it was successful; bad tries from ever new
        addresses do not hold up the next one of this account from this address."""
        self.refund(address, account)
        known = (account, network_of(address))
        with self._lock:
            self._known[known] = None
            self._known.move_to_end(known)
            while len(self._known) > MAX_ADDRESSES:
                self._known.popitem(last=False)

    def _buckets(self, address: str, account: str) -> list[tuple[str, float]]:
        """Return the buckets that a try from an address counts in, each with its period."""
        for_all = [] if (account, address) in self._known else [(_ALL, PERIOD_S / FOR_ALL)]
        return [(address, PERIOD_S), *for_all]

    def _excess_s(self, key: str, every_s: float, now: float) -> float:
        return (
            self._full_until.get(key, now)
            - now
            - (BURST - 1) * every_s * (FOR_ALL if key == _ALL else 1)
        )

    def _fill(self, key: str, every_s: float, now: float) -> None:
        self._full_until[key] = max(self._full_until.get(key, now), now) + every_s
        self._full_until.move_to_end(key)


class PasswordTries:
    """Tries of passwords, limited in rate and one at a time, because hashing is slow and needs
    memory on purpose. For one event loop."""

    def __init__(self, limiter: RateLimiter | None = None) -> None:
        self._limiter = limiter or RateLimiter()
        self._one_at_a_time = asyncio.Semaphore(1)

    async def attempt(self, address: str, check: Callable[[], _Found], *, account: str) -> _Found:
        """Return what `check` returns in a thread, something true for the right password of an
        account; raises `TooManyTries`, and what `check` raises, which is about something else than
        the password: that counts as no try."""
        wait_s = self._limiter.wait_s(address, account)
        if wait_s:
            raise TooManyTries(wait_s)
        async with self._one_at_a_time:
            try:
                found = await asyncio.to_thread(check)
            except Exception:
                self._limiter.refund(address, account)
                raise
        if found:
            self._limiter.succeed(address, account)
        return found
