"""Reading the map in the thread that changes it: what another thread reads may be half changed."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
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
    """Return what `copy` returns in the thread of the map, after the edits before, or raise what it
    raises. Raises `Refused` where no tick comes that does it, and for None."""
    done: Future[Copy | None] = Future()

    def read(point_map: PointMap) -> None:
        try:
            done.set_result(copy(point_map))
        except Exception as error:
            done.set_exception(error)

    holder.edit_map(read)
    try:
        found = done.result(WAIT_S)
    except TimeoutError:
        raise Refused("the map cannot be read now, as no image is processed; try again") from None
    if found is None:
        raise Refused("there is no map now; the camera delivers no image")
    return found
