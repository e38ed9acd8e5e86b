"""Route of the audit log."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import AwareDatetime

from web.api.router import api_router
from web.auth.audit import AuditLog, is_deep
from web.auth.audit_text import describe_entry

LARGEST_ID = 2**53


def audit_router(audit_log: AuditLog | None) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("access")

    @router.get("/audit")
    def get_audit(
        count: Annotated[int, Query(ge=1, le=1000)] = 100,
        before: Annotated[int | None, Query(ge=0, le=LARGEST_ID)] = None,
        who: Annotated[
            str | None, Query(max_length=60, description="Only the actions of this visitor.")
        ] = None,
        since: Annotated[
            AwareDatetime | None,
            Query(description="With a time zone, such as 2026-03-01T08:00:00Z."),
        ] = None,
        until: Annotated[AwareDatetime | None, Query(description="With a time zone.")] = None,
    ) -> list[dict[str, Any]]:
        """Return the requests that could change something, newest first, with visitor, time (UTC),
        status, and in `text` what was done in words.

        `before` continues from the id of the last entry of an answer.
        """
        entries = (
            []
            if audit_log is None
            else audit_log.newest(count, before=before, who=who, since=since, until=until)
        )
        return [
            {
                **entry,
                **({"detail": "nested too deep"} if is_deep(entry.get("detail")) else {}),
                "text": describe_entry(entry),
            }
            for entry in entries
        ]

    return router
