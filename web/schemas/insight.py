"""Answers and requests of the routes of explanation, detections and corrections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, Field

from web.interface.insight import LabellingState, Sighting
from web.interface.wire import DOCUMENTED, Position, served
from web.schemas.fields import Closed, Name

MAX_KEYS = 64
Pixel = Annotated[int, Field(strict=True, ge=0, le=100_000)]
Key = Annotated[str, Field(strict=True, min_length=1, max_length=120)]


class ArcOut(BaseModel):
    """Motion primitive of the local planner."""

    model_config = DOCUMENTED

    points: list[Position]
    """Points (x, y) that the body reaches without a collision, metres of the map frame."""
    touch: Position | None
    """First point in collision; null for a primitive that is free to its end."""


class CandidatesOut(BaseModel):
    """Motion primitives of the local planner in the newest tick."""

    model_config = DOCUMENTED

    arcs: list[ArcOut]
    """Motion primitives."""
    chosen: int | None
    """Index of the primitive that is driven; null during any other motion."""


class WithoutIn(Closed):
    """Rules to leave out."""

    without: Annotated[list[Key], Field(min_length=1, max_length=MAX_KEYS)]
    """Keys as in `GET explain`."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class SightingOut(Sighting):
    """Detected object of the beware list with its age."""

    age_s: float
    """Time since the last detection, seconds."""


class SightingsOut(BaseModel):
    """All detected objects."""

    model_config = DOCUMENTED

    seen: dict[str, int]
    """Number of objects by class id, without wrong detections."""
    sightings: list[SightingOut]
    """Objects, newest first."""
    labelling: LabellingState | None
    """Folder of images for the next training; null if it cannot be read."""
    labelling_failure: str | None
    """Why the folder cannot be read; null if it can."""


class WrongIn(Closed):
    """Correction of a wrong detection."""

    class_name: Name | None = None
    """True class in the beware list; null for an object of no class."""


class SnapshotOut(BaseModel):
    """Image that is held for corrections."""

    model_config = DOCUMENTED

    snapshot: int
    """Id of the image."""


class MissedObjectIn(Closed):
    """Object that was missed in a held image."""

    snapshot: Annotated[int, Field(strict=True, ge=0, le=2**53)]
    """Id that `POST sightings/snapshots` returned."""
    class_name: Name
    """Class of the object in the beware list."""
    box: tuple[Pixel, Pixel, Pixel, Pixel]
    """Left, top, right and bottom edge in pixels of the camera image."""
