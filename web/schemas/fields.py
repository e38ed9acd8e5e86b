"""What the bodies of requests are made of: finite numbers within bounds, printable names, and no
unknown keys."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StrictStr

from navcore.mission.beware_list import MAX_MARGIN_M

MAX_NAME = 80
FAR_M = 1e6
"""No map is larger; keeps arithmetic on what a client sends far away from overflow."""


def _printable(text: str) -> str:
    """Control characters and lone surrogates would break logs, labels and every later answer that
    shows the name."""
    if not text.isprintable() or not text.strip():
        raise ValueError("must be printable text and not blank")
    return text


Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-FAR_M, le=FAR_M)]
Margin = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=MAX_MARGIN_M)]
Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1.0)]
Name = Annotated[StrictStr, Field(min_length=1, max_length=MAX_NAME), AfterValidator(_printable)]
Corner = tuple[Metres, Metres]
Radians = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100.0, le=100.0)]
Label = Annotated[
    StrictStr,
    Field(max_length=MAX_NAME),
    AfterValidator(lambda text: _printable(text) if text else text),
]


class Closed(BaseModel):
    """A body whose unknown keys are refused by name."""

    model_config = ConfigDict(extra="forbid", frozen=True)
