"""Class names of the shipped network, in the order of its outputs."""

from __future__ import annotations

from navcore.perception.esanet.weights.class_names import BACKGROUND

__all__ = ["BACKGROUND", "BEWARE_CLASSES"]
BEWARE_CLASSES: tuple[str, ...] = (
    BACKGROUND,
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
"""Class names; class i has the label i + 1, and 0 is void, which no network predicts."""
