"""Ablations: one part of the navigation is left out, or made perfect."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from app.episode.ablations import Ablation
from navcore.config.navigator import NavigatorConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import BoolGrid
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from navcore.stages import Stages
from sim.simulator import Simulator

TURN_FROM_RAD = math.radians(60)
"""Heading error above which the robot turns in place, radians."""


class SeesNothing:
    """A segmenter without any detection."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label every pixel as nothing."""
        shape = frame.depth_m.shape
        return Labels(
            class_ids=np.full(shape, NOTHING, np.uint8), confidence=np.ones(shape, dtype=np.float32)
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return that no class is detected."""
        return LabelSource.NOTHING


class Oracle:
    """A segmenter with the simulator's true labels, which are noted when a frame arrives: at the
    end of its tick the simulator shows something else."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._shown: dict[int, dict[str, BoolGrid]] = {}

    def look(self, frame: Frame) -> None:
        """Note the ground truth of a frame that was taken now."""
        self._shown[frame.stamp_ns] = self._simulator.true_labels()

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label the pixels with the ground truth, at full confidence; an unknown frame, as of the
        warm-up, shows nothing."""
        class_ids = np.full(frame.depth_m.shape, NOTHING, np.uint8)
        shown = self._shown.get(frame.stamp_ns, {})
        self._shown = {t_ns: kept for t_ns, kept in self._shown.items() if t_ns > frame.stamp_ns}
        for entry in beware.classes:
            if entry.detected_as in shown:
                class_ids[shown[entry.detected_as]] = entry.class_id
        return Labels(class_ids=class_ids, confidence=np.ones(class_ids.shape, dtype=np.float32))

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return that every class is detected, as by a network."""
        return LabelSource.NETWORK


def segmenter_for(ablation: Ablation, usual: Segmenter, simulator: Simulator) -> Segmenter:
    """Return the segmenter of an ablation."""
    if ablation is Ablation.NO_SEMANTICS:
        return SeesNothing()
    return Oracle(simulator) if ablation is Ablation.ORACLE else usual


def ablate(
    stages: Stages, ablation: Ablation, profile: RobotProfile, config: NavigatorConfig
) -> Stages:
    """Return the stages of an ablation: pure pursuit instead of the local planner, if chosen."""
    if ablation is not Ablation.NO_LOCAL_PLANNER:
        return stages

    def control(_controller: Controller, task: ControlTask) -> Motion:
        return pursue(task.track, task.pose, profile, config) if len(task.track) else IDLE

    return dataclasses.replace(stages, control=control)


def pursue(track: Points, pose: Pose2, profile: RobotProfile, config: NavigatorConfig) -> Motion:
    """Follow the path by pure pursuit, without obstacles: towards the lookahead point, turning in
    place at a large heading error."""
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
