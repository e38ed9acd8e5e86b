"""TCP port of the console, reserved before slow start-up work. Imports no slow package."""

from __future__ import annotations

import errno
import socket

from navcore.errors import BadConfiguration


class PortInUse(BadConfiguration):
    """Refusal of a port that another program uses."""


def reserve(host: str, port: int) -> socket.socket:
    """Return a bound and listening socket; close it, or use it as a context.

    Raises `PortInUse`, which names the port and what to do, and `BadConfiguration` for an address
    or a port on which this program cannot listen.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio turns Nagle's algorithm off only where a socket says that it speaks TCP; with it a
    # client waits some 40 ms for the second part of each answer.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        refusal = f"the console cannot listen on {host}:{port}: {error.strerror}"
        if error.errno == errno.EADDRINUSE:
            raise PortInUse(
                f"{refusal}; end the program that uses the port, or choose another one with --port"
            ) from None
        raise BadConfiguration(
            f"{refusal}; choose an address of this machine with --host, or another port with --port"
        ) from None
    listener.set_inheritable(False)
    return listener
