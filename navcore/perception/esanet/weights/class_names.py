"""Class names of the background, and of the public data sets in the order of the network's
outputs."""

from __future__ import annotations

BACKGROUND = "background"
"""Class of everything that is none of the others; those of the public data sets have none."""
SUNRGBD_CLASSES = (
    *(
        "wall",
        "floor",
        "cabinet",
        "bed",
        "chair",
        "sofa",
        "table",
        "door",
        "window",
        "bookshelf",
        "picture",
        "counter",
    ),
    *(
        "blinds",
        "desk",
        "shelves",
        "curtain",
        "dresser",
        "pillow",
        "mirror",
        "floor mat",
        "clothes",
        "ceiling",
        "books",
    ),
    *(
        "fridge",
        "tv",
        "paper",
        "towel",
        "shower curtain",
        "box",
        "whiteboard",
        "person",
        "night stand",
        "toilet",
        "sink",
    ),
    *("lamp", "bathtub", "bag"),
)
"""The 37 classes of SUN RGB-D (Song et al. 2015)."""

NYUV2_CLASSES = (
    *(
        "refrigerator" if name == "fridge" else "television" if name == "tv" else name
        for name in SUNRGBD_CLASSES
    ),
    *("other structure", "other furniture", "other prop"),
)
"""The 40 classes of NYUv2 (Gupta et al. 2013); SUN RGB-D uses the first 37 and shortens two names.
"""

ALIASES = {
    "books": "book",
    "cell phone": "phone",
    "cables": "cable",
    "carton": "box",
    "cardboard box": "box",
    "human": "person",
    "mug": "cup",
    "wet floor sign": "wet-floor sign",
}
"""Class names of data sets (left) with another name on the beware list (right)."""


def aliases_for(class_names: tuple[str, ...]) -> dict[str, str]:
    """Return the aliases of a network's classes."""
    return {name: ALIASES[name.casefold()] for name in class_names if name.casefold() in ALIASES}
