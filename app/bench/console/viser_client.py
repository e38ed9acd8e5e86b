"""A minimal viser client for benchmarks and tests: connect as a browser, read node names."""

from __future__ import annotations

from typing import Any

import msgspec
import zstandard
from websockets.typing import Subprotocol

SUBPROTOCOL = Subprotocol("viser-v1.1.1")


def camera() -> bytes:
    """Return the first message of a viser client, after which viser counts it as connected."""
    pose = {
        "wxyz": [0.0, 1.0, 0.0, 0.0],
        "position": [0.0, 0.0, 10.0],
        "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 0.0, 1.0],
    }
    lens = {"fov": 1.3, "near": 0.01, "far": 1000.0, "image_height": 600, "image_width": 800}
    return bytes(msgspec.msgpack.encode({"type": "ViewerCameraMessage", **pose, **lens}))


def messages_in(frame: bytes) -> list[dict[str, Any]]:
    """Return the messages in a websocket frame of viser."""
    size = int.from_bytes(frame[8:16], "little")
    unpacked = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
    messages: list[dict[str, Any]] = msgspec.msgpack.decode(unpacked)["messages"]
    return messages


def names_in(frame: bytes) -> set[str]:
    """Return the names of the scene nodes in a websocket frame of viser."""
    return {str(message["name"]) for message in messages_in(frame) if "name" in message}
