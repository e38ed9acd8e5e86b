"""Who may come in, what each may do, and who drives."""

from __future__ import annotations

from dataclasses import dataclass, field

from web.auth.audit import Ledger
from web.auth.authenticator import House, LockedHouse, OpenHouse
from web.auth.control_lease import Control
from web.auth.users import Users


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """All of it for one console; by default everybody who reaches it may do everything, one at a
    time drives."""

    house: House = field(default_factory=OpenHouse)
    """How visitors are recognised."""
    control: Control = field(default_factory=Control)
    """Who drives."""
    ledger: Ledger | None = None
    """Where it is put down who did what; None to forget it."""

    @staticmethod
    def by_login(users: Users, ledger: Ledger | None = None) -> Access:
        """Only for those who log in, or send a token."""
        return Access(house=LockedHouse(users), ledger=ledger)
