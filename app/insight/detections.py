"""Everything of the beware list that was recognised, once for each place: a bounded list with the
best picture of each."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import NotKnown
from navcore.mission.beware_list import BewareList
from navcore.perception.instances import Cells, Detection, recognised
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from web.insight import Sighting
from web.pictures import camera_jpg

MAX_SIGHTINGS = 500
"""The one that was seen longest ago gives way."""
MAX_VIEWS = 60
"""Whole pictures are kept of the newest so many, for the labelling folder: some 30 MB."""
BETTER = 1.5
"""A view with so many times the pixels is kept instead."""
CROP_PX = 176


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredView:
    """A picture with what it was taken for, packed."""

    rgb_png: bytes
    """Colours."""
    depth_png: bytes
    """(H, W) millimetres, 0 = not measured."""
    class_ids_png: bytes
    """(H, W) class ids where the segmenter was sure enough to bind the robot."""
    unsure_png: bytes
    """(H, W) 255 where it claims something without being sure enough."""
    mask_png: bytes
    """(H, W) 255 on the thing itself."""


@dataclass(slots=True, eq=False)
class _Item:
    sighting: Sighting
    cells: set[tuple[int, int]]
    pixels: int
    crop: bytes
    view: StoredView | None


class DetectionGallery:
    """Written by one thread (`look`), read and judged by any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._items: dict[int, _Item] = {}
        self._next_id = 1

    def look(
        self, now_s: float, frame: Frame, labels: Labels, beware: BewareList
    ) -> list[Sighting]:
        """Note what a frame shows; what was never seen at its place before is returned."""
        names = {entry.class_id: entry.name for entry in beware.classes}
        return [
            new
            for region in recognised(frame, labels, beware)
            if (new := self._note(now_s, frame, labels, beware, region, names[region.class_id]))
            is not None
        ]

    def all(self) -> tuple[Sighting, ...]:
        """Newest first."""
        with self._lock:
            return tuple(
                item.sighting
                for item in sorted(self._items.values(), key=lambda item: -item.sighting.id)
            )

    def crop(self, sighting_id: int) -> bytes:
        """JPEG of the best view; raises `NotKnown`."""
        return self._item(sighting_id).crop

    def view(self, sighting_id: int) -> StoredView:
        """The whole picture; raises `NotKnown` when it is not kept any more."""
        view = self._item(sighting_id).view
        if view is None:
            raise NotKnown(
                f"the picture of sighting {sighting_id} is not kept any more; only the newest {MAX_VIEWS} are"
            )
        return view

    def call_wrong(self, sighting_id: int) -> None:
        """The operator says that it is no such thing."""
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
        better = item is None or pixels > BETTER * item.pixels
        # Packed outside the lock: it takes some milliseconds.
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
                    place=region.place,
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
                    item.sighting, place=region.place, confidence=region.confidence
                )
        return None

    def _at(self, class_id: int, cells: Cells) -> _Item | None:
        """The thing of this class on or beside these squares; of several the oldest."""
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
    """A frame, what binds in it, and a region of it."""
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
    """A picture of a `StoredView`; colours come as BGR."""
    return np.asarray(cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_UNCHANGED))


def _png(picture: npt.NDArray[np.integer | np.floating]) -> bytes:
    ok, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not ok:
        raise RuntimeError(f"OpenCV could not pack a picture of shape {picture.shape}")
    return data.tobytes()


def _crop(rgb: npt.NDArray[np.uint8], region: Detection) -> bytes:
    """JPEG of the region with some room about it, its outline drawn."""
    left, top, right, bottom = region.box
    room = max(12, (right - left + bottom - top) // 8)
    left, top = max(left - room, 0), max(top - room, 0)
    right, bottom = min(right + room, rgb.shape[1]), min(bottom + room, rgb.shape[0])
    picture = rgb[top:bottom, left:right].copy()
    outlines, _ = cv2.findContours(
        region.mask[top:bottom, left:right].view(np.uint8),
        cv2.RETR_EXTERNAL,
        cv2.CHAIN_APPROX_SIMPLE,
    )
    cv2.drawContours(picture, outlines, -1, (255, 183, 3), 1)
    scale = min(CROP_PX / max(picture.shape[:2]), 3.0)
    size = (max(round(picture.shape[1] * scale), 1), max(round(picture.shape[0] * scale), 1))
    return camera_jpg(
        np.asarray(
            cv2.resize(
                picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
            ),
            dtype=np.uint8,
        )
    )
