"""The camera image as JPEG, and what it shows of the beware list."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels
from web.images import palette
from web.images.encode import PNG_OPTIONS, Image, Mask, encoded
from web.interface.snapshots import TickSnapshot

JPEG_QUALITY = 80
MASK_BGRA = (255, 0, 255, 170)
"""Blue, green, red and opacity of the pixels that a colour rule takes, 0 to 255."""
MIN_LABELLED_SHARE = 0.0005
"""Share of the image below which an object gets no label."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageLabel:
    """Object of the beware list in the camera image."""

    name: str
    """What people call its class."""
    class_id: int
    """Id of its class in the beware list."""
    confidence: float
    """Mean confidence of its pixels, 0 to 1."""
    box: tuple[float, float, float, float]
    """Left, top, right and bottom edge as shares of the image's width and height."""


def camera_jpg(image: Image) -> bytes:
    """Return an RGB image (H, W, 3) as JPEG."""
    return encoded(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    )


def mask_png(mask: Mask) -> bytes:
    """Return the pixels of a mask (H, W) as PNG, all others transparent."""
    image = np.zeros((*mask.shape, 4), dtype=np.uint8)
    image[mask] = MASK_BGRA
    return encoded(".png", image, PNG_OPTIONS)


def narrowed(image: npt.NDArray[np.uint8], width: int) -> npt.NDArray[np.uint8]:
    """Return an image with at most this width in pixels; no pixel of it is a mixture."""
    if image.shape[1] <= width:
        return image
    height = max(round(image.shape[0] * width / image.shape[1]), 1)
    return np.asarray(
        cv2.resize(image, (width, height), interpolation=cv2.INTER_NEAREST), dtype=np.uint8
    )


def with_overlay(tick: TickSnapshot, beware: BewareList, *, named: bool = True) -> Image:
    """Return the camera image (H, W, 3) with the objects of the enabled classes tinted by their
    confidence and outlined, and with their names unless a viewer writes them itself."""
    image = tick.rgb.copy()
    for entry, mask in _masks(tick, beware):
        colour = palette.class_colour(entry.class_id)
        opacity = (0.25 + 0.45 * tick.confidence[mask])[:, None]
        image[mask] = ((1 - opacity) * image[mask] + opacity * np.array(colour)).astype(np.uint8)
        outlines, _ = cv2.findContours(
            mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        cv2.drawContours(image, outlines, -1, colour, 2)
        if named:
            left, top, _, _ = cv2.boundingRect(max(outlines, key=cv2.contourArea))
            name = entry.title if entry.title.isascii() else entry.name  # OpenCV draws no other
            _name(image, f"{name} {tick.confidence[mask].mean():.0%}", left, top)
    return image


def labels_of(tick: TickSnapshot, beware: BewareList) -> tuple[ImageLabel, ...]:
    """Return a label for every separate object of the enabled classes in the camera image."""
    rows, cols = tick.labels.shape
    found = []
    for entry, mask in _masks(tick, beware):
        count, regions, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8))
        for region in range(1, count):
            left, top, width, height, area = stats[region].tolist()
            if area < MIN_LABELLED_SHARE * rows * cols:
                continue
            found.append(
                ImageLabel(
                    name=entry.title,
                    class_id=entry.class_id,
                    confidence=float(tick.confidence[regions == region].mean()),
                    box=(left / cols, top / rows, (left + width) / cols, (top + height) / rows),
                )
            )
    return tuple(found)


def _masks(tick: TickSnapshot, beware: BewareList) -> Iterator[tuple[BewareClass, Mask]]:
    """Yield the enabled classes in the image with their pixels (H, W)."""
    binding = beware_mask(tick, beware)
    for entry in beware.enabled:
        mask = binding & (tick.labels == entry.class_id)
        if mask.any():
            yield entry, mask


def beware_mask(tick: TickSnapshot, beware: BewareList) -> Mask:
    """Return (H, W) the pixels of the enabled classes with sufficient confidence."""
    return Labels(class_ids=tick.labels, confidence=tick.confidence).mask(beware)


def _name(image: Image, text: str, left: int, top: int) -> None:
    """Write white text with a black rim above a position, or just below it at the upper edge;
    OpenCV draws ASCII only."""
    text = text.encode("ascii", "replace").decode()
    (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 1)
    at = min(left, max(image.shape[1] - wide - 2, 0)), top - 4 if top > high + 6 else top + high + 6
    for x, y, level in ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, 255)):
        corner = at[0] + x, at[1] + y
        cv2.putText(
            image,
            text,
            corner,
            cv2.FONT_HERSHEY_SIMPLEX,
            0.4,
            (level, level, level),
            1,
            cv2.LINE_AA,
        )
