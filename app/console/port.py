"""A port for the console, or the refusal that the command line shows. Imports nothing that takes a
second."""

from __future__ import annotations

import socket

from navcore.errors import BadConfiguration
from web.listening import PortInUse, reserve


def taken_port(host: str, port: int) -> socket.socket:
    """Bound and listening; raises `BadConfiguration` with the port and the remedy."""
    try:
        return reserve(host, port)
    except PortInUse as error:
        raise BadConfiguration(str(error)) from None
