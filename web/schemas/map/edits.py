"""Requests and answers of the routes of the edits of the map."""

from __future__ import annotations

from pydantic import BaseModel, Field, StrictBool

from navcore.mapping.points.erasing import Erasable
from web.interface.drafts import RejectedPlace
from web.interface.operations import AllEdits, MapEdits
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed, Corner
from web.schemas.zones import Geometry


class EraseIn(Closed):
    """Area to erase."""

    geometry: Geometry
    """GeoJSON Polygon in metres of the map frame, a Point with `radius_m`, or a LineString with
    `width_m`."""
    what: Erasable = Erasable.BOTH
    """What is erased in the area."""


class RejectIn(Closed):
    """Detection that is not one of its class."""

    all_of_class: StrictBool = False
    """Whether all present detections of its class are rejected with it."""


class RejectAtIn(RejectIn):
    """Place of the map where nothing of a class is."""

    class_id: int = Field(strict=True, ge=1, le=255)
    """Class id of the beware list."""
    at: Corner
    """Position (x, y) in metres of the map frame."""


class EditsOut(BaseModel):
    """Edits of zones, beware list, map or path settings that can be undone and redone."""

    model_config = DOCUMENTED

    undo: str | None
    """Description of the edit that undo would take back; null without one."""
    redo: str | None
    """Description of the edit that redo would repeat; null without one."""
    undo_number: int
    """Number of the edit that undo would take back; 0 without one."""

    @staticmethod
    def of(edits: AllEdits) -> EditsOut:
        """Return the answer for the present history."""
        history = edits.history
        return EditsOut(undo=history.undo, redo=history.redo, undo_number=history.undo_number)


class EditDone(BaseModel):
    """Edit that was undone or repeated."""

    model_config = DOCUMENTED

    text: str
    """Description of the edit."""


class MapEditsOut(BaseModel):
    """Edits of the map that can be undone and redone, and what they have rejected."""

    model_config = DOCUMENTED

    undo: str | None
    """Description of the edit that undo would take back; null without one."""
    redo: str | None
    """Description of the edit that redo would repeat; null without one."""

    rejected: tuple[RejectedPlace, ...]
    """Where detections were rejected, oldest first; kept with the map."""

    @staticmethod
    def of(edits: MapEdits) -> MapEditsOut:
        """Return the answer for the present history."""
        history = edits.history
        return MapEditsOut(undo=history.undo, redo=history.redo, rejected=edits.rejected)
