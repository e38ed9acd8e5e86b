"""The parts of the benchmark."""

from __future__ import annotations

from enum import StrEnum


class BenchPart(StrEnum):
    """What `bench` can measure."""

    DRIVE = "drive"
    TICK = "tick"
    SEGMENT = "segment"
    PLAN = "plan"
    CONSOLE = "console"
