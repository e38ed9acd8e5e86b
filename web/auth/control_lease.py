"""Control of the robot: a lease that one client holds at a time.

The first client that drives while the lease is free gets it, so that a single page needs no extra
step. Other clients ask for it or take it, and all of them see that. The lease of a client without a
sign of life expires after some seconds of the monotonic clock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from navcore.errors import Refused
from web.auth.roles import Role, Visitor

PAGE_LEASE_S = 3.0
"""Duration of a page's lease in seconds; a page renews it twice a second."""
PROGRAM_LEASE_S = 30.0
"""Duration of a program's lease in seconds; its requests renew it, but for those that read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlLease:
    """Present holder of control; a new value with every change."""

    serial: int = 0
    """Number of changes."""
    holder: Visitor | None = None
    """Visitor in control; None for none."""
    asking: Visitor | None = None
    """Visitor who asked for control last, and has not left since; None for none."""
    before: Visitor | None = None
    """Visitor who was in control before; None for none."""
    taken: bool = False
    """Whether the holder took control without being given it."""

    def is_held_by(self, visitor: Visitor) -> bool:
        """Return whether a visitor is in control."""
        return self.holder is not None and self.holder.client_id == visitor.client_id

    def is_asked_by(self, visitor: Visitor) -> bool:
        """Return whether a visitor asked for control last."""
        return self.asking is not None and self.asking.client_id == visitor.client_id


class NotInControl(Refused):
    """Refusal of a client that does not hold the lease."""


class ControlLeases:
    """Lease of control over time; safe from any thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._lease = ControlLease()
        self._until_s = self._asking_until_s = 0.0

    @property
    def now(self) -> ControlLease:
        """Present lease; an expired one has no holder."""
        with self._lock:
            self._expire()
            return self._lease

    def claim(self, visitor: Visitor) -> None:
        """Take a free lease or renew an own one before driving; raises `NotInControl` when another
        client holds it."""
        with self._lock:
            self._expire()
            holder = self._lease.holder
            if holder is None:
                self._give(visitor, taken=False)
            elif not self._lease.is_held_by(visitor):
                raise NotInControl(f"{holder.name} is in control; ask for it, or take over")
            self._renew(visitor)

    def heartbeat(self, visitor: Visitor) -> None:
        """Renew the lease if the visitor holds it, and the wish for it if the visitor asked, and
        still may."""
        with self._lock:
            self._expire()
            if not visitor.role.may(Role.OPERATOR):
                return
            if self._lease.is_held_by(visitor):
                self._renew(visitor)
            elif self._lease.is_asked_by(visitor):
                self._asking_until_s = self._end_s(visitor)

    def keep(self, visitor: Visitor) -> None:
        """Renew the lease; raises `NotInControl` when the visitor does not hold it."""
        with self._lock:
            self._expire()
            if not self._lease.is_held_by(visitor):
                raise NotInControl("only the one in control can keep it")
            self._renew(visitor)

    def take(self, visitor: Visitor) -> None:
        """Take control, even from another client."""
        with self._lock:
            self._expire()
            if not self._lease.is_held_by(visitor):
                self._give(visitor, taken=self._lease.holder is not None)
            self._renew(visitor)

    def ask(self, visitor: Visitor) -> None:
        """Ask the holder for control; a free lease is given at once. The wish expires as a lease
        does: control is handed over to none who has left."""
        with self._lock:
            self._expire()
            if self._lease.holder is None:
                self._give(visitor, taken=False)
                self._renew(visitor)
            elif not self._lease.is_held_by(visitor):
                self._asking_until_s = self._end_s(visitor)
                self._change(replace(self._lease, asking=visitor))

    def give(self, visitor: Visitor) -> None:
        """Give control to the client that asked, or free the lease; raises `NotInControl` when the
        visitor does not hold it."""
        with self._lock:
            self._expire()
            if not self._lease.is_held_by(visitor):
                raise NotInControl("only the one in control can hand it over")
            asking = self._lease.asking
            if asking is None:
                self._change(ControlLease(before=visitor))
            else:
                self._give(asking, taken=False)
                self._renew(asking)

    def _give(self, visitor: Visitor, *, taken: bool) -> None:
        assert visitor.role.may(Role.OPERATOR)
        self._change(ControlLease(holder=visitor, before=self._lease.holder, taken=taken))

    def _renew(self, visitor: Visitor) -> None:
        self._until_s = self._end_s(visitor)

    def _end_s(self, visitor: Visitor) -> float:
        is_program = visitor.client_id.startswith("program")
        return self._clock() + (PROGRAM_LEASE_S if is_program else PAGE_LEASE_S)

    def _expire(self) -> None:
        if self._lease.holder is not None and self._clock() > self._until_s:
            self._change(ControlLease(before=self._lease.holder))
        elif self._lease.asking is not None and self._clock() > self._asking_until_s:
            self._change(replace(self._lease, asking=None))

    def _change(self, lease: ControlLease) -> None:
        self._lease = replace(lease, serial=self._lease.serial + 1)
