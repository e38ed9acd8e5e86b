"""The one door: what every request and every websocket upgrade must satisfy before any handler runs.

1. Host is one the operator has allowed, so that a foreign name that resolves here (DNS rebinding) gets nothing.
2. Origin, where a browser names one, is the console itself. CORS rules do not cover websockets; this does.
3. When a token is set: a bearer header or the session cookie that the login page gives.
4. The body is bounded.

It is plain ASGI and wraps the whole app, so a route cannot forget it.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import logging
from collections.abc import Iterable, Sequence
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from web.problems import problem

log = logging.getLogger(__name__)

MAX_BODY_BYTES = 1_000_000
BODY_TIMEOUT_S = 10.0
COOKIE = "bewarenav_session"
LOGIN_PATH = "/login"
POLICY_VIOLATION = 1008

_OWN_CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "frame-src 'self'; font-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'self'"
)
# viser's page is one file with inline scripts, workers made from blobs, and WebAssembly.
_VIEWER_CSP = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:; "
    "base-uri 'none'; frame-ancestors 'self'"
)
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Guard:
    """ASGI middleware; see the module's text."""

    def __init__(self, app: ASGIApp, *, allowed_hosts: Sequence[str], token: str | None = None) -> None:
        self._app = app
        self._hosts = frozenset(host.lower() for host in allowed_hosts)
        self._token = token
        self._session = _session_of(token) if token else None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, or hand on to the app."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        answer = self._refusal(scope)
        if scope["type"] == "websocket":
            await (self._app(scope, receive, send) if answer is None else _refuse_upgrade(receive, send))
            return
        send = _with_headers(send, scope)
        logging_in = answer is not None and answer.status_code == 401 and _is_login(scope)
        if answer is None or logging_in:
            body = await _bounded_body(scope, receive)
            if isinstance(body, Response):
                answer = body
            elif logging_in:
                answer = self._login(scope, body)
            else:
                receive = _replayed(body, receive)
        await (self._app if answer is None else answer)(scope, receive, send)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = (_only(headers.getlist("host")) or "").lower()
        if not host or not self._is_allowed(host):
            return problem(421, "foreign_host", "this console does not answer under that name", "header Host")
        if not _is_own_origin(headers, host) or _is_foreign_fetch(headers, scope):
            return problem(403, "foreign_origin", "requests from other web pages are refused", "header Origin")
        if self._token is None or self._is_known(headers):
            return None
        return self._login_page(scope, headers)

    def _is_allowed(self, host: str) -> bool:
        return host in self._hosts or _without_port(host) in self._hosts

    def _is_known(self, headers: Headers) -> bool:
        assert self._token is not None and self._session is not None
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and _same(given.strip(), self._token):
            return True
        return _same(cookie_parser(headers.get("cookie", "")).get(COOKIE, ""), self._session)

    def _login_page(self, scope: Scope, headers: Headers) -> Response:
        """401; for a browser that asks for the page itself, with a form. `/?token=…` logs in by a link."""
        if scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/":
            given = _only(parse_qs(scope["query_string"].decode("latin-1")).get("token", []))
            if given is not None and self._token is not None and _same(given, self._token):
                return self._logged_in(scope)
            if "text/html" in headers.get("accept", ""):
                return HTMLResponse(_page(failed=given is not None), status_code=401)
        problem_headers = {"WWW-Authenticate": "Bearer"}
        return problem(401, "login_needed", "log in at / or send the token as a bearer", headers=problem_headers)

    def _login(self, scope: Scope, body: bytes) -> Response:
        """The form of the login page was sent."""
        given = _only(parse_qs(body.decode("utf-8", "replace")).get("token", []))
        if given is not None and self._token is not None and _same(given, self._token):
            return self._logged_in(scope)
        return HTMLResponse(_page(failed=True), status_code=401)

    def _logged_in(self, scope: Scope) -> Response:
        # A page that goes on by itself, not a redirect: after a redirect from elsewhere a strict cookie is not sent.
        response = HTMLResponse('<!doctype html><meta http-equiv="refresh" content="0; url=/"><title>Logged in</title>')
        assert self._session is not None
        secure = scope.get("scheme") in ("https", "wss")
        response.set_cookie(COOKIE, self._session, httponly=True, samesite="strict", secure=secure, path="/")
        return response


def _session_of(token: str) -> str:
    # Derived, so that the cookie is not the token, and a restart of the console logs nobody out.
    return hmac.new(token.encode(), b"bewarenav session", hashlib.sha256).hexdigest()


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "surrogatepass"), expected.encode())


def _only(values: Sequence[str]) -> str | None:
    return values[0] if len(values) == 1 else None


def _without_port(host: str) -> str:
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdigit() else host


def _is_own_origin(headers: Headers, host: str) -> bool:
    """A browser names the origin of scripts and forms; a program need not."""
    origins: Iterable[str] = headers.getlist("origin")
    return all(_netloc(origin) == host for origin in origins)


def _netloc(origin: str) -> str | None:
    try:
        parts = urlsplit(origin.lower())
    except ValueError:
        return None
    return parts.netloc if parts.scheme in ("http", "https") and origin.lower() == f"{parts.scheme}://{parts.netloc}" else None


def _is_foreign_fetch(headers: Headers, scope: Scope) -> bool:
    """A picture or script of the console embedded in another page: browsers say so though they name no origin."""
    if headers.get("sec-fetch-site") not in ("cross-site", "same-site"):
        return False
    opened = scope["type"] == "http" and scope["method"] == "GET"
    return not (opened and headers.get("sec-fetch-dest") == "document")


def _is_login(scope: Scope) -> bool:
    return (scope["type"], scope.get("method"), scope["path"]) == ("http", "POST", LOGIN_PATH)


async def _refuse_upgrade(receive: Receive, send: Send) -> None:
    await receive()
    await send({"type": "websocket.close", "code": POLICY_VIOLATION})


async def _bounded_body(scope: Scope, receive: Receive) -> bytes | Response:
    """The whole body, or the refusal of one that is too large or too slow."""
    if scope["method"] in ("GET", "HEAD", "OPTIONS"):
        return b""
    too_large = problem(413, "too_large", f"a body may have at most {MAX_BODY_BYTES} bytes", "body")
    length = Headers(scope=scope).get("content-length", "0")
    if not length.isdigit() or len(length) > 12 or int(length) > MAX_BODY_BYTES:
        return too_large
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_TIMEOUT_S):
            while True:
                message = await receive()
                body += message.get("body", b"")
                if len(body) > MAX_BODY_BYTES:
                    return too_large
                if message["type"] != "http.request" or not message.get("more_body"):
                    return bytes(body)
    except TimeoutError:
        return problem(408, "too_slow", f"the body did not arrive within {BODY_TIMEOUT_S:g} s", "body")


def _replayed(body: bytes, receive: Receive) -> Receive:
    waiting = [body]

    async def replay() -> Message:
        if waiting:
            return {"type": "http.request", "body": waiting.pop(), "more_body": False}
        return await receive()

    return replay


def _with_headers(send: Send, scope: Scope) -> Send:
    policy = _VIEWER_CSP if scope["path"].startswith("/viewer") else _OWN_CSP

    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.update({**_HEADERS, "Content-Security-Policy": policy})
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return guarded


def _page(*, failed: bool) -> str:
    note = '<p role="alert"><strong>That token is wrong.</strong></p>' if failed else ""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Log in</title><link rel="icon" href="data:,">'
        f'<h1>Operator console</h1>{note}<form method="post" action="{LOGIN_PATH}"><label>Token '
        '<input name="token" type="password" autocomplete="current-password" autofocus required></label> '
        "<button>Log in</button></form></html>"
    )
