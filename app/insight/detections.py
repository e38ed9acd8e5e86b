"""The gallery of detected objects of the beware list: one entry per object, with its best view."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import NotKnown, Refused
from navcore.geometry.arrays import Bools, Points
from navcore.geometry.transform import Pose2
from navcore.learning.data.images import encode_rgb
from navcore.mapping.points.rejections import MAX_POINTS
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.instances import CELL_M, Detection, detect_instances
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from web.images.camera import camera_jpg
from web.interface.insight import Sighting, Verdict

MAX_SIGHTINGS = 500
"""Largest number of entries; the one that was seen longest ago is dropped."""
MAX_VIEWS = 60
"""Largest number of whole views, kept for the labelling folder: some 30 MB."""
BETTER_VIEW = 1.5
"""Ratio of pixels from which a view replaces the kept one."""
CROP_PX = 176
"""Longer side of a cropped view, pixels."""
MIN_BACKGROUND_CONFIDENCE = 0.5
"""Confidence from which a pixel without a class of the list is learned from as background: more
likely than not."""
SAMPLES_M = CELL_M * np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)])
"""Positions in a cell of a detection, metres."""
MAX_ENLARGEMENT = 3.0
"""Largest enlargement of a cropped view."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredView:
    """A camera image with its labels, compressed as PNG."""

    rgb_png: bytes
    """(H, W, 3) colour image; with a fourth channel, 0 where the colour is not known, if there are
    such pixels."""
    depth_png: bytes
    """(H, W) depth in millimetres, 0 = not measured."""
    class_ids_png: bytes
    """(H, W) class ids of the beware list where the confidence suffices, else 0."""
    unsure_png: bytes
    """(H, W) 255 where neither a class of the list nor the background is known well enough to be
    learned from."""
    mask_png: bytes
    """(H, W) 255 on the detected object."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionExtent:
    """Where a detected object is."""

    sighting: Sighting
    """The object."""
    points: Points
    """(N, 2) positions in metres of the map frame, 10 cm apart, on all that its looks covered."""
    confidence: float
    """Highest confidence of its looks, 0 to 1."""


@dataclass(slots=True, eq=False)
class _Item:
    sighting: Sighting
    cells: set[tuple[int, int]]
    seen_from: Pose2  # T_map_base
    highest: float
    pixels: int
    crop: bytes
    view: StoredView | None


class DetectionGallery:
    """Written by one thread (`update`), read and corrected by any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._items: dict[int, _Item] = {}
        self._next_id = 1
        self.moves = 0
        """Number of the newest correction of the map, or of forgetting all."""

    def update(
        self, now_s: float, frame: Frame, labels: Labels, beware: BewareList, *, moves: int
    ) -> list[Sighting]:
        """Add the detections of a frame and return the new entries; none if the gallery has moved
        since the frame, which was seen on the map of when `moves` was its number."""
        names = {entry.class_id: entry.name for entry in beware.classes}
        added, images = list[Sighting](), None
        for region in detect_instances(frame, labels, beware):
            item, pixels = self._at(region), int(region.mask.sum())
            crop, view = b"", None
            # Compressed outside the lock: it takes some milliseconds, and the whole frame most.
            if item is None or (
                item.sighting.verdict != "rejected" and pixels > BETTER_VIEW * item.pixels
            ):
                images = images or packed(frame, labels, beware, region.mask)
                crop, view = (
                    _crop(frame.rgb, region),
                    replace(images, mask_png=_mask_png(region.mask)),
                )
            with self._lock:
                if self.moves != moves:
                    break
                if item is None:
                    name = names[region.class_id]
                    added.append(self._add(now_s, frame.pose, region, name, crop, view))
                else:
                    self._look(item, now_s, frame.pose, region, crop, view)
                self._keep_bounds()
        return added

    def all(self) -> tuple[Sighting, ...]:
        """Return all entries, newest first."""
        with self._lock:
            return tuple(
                item.sighting
                for item in sorted(self._items.values(), key=lambda item: -item.sighting.id)
            )

    def follow(self, before: Sequence[Pose2], after: Sequence[Pose2]) -> None:
        """Move the entries with a correction of the map, T_map_base by pose ID: each with the pose
        that is nearest to where it was seen from last."""
        places = np.array([(pose.x_m, pose.y_m) for pose in before]).reshape(-1, 2)
        with self._lock:
            self.moves += 1
            for item in self._items.values() if len(places) else ():
                robot = item.seen_from
                nearest = int(np.hypot(*(places - (robot.x_m, robot.y_m)).T).argmin())
                moved = after[nearest] @ before[nearest].inverse()
                if after[nearest] == before[nearest]:
                    continue
                middles = (np.array(sorted(item.cells))[:, ::-1] + 0.5) * CELL_M
                cells = np.floor(moved.to_parent(middles) / CELL_M).astype(np.int64)
                item.cells = set(map(tuple, cells[:, ::-1].tolist()))
                item.seen_from = moved @ robot
                x, y = moved.to_parent(np.array(item.sighting.place)).tolist()
                item.sighting = replace(item.sighting, place=(x, y))

    def clear(self) -> None:
        """Forget all entries; their ids are not given again."""
        with self._lock:
            self.moves += 1
            self._items.clear()

    def counts(self) -> dict[int, int]:
        """Return the number of entries by class id, without wrong detections."""
        return Counter(sighting.class_id for sighting in self.all() if sighting.verdict is None)

    def crop(self, sighting_id: int) -> bytes:
        """Return the JPEG of the best view, cropped; raises `NotKnown`."""
        return self._item(sighting_id).crop

    def view(self, sighting_id: int) -> StoredView:
        """Return the whole view of an entry to be corrected; raises `NotKnown` when it is no longer
        kept, `Refused` when there is a verdict on the entry."""
        item = self._item(sighting_id)
        if item.sighting.verdict is not None:
            raise Refused(f"sighting {sighting_id} was corrected or rejected before")
        view = item.view
        if view is None:
            raise NotKnown(
                f"the image of sighting {sighting_id} is no longer kept; "
                f"only the newest {MAX_VIEWS} are"
            )
        return view

    def mark(self, sighting_id: int, verdict: Verdict | None) -> None:
        """Mark an entry with the operator's verdict; None takes it back. An unknown entry stays
        unknown: it was dropped meanwhile."""
        with self._lock:
            if (item := self._items.get(sighting_id)) is not None:
                item.sighting = replace(item.sighting, verdict=verdict)

    def extent(self, sighting_id: int) -> DetectionExtent:
        """Return what an entry covers and how sure its looks were; raises `NotKnown`."""
        item = self._item(sighting_id)
        with self._lock:
            corners = np.array(sorted(item.cells), dtype=np.float64)[:, None, ::-1] * CELL_M
            points = (corners + SAMPLES_M).reshape(-1, 2)
            return DetectionExtent(
                sighting=item.sighting, points=points[:MAX_POINTS], confidence=item.highest
            )

    def _item(self, sighting_id: int) -> _Item:
        with self._lock:
            if sighting_id not in self._items:
                raise NotKnown(f"nothing was recognised under the id {sighting_id}")
            return self._items[sighting_id]

    def _add(
        self,
        now_s: float,
        seen_from: Pose2,
        region: Detection,
        name: str,
        crop: bytes,
        view: StoredView | None,
    ) -> Sighting:
        """Add a new entry; called with the lock."""
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
        pixels = int(region.mask.sum())
        self._items[sighting.id] = _Item(
            sighting, set(region.cells), seen_from, region.confidence, pixels, crop, view
        )
        return sighting

    def _look(
        self,
        item: _Item,
        now_s: float,
        seen_from: Pose2,
        region: Detection,
        crop: bytes,
        view: StoredView | None,
    ) -> None:
        """Count one more look at an entry, with its view where that is better; called with the
        lock."""
        if item.sighting.verdict == "rejected":
            return  # an image from before the rejection: none of them is surer
        item.cells |= region.cells
        item.seen_from = seen_from
        item.highest = max(item.highest, region.confidence)
        item.sighting = replace(item.sighting, looks=item.sighting.looks + 1, last_s=now_s)
        if view is not None:
            item.pixels, item.crop, item.view = int(region.mask.sum()), crop, view
            item.sighting = replace(
                item.sighting,
                place=region.position,
                confidence=region.confidence,
                has_image=True,
            )

    def _at(self, region: Detection) -> _Item | None:
        """Return the oldest entry of a region's class on or beside its cells, none that was
        rejected with less confidence; None without one."""
        steps = (-1, 0, 1)
        around = {(row + i, col + j) for row, col in region.cells for i in steps for j in steps}
        with self._lock:
            for item in self._items.values():
                surer = region.confidence > item.highest
                if item.sighting.class_id != region.class_id or around.isdisjoint(item.cells):
                    continue
                if not (item.sighting.verdict == "rejected" and surer):
                    return item
        return None

    def _keep_bounds(self) -> None:
        while len(self._items) > MAX_SIGHTINGS:
            del self._items[min(self._items, key=lambda key: self._items[key].sighting.last_s)]
        with_view = [item for item in self._items.values() if item.view is not None]
        while len(with_view) > MAX_VIEWS:
            oldest = min(with_view, key=lambda item: item.sighting.last_s)
            with_view.remove(oldest)
            oldest.view, oldest.sighting = None, replace(oldest.sighting, has_image=False)


def packed(
    frame: Frame, labels: Labels, beware: BewareList, mask: npt.NDArray[np.bool_]
) -> StoredView:
    """Compress a frame with its labels and the mask (H, W) of one object."""
    binding = labels.mask(beware)
    depth_mm = np.clip(np.round(frame.depth_m * 1000), 0, 65535).astype(np.uint16)
    return StoredView(
        rgb_png=encode_rgb(frame.rgb, uncoloured=frame.uncoloured),
        depth_png=_png(depth_mm),
        class_ids_png=_png(np.where(binding, labels.class_ids, np.uint8(0))),
        unsure_png=_mask_png(_unsure(frame, labels, binding)),
        mask_png=_mask_png(mask),
    )


def _unsure(frame: Frame, labels: Labels, binding: Bools) -> Bools:
    """Return the (H, W) pixels that are neither known to show a class of the list, as `binding`
    tells, nor to show background."""
    is_background = (labels.class_ids == NOTHING) & (labels.confidence >= MIN_BACKGROUND_CONFIDENCE)
    if labels.unlisted is not None:
        is_background &= ~labels.unlisted
    is_known = binding | is_background
    if frame.uncoloured is not None:
        is_known &= ~frame.uncoloured
    return np.asarray(~is_known)


def unpacked(png: bytes) -> npt.NDArray[np.integer]:
    """Decompress an image of a `StoredView`; colours come as BGR."""
    return np.asarray(cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_UNCHANGED))


def _mask_png(mask: npt.NDArray[np.bool_]) -> bytes:
    return _png(mask.view(np.uint8) * np.uint8(255))


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
