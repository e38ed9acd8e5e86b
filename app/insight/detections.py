"""The gallery of detected objects of the beware list: one entry per object, with its best view."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import NotKnown
from navcore.mission.beware_list import BewareList
from navcore.perception.instances import Cells, Detection, detect_instances
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from web.images.camera import camera_jpg
from web.interface.insight import Sighting

MAX_SIGHTINGS = 500
"""Largest number of entries; the one that was seen longest ago is dropped."""
MAX_VIEWS = 60
"""Largest number of whole views, kept for the labelling folder: some 30 MB."""
BETTER_VIEW = 1.5
"""Ratio of pixels from which a view replaces the kept one."""
CROP_PX = 176
"""Longer side of a cropped view, pixels."""
MAX_ENLARGEMENT = 3.0
"""Largest enlargement of a cropped view."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredView:
    """A camera image with its labels, compressed as PNG."""

    rgb_png: bytes
    """(H, W, 3) colour image."""
    depth_png: bytes
    """(H, W) depth in millimetres, 0 = not measured."""
    class_ids_png: bytes
    """(H, W) class ids of the beware list where the confidence suffices, else 0."""
    unsure_png: bytes
    """(H, W) 255 where the confidence of a class does not suffice."""
    mask_png: bytes
    """(H, W) 255 on the detected object."""


@dataclass(slots=True, eq=False)
class _Item:
    sighting: Sighting
    cells: set[tuple[int, int]]
    pixels: int
    crop: bytes
    view: StoredView | None


class DetectionGallery:
    """Written by one thread (`update`), read and corrected by any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._items: dict[int, _Item] = {}
        self._next_id = 1

    def update(
        self, now_s: float, frame: Frame, labels: Labels, beware: BewareList
    ) -> list[Sighting]:
        """Add the detections of a frame and return the new entries."""
        names = {entry.class_id: entry.name for entry in beware.classes}
        return [
            new
            for region in detect_instances(frame, labels, beware)
            if (new := self._note(now_s, frame, labels, beware, region, names[region.class_id]))
            is not None
        ]

    def all(self) -> tuple[Sighting, ...]:
        """Return all entries, newest first."""
        with self._lock:
            return tuple(
                item.sighting
                for item in sorted(self._items.values(), key=lambda item: -item.sighting.id)
            )

    def counts(self) -> dict[int, int]:
        """Return the number of entries by class id, without wrong detections."""
        return Counter(sighting.class_id for sighting in self.all() if sighting.verdict is None)

    def crop(self, sighting_id: int) -> bytes:
        """Return the JPEG of the best view, cropped; raises `NotKnown`."""
        return self._item(sighting_id).crop

    def view(self, sighting_id: int) -> StoredView:
        """Return the whole view; raises `NotKnown` when it is no longer kept."""
        view = self._item(sighting_id).view
        if view is None:
            raise NotKnown(
                f"the image of sighting {sighting_id} is no longer kept; "
                f"only the newest {MAX_VIEWS} are"
            )
        return view

    def mark_wrong(self, sighting_id: int) -> None:
        """Mark an entry as a wrong detection, on the operator's word."""
        item = self._item(sighting_id)
        with self._lock:
            item.sighting = replace(item.sighting, verdict="wrong")

    def _item(self, sighting_id: int) -> _Item:
        with self._lock:
            if sighting_id not in self._items:
                raise NotKnown(f"nothing was recognised under the id {sighting_id}")
            return self._items[sighting_id]

    def _note(
        self,
        now_s: float,
        frame: Frame,
        labels: Labels,
        beware: BewareList,
        region: Detection,
        name: str,
    ) -> Sighting | None:
        pixels = int(region.mask.sum())
        item = self._at(region.class_id, region.cells)
        better = item is None or pixels > BETTER_VIEW * item.pixels
        # Compressed outside the lock: it takes some milliseconds.
        crop, view = (
            (_crop(frame.rgb, region), packed(frame, labels, beware, region.mask))
            if better
            else (b"", None)
        )
        with self._lock:
            if item is None:
                sighting = Sighting(
                    id=self._next_id,
                    class_name=name,
                    class_id=region.class_id,
                    place=region.position,
                    confidence=region.confidence,
                    looks=1,
                    first_s=now_s,
                    last_s=now_s,
                )
                self._next_id += 1
                self._items[sighting.id] = _Item(sighting, set(region.cells), pixels, crop, view)
                self._keep_bounds()
                return sighting
            item.cells |= region.cells
            item.sighting = replace(item.sighting, looks=item.sighting.looks + 1, last_s=now_s)
            if better:
                item.pixels, item.crop, item.view = pixels, crop, view
                item.sighting = replace(
                    item.sighting, place=region.position, confidence=region.confidence
                )
        return None

    def _at(self, class_id: int, cells: Cells) -> _Item | None:
        """Return the oldest entry of a class on or beside these cells; None without one."""
        around = {(row + i, col + j) for row, col in cells for i in (-1, 0, 1) for j in (-1, 0, 1)}
        with self._lock:
            for item in self._items.values():
                if item.sighting.class_id == class_id and not around.isdisjoint(item.cells):
                    return item
        return None

    def _keep_bounds(self) -> None:
        if len(self._items) > MAX_SIGHTINGS:
            del self._items[min(self._items, key=lambda key: self._items[key].sighting.last_s)]
        with_view = [item for item in self._items.values() if item.view is not None]
        if len(with_view) > MAX_VIEWS:
            min(with_view, key=lambda item: item.sighting.last_s).view = None


def packed(
    frame: Frame, labels: Labels, beware: BewareList, mask: npt.NDArray[np.bool_]
) -> StoredView:
    """Compress a frame with its labels and the mask (H, W) of one object."""
    binding = labels.mask(beware)
    depth_mm = np.clip(np.round(frame.depth_m * 1000), 0, 65535).astype(np.uint16)
    return StoredView(
        rgb_png=_png(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2BGR)),
        depth_png=_png(depth_mm),
        class_ids_png=_png(np.where(binding, labels.class_ids, np.uint8(0))),
        unsure_png=_png(((labels.class_ids > 0) & ~binding).view(np.uint8) * np.uint8(255)),
        mask_png=_png(mask.view(np.uint8) * np.uint8(255)),
    )


def unpacked(png: bytes) -> npt.NDArray[np.integer]:
    """Decompress an image of a `StoredView`; colours come as BGR."""
    return np.asarray(cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_UNCHANGED))


def _png(image: npt.NDArray[np.integer | np.floating]) -> bytes:
    ok, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not ok:
        raise RuntimeError(f"OpenCV could not compress an image of shape {image.shape}")
    return data.tobytes()


def _crop(rgb: npt.NDArray[np.uint8], region: Detection) -> bytes:
    """Return the JPEG of a region with a border, its outline drawn."""
    left, top, right, bottom = region.box
    border = max(12, (right - left + bottom - top) // 8)
    left, top = max(left - border, 0), max(top - border, 0)
    right, bottom = min(right + border, rgb.shape[1]), min(bottom + border, rgb.shape[0])
    image = rgb[top:bottom, left:right].copy()
    outlines, _ = cv2.findContours(
        region.mask[top:bottom, left:right].view(np.uint8),
        cv2.RETR_EXTERNAL,
        cv2.CHAIN_APPROX_SIMPLE,
    )
    cv2.drawContours(image, outlines, -1, (255, 183, 3), 1)
    scale = min(CROP_PX / max(image.shape[:2]), MAX_ENLARGEMENT)
    size = (max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1))
    return camera_jpg(
        np.asarray(
            cv2.resize(
                image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
            ),
            dtype=np.uint8,
        )
    )
