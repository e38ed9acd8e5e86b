"""Who may come in, what each may do, and who drives."""

from __future__ import annotations

from dataclasses import dataclass, field

from web.auth.audit import AuditLog
from web.auth.authenticator import AnonymousAuthenticator, Authenticator, PasswordAuthenticator
from web.auth.control_lease import ControlLeases
from web.auth.users import Users


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """All of it for one console; by default everybody who reaches it may do everything, one at a
    time drives."""

    authenticator: Authenticator = field(default_factory=AnonymousAuthenticator)
    """How visitors are recognised."""
    control: ControlLeases = field(default_factory=ControlLeases)
    """Who drives."""
    audit_log: AuditLog | None = None
    """Where it is put down who did what; None to forget it."""

    @staticmethod
    def by_login(users: Users, audit_log: AuditLog | None = None) -> Access:
        """Only for those who log in, or send a token."""
        return Access(authenticator=PasswordAuthenticator(users), audit_log=audit_log)
