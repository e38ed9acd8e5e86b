"""Who drives: one seat at a time. Others watch, ask for it, or take it, and everybody sees that.

Whoever acts first when nobody drives has it, so a single page needs no ceremony. A seat that shows
no sign of life for a few seconds has lost it; the clock is monotonic.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from navcore.errors import Refused
from web.auth.roles import Role, Visitor

PAGE_LEASE_S = 3.0
"""A page answers twice a second; a program lives by its requests."""
PROGRAM_LEASE_S = 30.0
"""A program that waits for something asks now and then, but need not ask twice a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlLease:
    """Who drives now; a new value with every change."""

    serial: int = 0
    """Grows with every change."""
    holder: Visitor | None = None
    """Who is in control; None when nobody is."""
    asking: Visitor | None = None
    """Who has asked for it last."""
    before: Visitor | None = None
    """Who was in control before."""
    taken: bool = False
    """Whether the holder took it from the one before, rather than got it."""


class NotInControl(Refused):
    """Somebody else drives."""


class ControlLeases:
    """Safe to use from any thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._lease = ControlLease()
        self._until_s = 0.0

    @property
    def now(self) -> ControlLease:
        """Who drives, after whoever has gone silent has lost it."""
        with self._lock:
            self._expire()
            return self._lease

    def claim(self, visitor: Visitor) -> None:
        """He is about to drive: nobody else may be in control. Raises `NotInControl` with what to
        do."""
        with self._lock:
            self._expire()
            holder = self._lease.holder
            if holder is None:
                self._give(visitor, taken=False)
            elif holder.client_id != visitor.client_id:
                raise NotInControl(f"{holder.name} is in control; ask for it, or take over")
            self._renew(visitor)

    def is_held_by(self, visitor: Visitor) -> bool:
        """Whether he drives."""
        holder = self.now.holder
        return holder is not None and holder.client_id == visitor.client_id

    def heartbeat(self, visitor: Visitor) -> None:
        """He is still there."""
        with self._lock:
            self._expire()
            if self._lease.holder is not None and self._lease.holder.client_id == visitor.client_id:
                self._renew(visitor)

    def take(self, visitor: Visitor) -> None:
        """Take over, whoever drives."""
        with self._lock:
            self._expire()
            if self._lease.holder is None or self._lease.holder.client_id != visitor.client_id:
                self._give(visitor, taken=self._lease.holder is not None)
            self._renew(visitor)

    def ask(self, visitor: Visitor) -> None:
        """Let the one who drives know that this one would like to; when nobody drives he has it at
        once."""
        with self._lock:
            self._expire()
            if self._lease.holder is None:
                self._give(visitor, taken=False)
                self._renew(visitor)
            elif self._lease.holder.client_id != visitor.client_id:
                self._change(
                    holder=self._lease.holder,
                    asking=visitor,
                    before=self._lease.before,
                    taken=self._lease.taken,
                )

    def give(self, visitor: Visitor) -> None:
        """Hand it to whoever has asked, or to nobody. Raises `NotInControl` when it is not his to
        give."""
        with self._lock:
            self._expire()
            if self._lease.holder is None or self._lease.holder.client_id != visitor.client_id:
                raise NotInControl("only the one in control can hand it over")
            asking = self._lease.asking
            if asking is None:
                self._change(holder=None, before=visitor)
            else:
                self._give(asking, taken=False)
                self._renew(asking)

    def _give(self, visitor: Visitor, *, taken: bool) -> None:
        assert visitor.role.may(Role.OPERATOR)
        self._change(holder=visitor, before=self._lease.holder, taken=taken)

    def _renew(self, visitor: Visitor) -> None:
        self._until_s = self._clock() + (
            PROGRAM_LEASE_S if visitor.client_id.startswith("program") else PAGE_LEASE_S
        )

    def _expire(self) -> None:
        if self._lease.holder is not None and self._clock() > self._until_s:
            self._change(holder=None, before=self._lease.holder)

    def _change(
        self,
        *,
        holder: Visitor | None,
        asking: Visitor | None = None,
        before: Visitor | None = None,
        taken: bool = False,
    ) -> None:
        serial = self._lease.serial + 1
        self._lease = ControlLease(
            serial=serial, holder=holder, asking=asking, before=before, taken=taken
        )
