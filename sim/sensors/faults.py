"""Fault injection: what a sensor, the wheels or the software above them do wrong, and when.

Faults come from the `[[faults]]` of a world or from `Simulator.inject`. Sensors and wheels are
falsified here, where their values are made; the planner and the segmentation run above the robot,
and `app` falsifies them by the same schedule.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist, wrap_angle
from navcore.robot.frame import Frame
from navcore.toml_config import ranged

Sensor = Literal[
    "camera", "depth", "rgb", "odometry", "gyro", "wheels", "stamps", "planner", "segmentation"
]
Kind = Literal["off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent", "hang"]
EVERY_KIND: tuple[Kind, ...] = (
    "off",
    "stuck",
    "garbage",
    "wrong",
    "slow",
    "delayed",
    "intermittent",
)
KINDS: dict[Sensor, tuple[Kind, ...]] = {
    **dict.fromkeys(("camera", "depth", "rgb", "odometry", "gyro", "wheels"), EVERY_KIND),
    "stamps": ("stuck", "wrong"),
    "planner": ("off", "slow", "hang"),
    "segmentation": ("off", "garbage", "slow", "hang"),
}
"""Possible fault kinds of each sensor."""
Wheels = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault during an interval of time."""

    sensor: Sensor
    """The faulty part; `wheels` are the motors, `stamps` the capture times, `camera` colours and
    depth together."""
    kind: Kind
    """Kind of the fault: no value, a repeated value, nonsense, plausible but false values, a low
    rate, a delay, or intermittent loss."""
    from_s: float = ranged(0.0, math.inf)
    """Simulated time at which the fault begins."""
    until_s: float = ranged(0.0, math.inf, default=math.inf)
    """Simulated time at which the fault ends; it never does when left out."""
    delay_s: float = ranged(0.0, 10.0, default=0.3)
    """Delay of `delayed` values, duration of a `slow` planner or segmentation, or shift into the
    past of `wrong` stamps."""
    period_s: float = ranged(0.01, 60.0, default=1.0)
    """Period of new values of a `slow` sensor."""
    share: float = ranged(0.0, 1.0, default=0.5)
    """Share of values that an `intermittent` sensor loses."""
    scale: float = ranged(0.0, 10.0, default=0.5)
    """Factor of `wrong` depth and wheel speeds."""
    shift_m: float = ranged(-100.0, 100.0, default=1.0)
    """Offset of `wrong` odometry along x of the map."""
    turn_deg: float = ranged(-180.0, 180.0, default=0.0)
    """Rotation of `wrong` odometry, or rate in degrees per second that a `wrong` gyro adds."""

    def is_active(self, t_s: float) -> bool:
        """Return whether the fault is active at this simulated time."""
        return self.from_s <= t_s < self.until_s


def check_faults(faults: Sequence[Fault], where: str) -> None:
    """Raise `BadConfiguration`, which names the key, for an impossible fault."""
    for i, fault in enumerate(faults):
        if fault.kind not in KINDS[fault.sensor]:
            known = ", ".join(KINDS[fault.sensor])
            raise BadConfiguration(
                f"{where}.faults[{i}].kind: {fault.kind!r} does not happen to {fault.sensor}, "
                f"expected one of: {known}"
            )
        if fault.until_s <= fault.from_s:
            raise BadConfiguration(
                f"{where}.faults[{i}].until_s: {fault.until_s:g} is not after from_s, "
                f"{fault.from_s:g}; the fault would never be active"
            )


class FaultSchedule:
    """Falsifies values by a schedule of faults. Without faults it changes nothing and draws no
    random number."""

    def __init__(self, faults: Sequence[Fault], seed: Sequence[int]) -> None:
        self._seed = tuple(seed)
        self.faults: tuple[Fault, ...] = ()
        """The scheduled faults."""
        self._active: dict[str, list[_ActiveFault]] = {}
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """Schedule one more fault; raises `BadConfiguration` for an impossible one."""
        check_faults((fault,), "inject")
        rng = np.random.default_rng((*self._seed, len(self.faults)))
        self.faults = (*self.faults, fault)
        if fault.sensor in _EFFECTS:
            self._active.setdefault(fault.sensor, []).append(_ActiveFault(fault, rng))

    def wheels(self, speeds_radps: Wheels, t_s: float) -> Wheels:
        """Return the (left, right) wheel speeds in rad/s that the motors realise."""
        wheels: Wheels = self._apply("wheels", speeds_radps, t_s)
        return wheels

    def gyro(self, rate_radps: float, t_s: float) -> float:
        """Return the measured yaw rate in rad/s."""
        return float(self._apply("gyro", rate_radps, t_s))

    def frame(self, frame: Frame, t_s: float) -> Frame | None:
        """Return the frame that is delivered, or None when none is."""
        if not self._active:
            return frame
        pose, twist = self._apply("odometry", (frame.pose, frame.twist), t_s)
        faulty = dataclasses.replace(
            frame,
            stamp_ns=self._apply("stamps", frame.stamp_ns, t_s),
            rgb=_read_only(self._apply("rgb", frame.rgb, t_s)),
            depth_m=_read_only(self._apply("depth", frame.depth_m, t_s)),
            pose=pose,
            twist=twist,
        )
        passed: Frame | None = self._apply("camera", faulty, t_s)
        return passed

    def _apply(self, sensor: str, value: Any, t_s: float) -> Any:
        for active in self._active.get(sensor, ()):
            value = active.apply(value, t_s) if value is not None else None
        return value


class _ActiveFault:
    """One fault of one sensor, with the earlier values that it needs."""

    def __init__(self, fault: Fault, rng: np.random.Generator) -> None:
        self._fault, self._rng, self._effects = fault, rng, _EFFECTS[fault.sensor]
        self._held: Any = None
        self._held_s = -math.inf
        self._past: deque[tuple[float, Any]] = deque()

    def apply(self, value: Any, t_s: float) -> Any:
        fault, effects = self._fault, self._effects
        if fault.kind == "delayed":
            self._past.append((t_s, value))
            while len(self._past) > 1 and self._past[1][0] <= self._due_s(t_s):
                self._past.popleft()
        if not fault.is_active(t_s):
            self._held, self._held_s = value, -math.inf
            return value
        match fault.kind:
            case "off":
                return effects.off(value)
            case "stuck":
                self._held = value if self._held is None else self._held
                return effects.stuck(self._held, value)
            case "garbage":
                return effects.garbage(value, self._rng)
            case "wrong":
                return effects.wrong(value, fault)
            case "slow":
                return self._slow(value, t_s)
            case "delayed":
                return self._delayed(t_s)
            case _:
                return effects.off(value) if self._rng.random() < fault.share else value

    def _slow(self, value: Any, t_s: float) -> Any:
        if t_s - self._held_s >= self._fault.period_s - 1e-9:
            self._held, self._held_s = value, t_s
            return value
        return self._effects.missing(self._held)

    def _delayed(self, t_s: float) -> Any:
        taken_s, value = self._past[0]
        return value if taken_s <= self._due_s(t_s) else self._effects.missing(value)

    def _due_s(self, t_s: float) -> float:
        """Return the time up to which values are delivered."""
        return t_s - self._fault.delay_s + 1e-9


def _unchanged(value: Any, *_: Any) -> Any:
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class _Effects:
    """Effect of each fault kind on the values of one sensor."""

    off: Callable[[Any], Any] = _unchanged
    """The value of a sensor without power."""
    garbage: Callable[[Any, np.random.Generator], Any] = _unchanged
    """A nonsense value."""
    wrong: Callable[[Any, Fault], Any] = _unchanged
    """A plausible but false value."""
    stuck: Callable[[Any, Any], Any] = _unchanged
    """The result when the first value is repeated in place of the second."""
    missing: Callable[[Any], Any] = _unchanged
    """The value while no new one comes."""


def _garbage_image(frame: Frame, rng: np.random.Generator) -> Frame:
    return dataclasses.replace(frame, depth_m=_read_only(_garbage_depth(frame.depth_m, rng)))


def _garbage_depth(depth_m: Any, rng: np.random.Generator) -> Any:
    bad, some = depth_m.copy(), rng.random(depth_m.shape) < 0.1
    match rng.integers(5):
        case 0:
            bad[some] = math.nan
        case 1:
            bad[some] = math.inf
        case 2:
            bad[some] *= -1.0
            bad[0, 0] = -1.0
        case 3:
            bad[:] = 0.0
        case _:
            bad = bad[: max(1, bad.shape[0] // 2)]
    return bad


def _garbage_wheels(_: Wheels, rng: np.random.Generator) -> Wheels:
    left, right = rng.uniform(-6.0, 6.0, 2)
    return float(left), float(right)


def _wrong_odometry(belief: tuple[Pose2, Twist], fault: Fault) -> tuple[Pose2, Twist]:
    pose, twist = belief
    return dataclasses.replace(
        pose,
        x_m=pose.x_m + fault.shift_m,
        yaw_rad=wrap_angle(pose.yaw_rad + math.radians(fault.turn_deg)),
    ), twist


def _garbage_odometry(_: tuple[Pose2, Twist], rng: np.random.Generator) -> tuple[Pose2, Twist]:
    x, y, yaw, v, w = (float(number) for number in rng.uniform(-3.0, 3.0, 5))
    return Pose2(x_m=5 * x, y_m=5 * y, yaw_rad=yaw), Twist(v_mps=v, w_radps=w)


def _lost_odometry(_: tuple[Pose2, Twist]) -> tuple[Pose2, Twist]:
    return Pose2(x_m=math.nan, y_m=math.nan, yaw_rad=math.nan), Twist(
        v_mps=math.nan, w_radps=math.nan
    )


def _wrong_image(frame: Frame, fault: Fault) -> Frame:
    rgb, depth_m = frame.rgb[..., ::-1].copy(), frame.depth_m * np.float32(fault.scale)
    return dataclasses.replace(frame, rgb=_read_only(rgb), depth_m=_read_only(depth_m))


_EFFECTS: dict[str, _Effects] = {
    "camera": _Effects(
        off=lambda frame: None,
        garbage=_garbage_image,
        wrong=_wrong_image,
        stuck=lambda old, new: dataclasses.replace(new, rgb=old.rgb, depth_m=old.depth_m),
        missing=lambda frame: None,
    ),
    "depth": _Effects(
        off=np.zeros_like,
        garbage=_garbage_depth,
        wrong=lambda depth_m, fault: depth_m * np.float32(fault.scale),
    ),
    "rgb": _Effects(
        off=np.zeros_like,
        garbage=lambda rgb, rng: rng.integers(0, 256, rgb.shape, dtype=np.uint8),
        wrong=lambda rgb, fault: rgb[..., ::-1].copy(),
    ),
    "odometry": _Effects(off=_lost_odometry, garbage=_garbage_odometry, wrong=_wrong_odometry),
    "gyro": _Effects(
        off=lambda rate: 0.0,
        garbage=lambda rate, rng: float(rng.uniform(-4.0, 4.0)),
        wrong=lambda rate, fault: rate + math.radians(fault.turn_deg),
    ),
    "wheels": _Effects(
        off=lambda speeds: (0.0, 0.0),
        garbage=_garbage_wheels,
        wrong=lambda speeds, fault: (speeds[0] * fault.scale, speeds[1] * fault.scale),
        stuck=lambda old, new: (0.0, 0.0),
    ),
    "stamps": _Effects(wrong=lambda stamp_ns, fault: stamp_ns - round(fault.delay_s * 1e9)),
}


def _read_only(array: Any) -> Any:
    array.flags.writeable = False
    return array
