"""The operator's edits of the map: erasing, and the history of these edits.

Only the think thread changes the map, so an edit is posted and done before the next tick; the event
log then says what it has changed.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import shapely

from navcore.errors import BadGeometry, Refused
from navcore.grid.grid import GridSpec
from navcore.mapping.erasing import Erasable, Erased
from navcore.mapping.point_map import PointMap
from navcore.mission.zone import check_polygon
from navcore.mission.zone_cells import Corners, rasterise
from web.interface.drafts import EditHistory
from web.interface.wire import Position

MAX_AREA_M2 = 2500.0
"""Largest area that is erased at once, square metres."""
MAX_UNDO = 100
"""Largest number of edits that can be undone."""
MAX_UNDO_BYTES = 1 << 26
"""Memory of what was erased and can be put back; beyond it the oldest edits cannot be undone."""
_WHAT = {
    Erasable.GEOMETRY: "obstacles",
    Erasable.BEWARE: "beware points",
    Erasable.BOTH: "obstacles and beware points",
}
Tell = Callable[[str, Position], None]


class MapHolder(Protocol):
    """A holder of the map; `app.runtime.robot_controller.RobotController` is one."""

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Have the thread of the map edit it, after the edits before."""


class _Edit(Protocol):
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
        self.erased = erased = point_map.erase(cells, self.what)
        found = f"{erased.cells} cells" if erased.cells != 1 else "1 cell"
        tell(f"{by} erased {found} of {_WHAT[self.what]}.", self.place)

    def take_back(self, point_map: PointMap, tell: Tell, by: str) -> None:
        if self.erased is not None:
            point_map.put_back(self.erased)
            self.erased = None
        tell(f"{by} undid the {self.text}.", self.place)

    @property
    def bytes_used(self) -> int:
        return 0 if self.erased is None else self.erased.bytes_used


class MapEditor:
    """Satisfies the console's port `MapEdits`. Safe from any thread: one edit at a time."""

    def __init__(self, holder: MapHolder, *, spec: Callable[[], GridSpec], tell: Tell) -> None:
        """`spec` gives the present grid; `tell` notes a sentence with its place in the log."""
        self._holder, self._spec, self._tell = holder, spec, tell
        self._lock = threading.Lock()
        self._is_retired = False
        self._done: list[_Edit] = []
        self._undone: list[_Edit] = []

    @contextmanager
    def retired(self) -> Iterator[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        with self._lock:
            yield
            self._is_retired = True

    @property
    def history(self) -> EditHistory:
        """Descriptions of the next undo and redo."""
        done, undone = self._done, self._undone
        return EditHistory(
            undo=done[-1].text if done else None, redo=undone[-1].text if undone else None
        )

    def erase(self, corners: Corners, what: Erasable, *, by: str) -> None:
        """Erase what is in a polygon; raises `BadGeometry` with what is wrong with it."""
        polygon = check_polygon(corners, "area")
        self._check(polygon)
        x_m, y_m = np.mean(polygon, axis=0).tolist()
        text = f"erasing of {_WHAT[what]} around ({x_m:.1f}, {y_m:.1f})"
        self._step(_Erasure(polygon=polygon, what=what, text=text, place=(x_m, y_m)), by)

    def undo(self, *, by: str) -> str:
        """Undo the newest edit and return its description."""
        with self._lock:
            edit = self._last(self._done, "undo")
            self._post(edit.take_back, by)
            self._undone.append(self._done.pop())
        return edit.text

    def redo(self, *, by: str) -> str:
        """Repeat the edit that was undone last and return its description."""
        with self._lock:
            edit = self._last(self._undone, "redo")
            self._post(edit.apply, by)
            self._done.append(self._undone.pop())
        return edit.text

    def _check(self, polygon: Corners) -> None:
        area = shapely.Polygon(polygon)
        if area.area > MAX_AREA_M2:
            raise BadGeometry(
                f"area covers {area.area:.0f} m², at most {MAX_AREA_M2:g} m² are erased at once"
            )
        spec = self._spec()
        left, low = spec.origin_x_m, spec.origin_y_m
        width_m, height_m = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
        if not area.intersects(shapely.box(left, low, left + width_m, low + height_m)):
            raise BadGeometry(f"area is beside the map, which covers {spec.extent()}")

    def _step(self, edit: _Edit, by: str) -> None:
        with self._lock:
            self._post(edit.apply, by)
            self._done = [*self._done[1 - MAX_UNDO :], edit]
            self._undone = []
            while sum(step.bytes_used for step in self._done) > MAX_UNDO_BYTES:
                del self._done[0]

    def _post(self, run: Callable[[PointMap, Tell, str], None], by: str) -> None:
        if self._is_retired:
            raise Refused("the site has been changed meanwhile; load the map again")
        self._holder.edit_map(lambda point_map: run(point_map, self._tell, by))

    @staticmethod
    def _last(edits: list[_Edit], verb: str) -> _Edit:
        if not edits:
            raise Refused(f"there is no edit of the map to {verb}")
        return edits[-1]
