"""As much of a viser client as figures and tests need: to be taken for a browser, and to read which
nodes a frame speaks of."""

from __future__ import annotations

from typing import Any

import msgspec
import zstandard
from websockets.typing import Subprotocol

SUBPROTOCOL = Subprotocol("viser-v1.1.1")


def camera() -> bytes:
    """The first message of a viser client; with it, it counts as connected."""
    place = {
        "wxyz": [0.0, 1.0, 0.0, 0.0],
        "position": [0.0, 0.0, 10.0],
        "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 0.0, 1.0],
    }
    lens = {"fov": 1.3, "near": 0.01, "far": 1000.0, "image_height": 600, "image_width": 800}
    return bytes(msgspec.msgpack.encode({"type": "ViewerCameraMessage", **place, **lens}))


def names_in(frame: bytes) -> set[str]:
    """Names of the scene nodes that a frame of viser speaks of."""
    size = int.from_bytes(frame[8:16], "little")
    messages: Any = msgspec.msgpack.decode(
        zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
    )["messages"]
    return {str(message["name"]) for message in messages if "name" in message}
