"""Colours and patterns of the layers, the same in the 3D view, on the map and in the legend."""

from __future__ import annotations

from navcore.mission.zone import Zone, ZoneKind

Rgb = tuple[int, int, int]

UNKNOWN: Rgb = (62, 71, 87)
"""Unobserved cells, which are free to the planner."""
UNKNOWN_DOT: Rgb = (126, 138, 158)
"""Dots on unobserved cells."""
FREE: Rgb = (206, 214, 226)
"""Observed free cells."""
INFLATED: Rgb = (120, 134, 158)
"""Cells closed to the robot's centre."""
GEOMETRIC: Rgb = (12, 15, 20)
"""Geometric obstacles."""
ZONE: Rgb = (214, 51, 132)
"""Keep-out zones."""
SLOW: Rgb = (183, 121, 31)
"""Speed-limit zones."""
PATH: Rgb = (10, 132, 255)
DRIVEN: Rgb = (87, 100, 122)
GOAL: Rgb = (0, 168, 107)
DRAFT: Rgb = (255, 183, 3)
PERSON: Rgb = (232, 93, 4)

# Distinct for the common forms of colour blindness (after Okabe and Ito), and by patterns.
_CLASSES: tuple[Rgb, ...] = (
    (230, 57, 53),
    (64, 160, 43),
    (30, 102, 245),
    (223, 142, 29),
    (136, 57, 239),
    (4, 165, 229),
    (178, 102, 60),
    (23, 146, 153),
)
PATTERNS = ("stripes rising", "dots", "stripes falling", "grid", "bars", "columns")
"""Patterns of the classes, by class id."""


def class_colour(class_id: int) -> Rgb:
    """Return the colour of a class of the beware list, constant for its id."""
    return _CLASSES[(class_id - 1) % len(_CLASSES)]


def class_pattern(class_id: int) -> str:
    """Return the pattern of a class of the beware list."""
    return PATTERNS[(class_id - 1) % len(PATTERNS)]


def zone_colour(zone: Zone) -> Rgb:
    """Return the colour that the operator chose for a zone, or that of its kind."""
    if zone.colour is not None:
        return int(zone.colour[1:3], 16), int(zone.colour[3:5], 16), int(zone.colour[5:7], 16)
    return SLOW if zone.kind is ZoneKind.SPEED_LIMIT else ZONE


def hex_colour(rgb: Rgb) -> str:
    """Return `#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)
