"""Ticks of the whole navigation: the frames, the navigator and what is asked of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from tests.navcore.scene import RED_LIST, SPEC, picture

SECOND = 1_000_000_000
OPEN = picture(stamp_ns=SECOND)
NAN = dataclasses.replace(OPEN, depth_m=np.full_like(OPEN.depth_m, math.nan))
ACROSS = Zone(id="z", name="across", polygon=((1.5, -7.9), (2.0, -7.9), (2.0, 7.9), (1.5, 7.9)))


def navigator(stages: Stages | None = None) -> Navigator:
    return Navigator(
        spec=SPEC,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=stages,
    )


def order(
    goal: tuple[float, float] | None = (4.0, 0.0),
    *,
    enabled: bool = True,
    zones: tuple[Zone, ...] = (),
    leave: bool = False,
) -> NavigationRequest:
    return NavigationRequest(
        goal=goal, beware=RED_LIST.edited("red floor", enabled=enabled), zones=zones, leave=leave
    )
