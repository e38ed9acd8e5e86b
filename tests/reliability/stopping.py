"""Rows 1 to 6: time to standstill when sensors, planner or console fail."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from itertools import product

import numpy as np

from app.runtime.control.robot_controller import COMMAND_PERIOD_S
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.sensor_monitor import SensorMonitor
from sim.scenario.schema import MapExtent, Scenario
from sim.sensors.faults import Fault
from sim.simulator import STEPS_PER_S, Simulator
from tests.app.runtime.control.controlled import forget_frames
from tests.reliability.fault_runs import (
    FaultRun,
    bench_run,
    fault_run,
    first_frame,
    standing_controller,
)
from tests.reliability.result import Measurement

FROM_S, UNTIL_S, END_S = 1.2, 2.7, 3.7
"""Times of a run: the fault begins, the fault ends, and the run ends after driving on."""
MOMENTS = 13
"""Number of different moments at which a fault begins; the last of them leaves a second of fault.
"""
LATE_S = 0.02
"""Delay that a busy machine may put between judging a command and sending it."""
STILL_MPS = 0.01


def _trials(faults: list[Fault], trials: int) -> list[tuple[int, Fault]]:
    """Return (seed, fault) of each trial: all faults in turn, then again with another seed, at
    another moment of half a second."""
    turns = product(range(-(-trials // len(faults))), faults)
    return [
        (seed, _delayed(fault, 0.021 + 0.037 * (seed % MOMENTS)))
        for seed, fault in list(turns)[:trials]
    ]


def _delayed(fault: Fault, by_s: float) -> Fault:
    """Return the fault delayed, so that it does not begin at the moment of a frame."""
    return dataclasses.replace(fault, from_s=fault.from_s + by_s)


def _is_driven(record: FaultRun, from_s: float, until_s: float) -> bool:
    return any(sent.moving for sent in record.between(from_s, until_s))


def silent_camera(trials: int) -> Measurement:
    """Row 1: true age of the content of the newest image while the robot was still told to move."""
    span = {"sensor": "camera", "from_s": FROM_S, "until_s": UNTIL_S}
    faults = [
        Fault(kind="off", **span),  # type: ignore[arg-type]
        Fault(kind="stuck", **span),  # type: ignore[arg-type]
        Fault(kind="slow", period_s=1.2, **span),  # type: ignore[arg-type]
        Fault(kind="intermittent", share=0.9, **span),  # type: ignore[arg-type]
        Fault(kind="delayed", delay_s=0.7, **span),  # type: ignore[arg-type]
    ]
    oldest_s, drove, said, unsaid = 0.0, 0, 0, 0
    for seed, fault in _trials(faults, trials):
        record, _ = fault_run(fault, seed=seed, until_s=END_S)
        oldest_s = max([oldest_s, *(sent.content_age_s for sent in record.sent if sent.moving)])
        drove += _is_driven(record, 0.0, fault.from_s) and _is_driven(record, UNTIL_S, END_S)
        named = any(
            cause in ("stale_frame", "stuck_camera")
            for sent in record.sent
            for cause in sent.causes
        )
        said += named
        # # An intermittent camera may deliver a frame in time by chance: then there is nothing to
        # name.
        unsaid += not named and any(
            sent.content_age_s > 0.5 + COMMAND_PERIOD_S for sent in record.sent
        )
    return Measurement(
        trials=trials,
        measured=f"moved on content at most {oldest_s:.2f} s old; camera named in {said}, "
        f"not named though late in {unsaid}, drove before and after in {drove}",
        met=oldest_s <= 0.5 and drove == trials and unsaid == 0 and said > 0,
    )


def hung_planner(trials: int) -> Measurement:
    """Row 2: age of the oldest command that was sent while the planner hung, in real time."""
    faults: list[Fault] = []
    with bench_run(faults) as (robot, now_s):
        for _ in range(trials):
            sent = len(robot.ages_s)
            _wait_until(lambda sent=sent: len(robot.ages_s) > sent + 5)
            faults.append(
                Fault(sensor="planner", kind="hang", from_s=now_s(), until_s=now_s() + 0.6)
            )
            time.sleep(0.7)
    oldest_s = max(robot.ages_s)
    return Measurement(
        trials=trials,
        measured=f"oldest command sent {oldest_s * 1e3:.0f} ms",
        met=oldest_s <= 0.25 + LATE_S,
    )


def _wait_until(holds: object, patience_s: float = 20.0) -> None:
    until_s = time.monotonic() + patience_s
    while not holds() and time.monotonic() < until_s:  # type: ignore[operator]
        time.sleep(0.01)


def frozen_console(trials: int) -> Measurement:
    """Row 3: time that the robot rolls on after the last command."""
    world = Scenario(
        name="open",
        size_m=(40.0, 40.0),
        map=MapExtent(size_m=(40.0, 40.0)),
        start=(-15.0, 0.0, 0.0),
    )
    longest_s, rng = 0.0, np.random.default_rng(0)
    with Simulator(world, seed=0, camera_size=(16, 16), camera_rate_hz=0.001) as simulator:
        for _ in range(trials):
            twist = Twist(v_mps=float(rng.uniform(0.2, 1.0)), w_radps=float(rng.uniform(-1.0, 1.0)))
            for step in range(STEPS_PER_S + int(rng.integers(12))):
                if step % 12 == 0:
                    last_ns = simulator.now_ns()
                    simulator.send(twist)
                simulator.step()
            until_ns = last_ns + 3_000_000_000
            while abs(simulator.velocity().v_mps) + abs(simulator.velocity().w_radps) > STILL_MPS:
                if simulator.now_ns() > until_ns:
                    break
                simulator.step()
            longest_s = max(longest_s, (simulator.now_ns() - last_ns) / 1e9)
    allowed_s = (
        0.25
        + max(HUSKY.max_speed_mps / HUSKY.max_accel_mps2, 1.0 / HUSKY.max_yaw_accel_radps2)
        + 0.15
    )
    return Measurement(
        trials=trials,
        measured=f"stood at most {longest_s:.2f} s after the last command "
        "(braking from 1 m/s takes 0.33 s)",
        met=longest_s <= allowed_s,
    )


def _clock_at(stamp_ns: int) -> Callable[[], int]:
    return lambda: stamp_ns


def malformed_frames(trials: int) -> Measurement:
    """Row 4: frames with one defect, and the number that got through."""
    controller, rng, good = standing_controller(), np.random.default_rng(4), first_frame()
    controller.change_mission(
        lambda mission: mission.add(0.0, 2.5, controller.navigator.map.spec).start()
    )
    refused = escaped = 0
    for number in range(trials):
        frame = malformed(good, number, rng)
        forget_frames(controller)
        clock = _clock_at(frame.stamp_ns)
        try:
            decision = controller.think(frame, clock=clock)
        except Exception:
            escaped += 1
            continue
        verdict = controller.command(clock, COMMAND_PERIOD_S, newest=frame)
        refused += decision is None and controller.tick_state.bad_frame is not None
        numbers = (verdict.twist.v_mps, verdict.twist.w_radps)
        escaped += not all(map(math.isfinite, numbers)) or decision is not None
        escaped += (
            not np.isfinite(controller.navigator.map.points.points_map).all()
            if number % 500 == 0
            else 0
        )
    return Measurement(
        trials=trials,
        measured=f"{refused} refused with a reason, {escaped} escaped",
        met=escaped == 0,
    )


def malformed(good: Frame, number: int, rng: np.random.Generator) -> Frame:
    """Return the frame with one defect, which depends on the number."""
    frame = dataclasses.replace(good, stamp_ns=number * 100_000_000 + 1)
    depth_m, at = good.depth_m.copy(), tuple(int(rng.integers(side)) for side in good.depth_m.shape)
    nonsense = float(rng.choice([math.nan, math.inf, -math.inf]))
    match number % 9:
        case 0:
            depth_m[at] = nonsense
        case 1:
            depth_m[rng.random(depth_m.shape) < rng.random()] = nonsense
            depth_m[at] = nonsense
        case 2:
            depth_m[at] = -float(rng.uniform(1e-3, 10.0))
        case 3:
            depth_m[:] = 0.0
        case 4:
            depth_m = depth_m[: -int(rng.integers(1, 20))]
        case 5:
            return dataclasses.replace(frame, depth_m=depth_m.astype(np.uint16))
        case 6:
            return dataclasses.replace(frame, pose=Pose2(x_m=nonsense, y_m=0.0, yaw_rad=0.0))
        case 7:
            return dataclasses.replace(
                frame, intrinsics=dataclasses.replace(good.intrinsics, fx=0.0, cx=nonsense)
            )
        case _:
            return dataclasses.replace(frame, T_base_camera=np.full((4, 4), nonsense))
    return dataclasses.replace(frame, depth_m=depth_m)


def jumping_odometry(trials: int) -> Measurement:
    """Row 5: time after the fault at which the robot was last told to move, and changes of the map
    meanwhile."""
    faults = [
        Fault(sensor="odometry", kind="wrong", shift_m=1.0, from_s=FROM_S, until_s=UNTIL_S),
        Fault(
            sensor="odometry",
            kind="wrong",
            shift_m=0.0,
            turn_deg=180.0,
            from_s=FROM_S,
            until_s=UNTIL_S,
        ),
        Fault(sensor="stamps", kind="stuck", from_s=FROM_S, until_s=UNTIL_S),
        Fault(sensor="stamps", kind="wrong", delay_s=0.2, from_s=FROM_S, until_s=UNTIL_S),
    ]
    longest_s, mapped = 0.0, 0
    for seed, fault in _trials(faults, trials):
        record, _ = fault_run(fault, seed=seed, until_s=UNTIL_S)
        during = record.between(fault.from_s, UNTIL_S)
        longest_s = max(
            [
                longest_s,
                *(sent.t_s - fault.from_s + COMMAND_PERIOD_S for sent in during if sent.moving),
            ]
        )
        mapped += sum(late.map_version != during[0].map_version for late in during[-1:])
    return Measurement(
        trials=trials,
        measured=f"zero after at most {longest_s:.2f} s; the map changed in {mapped}",
        met=longest_s <= 0.25 and mapped == 0,
    )


def false_alarms(trials: int) -> Measurement:
    """Row 5 without faults, each trial 10 s of random driving: number of doubted frames."""
    world = Scenario(
        name="open",
        size_m=(200.0, 200.0),
        map=MapExtent(size_m=(10.0, 10.0)),
        start=(0.0, 0.0, 0.0),
    )
    rng, doubted, frames, senses, frame = np.random.default_rng(5), 0, 0, SensorMonitor(), None
    with Simulator(world, seed=0, camera_size=(32, 24), camera_rate_hz=10.0) as simulator:
        twist = Twist(v_mps=0.0, w_radps=0.0)
        for step in range(trials * 10 * STEPS_PER_S):
            if step % (STEPS_PER_S // 2) == 0 and rng.random() < 0.4:
                twist = Twist(
                    v_mps=float(rng.uniform(-1.0, 1.0)), w_radps=float(rng.uniform(-2.0, 2.0))
                )
            if step % 12 == 0:
                simulator.send(twist)
            simulator.step()
            if simulator.newest_frame() is not frame:
                frame = simulator.newest_frame()
                assert frame is not None
                senses = senses.after(frame, HUSKY)
                frames += 1
                doubted += senses.fault is not None
                senses = senses if senses.fault is None else SensorMonitor()
    return Measurement(
        trials=trials,
        measured=f"{doubted} of {frames} frames doubted in {frames / 600:.1f} min",
        met=doubted == 0,
    )


def failing_segmentation(trials: int) -> Measurement:
    """Row 6: loops that died, robots that were told to move meanwhile, and robots that drove on."""
    span = {"sensor": "segmentation", "from_s": FROM_S, "until_s": UNTIL_S}
    faults = [
        Fault(kind="off", **span),  # type: ignore[arg-type]
        Fault(kind="garbage", **span),  # type: ignore[arg-type]
        Fault(kind="slow", delay_s=2.0, **span),  # type: ignore[arg-type]
    ]
    deaths = moved = drove_on = 0
    for seed, fault in _trials(faults, trials):
        try:
            record, _ = fault_run(fault, seed=seed, until_s=END_S + 0.6)
        except Exception:
            deaths += 1
            continue
        moved += _is_driven(record, fault.from_s + 0.36, UNTIL_S)
        drove_on += _is_driven(record, UNTIL_S, END_S + 0.6)
    return Measurement(
        trials=trials,
        measured=f"{deaths} loops died, {moved} moved meanwhile, {drove_on} drove on",
        met=deaths == 0 and moved == 0 and drove_on == trials,
    )
