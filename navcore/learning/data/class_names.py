"""The classes that the network for the beware list tells apart, in the order of its outputs."""

from __future__ import annotations

BEWARE_CLASSES: tuple[str, ...] = (
    "background",
    "book",
    "cup",
    "bottle",
    "cable",
    "box",
    "keyboard",
    "landmine",
    "red floor",
    "spill",
    "wet-floor sign",
    "person",
)
"""In a label picture class i has the value i + 1; 0 is void, which no network predicts."""
