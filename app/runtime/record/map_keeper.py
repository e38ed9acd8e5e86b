"""The map on disk while the robot drives: a snapshot every few seconds, written in a thread of its
own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from app.runtime.control.loop import PeriodicThread
from navcore.errors import Refused, StorageFailed
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_state import MapState

SNAPSHOT_PERIOD_S = 4.0
"""Time between two snapshots of a map that changes, seconds. A kill loses this time and that of two
writes: less than 10 s while a write takes less than 2.5 s."""
WRITE_PERIOD_S = 0.5
"""Time between two looks for a new snapshot, seconds."""
SNAPSHOT_WAIT_S = 5.0
"""Longest wait for a snapshot that was asked for, seconds."""


StoreRest = Callable[[], None]
"""Stores what lies on a map as it was when the map was copied."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Snapshot:
    """A map that waits to be written."""

    path: Path
    state: MapState
    class_names: Mapping[int, str]
    corrections: int
    """Number of the newest correction that is in it."""
    store_rest: StoreRest | None
    """Stores what a correction has moved with the map; None where none has since the last write."""


@dataclass(slots=True, eq=False)
class _Request:
    """A request to write the map now."""

    is_last: bool
    """Whether nothing is copied after it."""
    is_copied: threading.Event = field(default_factory=threading.Event)


class MapKeeper:
    """Keeps one map in one file. The think thread, which alone changes the map, copies it; a thread
    of this object writes the copy.

    A correction moves zones, goals and the robot with the map. So that they lie on the map on disk
    at any moment, what it has moved is stored when the map that was copied with it is written.
    """

    def __init__(self, path: Path, class_names: Mapping[int, str]) -> None:
        """`class_names`: class id → name in the map so far, removed classes included."""
        self._path, self._names = path, dict(class_names)
        self.copy_rest: Callable[[], StoreRest] | None = None
        """Copies what lies on the map, and returns what stores that; called by the think thread."""
        self._waiting: _Snapshot | None = None
        self._copied: tuple[int, float, int] | None = None
        self._looked_ns: int | None = None
        self._corrections = self._written_corrections = 0
        self._on_trial = self._is_held = False
        self._requests: list[_Request] = []
        self._writing, self._handing = threading.Lock(), threading.Lock()
        self._thread = PeriodicThread(self._write, period_s=WRITE_PERIOD_S, name="map to disk")

    @property
    def is_behind(self) -> bool:
        """Whether a correction has moved the map since the one on disk was copied. What lies on the
        map is not stored then: `copy_rest` has it stored with the map."""
        return self._written_corrections != self._corrections

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
        self._on_trial = self._is_held = False
        self._written_corrections = self._corrections

    def note_correction(self) -> None:
        """Copy the map after this tick, before what the tick moves with it is moved; called by the
        think thread when a correction has moved the map."""
        self._corrections += 1
        self._copied = self._looked_ns = None

    def note_tick(
        self,
        point_map: PointMap,
        names: Mapping[int, str],
        now_ns: int,
        *,
        on_trial: bool = False,
    ) -> None:
        """Copy the map when it is due; called by the think thread after each tick.

        `names`: class id → name in the beware list of the tick. As long as the map is `on_trial`,
        what it holds may be wrong, and the file stays as it is.
        """
        self._on_trial = on_trial
        if self._requests:
            self._copy(point_map, names)
            with self._handing:
                requests, self._requests = self._requests, []
                self._is_held |= any(request.is_last for request in requests)
                for request in requests:
                    request.is_copied.set()
            return
        since_ns = self._looked_ns
        # Also where the clock was set back.
        is_due = since_ns is None or not 0 <= now_ns - since_ns < SNAPSHOT_PERIOD_S * 1e9
        if is_due and self._waiting is None:
            self._looked_ns = now_ns
            if _key(point_map) != self._copied:
                self._copy(point_map, names)

    def write_now(
        self, edit_map: Callable[[Callable[[PointMap], None]], None], *, is_last: bool = False
    ) -> None:
        """Write the present map before returning; raises `StorageFailed`, and `Refused` when no
        tick delivers it. `edit_map` has the think thread edit the map before a tick, in order: what
        was asked of the map before is in the file. `is_last`: write nothing after it until `use` or
        `go_on`, as another map replaces this one, whose folder may be deleted then."""
        request = _Request(is_last)
        edit_map(lambda _: self._requests.append(request))
        if not request.is_copied.wait(SNAPSHOT_WAIT_S):
            with self._handing:
                request.is_last = False
            raise Refused("the map cannot be kept now, as the camera delivers no image; try again")
        self._write()

    def go_on(self) -> None:
        """Go on with the present map, as no other one replaces it."""
        self._is_held = False

    def finish(self, point_map: PointMap, names: Mapping[int, str]) -> None:
        """Write the map at the end, when no thread changes it any more."""
        self._copy(point_map, names)
        self._write()

    def _copy(self, point_map: PointMap, names: Mapping[int, str]) -> None:
        if self._on_trial or self._is_held:
            return
        self._names |= names
        copy_rest = self.copy_rest if self.is_behind else None
        snapshot = _Snapshot(
            path=self._path,
            state=point_map.state(),
            class_names=dict(self._names),
            corrections=self._corrections,
            store_rest=None if copy_rest is None else copy_rest(),
        )
        self._copied = _key(point_map)
        with self._handing:
            self._waiting = snapshot

    def _write(self) -> None:
        with self._writing:
            snapshot = self._waiting
            if snapshot is None:
                return
            try:
                snapshot.path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise StorageFailed(f"{snapshot.path}: {error.strerror}") from None
            try:
                map_file.save(snapshot.path, snapshot.state, snapshot.class_names)
            except map_file.MapTooLarge:
                self._drop(snapshot)  # no further try helps, but a smaller map may follow
                raise
            if snapshot.store_rest is not None:
                snapshot.store_rest()
            self._written_corrections = max(self._written_corrections, snapshot.corrections)
            self._drop(snapshot)

    def _drop(self, snapshot: _Snapshot) -> None:
        with self._handing:  # the think thread may hand over the next one
            if self._waiting is snapshot:
                self._waiting = None


def _key(point_map: PointMap) -> tuple[int, float, int]:
    """Return what differs between two states of a map."""
    return point_map.version, point_map.explored.area_m2, len(point_map.poses)
