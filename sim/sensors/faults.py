"""Faults to order: what a sensor, the wheels or the software above them do wrong, and from when to
when.

A schedule comes from a world's `[[faults]]` or from `Simulator.inject`. Sensors and wheels are
spoilt here, where their values are made; the planner and the segmentation live above the robot, and
`app` spoils them by the same schedule.
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
"""What can happen to what."""
FOR_EVER_S = 86_400.0
Wheels = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that goes wrong for a while."""

    sensor: Sensor
    """What; `wheels` are the motors, `stamps` the capture times, `camera` colours and depth
    together."""
    kind: Kind
    """How: no value, the same value again and again, nonsense, plausible but false, seldom, late,
    or now and then none."""
    from_s: float = ranged(0.0, FOR_EVER_S)
    """Simulated time at which it begins."""
    until_s: float = ranged(0.0, FOR_EVER_S, default=FOR_EVER_S)
    """And ends."""
    delay_s: float = ranged(0.0, 10.0, default=0.3)
    """`delayed`: how late. `slow` planner and segmentation: how long they take. `wrong` stamps: how
    far back."""
    period_s: float = ranged(0.01, 60.0, default=1.0)
    """`slow`: a new value only so often."""
    share: float = ranged(0.0, 1.0, default=0.5)
    """`intermittent`: how many values are lost."""
    scale: float = ranged(0.0, 10.0, default=0.5)
    """`wrong` depth and wheels: multiplied by this."""
    shift_m: float = ranged(-100.0, 100.0, default=1.0)
    """`wrong` odometry: so far off along the map's x."""
    turn_deg: float = ranged(-180.0, 180.0, default=0.0)
    """`wrong` odometry: and turned by this. `wrong` gyro: this much a second too fast."""

    def holds(self, t_s: float) -> bool:
        """Whether it is on at this simulated time."""
        return self.from_s <= t_s < self.until_s


def check_faults(faults: Sequence[Fault], where: str) -> None:
    """Raise `BadConfiguration`, which names the key, for what cannot happen."""
    for i, fault in enumerate(faults):
        if fault.kind not in KINDS[fault.sensor]:
            known = ", ".join(KINDS[fault.sensor])
            raise BadConfiguration(
                f"{where}.faults[{i}].kind: {fault.kind!r} does not happen to {fault.sensor}, only {known}"
            )
        if fault.until_s <= fault.from_s:
            raise BadConfiguration(
                f"{where}.faults[{i}].until_s: {fault.until_s:g} is not after from_s, {fault.from_s:g}; it would never be"
            )


class FaultSchedule:
    """Passes values on, or what the faults make of them. Without faults it changes nothing and
    draws no random number."""

    def __init__(self, faults: Sequence[Fault], seed: Sequence[int]) -> None:
        self._seed = tuple(seed)
        self.faults: tuple[Fault, ...] = ()
        """The schedule so far."""
        self._spoilt: dict[str, list[_Spoilt]] = {}
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """One more; refused when it cannot happen."""
        check_faults((fault,), "inject")
        rng = np.random.default_rng((*self._seed, len(self.faults)))
        self.faults = (*self.faults, fault)
        if fault.sensor in _SPOIL:
            self._spoilt.setdefault(fault.sensor, []).append(_Spoilt(fault, rng))

    def wheels(self, speeds_radps: Wheels, t_s: float) -> Wheels:
        """(left, right) speeds that the motors turn with."""
        wheels: Wheels = self._through("wheels", speeds_radps, t_s)
        return wheels

    def gyro(self, rate_radps: float, t_s: float) -> float:
        """The yaw rate that is measured."""
        return float(self._through("gyro", rate_radps, t_s))

    def frame(self, frame: Frame, t_s: float) -> Frame | None:
        """The frame that is handed over; None when none is."""
        if not self._spoilt:
            return frame
        pose, twist = self._through("odometry", (frame.pose, frame.twist), t_s)
        spoilt = dataclasses.replace(
            frame,
            stamp_ns=self._through("stamps", frame.stamp_ns, t_s),
            rgb=_frozen(self._through("rgb", frame.rgb, t_s)),
            depth_m=_frozen(self._through("depth", frame.depth_m, t_s)),
            pose=pose,
            twist=twist,
        )
        passed: Frame | None = self._through("camera", spoilt, t_s)
        return passed

    def _through(self, sensor: str, value: Any, t_s: float) -> Any:
        for spoilt in self._spoilt.get(sensor, ()):
            value = spoilt.pass_on(value, t_s) if value is not None else None
        return value


class _Spoilt:
    """One fault of one sensor, and what it remembers of the values before."""

    def __init__(self, fault: Fault, rng: np.random.Generator) -> None:
        self._fault, self._rng, self._how = fault, rng, _SPOIL[fault.sensor]
        self._kept: Any = None
        self._kept_s = -math.inf
        self._past: deque[tuple[float, Any]] = deque()

    def pass_on(self, value: Any, t_s: float) -> Any:
        fault, how = self._fault, self._how
        if fault.kind == "delayed":
            self._past.append((t_s, value))
        if not fault.holds(t_s):
            self._kept, self._kept_s = value, -math.inf
            return value
        match fault.kind:
            case "off":
                return how.off(value)
            case "stuck":
                self._kept = value if self._kept is None else self._kept
                return how.again(self._kept, value)
            case "garbage":
                return how.garbage(value, self._rng)
            case "wrong":
                return how.wrong(value, fault)
            case "slow":
                return self._seldom(value, t_s)
            case "delayed":
                return self._late(t_s)
            case _:
                return how.off(value) if self._rng.random() < fault.share else value

    def _seldom(self, value: Any, t_s: float) -> Any:
        if t_s - self._kept_s >= self._fault.period_s - 1e-9:
            self._kept, self._kept_s = value, t_s
            return value
        return self._how.meanwhile(self._kept)

    def _late(self, t_s: float) -> Any:
        due_s = t_s - self._fault.delay_s + 1e-9
        while len(self._past) > 1 and self._past[1][0] <= due_s:
            self._past.popleft()
        return (
            self._past[0][1] if self._past[0][0] <= due_s else self._how.meanwhile(self._past[0][1])
        )


def _unchanged(value: Any, *_: Any) -> Any:
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class _How:
    """What goes wrong with one kind of value."""

    off: Callable[[Any], Any] = _unchanged
    """Without power."""
    garbage: Callable[[Any, np.random.Generator], Any] = _unchanged
    """Nonsense."""
    wrong: Callable[[Any, Fault], Any] = _unchanged
    """Plausible, but false."""
    again: Callable[[Any, Any], Any] = _unchanged
    """The kept value where the second should be."""
    meanwhile: Callable[[Any], Any] = _unchanged
    """What is there while no new value comes."""


def _bad_picture(frame: Frame, rng: np.random.Generator) -> Frame:
    return dataclasses.replace(frame, depth_m=_frozen(_bad_depth(frame.depth_m, rng)))


def _bad_depth(depth_m: Any, rng: np.random.Generator) -> Any:
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


def _bad_wheels(_: Wheels, rng: np.random.Generator) -> Wheels:
    left, right = rng.uniform(-6.0, 6.0, 2)
    return float(left), float(right)


def _elsewhere(belief: tuple[Pose2, Twist], fault: Fault) -> tuple[Pose2, Twist]:
    pose, twist = belief
    return dataclasses.replace(
        pose,
        x_m=pose.x_m + fault.shift_m,
        yaw_rad=wrap_angle(pose.yaw_rad + math.radians(fault.turn_deg)),
    ), twist


def _anywhere(_: tuple[Pose2, Twist], rng: np.random.Generator) -> tuple[Pose2, Twist]:
    x, y, yaw, v, w = (float(number) for number in rng.uniform(-3.0, 3.0, 5))
    return Pose2(x_m=5 * x, y_m=5 * y, yaw_rad=yaw), Twist(v_mps=v, w_radps=w)


def _nowhere(_: tuple[Pose2, Twist]) -> tuple[Pose2, Twist]:
    return Pose2(x_m=math.nan, y_m=math.nan, yaw_rad=math.nan), Twist(
        v_mps=math.nan, w_radps=math.nan
    )


def _wrong_picture(frame: Frame, fault: Fault) -> Frame:
    rgb, depth_m = frame.rgb[..., ::-1].copy(), frame.depth_m * np.float32(fault.scale)
    return dataclasses.replace(frame, rgb=_frozen(rgb), depth_m=_frozen(depth_m))


_SPOIL: dict[str, _How] = {
    "camera": _How(
        off=lambda frame: None,
        garbage=_bad_picture,
        wrong=_wrong_picture,
        again=lambda old, new: dataclasses.replace(new, rgb=old.rgb, depth_m=old.depth_m),
        meanwhile=lambda frame: None,
    ),
    "depth": _How(
        off=np.zeros_like,
        garbage=_bad_depth,
        wrong=lambda depth_m, fault: depth_m * np.float32(fault.scale),
    ),
    "rgb": _How(
        off=np.zeros_like,
        garbage=lambda rgb, rng: rng.integers(0, 256, rgb.shape, dtype=np.uint8),
        wrong=lambda rgb, fault: rgb[..., ::-1].copy(),
    ),
    "odometry": _How(off=_nowhere, garbage=_anywhere, wrong=_elsewhere),
    "gyro": _How(
        off=lambda rate: 0.0,
        garbage=lambda rate, rng: float(rng.uniform(-4.0, 4.0)),
        wrong=lambda rate, fault: rate + math.radians(fault.turn_deg),
    ),
    "wheels": _How(
        off=lambda speeds: (0.0, 0.0),
        garbage=_bad_wheels,
        wrong=lambda speeds, fault: (speeds[0] * fault.scale, speeds[1] * fault.scale),
        again=lambda old, new: (0.0, 0.0),
    ),
    "stamps": _How(wrong=lambda stamp_ns, fault: stamp_ns - round(fault.delay_s * 1e9)),
}


def _frozen(array: Any) -> Any:
    array.flags.writeable = False
    return array
