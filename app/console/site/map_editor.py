"""The operator's edits of the map: erasing, rejecting detections, and the history of these edits.

Only the think thread changes the map, so an edit is posted and done before the next tick; the event
log then says what it has changed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import shapely

from app.console.edit_history import Edit, EditStack
from app.console.map_reading import MapHolder, read_map
from app.console.site.map_regions import REACH_M, ClassCells, Region, distance_m, regions_of
from app.insight.detections import DetectionExtent
from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable, Erased
from navcore.mapping.points.rejections import MAX_REJECTIONS, Rejection
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import check_polygon
from navcore.mission.zone_cells import Corners, rasterise
from web.interface.drafts import EditHistory, RejectedPlace
from web.interface.insight import Sighting, Verdict
from web.interface.wire import Position

MAX_AREA_M2 = 2500.0
"""Largest area that is erased at once, square metres."""
MAX_UNDO_BYTES = 1 << 26
"""Memory of what was erased and can be put back; beyond it the oldest edits cannot be undone."""
_WHAT = {
    Erasable.GEOMETRY: "obstacles",
    Erasable.BEWARE: "beware points",
    Erasable.BOTH: "obstacles and beware points",
}
Tell = Callable[[str, Position], None]


class Gallery(Protocol):
    """Detected objects; `app.insight.detections.DetectionGallery` is one."""

    def all(self) -> tuple[Sighting, ...]:
        """Return all objects."""

    def extent(self, sighting_id: int) -> DetectionExtent:
        """Return what an object covers; raises `NotKnown`."""

    def mark(self, sighting_id: int, verdict: Verdict | None) -> None:
        """Mark an object with the operator's verdict."""


class _Step(Protocol):
    """One step of the operator; its methods run in the thread of the map, by turns."""

    text: str
    """Description of the step."""

    def apply(self, point_map: PointMap, tell: Tell, by: str) -> None:
        """Change the map."""

    def take_back(self, point_map: PointMap, tell: Tell, by: str) -> None:
        """Undo the change."""

    @property
    def bytes_used(self) -> int:
        """Memory of what can be put back."""


@dataclass(slots=True, kw_only=True)
class _Erasure:
    """Erasing of an area."""

    polygon: Corners
    what: Erasable
    text: str
    place: Position
    erased: Erased | None = field(default=None, init=False)

    def apply(self, point_map: PointMap, tell: Tell, by: str) -> None:
        cells = np.flatnonzero(rasterise(self.polygon, point_map.spec))
        self.erased = erased = point_map.edits.erase(cells, self.what.class_ids)
        found = f"{erased.cells} cells" if erased.cells != 1 else "1 cell"
        tell(f"{by} erased {found} of {_WHAT[self.what]}.", self.place)

    def take_back(self, point_map: PointMap, tell: Tell, by: str) -> None:
        if self.erased is not None:
            point_map.edits.put_back(self.erased)
            self.erased = None
        tell(f"{by} took back: {self.text}.", self.place)

    @property
    def bytes_used(self) -> int:
        return 0 if self.erased is None else self.erased.bytes_used


@dataclass(slots=True, kw_only=True)
class _Rejecting:
    """Regions and detections that are not what they were taken for."""

    regions: tuple[Region, ...]
    sightings: tuple[Sighting, ...]
    mark: Callable[[int, Verdict | None], None]
    text: str
    place: Position
    done: list[tuple[int, Erased]] = field(default_factory=list, init=False)

    def apply(self, point_map: PointMap, tell: Tell, by: str) -> None:
        for sighting in self.sightings:
            self.mark(sighting.id, "rejected")
        for region in self.regions:
            rejection, erased = point_map.edits.reject(
                region.class_id, region.points, region.confidence
            )
            self.done.append((rejection.id, erased))
        freed = sum(erased.cells for _, erased in self.done)
        tell(f"{by}: {self.text}; {freed} cells are free.", self.place)

    def take_back(self, point_map: PointMap, tell: Tell, by: str) -> None:
        for rejection_id, erased in reversed(self.done):
            point_map.edits.take_back(rejection_id)
            point_map.edits.put_back(erased)
        self.done = []
        for sighting in self.sightings:
            self.mark(sighting.id, sighting.verdict)
        tell(f"{by} took back: {self.text}.", self.place)

    @property
    def bytes_used(self) -> int:
        return sum(erased.bytes_used for _, erased in self.done)


@dataclass(slots=True, kw_only=True)
class _Forgetting:
    """A rejection that no longer holds."""

    rejection_id: int
    text: str
    place: Position
    removed: Rejection | None = field(default=None, init=False)

    def apply(self, point_map: PointMap, tell: Tell, by: str) -> None:
        self.removed = point_map.edits.take_back(self.rejection_id)
        tell(f"{by}: {self.text}.", self.place)

    def take_back(self, point_map: PointMap, tell: Tell, by: str) -> None:
        if self.removed is not None:
            point_map.edits.restore_rejection(self.removed)
            self.removed = None
        tell(f"{by} took back: {self.text}.", self.place)

    @property
    def bytes_used(self) -> int:
        return 0


class MapEditor:
    """Satisfies the console's port `MapEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        holder: MapHolder,
        *,
        point_map: PointMap,
        detections: Callable[[], Gallery],
        beware: Callable[[], BewareList],
        tell: Tell,
        number: Callable[[], int] | None = None,
        max_undo_bytes: int = MAX_UNDO_BYTES,
    ) -> None:
        """`point_map` is only read here; `detections` gives the present gallery, `beware` the
        beware list, `tell` notes a sentence with its place in the log, and `number` counts the
        edits of all kinds."""
        self._holder, self._map, self._tell = holder, point_map, tell
        self._detections, self._beware = detections, beware
        self._edits = EditStack[_Step](
            number=number, bytes_used=lambda step: step.bytes_used, max_bytes=max_undo_bytes
        )

    def retired(self) -> AbstractContextManager[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        return self._edits.retired()

    @property
    def history(self) -> EditHistory:
        """Descriptions of the next undo and redo."""
        return self._edits.history

    def erase(self, corners: Corners, what: Erasable, *, by: str) -> None:
        """Erase what is in a polygon; raises `BadGeometry` with what is wrong with it."""
        polygon = check_polygon(corners, "area")
        self._check(polygon)
        x_m, y_m = np.mean(polygon, axis=0).tolist()
        text = f"erasing of {_WHAT[what]} around ({x_m:.1f}, {y_m:.1f})"
        self._step(_Erasure(polygon=polygon, what=what, text=text, place=(x_m, y_m)), by)

    def reject(self, sighting_id: int, *, all_of_class: bool, by: str) -> None:
        """Free what a detection occupies, or all present ones of its class, and remember that it
        takes better evidence there."""
        gallery = self._detections()
        first = gallery.extent(sighting_id)
        if first.sighting.verdict == "rejected":
            raise Refused(f"sighting {sighting_id} is rejected already; undo takes it back")
        chosen: tuple[DetectionExtent, ...] = (first,)
        if all_of_class:
            chosen = tuple(
                gallery.extent(one.id)
                for one in gallery.all()
                if one.class_id == first.sighting.class_id and one.verdict != "rejected"
            )
        (x_m, y_m), class_id = first.sighting.place, first.sighting.class_id
        name = self._beware().titles.get(class_id, first.sighting.class_name)
        text = f"“{name}” at ({x_m:.1f}, {y_m:.1f}) is not one"
        if all_of_class:
            text = f"none of {len(chosen)} detections of “{name}” is one"
        regions = tuple(
            Region(
                class_id=extent.sighting.class_id,
                points=extent.points,
                confidence=extent.confidence,
            )
            for extent in chosen
        )
        sightings = tuple(extent.sighting for extent in chosen)
        self._reject(regions, sightings, text, first.sighting.place, by)

    def reject_at(self, class_id: int, at: Position, *, all_of_class: bool, by: str) -> None:
        """Free the region of a class at a place of the map, or all of its regions, and remember
        that it takes better evidence there, whatever has shown it: a kept map has no detections.
        Raises `Refused` where there is none, and without a tick that could tell."""
        cells = read_map(self._holder, lambda point_map: ClassCells.of(point_map, class_id))
        regions = regions_of(cells, None if all_of_class else at)
        name, (x_m, y_m) = self._beware().titles.get(class_id, f"class {class_id}"), at
        if not regions:
            raise Refused(f"there is nothing of “{name}” on the map at ({x_m:.1f}, {y_m:.1f})")
        sightings = tuple(
            one
            for one in self._detections().all()
            if one.class_id == class_id
            and one.verdict != "rejected"
            and min(distance_m(region, *one.place) for region in regions) < REACH_M
        )
        text = f"“{name}” at ({x_m:.1f}, {y_m:.1f}) is not one"
        if all_of_class:
            text = f"none of {len(regions)} places of “{name}” is one"
        self._reject(regions, sightings, text, at, by)

    def _reject(
        self,
        regions: tuple[Region, ...],
        sightings: tuple[Sighting, ...],
        text: str,
        place: Position,
        by: str,
    ) -> None:
        if len(self._map.rejections.all) + len(regions) > MAX_REJECTIONS:
            raise Refused(f"at most {MAX_REJECTIONS} rejections are kept; take some back first")
        if not self._map.poses:
            raise Refused("there is no map yet; the camera has delivered no image")
        mark = self._detections().mark
        for sighting in sightings:
            mark(sighting.id, "rejected")
        edit = _Rejecting(regions=regions, sightings=sightings, mark=mark, text=text, place=place)
        self._step(edit, by)

    @property
    def rejected(self) -> tuple[RejectedPlace, ...]:
        """Where detections were rejected, oldest first."""
        names, places = self._beware().names, self._map.rejections.places
        return tuple(
            RejectedPlace(
                id=one.id,
                class_id=one.class_id,
                class_name=names.get(one.class_id, f"class {one.class_id}"),
                place=places[one.id],
                confidence=round(one.confidence, 3),
            )
            for one in self._map.rejections.all
            if one.id in places
        )

    def forget(self, rejection_id: int, *, by: str) -> None:
        """Forget a rejection: its class counts there as everywhere."""
        for one in self.rejected:
            if one.id == rejection_id:
                x_m, y_m = one.place
                name = self._beware().titles.get(one.class_id, one.class_name)
                text = f"“{name}” at ({x_m:.1f}, {y_m:.1f}) counts again"
                self._step(_Forgetting(rejection_id=one.id, text=text, place=one.place), by)
                return
        raise NotKnown(f"nothing was rejected under the id {rejection_id}")

    def undo(self, *, by: str, number: int | None = None) -> str:
        """Undo the newest edit and return its description."""
        return self._edits.undo(lambda edit: self._post(edit.step.take_back, by), number=number)

    def redo(self, *, by: str) -> str:
        """Repeat the edit that was undone last and return its description."""
        return self._edits.redo(lambda edit: self._repeat(edit, by))

    def _repeat(self, edit: Edit[_Step], by: str) -> _Step:
        self._post(edit.step.apply, by)
        return edit.step

    def _check(self, polygon: Corners) -> None:
        area = shapely.Polygon(polygon)
        if area.area > MAX_AREA_M2:
            raise BadGeometry(
                f"area covers {area.area:.0f} m², at most {MAX_AREA_M2:g} m² are erased at once"
            )
        spec = self._map.spec
        left, low = spec.origin_x_m, spec.origin_y_m
        width_m, height_m = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
        if not area.intersects(shapely.box(left, low, left + width_m, low + height_m)):
            raise BadGeometry(f"area is beside the map, which covers {spec.extent()}")

    def _step(self, step: _Step, by: str) -> None:
        with self._edits.editing():
            self._post(step.apply, by)
            self._edits.add(step.text, step)

    def _post(self, run: Callable[[PointMap, Tell, str], None], by: str) -> None:
        self._holder.edit_map(lambda point_map: run(point_map, self._tell, by))
