"""A robot controller with a mission, and the commands that it gives."""

from __future__ import annotations

from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from navcore.mission.mission import Mission
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision
from navcore.safety.sensor_monitor import SensorMonitor
from navcore.stages import Stages
from tests.navcore.scene import RED_LIST, SPEC
from tests.navcore.ticks import OPEN, SECOND, navigator


def controller(*goals: tuple[float, float], stages: Stages | None = None) -> RobotController:
    mission = Mission()
    for x, y in goals:
        mission = mission.add(x, y, SPEC)
    intent = OperatorState(mission=mission.start() if goals else mission, beware=RED_LIST)
    return RobotController(navigator=navigator(stages), profile=HUSKY, intent=intent)


def forget_frames(driver: RobotController) -> None:
    """Have the next frame accepted, whatever came before it."""
    driver._mapped = driver._watched = SensorMonitor()


def think(driver: RobotController, frame: Frame = OPEN) -> None:
    forget_frames(driver)
    driver.think(frame, clock=lambda: frame.stamp_ns)


def command(driver: RobotController, after_s: float = 0.0) -> GateDecision:
    newest = driver.tick_state.decision.frame if driver.tick_state.decision else None
    return driver.command(lambda: SECOND + round(after_s * SECOND), 0.05, newest=newest)


def causes(verdict: GateDecision) -> list[Cause]:
    return [reason.cause for reason in verdict.reasons]
