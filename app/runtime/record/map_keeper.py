"""The map on disk while the robot drives: a snapshot every few seconds, written in a thread of its
own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from app.runtime.control.loop import PeriodicThread
from navcore.errors import Refused, StorageFailed
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_state import MapState

log = logging.getLogger(__name__)
SNAPSHOT_PERIOD_S = 4.0
"""Time between two snapshots of a map that changes, seconds. A kill loses this time and that of two
writes: less than 10 s while a write takes less than 2.5 s."""
WRITE_PERIOD_S = 0.5
"""Time between two looks for a new snapshot, seconds."""
SNAPSHOT_WAIT_S = 5.0
"""Longest wait for a snapshot that was asked for, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Snapshot:
    """A map that waits to be written."""

    path: Path
    state: MapState
    class_names: Mapping[int, str]


class MapKeeper:
    """Keeps one map in one file. The think thread, which alone changes the map, copies it; a thread
    of this object writes the copy."""

    def __init__(self, path: Path, class_names: Mapping[int, str]) -> None:
        """`class_names`: class id → name in the map so far, removed classes included."""
        self._path, self._names = path, dict(class_names)
        self._waiting: _Snapshot | None = None
        self._copied: tuple[int, float, int] | MapState | None = None
        """The map that was copied last, or what tells it from others."""
        self._looked_ns: int | None = None
        self.left: Path | None = None
        """File of the map before, which is written no more once its folder is deleted."""
        self._asked, self._answered = threading.Event(), threading.Event()
        self._writing, self._handing = threading.Lock(), threading.Lock()
        self.failure: str | None = None
        """Why the map could not be written last; None where it was, or is about to be."""
        self._thread = PeriodicThread(
            self._write_logged, period_s=WRITE_PERIOD_S, name="map to disk"
        )

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread; a snapshot may still wait, see `finish`."""
        self._thread.stop()

    def use(self, path: Path, class_names: Mapping[int, str]) -> None:
        """Keep another map in another file from the next snapshot on; called by the thread that
        changes the map."""
        self._path, self._names, self._copied = path, dict(class_names), None

    def note_tick(
        self,
        point_map: PointMap,
        names: Mapping[int, str],
        now_ns: int,
        *,
        held: MapState | None = None,
    ) -> None:
        """Copy the map when it is due; called by the think thread after each tick.

        `names`: class id → name in the beware list of the tick. `held`: the map to keep instead, as
        long as what the present one holds besides may be wrong.
        """
        if self._asked.is_set():
            self._asked.clear()
            self._copy(point_map, names, held)
            self._answered.set()
            return
        since_ns = self._looked_ns
        # Also where the clock was set back.
        is_due = since_ns is None or not 0 <= now_ns - since_ns < SNAPSHOT_PERIOD_S * 1e9
        if is_due and self._waiting is None:
            self._looked_ns = now_ns
            if (held or _key(point_map)) != self._copied:
                self._copy(point_map, names, held)

    def write_now(self, edit_map: Callable[[Callable[[PointMap], None]], None]) -> None:
        """Write the present map before returning; raises `StorageFailed`, and `Refused` when no
        tick delivers it. `edit_map` has the think thread edit the map before a tick, in order: what
        was asked of the map before is in the file."""
        self._answered.clear()
        edit_map(lambda _: self._asked.set())
        if not self._answered.wait(SNAPSHOT_WAIT_S):
            self._asked.clear()
            raise Refused("the map cannot be kept now, as the camera delivers no image; try again")
        try:
            self._write()
        except StorageFailed as error:
            raise StorageFailed(f"the map cannot be stored: {error}") from None

    def finish(
        self, point_map: PointMap, names: Mapping[int, str], held: MapState | None = None
    ) -> None:
        """Write the map at the end, when no thread changes it any more; `held` as for
        `note_tick`."""
        self._copy(point_map, names, held)
        self._write()

    def _copy(
        self, point_map: PointMap, names: Mapping[int, str], held: MapState | None = None
    ) -> None:
        self._names |= names
        self._copied, state = held or _key(point_map), held or point_map.state()
        with self._handing:
            self._waiting = _Snapshot(path=self._path, state=state, class_names=dict(self._names))

    def _write(self) -> bool:
        """Write the snapshot that waits; return whether there was one."""
        with self._writing:
            snapshot = self._waiting
            if snapshot is None:
                return False
            try:
                # That of a site that was left and is deleted is not written.
                if snapshot.path != self.left or snapshot.path.parent.exists():
                    self._store(snapshot)
            except Exception as error:
                self.failure = str(error)
                raise
            self._drop(snapshot)
            self.failure = None
            return True

    def _store(self, snapshot: _Snapshot) -> None:
        try:
            snapshot.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageFailed(f"{snapshot.path}: {error.strerror}") from None
        try:
            map_file.save(snapshot.path, snapshot.state, snapshot.class_names)
        except map_file.MapTooLarge:
            self._drop(snapshot)  # no further try helps, but a smaller map may follow
            raise

    def _drop(self, snapshot: _Snapshot) -> None:
        with self._handing:  # the think thread may hand over the next one
            if self._waiting is snapshot:
                self._waiting = None

    def _write_logged(self) -> None:
        failed = self.failure is not None
        try:
            self._write()
        except StorageFailed:
            # The snapshot waits for the next try; a full disk is told once.
            if not failed:
                log.exception("the map is not kept; it is tried again")


def _key(point_map: PointMap) -> tuple[int, float, int]:
    """Return what differs between two states of a map."""
    return point_map.version, point_map.explored.area_m2, len(point_map.poses)
