"""ETag with If-Match: an edit names the version it was made from; a lost update is refused. With
If-None-Match: what the client has already is not sent again."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from fastapi import Depends, Header, HTTPException, Request, Response

from web.gateway.problems import ProblemResponse, problem

_ETAG = re.compile(r'"(\d{1,15})"')


def etag(version: int) -> dict[str, str]:
    """Return the header that names a version."""
    return {"ETag": f'"{version}"'}


def unless_known(
    request: Request, tag: str, make: Callable[[], bytes], media_type: str | None
) -> Response:
    """Return what `make` makes, under a quoted ETag; 304 to a client that has it already."""
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(make(), media_type=media_type, headers=headers)


async def _expected(
    if_match: Annotated[str | None, Header(description="ETag of the edited version.")] = None,
) -> int | None:
    if if_match is None or if_match.strip() == "*":
        return None
    matched = _ETAG.fullmatch(if_match.strip())
    if matched is None:
        raise HTTPException(
            400, 'If-Match must be one strong ETag of this resource, e.g. "3", or *'
        )
    return int(matched[1])


ExpectedVersion = Annotated[int | None, Depends(_expected)]
"""Version in `If-Match`; None without the header."""


def outdated(
    what: str, given: int | None, stored: Mapping[str, Any], version: int
) -> ProblemResponse:
    """Return 409 with both versions, so that the second of two operators can compare and retry."""
    message = (
        f"{what} is at version {version}, your edit was made from version {given}; "
        "look at the stored one and edit again"
    )
    extra = {"stored": dict(stored), "stored_version": version, "given_version": given}
    return problem(409, "outdated", message, "If-Match", extra=extra, headers=etag(version))
