"""The operator console: HTTP API, websockets, 3D view, page, and the guard in front of them all.

The names below are the public ones; they load on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from web.auth.access import Access as Access
    from web.interface.insight import Diagnostics as Diagnostics
    from web.interface.operations import RobotService as RobotService
    from web.interface.snapshots import State as State
    from web.interface.snapshots import TickSnapshot as TickSnapshot
    from web.server import ConsoleServer as ConsoleServer
    from web.server import create_app as create_app

_HOMES = {
    "Access": "web.auth.access",
    "ConsoleServer": "web.server",
    "Diagnostics": "web.interface.insight",
    "RobotService": "web.interface.operations",
    "State": "web.interface.snapshots",
    "TickSnapshot": "web.interface.snapshots",
    "create_app": "web.server",
}

__all__ = [
    "Access",
    "ConsoleServer",
    "Diagnostics",
    "RobotService",
    "State",
    "TickSnapshot",
    "create_app",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'web' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
