"""Router of `/api/v1`."""

from __future__ import annotations

from fastapi import APIRouter

from web.gateway.pooled_route import PooledRoute
from web.gateway.problems import JsonResponse


def api_router(*tags: str) -> APIRouter:
    """Return a router without routes. Its routes know their whole path, so that an app takes them
    as they are: an app that includes a router with a prefix builds every route twice."""
    return APIRouter(
        prefix="/api/v1",
        tags=[*tags],
        default_response_class=JsonResponse,
        route_class=PooledRoute,
    )
