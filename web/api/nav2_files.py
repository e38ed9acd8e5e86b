"""The two files of a Nav2 map by HTTP. Each is of the newest map, which may have grown in between:
so the answer names its grid, and the request for the second file may ask for the same."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query

from navcore.errors import Outdated
from navcore.grid.grid import GridSpec

OfGrid = Annotated[
    str | None,
    Query(
        alias="grid",
        max_length=200,
        description="Header `Grid` of the answer with the other file; 409 if the map has grown "
        "since.",
    ),
]


def on_grid(spec: GridSpec, asked: str | None) -> dict[str, str]:
    """Return the header that names a grid; raises `Outdated` unless it is the one `asked` for."""
    name = f"{spec.resolution_m:g},{spec.rows},{spec.cols},{spec.origin_x_m:g},{spec.origin_y_m:g}"
    if asked not in (None, name):
        raise Outdated("the map has grown since its other file was read; get both files again")
    return {"Grid": name}
