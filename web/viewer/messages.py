"""Messages of a console page to its 3D view: draft, camera, display options, highlights."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field, TypeAdapter

from navcore.mission.zone import MAX_CORNERS
from web.schemas.fields import MAX_NAME, Closed, Corner, Share

Layer = Literal[
    "cloud",
    "floor",
    "robot",
    "camera",
    "path",
    "waypoints",
    "driven",
    "candidates",
    "goals",
    "zones",
    "people",
]
LAYERS: tuple[Layer, ...] = get_args(Layer)
CloudColour = Literal["camera", "height", "class"]
CLOUD_COLOURS: tuple[CloudColour, ...] = get_args(CloudColour)
Mode = Literal["navigate", "goal", "draw", "edit"]
MAX_NOTE = 200
"""Largest number of characters of a draft's note."""


class Draft(Closed):
    """Draft of the operator; the page keeps it, the 3D view shows it."""

    type: Literal["draft"] = "draft"
    mode: Mode = "navigate"
    corners: Annotated[tuple[Corner, ...], Field(max_length=MAX_CORNERS)] = ()
    outline: Annotated[tuple[Corner, ...], Field(max_length=2 * MAX_CORNERS)] = ()
    path: Annotated[tuple[Corner, ...], Field(max_length=4000)] = ()
    note: Annotated[str, Field(max_length=MAX_NOTE)] = ""
    """Text beside the outline, as the length and duration of the path to a goal."""


class CameraMove(Closed):
    """Motion of the operator's camera."""

    type: Literal["look"]
    at: Literal["overview", "top", "robot", "place"]
    place: Corner | None = None
    """Position (x, y) in metres of the map frame, for `at` = `place`."""


class HighlightedLine(Closed):
    """Line on the floor with its own colour."""

    colour: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")]
    points: Annotated[list[Corner], Field(max_length=2000)]
    dashed: bool = False
    name: Annotated[str, Field(max_length=MAX_NAME)] | None = None


class Highlight(Closed):
    """Answer to a question of the operator: an explained path, or a position of the event log."""

    type: Literal["mark"]
    lines: Annotated[tuple[HighlightedLine, ...], Field(max_length=200)] = ()
    place: Corner | None = None


class DisplayOptions(Closed):
    """Display of the scene on this page."""

    type: Literal["show"] = "show"
    cloud_colour: CloudColour = "camera"
    hidden: Annotated[tuple[Layer, ...], Field(max_length=len(LAYERS))] = ("candidates",)
    follows: bool = False
    """Whether the camera moves with the robot."""


class Pointer(Closed):
    """Pointer on the 3D view, of which the page asks the point on the floor."""

    type: Literal["pointer"]
    phase: Literal["hover", "down", "turn", "up"]
    """What the pointer does; the answer repeats it."""
    right: Share
    """Share of the width of the view to the left of the pointer."""
    down: Share
    """Share of the height of the view above the pointer."""


Message = Draft | CameraMove | DisplayOptions | Highlight | Pointer
PageMessage: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="type")])
