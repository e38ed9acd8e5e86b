"""Refusals in one shape: the fields of RFC 9457 and `{"error": {"code", "message", "where"}}`,
never the input itself.

FastAPI's own 422 echoes what was sent; NaN, 1e999 and lone surrogates in an echo cannot be written
as JSON and turn the refusal into a 500. So an answer holds position and reason only.
"""

from __future__ import annotations

import json
import logging
import math
import threading
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic.json_schema import models_json_schema
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from navcore.errors import (
    AlreadyThere,
    BadConfiguration,
    BadGeometry,
    BewareNavError,
    BlockedGoal,
    CrossedOutline,
    NeedsForce,
    NotKnown,
    OtherSite,
    Outdated,
    Refused,
    StorageFailed,
)
from web.auth.permissions import SAFE, STOP
from web.gateway.sentences import sentence_of
from web.schemas.problem import Problem, ProblemBody

log = logging.getLogger(__name__)

MAX_WHERE, MAX_MESSAGE = 120, 600
"""Largest lengths of texts in a refusal, characters."""
MEDIA_TYPE = "application/problem+json"
"""Media type of refusals, by RFC 9457."""
_SCHEMAS = "#/components/schemas/{model}"
_TAGS = ("Feature", "plain", "Polygon", "Point", "LineString")

# The first match applies, so a subclass comes before its parent.
_STATUS: tuple[tuple[type[BewareNavError], int, str], ...] = (
    (BadGeometry, HTTPStatus.UNPROCESSABLE_ENTITY, "bad_geometry"),
    (BadConfiguration, HTTPStatus.UNPROCESSABLE_ENTITY, "bad_value"),
    (NotKnown, HTTPStatus.NOT_FOUND, "not_known"),
    (Outdated, HTTPStatus.CONFLICT, "outdated"),
    (AlreadyThere, HTTPStatus.CONFLICT, "already_there"),
    (NeedsForce, HTTPStatus.CONFLICT, "needs_force"),
    (OtherSite, HTTPStatus.CONFLICT, "other_site"),
    (Refused, HTTPStatus.CONFLICT, "refused"),
    (StorageFailed, HTTPStatus.SERVICE_UNAVAILABLE, "storage_failed"),
)

RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {
        "description": text,
        "content": {MEDIA_TYPE: {"schema": {"$ref": _SCHEMAS.format(model="Problem")}}},
    }
    for status, text in (
        (404, "Nothing has this id, or no value is known yet"),
        (
            409,
            "Refused in the present state, without control or at another site, or changed by "
            "another operator meanwhile (then both versions are in the body)",
        ),
        (422, "A value is wrong; the answer names it and the reason"),
        (429, "Too many tries of a password; `Retry-After` says how many seconds to wait"),
        (503, "The store failed; the values stored before are intact"),
    )
}
"""Refusals by status, for OpenAPI: by reference, since a model of its own for each refusal of each
route takes more time than all the rest of a start."""


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the description of some refusals for OpenAPI."""
    return {status: RESPONSES[status] for status in statuses}


class JsonResponse(Response):
    """JSON that can always be written: text that is not Unicode is escaped, and a number that is
    not finite becomes null."""

    media_type = "application/json"

    def render(self, content: Any) -> bytes:
        """Return the bytes of JSON."""
        try:
            return to_json(content, inf_nan_mode="null")
        except ValueError:  # a lone surrogate cannot be written but as ASCII
            return json.dumps(finite(content), separators=(",", ":")).encode()


class ProblemResponse(JsonResponse):
    """Refusal by RFC 9457."""

    media_type = MEDIA_TYPE


def finite(value: Any) -> Any:
    """Return plain values with null for each number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def problem(
    status: int,
    code: str,
    message: str,
    where: str | None = None,
    *,
    extra: Mapping[str, Any] | None = None,
    headers: Mapping[str, str] | None = None,
) -> ProblemResponse:
    """Return a refusal; see `web.schemas.problem.Problem`."""
    text = _clean(message, MAX_MESSAGE)
    body = Problem(
        type="about:blank",
        title=HTTPStatus(status).phrase,
        status=int(status),
        detail=text,
        error=ProblemBody(
            code=code, message=text, where=_clean(where, MAX_WHERE) if where else None
        ),
    )
    return ProblemResponse(
        {**body.model_dump(), **(extra or {})},
        status_code=int(status),
        headers=dict(headers or {}),
    )


def refusal(error: BewareNavError) -> ProblemResponse:
    """Return the answer to a refusal of the system behind the console."""
    for kind, status, code in _STATUS:
        if isinstance(error, kind):
            return problem(status, code, str(error), extra=_more(error))
    return problem(HTTPStatus.BAD_REQUEST, "refused", str(error))


def _more(error: BewareNavError) -> dict[str, Any] | None:
    """Return the nearest free position for a blocked goal, the crossing of an outline."""
    if isinstance(error, BlockedGoal) and error.nearest is not None:
        return {"nearest": _position(error.nearest)}
    if isinstance(error, AlreadyThere):
        return {"there": list(error.names)}
    if isinstance(error, CrossedOutline):
        return {"crossing": _position(error.crossing)}
    return None


def _position(point: tuple[float, float]) -> dict[str, float]:
    return {"x_m": round(point[0], 3), "y_m": round(point[1], 3)}


def install(app: FastAPI) -> None:
    """Make the app answer every refusal in this shape, and describe the shape in OpenAPI."""
    without = app.openapi
    building = threading.Lock()

    def openapi() -> dict[str, Any]:
        with building:
            if app.openapi_schema is None:
                app.openapi_schema = _with_problems(without())
            return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]

    @app.exception_handler(BewareNavError)
    async def _(_: Request, error: BewareNavError) -> Response:
        return refusal(error)

    @app.exception_handler(RequestValidationError)
    async def _(_: Request, error: RequestValidationError) -> Response:
        return _invalid(error.errors())

    @app.exception_handler(HTTPException)
    async def _(_: Request, error: HTTPException) -> Response:
        code = HTTPStatus(error.status_code).phrase.lower().replace(" ", "_")
        return problem(error.status_code, code, str(error.detail), headers=error.headers)


async def answered(app: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
    """Run an app; an error before its answer is answered by 500, and raised again, so that the
    server logs its traceback. A handler of `Exception` would answer outside of the guard: without
    security headers, and past the audit log."""
    is_begun = False

    async def begun(message: Message) -> None:
        nonlocal is_begun
        is_begun = True
        await send(message)

    try:
        await app(scope, receive, begun)
    except Exception:
        if not is_begun:
            said = "the console failed; the robot is not affected, its log says more"
            await problem(500, "internal_error", said)(scope, receive, send)
        raise


def _with_problems(document: dict[str, Any]) -> dict[str, Any]:
    """Return the description of an API with the shape of refusals."""
    _, known = models_json_schema([(Problem, "serialization")], ref_template=_SCHEMAS)
    schemas: dict[str, Any] = document["components"]["schemas"]
    schemas |= known["$defs"]
    # FastAPI names its own shape wherever no refusal of a value is described; none is sent.
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if "422" in operation["responses"]:
                operation["responses"]["422"] = RESPONSES[422]
            if method.upper() not in SAFE and path != STOP:  # of control, and of the site
                operation["responses"]["409"] = RESPONSES[409]
    return document


def _invalid(errors: Sequence[Any]) -> ProblemResponse:
    details = [
        {"where": _where(error.get("loc", ())), "message": _reason(error)} for error in errors[:10]
    ]
    first = details[0] if details else {"where": "body", "message": "is not valid"}
    where = _clean(str(first["where"]), MAX_WHERE)
    unreadable = errors and errors[0].get("type") == "json_invalid"
    message = "The request is not JSON." if unreadable else str(first["message"])
    return problem(
        422, "invalid", message, where, extra={"details": details} if len(details) > 1 else None
    )


def _reason(error: Mapping[str, Any]) -> str:
    kind, place = error.get("type"), _parts(error.get("loc", ()))
    if place == ["body"] and kind not in ("missing", "value_error"):
        return (
            "The request must be a JSON object of Unicode text, sent as Content-Type: "
            "application/json."
        )
    return _clean(sentence_of(error, place), 200)


def _where(location: Sequence[Any]) -> str:
    return _clean(".".join(map(str, _parts(location))), MAX_WHERE)


def _parts(location: Sequence[Any]) -> list[str | int]:
    # The tags of the unions of zones and geometries are not part of the request.
    return [
        part
        for i, part in enumerate(location)
        if not (
            part in _TAGS and i > 0 and location[i - 1] in ("body", "zone", "geometry", "drawn")
        )
    ]


def _clean(text: str, limit: int) -> str:
    """Return text that can be printed: the names of unknown keys come from outside."""
    printable = "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text[: limit + 1])
    return printable if len(printable) <= limit else printable[: limit - 1] + "…"
