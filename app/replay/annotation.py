"""Objects of a recording that are outlined by hand, and what a map takes for one of the beware
list beside them."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Matrix, transform_points
from navcore.grid.grid import GridSpec, inflate
from navcore.mapping.layers import least_confidence
from navcore.mapping.points.point_table import MapPoints
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.mission.zone_cells import rasterise
from navcore.toml_config import from_table, ranged, read_text

NEAR_M = 0.15
"""Distance from an annotated object in metres within which a cell of the list is not wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotatedObject:
    """An object that an image of the recording shows."""

    name: str
    """What it is, for example `white cup`."""
    outline: tuple[tuple[float, float, float], ...]
    """At least three points (x, y, z) around it in metres of the recording's world frame."""
    beware_class: str | None = None
    """Class of the beware list that it is to be held as; None where any class or none is right,
    as for a computer of the shape of a box."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotation:
    """The objects of a recording."""

    objects: tuple[AnnotatedObject, ...]
    """All objects of the list's classes below `judged_below_m`."""
    judged_below_m: float = ranged(0.1, 3.0, default=1.5)
    """Height above the floor in metres from which points are not judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareAgreement:
    """What a map takes for an object of the list, beside the annotated ones."""

    judged_cells: int
    """Number of occupied cells below the height that is judged."""
    wrong_cells: int
    """Number of those that a class of the list occupies away from every annotated object."""
    wrong_by_class: Mapping[str, int]
    """The same by class; a cell may be of several."""
    held: Mapping[str, tuple[str, ...]]
    """Classes that the map holds within the outline of each object with a class, by its name."""
    held_as_own_class: int
    """Number of objects that the map holds as their own class."""

    @property
    def wrong_share(self) -> float:
        """Share of the judged cells that are wrong."""
        return self.wrong_cells / max(self.judged_cells, 1)


def load_annotation(path: Path) -> Annotation:
    """Load a TOML file; raises `BadConfiguration`."""
    try:
        annotation = from_table(Annotation, tomllib.loads(read_text(path)), str(path))
    except tomllib.TOMLDecodeError as error:
        raise BadConfiguration(f"{path}: not readable as TOML: {error}") from None
    for one in annotation.objects:
        if len(one.outline) < 3:
            raise BadConfiguration(
                f"{path}: {one.name!r:.60}: an outline has at least 3 points, got "
                f"{len(one.outline)}"
            )
    return annotation


def judge_beware(
    points: MapPoints,
    spec: GridSpec,
    T_map_world: Matrix,
    annotation: Annotation,
    beware: BewareList,
    *,
    certain: float,
) -> BewareAgreement:
    """Compare the points of a map with the annotated objects of its recording; `certain` is the
    largest confidence that a list can ask for."""
    cells, class_ids = _judged(points, spec, annotation, beware, certain)
    outlines = {
        one.name: rasterise(
            transform_points(T_map_world, np.array(one.outline))[:, :2].tolist(), spec
        )
        for one in annotation.objects
    }
    near = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    for outline in outlines.values():
        near |= inflate(outline, math.ceil(NEAR_M / spec.resolution_m))
    away = (class_ids != NOTHING) & ~near.ravel()[cells]
    held = {
        one.name: tuple(
            entry.name
            for entry in beware.enabled
            if outlines[one.name].ravel()[cells[class_ids == entry.class_id]].any()
        )
        for one in annotation.objects
        if one.beware_class is not None
    }
    own = {one.name: one.beware_class for one in annotation.objects}
    wrong = {
        entry.name: len(np.unique(cells[away & (class_ids == entry.class_id)]))
        for entry in beware.enabled
    }
    return BewareAgreement(
        judged_cells=len(np.unique(cells)),
        wrong_cells=len(np.unique(cells[away])),
        wrong_by_class={name: count for name, count in wrong.items() if count},
        held=held,
        held_as_own_class=sum(own[name] in classes for name, classes in held.items()),
    )


def _judged(
    points: MapPoints, spec: GridSpec, annotation: Annotation, beware: BewareList, certain: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8]]:
    """Return the cell, row · cols + col, and the class of each point that occupies one below the
    height that is judged."""
    enabled = [NOTHING, *(entry.class_id for entry in beware.enabled)]
    cells = np.floor(
        (points.points_map[:, :2] - (spec.origin_x_m, spec.origin_y_m)) / spec.resolution_m
    ).astype(np.int64)
    counts = (
        (points.points_map[:, 2] < annotation.judged_below_m)
        & (points.confidence >= least_confidence(beware, certain)[points.class_ids])
        & np.isin(points.class_ids, enabled)
        & ((cells >= 0) & (cells < (spec.cols, spec.rows))).all(axis=1)
    )
    return cells[counts, 1] * spec.cols + cells[counts, 0], points.class_ids[counts]
