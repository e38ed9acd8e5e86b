"""The beware list as it may come in."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictBool, StrictStr

from navcore.mission.beware_list import LARGEST_CLASS_ID
from web.schemas.fields import Closed, Margin, Name, Share

MAX_CLASSES = LARGEST_CLASS_ID
Relief = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.01, le=2.0)]
Degrees = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=360.0)]


class ColourRuleIn(Closed):
    """Pixels of a colour, in HSV."""

    hue_deg: tuple[Degrees, Degrees] = Field(
        description="first and last hue, going up; may wrap around red"
    )
    min_saturation: Share = 0.5
    min_value: Share = 0.2
    max_height_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=3.0)] = 0.05
    fallback: StrictBool = Field(False, description="used only while no network knows the class")


class BewareClassIn(Closed):
    """One thing to beware of."""

    name: Name
    class_id: Annotated[int, Field(strict=True, ge=1, le=LARGEST_CLASS_ID)]
    enabled: StrictBool = True
    margin_m: Margin = 0.0
    min_confidence: Share = 0.5
    colour: ColourRuleIn | None = None
    min_height_m: Relief | None = Field(None, description="what is flatter is only a picture of it")
    max_height_m: Relief | None = Field(
        None, description="what has something higher above it is a part of that"
    )
    min_size_m: Relief | None = Field(
        None, description="what of it is seen at once and is shorter is only a speck"
    )
    label: Name | None = Field(None, description="what the console calls it")
    display: StrictStr | None = Field(None, description="ignored: the console's own colour")
    found_by: StrictStr | None = Field(None, description="ignored: what finds it here")


class BewareListIn(Closed):
    """A whole list, in the operator's order."""

    classes: Annotated[list[BewareClassIn], Field(max_length=MAX_CLASSES)]
    version: int | None = Field(None, description="ignored; `If-Match` guards against lost edits")
    can_undo: StrictBool | None = Field(None, description="ignored")


class BewarePatchIn(Closed):
    """The fields of one class that change; null takes away `colour`, the heights, `min_size_m` or
    `label`."""

    enabled: StrictBool | None = None
    margin_m: Margin | None = None
    min_confidence: Share | None = None
    colour: ColourRuleIn | None = None
    min_height_m: Relief | None = None
    max_height_m: Relief | None = None
    min_size_m: Relief | None = None
    label: Name | None = None
