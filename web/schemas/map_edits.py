"""Requests and answers of the routes of the edits of the map."""

from __future__ import annotations

from pydantic import BaseModel

from navcore.mapping.erasing import Erasable
from web.interface.operations import MapEdits
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed
from web.schemas.zones import Geometry


class EraseIn(Closed):
    """Area to erase."""

    geometry: Geometry
    """GeoJSON Polygon in metres of the map frame, a Point with `radius_m`, or a LineString with
    `width_m`."""
    what: Erasable = Erasable.BOTH
    """What is erased in the area."""


class MapEditsOut(BaseModel):
    """History of the edits of the map."""

    model_config = DOCUMENTED

    undo: str | None
    """Description of the edit that undo would take back; null without one."""
    redo: str | None
    """Description of the edit that redo would repeat; null without one."""

    @staticmethod
    def of(edits: MapEdits) -> MapEditsOut:
        """Return the answer for the present history."""
        history = edits.history
        return MapEditsOut(undo=history.undo, redo=history.redo)
