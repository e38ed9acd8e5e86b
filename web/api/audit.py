"""`GET /api/v1/audit`: who did what, newest first."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import AwareDatetime

from web.auth.audit import AuditLog, is_deep
from web.gateway.problems import JsonResponse
from web.schemas.convert import finite

LARGEST_ID = 2**53


def audit_router(audit_log: AuditLog | None) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["access"], default_response_class=JsonResponse)

    @router.get("/audit")
    def get_audit(
        count: Annotated[int, Query(ge=1, le=1000)] = 100,
        before: Annotated[int | None, Query(ge=0, le=LARGEST_ID)] = None,
        who: Annotated[
            str | None, Query(max_length=60, description="only what this visitor did")
        ] = None,
        since: Annotated[
            AwareDatetime | None, Query(description="with a time zone, e.g. 2026-03-01T08:00:00Z")
        ] = None,
        until: Annotated[AwareDatetime | None, Query(description="the same")] = None,
    ) -> list[dict[str, Any]]:
        """Every request that could change something, with who made it, when (UTC) and how it ended;
        newest first.

        `before` takes the id of the last entry of one answer and gives those that are older.
        """
        entries = (
            []
            if audit_log is None
            else audit_log.newest(count, before=before, who=who, since=since, until=until)
        )
        shown = (
            {**entry, "detail": "nested too deep"} if is_deep(entry.get("detail")) else entry
            for entry in entries
        )
        return [finite(dict(entry)) for entry in shown]

    return router
