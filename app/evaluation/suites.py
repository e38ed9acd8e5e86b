"""Names of the suites, as campaigns, summaries and `bewarenav evaluate` call them."""

from __future__ import annotations

from enum import StrEnum


class Suite(StrEnum):
    """What is measured."""

    RANDOM = "random"
    """Missions in a world whose start and goal each seed draws."""
    GIVEN = "given"
    """The mission of a world, e.g. the paper's."""
    BARN = "barn"
    DYNABARN = "dynabarn"
    CROSSINGS = "crossings"
    UNSEEN_CROSSINGS = "unseen-crossings"
    """Crossings that are left out of the others, as the camera shows the person too late."""
    DOORS = "doors"
    LOCALISATION = "localisation"
    FINDING = "finding"
    ONE_CLICK = "one-click"
    LIGHT = "light"
    TEACHING = "teaching"
    TABLE_TOPS = "table-tops"
    PRINTS = "prints"
    REPLAY = "replay"
    """A recording with annotated objects."""


BARN_SUITES = (Suite.BARN, Suite.DYNABARN)
"""Suites of the published worlds."""
VIEWING = (
    *(Suite.FINDING, Suite.ONE_CLICK, Suite.LIGHT, Suite.TEACHING),
    *(Suite.TABLE_TOPS, Suite.PRINTS),
)
"""Suites in which a camera sees things and nothing drives."""
UNRECORDED = (Suite.LOCALISATION, Suite.TEACHING, Suite.TABLE_TOPS)
"""Suites that write their results at their end alone, and begin again after an interruption."""
CROSSING_SUITES = (Suite.CROSSINGS, Suite.UNSEEN_CROSSINGS)
"""Suites of people who cross the robot's path."""
BY_NAME = (*BARN_SUITES, *CROSSING_SUITES, Suite.DOORS, Suite.LOCALISATION, *VIEWING)
"""Suites that `bewarenav evaluate` takes by their names; any other argument is a world."""
