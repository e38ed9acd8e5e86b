"""Routes of the settings of the path."""

from __future__ import annotations

from fastapi import APIRouter

from web.api.router import api_router
from web.gateway.problems import refusals
from web.interface.operations import RobotService
from web.schemas.mission.path_settings import PathSettingsIn, PathSettingsOut


def path_settings_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("map and camera")

    def settings() -> PathSettingsOut:
        return PathSettingsOut(unknown_price=operations.path_settings.unknown_price)

    @router.get("/path/settings", response_model=PathSettingsOut)
    def get_settings() -> PathSettingsOut:
        """Return the settings of the path at this site, and their ranges."""
        return settings()

    @router.put("/path/settings", response_model=PathSettingsOut, responses=refusals(409, 422, 503))
    def change_settings(given: PathSettingsIn) -> PathSettingsOut:
        """Change the settings of the path, while driving too; they are kept with the site, and
        `POST edits/undo` takes the change back. `POST preview` with `unknown_price` tries one."""
        operations.path_settings.set_unknown_price(given.unknown_price)
        return settings()

    return router
