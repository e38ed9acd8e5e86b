"""Access to one console: authentication, control of the robot, audit log."""

from __future__ import annotations

from dataclasses import dataclass, field

from web.auth.audit import AuditLog
from web.auth.authenticator import AnonymousAuthenticator, Authenticator, PasswordAuthenticator
from web.auth.control_lease import ControlLeases
from web.auth.users import Users


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Access to one console; by default every client that reaches it has all rights, and one at a
    time drives."""

    authenticator: Authenticator = field(default_factory=AnonymousAuthenticator)
    """Authentication of visitors."""
    control: ControlLeases = field(default_factory=ControlLeases)
    """Control of the robot."""
    audit_log: AuditLog | None = None
    """Audit log; None for none."""

    @staticmethod
    def by_login(users: Users, audit_log: AuditLog | None = None) -> Access:
        """Return access for users who log in or send a token."""
        return Access(authenticator=PasswordAuthenticator(users), audit_log=audit_log)
