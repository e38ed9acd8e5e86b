"""Reading the map in the thread that changes it: what another thread reads may be half changed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol, TypeVar

from navcore.errors import Refused
from navcore.mapping.point_map import PointMap

Copy = TypeVar("Copy")

WAIT_S = 3.0
"""Longest wait for the thread of the map, seconds."""


class MapHolder(Protocol):
    """A holder of the map; `app.runtime.control.robot_controller.RobotController` is one."""

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Have the thread of the map edit it, after the edits before."""


def read_map(holder: MapHolder, copy: Callable[[PointMap], Copy | None]) -> Copy:
    """Return what `copy` returns in the thread of the map, after the edits before. Raises `Refused`
    where no tick comes that does it, and for None."""
    taken: list[Copy | None] = []
    done = threading.Event()

    def read(point_map: PointMap) -> None:
        try:
            taken.append(copy(point_map))
        finally:
            done.set()

    holder.edit_map(read)
    found = taken[0] if done.wait(WAIT_S) and taken else None
    if found is None:
        raise Refused("there is no map now; the camera delivers no image")
    return found
