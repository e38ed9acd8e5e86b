"""Leave one part of the navigation out, or make one perfect, to see what it is worth."""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.geometry.arrays import Points, path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.navigator import Stages
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from sim.simulator import Simulator

TURN_FROM_RAD = math.radians(60)
"""A path that leads off by more than this is turned to on the spot."""


class SeesNothing:
    """A segmenter that never sees anything."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Nothing in every pixel."""
        shape = frame.depth_m.shape
        return Labels(
            class_ids=np.full(shape, NOTHING, np.uint8), confidence=np.ones(shape, dtype=np.float32)
        )

    def finds(self, entry: BewareClass) -> LabelSource:
        """Nothing."""
        return LabelSource.NOTHING


class Oracle:
    """A segmenter that is told by the simulator. It must be asked about a picture before the
    simulator steps on."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """The truth, with certainty."""
        class_ids = np.full(frame.depth_m.shape, NOTHING, np.uint8)
        shown = self._simulator.true_labels()
        for entry in beware.classes:
            # The warm-up shows a picture of its own, of another size.
            if entry.name in shown and shown[entry.name].shape == class_ids.shape:
                class_ids[shown[entry.name]] = entry.class_id
        return Labels(class_ids=class_ids, confidence=np.ones(class_ids.shape, dtype=np.float32))

    def finds(self, entry: BewareClass) -> LabelSource:
        """Everything, as a network that knows everything would."""
        return LabelSource.NETWORK


def segmenter_for(ablation: Ablation, usual: Segmenter, simulator: Simulator) -> Segmenter:
    """What labels the pictures."""
    if ablation is Ablation.NO_SEMANTICS:
        return SeesNothing()
    return Oracle(simulator) if ablation is Ablation.ORACLE else usual


def ablate(
    stages: Stages, ablation: Ablation, profile: RobotProfile, config: NavigatorConfig
) -> Stages:
    """Replace the local planner by pure pursuit where that is asked for."""
    if ablation is not Ablation.NO_LOCAL_PLANNER:
        return stages

    def control(_controller: Controller, task: ControlTask) -> Motion:
        return pursue(task.track, task.pose, profile, config) if len(task.track) else IDLE

    return dataclasses.replace(stages, control=control)


def pursue(track: Points, pose: Pose2, profile: RobotProfile, config: NavigatorConfig) -> Motion:
    """Pure pursuit of the path, blind to all else: towards a point ahead on it, turning on the spot
    where it leads off."""
    rules = config.local
    path = path_from(track, pose)
    goal_m = float(np.hypot(*path[-1]))
    if goal_m <= rules.arrival_m:
        return Motion(twist=STANDSTILL, outcome=ControllerState.ARRIVED)
    away_m = np.hypot(*path.T)
    ahead = np.flatnonzero(away_m >= rules.lookahead_m)
    x, y = path[ahead[0]] if len(ahead) else path[-1]
    bearing = math.atan2(y, x)
    if abs(bearing) > TURN_FROM_RAD:
        return Motion(
            twist=Twist(v_mps=0.0, w_radps=math.copysign(rules.turn_rate_radps, bearing)),
            outcome=ControllerState.TURN,
        )
    curvature = 2 * y / max(x**2 + y**2, 1e-6)
    v_mps = min(
        profile.max_speed_mps,
        math.sqrt(rules.braking_mps2 * goal_m) + 0.02,
        rules.turn_rate_radps / max(abs(curvature), 1e-6),
    )
    return dataclasses.replace(
        IDLE, twist=Twist(v_mps=v_mps, w_radps=v_mps * curvature), outcome=ControllerState.FOLLOW
    )


class Ablation(StrEnum):
    """What is different from the whole system."""

    NONE = "none"
    NO_SEMANTICS = "no-semantics"
    """Nothing of the beware list is ever seen: a robot with geometry alone."""
    NO_ZONES = "no-zones"
    """The operator's zones are not told to the robot; the referee judges by them all the same."""
    NO_LOCAL_PLANNER = "no-local-planner"
    """The path is followed directly, with no look at what stands near it; the gate before the
    wheels stays."""
    ORACLE = "oracle"
    """The simulator's own labels in the place of a segmenter's."""
