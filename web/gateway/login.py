"""Log-in and log-out by a page that works without scripts, in the language of the browser."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import Scope

from web.auth.audit import Auditor
from web.auth.authenticator import PasswordAuthenticator
from web.auth.rate_limit import TooManyTries, address_of
from web.gateway.origin_check import single
from web.gateway.problems import problem
from web.languages.catalog import CATALOGS, language_of

LOGIN_PATH = "/login"
_SOURCE = Path(__file__).with_name("login.html").read_text(encoding="utf-8")
_PAGES = {language: catalog.page(_SOURCE) for language, catalog in CATALOGS.items()}
_STYLE = _SOURCE.partition("<style>")[2].partition("</style>")[0]
_STYLE_HASH = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
_CSP = (
    f"default-src 'none'; style-src 'sha256-{_STYLE_HASH}'; img-src data:; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)


class Login:
    """Log-in of unknown visitors."""

    def __init__(self, authenticator: PasswordAuthenticator, auditor: Auditor) -> None:
        self._authenticator, self._auditor = authenticator, auditor

    def ask(self, scope: Scope, accept: str) -> Response:
        """Return 401, with the log-in form for a browser."""
        if scope["type"] == "http" and scope["method"] == "GET" and "text/html" in accept:
            return _page(scope)
        headers = {"WWW-Authenticate": "Bearer"}
        return problem(
            401, "login_needed", "log in at / or send a user's token as a bearer", headers=headers
        )

    async def attempt(self, scope: Scope, body: bytes, cookie_name: str) -> Response:
        """Return the answer to a sent form with name and password."""
        form = parse_qs(body.decode("utf-8", "replace"))
        name, password = single(form.get("name", [])) or "", single(form.get("password", [])) or ""
        address, authenticator = address_of(scope), self._authenticator
        words = CATALOGS[language_of(Headers(scope=scope))]
        try:
            cookie = await authenticator.tries.attempt(
                address, lambda: authenticator.log_in(name, password), account=name
            )
        except TooManyTries as error:
            return _page(
                scope,
                words.text("Too many tries; wait {wait_s} s.", wait_s=error.wait_s),
                status=429,
                headers={"Retry-After": str(error.wait_s)},
            )
        # A password that was typed as the name must not be readable in the log.
        who = name if authenticator.knows(name) else "unknown"
        status = 401 if cookie is None else 200
        await self._auditor.note(
            {"who": who, "method": "POST", "path": LOGIN_PATH, "status": status, "from": address}
        )
        if cookie is None:
            return _page(scope, words.text("That name or password is wrong."))
        response = RedirectResponse("/", status_code=303)
        response.headers.append("Set-Cookie", cookie_header(cookie_name, cookie, scope))
        return response

    def log_out(self, cookie: str, cookie_name: str) -> Response:
        """Return the answer to a log-out."""
        self._authenticator.sessions.end(cookie)
        response = RedirectResponse("/", status_code=303)
        response.delete_cookie(cookie_name, path="/", httponly=True, samesite="strict")
        return response


def cookie_header(name: str, value: str, scope: Scope) -> str:
    """Return a cookie that no script can read and no other page can send."""
    response = Response()
    secure = scope.get("scheme") in ("https", "wss")
    response.set_cookie(name, value, httponly=True, samesite="strict", secure=secure, path="/")
    return response.headers["set-cookie"]


def _page(
    scope: Scope, note: str = "", *, status: int = 401, headers: dict[str, str] | None = None
) -> Response:
    language = language_of(Headers(scope=scope))
    said = f'<p role="alert">▲ {note}</p>' if note else ""
    page = _PAGES[language].replace("<!--note-->", said).replace('lang="en"', f'lang="{language}"')
    response = HTMLResponse(page, status_code=status, headers=headers)
    response.headers["Content-Security-Policy"] = _CSP
    return response
