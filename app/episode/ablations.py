"""The ablations of an evaluation: which part of the navigation is left out."""

from __future__ import annotations

from enum import StrEnum


class Ablation(StrEnum):
    """Difference from the whole system."""

    NONE = "none"
    NO_SEMANTICS = "no-semantics"
    """No detection of the beware list: a robot with geometry alone."""
    NO_ZONES = "no-zones"
    """The robot does not know the operator's zones, by which the referee judges."""
    NO_LOCAL_PLANNER = "no-local-planner"
    """The path is followed without regard to nearby obstacles; the safety gate stays."""
    ORACLE = "oracle"
    """The simulator's true labels instead of a segmenter's."""
