"""Rows 7 to 11: impossible goals, zones drawn on the path, and sudden obstacles."""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np

from app.episode.episode import Episode
from app.runtime.control.robot_controller import COMMAND_PERIOD_S, RobotController
from navcore.config.safety import DEFAULT_SAFETY
from navcore.control.motion import ControllerState, Motion
from navcore.errors import BadGeometry
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.mission.zone import Zone
from navcore.planning.path import NoPath, Reason
from navcore.planning.planner import plan
from navcore.planning.route import no_route
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import StopReason
from navcore.stages import Stages
from sim.scenario.schema import Mover
from tests.app.runtime.control.controlled import forget_frames
from tests.reliability.fault_runs import OPEN_FLOOR, fault_run, first_frame, standing_controller
from tests.reliability.result import Measurement

Corners = tuple[tuple[float, float], ...]
BUDGET = 200
"""Expansion budget of the searches that exceed it; a whole search over these grids takes some
thousand."""


def _zone(corners: Corners, name: str = "drawn") -> Zone:
    return Zone(id=name, name=name, polygon=corners)


def _square(x_m: float, y_m: float, half_m: float, turn_rad: float = 0.0) -> Corners:
    angles = turn_rad + math.pi / 4 + math.pi / 2 * np.arange(4)
    reach = half_m * math.sqrt(2)
    return tuple((x_m + reach * math.cos(angle), y_m + reach * math.sin(angle)) for angle in angles)


def over_budget(trials: int) -> Measurement:
    """Row 7: searches on random grids that exceed their budget, and their duration compared with
    the whole search."""
    rng, given_up, over_ms = np.random.default_rng(7), 0, []
    for _ in range(trials):
        blocked = rng.random((400, 400)) < 0.33
        blocked[:8, :8] = blocked[-8:, -8:] = False
        began_s = time.perf_counter()
        whole = plan(blocked, (2, 2), (397, 397))
        whole_s, began_s = time.perf_counter() - began_s, time.perf_counter()
        cut = plan(blocked, (2, 2), (397, 397), max_expansions=BUDGET)
        over_ms.append((time.perf_counter() - began_s - whole_s) * 1e3)
        early = isinstance(whole, NoPath)  # walled in: found out before the budget was spent
        given_up += early or cut == NoPath(reason=Reason.TIMEOUT)
    held = _held_over_budget()
    p99_ms = float(np.percentile(over_ms, 99))
    return Measurement(
        trials=trials,
        measured=f"{given_up} given up, p99 {p99_ms:+.1f} ms against the whole search; "
        f"held: {'yes' if held else 'NO'}",
        met=given_up == trials and held and p99_ms <= 10.0,
    )


def _held_over_budget() -> bool:
    """Return whether a controller whose search is given up stands, with that reason."""
    timed_out = no_route(Reason.TIMEOUT)
    controller = standing_controller(stages=Stages(replan=lambda *_: timed_out))
    frame = first_frame()
    moved, reasons, _ = _response(controller, frame, (2.0, 2.0))
    return not moved and any(Reason.TIMEOUT in reason.text for reason in reasons)


def _response(
    controller: RobotController, frame: Frame, goal: tuple[float, float]
) -> tuple[bool, tuple[StopReason, ...], float]:
    """Return whether the robot moves when sent to a goal, why not, and the seconds of computation
    until that is known."""
    began_s = time.perf_counter()
    controller.change_mission(
        lambda mission: mission.add(*goal, controller.navigator.map.spec).start()
    )
    controller.think(frame, clock=lambda: frame.stamp_ns)
    verdict = controller.command(lambda: frame.stamp_ns, COMMAND_PERIOD_S, newest=frame)
    return verdict.twist != STANDSTILL, verdict.reasons, time.perf_counter() - began_s


def _pilot_with(areas: tuple[Corners, ...]) -> RobotController:
    controller = standing_controller()
    zones = tuple(_zone(corners, f"zone {number}") for number, corners in enumerate(areas))
    controller.change(lambda intent: dataclasses.replace(intent, zones=zones))
    return controller


def impossible_goals(trials: int) -> Measurement:
    """Row 8: impossible goals are told apart, in time, and without a motion.

    The robot faces along x from (-2.5, -2.5), and a box stands at (0.5, -2.4).
    """
    frame = first_frame()
    fence = (
        *(((1.0, y), (3.0, y), (3.0, y + 0.1), (1.0, y + 0.1)) for y in (0.9, 3.0)),
        *(((x, 0.9), (x + 0.1, 0.9), (x + 0.1, 3.1), (x, 3.1)) for x in (0.9, 3.0)),
    )
    cases: list[tuple[tuple[float, float], tuple[Corners, ...]]] = [
        ((0.24, -2.4), ()),
        ((2.0, 2.0), (_square(2.0, 2.0, 0.5),)),
        ((2.0, 2.0), fence),
        ((2.0, 2.0), (_square(-2.5, -2.5, 1.5),)),
        ((5000.0, 0.0), ()),
    ]
    slowest_s, moved, told = 0.0, 0, set[str]()
    for number in range(max(trials, len(cases))):
        goal, areas = cases[number % len(cases)]
        controller = _pilot_with(areas)
        # Observe first: a goal is judged by what has been seen.
        controller.think(frame, clock=lambda: frame.stamp_ns)
        forget_frames(controller)
        try:
            moves, reasons, took_s = _response(controller, frame, goal)
        except BadGeometry as error:
            moves, reasons, took_s = False, (), 0.0
            told.add(str(error))
        moved += moves
        slowest_s = max(slowest_s, took_s)
        # Without the name of the goal, which differs anyway.
        told.update(reason.text.split(": ", 1)[-1] for reason in reasons[:1])
    return Measurement(
        trials=max(trials, len(cases)),
        measured=f"{len(told)} different reasons, answered within {slowest_s * 1e3:.0f} ms, "
        f"{moved} moved",
        met=len(told) == len(cases) and moved == 0 and slowest_s <= 0.2,
    )


def zone_under_robot(trials: int) -> Measurement:
    """Row 9: zones of any size drawn over some part of the robot while it is told to drive."""
    rng, frame = np.random.default_rng(9), first_frame()
    stood = left = 0
    for _ in range(trials):
        x_m, y_m = (
            frame.pose.x_m + float(rng.uniform(-0.3, 0.3)),
            frame.pose.y_m + float(rng.uniform(-0.3, 0.3)),
        )
        controller = _pilot_with(
            (_square(x_m, y_m, float(rng.uniform(0.1, 0.8)), float(rng.uniform(0, math.pi))),)
        )
        moves, reasons, _ = _response(controller, frame, (2.0, 2.0))
        stood += not moves and bool(reasons)
        controller.change_mission(lambda mission: mission.pause().leave())
        forget_frames(controller)
        controller.think(frame, clock=lambda: frame.stamp_ns)
        verdict = controller.command(lambda: frame.stamp_ns, COMMAND_PERIOD_S, newest=frame)
        left += verdict.twist != STANDSTILL
    return Measurement(
        trials=trials,
        measured=f"{stood} stood with a reason; {left} moved once told to leave",
        met=stood == trials,
    )


def zone_across_path(trials: int, *, told: bool = True) -> Measurement:
    """Row 10: a zone appears on the path ahead of the driving robot, no nearer than it can brake;
    the referee watches it."""
    intrusions = drawn = 0
    for seed in range(trials):
        rng, zones = np.random.default_rng((10, seed)), list[Zone]()

        def draw(
            t_s: float, episode: Episode, rng: np.random.Generator = rng, zones: list[Zone] = zones
        ) -> None:
            decision = episode.controller.tick_state.decision
            if (
                zones
                or t_s < 1.2
                or decision is None
                or decision.route is None
                or not len(decision.route.points)
            ):
                return
            ahead = float(rng.uniform(1.9, 2.4)) + float(rng.uniform(0.2, 0.4))
            points, here = decision.route.points, episode.simulator.true_pose()
            far = [point for point in points if here.distance_to(*point) >= ahead]
            if not far:
                return
            x_m, y_m = far[0]
            zones.append(
                _zone(
                    _square(
                        float(x_m),
                        float(y_m),
                        float(rng.uniform(0.2, 0.5)),
                        float(rng.uniform(0, 3)),
                    )
                )
            )
            episode.simulator.referee.set_zones(tuple(np.array(zone.polygon) for zone in zones))
            if told:
                episode.controller.change(
                    lambda intent: dataclasses.replace(intent, zones=tuple(zones))
                )

        _, report = fault_run(seed=seed, until_s=7.0, on_command=draw)
        drawn += len(zones)
        intrusions += int(str(report["zone_intrusions"]))
    return Measurement(
        trials=trials,
        measured=f"{intrusions} intrusions, {drawn} zones drawn",
        met=intrusions == 0 and drawn == trials,
    )


def sudden_obstacle(trials: int) -> Measurement:
    """Row 11: at full speed, with a planner that sees nothing and drives straight on, so that only
    the gate can help."""
    track: list[tuple[float, float]] = []

    def follow(t_s: float, episode: Episode) -> None:
        track.append((t_s, episode.simulator.true_pose().x_m))

    fault_run(seed=0, until_s=2.0, scenario=OPEN_FLOOR, stages=drive_blindly(), on_command=follow)
    rng, contacts, nearest_m, fastest_mps = np.random.default_rng(11), 0, math.inf, 0.0
    reaction_s = DEFAULT_SAFETY.collision.reaction_s
    stop_m = HUSKY.max_speed_mps * reaction_s + HUSKY.max_speed_mps**2 / (2 * HUSKY.max_accel_mps2)
    for _ in range(trials):
        at_s, radius_m = float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.05, 0.4))
        x_m = (
            float(np.interp(at_s, *np.array(track).T))
            + HUSKY.length_m / 2
            + stop_m
            + 0.3
            + radius_m
        )
        there = (at_s + 0.004, x_m, float(rng.uniform(-0.3, 0.3)))
        post = Mover(
            keys=((0.0, 0.0, 10.0), (at_s, 0.0, 10.0), there),
            period_s=60.0,
            radius_m=radius_m,
            height_m=1.0,
        )
        world = dataclasses.replace(OPEN_FLOOR, movers=(post,))
        speeds: list[float] = []
        _, report = fault_run(
            seed=0,
            until_s=at_s + 1.6,
            scenario=world,
            stages=drive_blindly(),
            on_command=lambda t_s, episode, speeds=speeds: speeds.append(
                episode.simulator.velocity().v_mps
            ),  # type: ignore[misc]
        )
        contacts += int(str(report["collisions"]))
        fastest_mps = max(fastest_mps, *speeds)
        nearest_m = min(nearest_m, float(str(report["min_clearance_m"])))
    return Measurement(
        trials=trials,
        measured=f"{contacts} contacts from {fastest_mps:.2f} m/s, nearest {nearest_m:.2f} m",
        met=contacts == 0 and fastest_mps > 0.95,
    )


def drive_blindly() -> Stages:
    """Return stages whose local planner drives straight on at full speed."""
    full = Motion(
        twist=Twist(v_mps=HUSKY.max_speed_mps, w_radps=0.0), outcome=ControllerState.FOLLOW
    )
    return Stages(control=lambda *_: full)
