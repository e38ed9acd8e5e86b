"""What a console page tells its 3D view: the mode, the draft it is working on, where to look, what
to show."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from navcore.mission.zone import MAX_CORNERS
from web.schemas.fields import MAX_NAME, Corner, Share

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
Mode = Literal["navigate", "goal", "draw", "edit"]


class _Closed(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Draft(_Closed):
    """What this operator is drawing; it lives in the page, the 3D view only shows it."""

    type: Literal["draft"] = "draft"
    mode: Mode = "navigate"
    corners: Annotated[list[Corner], Field(max_length=MAX_CORNERS)] = []
    outline: Annotated[list[Corner], Field(max_length=2 * MAX_CORNERS)] = []
    path: Annotated[list[Corner], Field(max_length=4000)] = []


class CameraMove(_Closed):
    """Where this operator's camera goes."""

    type: Literal["look"]
    at: Literal["overview", "top", "robot", "place"]
    place: Corner | None = None
    """(x, y) on the map, where `at` is `place`."""


class HighlightedLine(_Closed):
    """A line on the floor in a colour of its own."""

    colour: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")]
    points: Annotated[list[Corner], Field(max_length=2000)]
    dashed: bool = False
    name: Annotated[str, Field(max_length=MAX_NAME)] | None = None


class Highlight(_Closed):
    """What this operator has asked about: the explained path, and a place of the log."""

    type: Literal["mark"]
    lines: Annotated[list[HighlightedLine], Field(max_length=200)] = []
    place: Corner | None = None


class DisplayOptions(_Closed):
    """How the scene is shown; the same for every operator."""

    type: Literal["show"]
    cloud_colour: Literal["camera", "class", "height"]
    hidden: Annotated[list[Layer], Field(max_length=len(LAYERS))]
    strength: Annotated[dict[Layer, Share], Field(max_length=len(LAYERS))] = {}
    """How strongly a layer is drawn; one that is not named fully."""


PageMessage: TypeAdapter[Draft | CameraMove | DisplayOptions | Highlight] = TypeAdapter(
    Annotated[Draft | CameraMove | DisplayOptions | Highlight, Field(discriminator="type")]
)
