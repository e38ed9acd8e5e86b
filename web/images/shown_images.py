"""Camera images that were given out last, by name: a click is made on one of them."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import Refused
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from navcore.mission.beware_list import BewareList
from web.images.camera import beware_mask
from web.interface.snapshots import TickSnapshot

MAX_AGE_S = 5.0
"""Time by which an image may be older than the newest one, seconds."""
MAX_PIXELS = 32 * 848 * 480
"""Largest number of pixels of all images, 5 bytes each: as many as a tick every 0.15 s gives out
in that time at 848 × 480."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShownImage:
    """What a click into a camera image is answered from."""

    name: str
    """Name of the image, by which a click refers to it."""
    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the enabled classes per pixel, 0 for nothing."""
    depth_m: npt.NDArray[np.float32] | None
    """(H, W) distance along the optical axis in metres, 0 for no measurement; None if unknown."""
    intrinsics: Intrinsics
    """Intrinsics of the camera."""
    T_map_camera: Matrix
    """(4, 4) pose of the camera's optical frame in the map frame."""
    at_s: float
    """Time at which it was given out first, seconds of the monotonic clock."""

    @classmethod
    def of(cls, tick: TickSnapshot, beware: BewareList) -> ShownImage:
        """Return that of a tick, given out now under a beware list."""
        return cls(
            name=name_of(tick),
            class_ids=np.where(beware_mask(tick, beware), tick.labels, np.uint8(0)),
            depth_m=tick.depth_m,
            intrinsics=tick.intrinsics,
            T_map_camera=tick.T_map_camera,
            at_s=time.monotonic(),
        )


class ShownImages:
    """Safe from any thread."""

    def __init__(self) -> None:
        self._images: deque[ShownImage] = deque()
        self._lock = threading.Lock()

    def note(self, tick: TickSnapshot, beware: BewareList) -> None:
        """Note a tick whose image is given out."""
        with self._lock:
            if any(image.name == name_of(tick) for image in self._images):
                return
            new = ShownImage.of(tick, beware)
            self._images.append(new)
            most = max(1, MAX_PIXELS // new.class_ids.size)
            while len(self._images) > most or new.at_s - self._images[0].at_s > MAX_AGE_S:
                self._images.popleft()

    def named(self, name: str) -> ShownImage:
        """Return the image with a name; raises `Refused` where it is no longer held."""
        with self._lock:
            for image in self._images:
                if image.name == name:
                    return image
        raise Refused("that image is no longer kept: the picture has moved on; click again")


def name_of(tick: TickSnapshot) -> str:
    """Return the name of a tick's camera image, by which a click refers to it."""
    return str(tick.serial)
