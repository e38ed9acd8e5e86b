"""Check of a request's Host and Origin."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ipaddress import IPv4Address, IPv6Address, ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Scope

from web.gateway.problems import problem


def check_origin(scope: Scope, headers: Headers, allowed_hosts: frozenset[str]) -> Response | None:
    """Return 421 for a foreign name (DNS rebinding), 403 for a foreign page, 404 for a path with
    control characters; None for none. CORS rules do not cover websockets; this check does.

    A router matches a path that ends in a line feed with the route without it, so that permissions
    would be checked for another path than the one that is served.
    """
    host = (single(headers.getlist("host")) or "").lower()
    names = {host, _without_port(host)}
    if not host or not (names & allowed_hosts or _is_local_address(_without_port(host), scope)):
        return problem(
            421, "foreign_host", "this console does not answer under that name", "header Host"
        )
    if not _is_own_origin(headers, host) or _is_foreign_fetch(headers, scope):
        return problem(
            403, "foreign_origin", "requests from other web pages are refused", "header Origin"
        )
    if not scope["path"].isprintable():
        return problem(404, "not_found", "no path of this console has control characters")
    return None


def single(values: Sequence[str]) -> str | None:
    """Return the only value; None for none, or for several, which may contradict each other."""
    return values[0] if len(values) == 1 else None


def _without_port(host: str) -> str:
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdigit() else host


def _is_local_address(name: str, scope: Scope) -> bool:
    """Return whether a name is the IP address that the connection came to, in figures. A network
    may give the machine another address at any time, and DNS rebinding needs a name."""
    local = _address((scope.get("server") or ("",))[0].partition("%")[0])
    return local is not None and _address(name.removeprefix("[").removesuffix("]")) == local


def _address(text: str) -> IPv4Address | IPv6Address | None:
    try:
        address = ip_address(text)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def _is_own_origin(headers: Headers, host: str) -> bool:
    """Return whether all named origins are the console; programs name none."""
    origins: Iterable[str] = headers.getlist("origin")
    return all(_netloc(origin) == host for origin in origins)


def _netloc(origin: str) -> str | None:
    try:
        parts = urlsplit(origin.lower())
    except ValueError:
        return None
    return (
        parts.netloc
        if parts.scheme in ("http", "https")
        and origin.lower() == f"{parts.scheme}://{parts.netloc}"
        else None
    )


def _is_foreign_fetch(headers: Headers, scope: Scope) -> bool:
    """Return whether another page embeds a resource of the console: browsers then name no origin
    but send `Sec-Fetch-Site`."""
    if headers.get("sec-fetch-site") not in ("cross-site", "same-site"):
        return False
    opened = scope["type"] == "http" and scope["method"] == "GET"
    return not (opened and headers.get("sec-fetch-dest") == "document")
