"""The console's port, taken before anything slow is begun: whether it is free is the first thing
that a start finds out."""

from __future__ import annotations

import socket


class PortInUse(OSError):  # noqa: N818 - named after what is wrong, as in navcore
    """Another program listens where the console should; the text says what to do."""


def reserve(host: str, port: int) -> socket.socket:
    """A bound and listening socket; close it, or use it as a context. Raises `PortInUse`, which
    names port and remedy."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise PortInUse(
            f"the console cannot listen on {host}:{port}: {error.strerror}; end the program that uses the port, or choose "
            "another one with --port"
        ) from None
    listener.set_inheritable(False)
    return listener
