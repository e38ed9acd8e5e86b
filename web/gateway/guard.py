"""Guard in front of the app: conditions of every request and websocket before any handler runs.

1. Host is an allowed name or the IP address that the connection came to, so that a foreign name
   that resolves to this machine (DNS rebinding) is refused.
2. Origin, if the browser names one, is the console itself.
3. The visitor is authenticated: by session or bearer token, or anonymously on a console of this
   machine alone.
4. The role allows the request; for a request that drives the robot, the visitor is in control, or
   gets control because it is free.
5. The body is bounded. A request that may change something is written to the audit log.

The guard is plain ASGI and wraps the whole app, so that no route can omit it.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Sequence

from fastapi import WebSocketDisconnect
from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from web.auth.audit import Auditor
from web.auth.authenticator import Authenticator, PasswordAuthenticator
from web.auth.control_lease import ControlLeases, NotInControl
from web.auth.permissions import LOGOUT, STOP, is_deliberate, requirement_of
from web.auth.roles import RENEWAL_KEY, SCOPE_KEY, Visitor
from web.gateway.login import LOGIN_PATH, Login, cookie_header
from web.gateway.origin_check import check_origin
from web.gateway.problems import answered, problem
from web.gateway.request_body import Spools, bounded_body, close, replayed
from web.gateway.security_headers import with_headers
from web.gateway.websockets import POLICY_VIOLATION

MAX_SOCKETS = 200
"""Largest number of open websockets of a visitor; a page of the console has four."""


class Guard:
    """ASGI middleware; see the module."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        allowed_hosts: Sequence[str],
        authenticator: Authenticator,
        control: ControlLeases,
        auditor: Auditor,
        spools: Spools,
    ) -> None:
        self._app, self._spools = app, spools
        self._sockets = Counter[str]()
        self._hosts = frozenset(host.lower() for host in allowed_hosts)
        self._authenticator, self._control, self._auditor = authenticator, control, auditor
        self._login = (
            Login(authenticator, auditor)
            if isinstance(authenticator, PasswordAuthenticator)
            else None
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it to the app."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._upgrade(scope, receive, send)
        else:
            if scope["path"] == f"{STOP}/":  # a stop is not redirected: its client may not follow
                scope["path"] = STOP
            await self._request(scope, receive, send)

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, and an error of the guard itself, with the security headers."""
        headers = Headers(scope=scope)
        foreign = check_origin(scope, headers, self._hosts)
        extra = self._client_cookie(scope, headers) if foreign is None else {}
        app = foreign or functools.partial(self._own_request, headers)
        await answered(app, scope, receive, with_headers(send, scope, extra))

    async def _own_request(
        self, headers: Headers, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Answer a request that names no foreign host or origin."""
        if self._login is not None and (scope["method"], scope["path"]) == ("POST", LOGIN_PATH):
            await self._log_in(self._login, scope, receive, send)
            return
        visitor = self._authenticator.authenticate(
            headers, _cookie(scope, headers), renews=is_deliberate(scope["method"], scope["path"])
        )
        app: ASGIApp | None = self._refusal(scope, headers, visitor)
        if visitor is not None:
            send = self._auditor.watching(send, scope, visitor)
            app = app or functools.partial(self._allowed_request, headers, visitor)
        assert app is not None
        await answered(app, scope, receive, send)

    async def _log_in(self, login: Login, scope: Scope, receive: Receive, send: Send) -> None:
        body = await bounded_body(scope, receive, self._spools)
        if isinstance(body, bytes):
            answer = await login.attempt(scope, body, _cookie_name(scope))
        else:
            assert isinstance(body, Response)
            answer = body
        await answer(scope, receive, send)

    async def _allowed_request(
        self, headers: Headers, visitor: Visitor, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Read the body of a request of a visitor with the right to it, and pass it to the app."""
        body = await bounded_body(scope, receive, self._spools)
        if isinstance(body, Response):
            await body(scope, receive, send)
            return
        receive = replayed(body, scope, receive)

        async def send_after_close(message: Message) -> None:
            # Who has the answer may send the next file.
            if not isinstance(body, bytes):
                await close(body)
            await send(message)

        try:
            app = self._claimed(scope, headers, visitor) or self._app
            await app(scope, receive, send_after_close)
        finally:
            if not isinstance(body, bytes):
                await close(body)

    def _refusal(self, scope: Scope, headers: Headers, visitor: Visitor | None) -> Response | None:
        """Return the refusal of an unknown visitor or of a role without the right, or None."""
        if visitor is None:
            assert self._login is not None
            return self._login.ask(scope, headers.get("accept", ""))
        need = requirement_of(scope["method"], scope["path"], scope["query_string"])
        if not visitor.role.may(need.role):
            said = f"{visitor.name} is {_article(visitor.role)}; this needs {_article(need.role)}"
            return problem(403, "not_allowed", said)
        scope[SCOPE_KEY] = visitor
        return None

    def _claimed(self, scope: Scope, headers: Headers, visitor: Visitor) -> Response | None:
        """Return the refusal of a visitor who is not in control but has to be, or the answer to a
        log-out; None for none."""
        if is_deliberate(scope["method"], scope["path"]):
            self._control.heartbeat(visitor)
        if self._login is not None and (scope["method"], scope["path"]) == ("POST", LOGOUT):
            return self._login.log_out(_cookie(scope, headers), _cookie_name(scope))
        if requirement_of(scope["method"], scope["path"], scope["query_string"]).control:
            try:
                self._control.claim(visitor)
            except NotInControl as error:
                return problem(409, "not_in_control", str(error))
        return None

    def _client_cookie(self, scope: Scope, headers: Headers) -> dict[str, str]:
        """Return the cookie header for a browser that opens the page of a console without users."""
        if (scope["method"], scope["path"]) != ("GET", "/"):
            return {}
        client_id = self._authenticator.issue_client_cookie(_cookie(scope, headers))
        return (
            {}
            if client_id is None
            else {"Set-Cookie": cookie_header(_cookie_name(scope), client_id, scope)}
        )

    async def _upgrade(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        visitor = None
        if check_origin(scope, headers, self._hosts) is None:
            visitor = self._authenticator.authenticate(headers, _cookie(scope, headers))
        if (
            visitor is None
            or not visitor.role.may(requirement_of("GET", scope["path"]).role)
            or self._sockets[_counted(visitor)] >= MAX_SOCKETS
        ):
            await receive()
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        scope[SCOPE_KEY] = visitor
        scope[RENEWAL_KEY] = functools.partial(
            self._authenticator.authenticate, headers, _cookie(scope, headers), renews=True
        )
        one = Counter([_counted(visitor)])
        self._sockets += one
        try:
            await self._app(scope, *self._while_known(scope, headers, visitor, receive, send))
        finally:
            self._sockets -= one

    def _while_known(
        self, scope: Scope, headers: Headers, visitor: Visitor, receive: Receive, send: Send
    ) -> tuple[Receive, Send]:
        """Return both directions of a connection; they close when the visitor is no longer
        authenticated as when it was opened. Names may change: two pages must not have the same."""

        def known() -> bool:
            now = self._authenticator.authenticate(headers, _cookie(scope, headers))
            return now is not None and (now.client_id, now.role) == (
                visitor.client_id,
                visitor.role,
            )

        async def receive_if_known() -> Message:
            message = await receive()
            return (
                message if known() else {"type": "websocket.disconnect", "code": POLICY_VIOLATION}
            )

        async def send_if_known(message: Message) -> None:
            if not known():
                await send({"type": "websocket.close", "code": POLICY_VIOLATION})
                raise WebSocketDisconnect(POLICY_VIOLATION)
            await send(message)

        return receive_if_known, send_if_known


def _cookie_name(scope: Scope) -> str:
    # Browsers share cookies among the ports of a machine; two consoles must not log each other out.
    return f"bewarenav_{(scope.get('server') or ('', 0))[1]}"


def _cookie(scope: Scope, headers: Headers) -> str:
    return cookie_parser(headers.get("cookie", "")).get(_cookie_name(scope), "")


def _counted(visitor: Visitor) -> str:
    # The name of a page of a console without users may become that of another one.
    return visitor.name if visitor.logged_in else visitor.client_id


def _article(role: str) -> str:
    return f"{'a' if role == 'viewer' else 'an'} {role}"
