"""The parts of the benchmark."""

from __future__ import annotations

from enum import StrEnum


class BenchPart(StrEnum):
    """A part of the benchmark; the values are the arguments of `bench`."""

    DRIVE = "drive"
    TICK = "tick"
    CORRECTION = "correction"
    SEGMENT = "segment"
    PLAN = "plan"
    CONSOLE = "console"
    TRAIN = "train"
    PAGE = "page"
    LATENCY = "latency"
    SOAK = "soak"
