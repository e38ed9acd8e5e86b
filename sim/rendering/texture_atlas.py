"""All textures of a world in one array, each with its smaller copies (mipmaps)."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from sim.models.textures import Texture

Levels = npt.NDArray[np.int32]
Texels = npt.NDArray[np.uint8]


def pack_textures(textures: list[Texture]) -> tuple[Levels, Texels]:
    """Return (textures, levels, 3) first texel, width and height of each level, 0 where a texture
    has no more, and the (texels, 3) colours of all."""
    copies = [_mipmaps(texture) for texture in textures]
    levels = np.zeros((len(copies), max(map(len, copies), default=1), 3), dtype=np.int32)
    rows: list[Texels] = [np.zeros((0, 3), dtype=np.uint8)]
    first = 0
    for i, images in enumerate(copies):
        for k, image in enumerate(images):
            levels[i, k] = first, image.shape[1], image.shape[0]
            rows.append(image.reshape(-1, 3))
            first += image.shape[0] * image.shape[1]
    return levels, np.concatenate(rows)


def _mipmaps(texture: Texture) -> list[Texture]:
    """Return the texture and its copies, each half as large, down to one pixel."""
    images = [texture]
    while max(images[-1].shape[:2]) > 1:
        height, width = (max(1, side // 2) for side in images[-1].shape[:2])
        smaller = cv2.resize(images[-1], (width, height), interpolation=cv2.INTER_AREA)
        images.append(np.asarray(smaller, dtype=np.uint8))
    return images
