"""Small worlds for the tests, made in code, and functions to drive in them."""

from __future__ import annotations

import math

from navcore.geometry.transform import Pose2, Twist
from sim.scenario.schema import Furniture, Item, MapExtent, Marking, Mover, Person, Scenario
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import STEPS_PER_S, Simulator

SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))


def open_floor(
    *,
    furniture: tuple[Furniture, ...] = (),
    markings: tuple[Marking, ...] = (),
    items: tuple[Item, ...] = (),
    people: tuple[Person, ...] = (),
    movers: tuple[Mover, ...] = (),
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Scenario:
    """Return a floor of 20 m × 20 m without walls."""
    return Scenario(
        name="open floor",
        size_m=(20.0, 20.0),
        map=MapExtent(size_m=(20.0, 20.0)),
        start=start,
        furniture=furniture,
        markings=markings,
        items=items,
        people=people,
        movers=movers,
    )


def blind(
    scenario: Scenario,
    seed: int = 0,
    *,
    start: Pose2 | None = None,
    odometry: str = "typical",
    odometry_origin: Pose2 | None = None,
) -> Simulator:
    """Return a simulator that renders almost no frames, for tests of everything else."""
    return Simulator(
        scenario,
        seed=seed,
        camera_size=(16, 16),
        camera_rate_hz=0.001,
        start=start,
        odometry=odometry,
        odometry_origin=odometry_origin,
    )


def seeing(scenario: Scenario, seed: int = 0, size: tuple[int, int] = (424, 240)) -> Simulator:
    """Return a simulator whose camera has no errors."""
    return Simulator(scenario, seed=seed, camera_size=size, camera_rate_hz=0.001, errors=PERFECT)


def drive(simulator: Simulator, v_mps: float, w_radps: float, duration_s: float) -> None:
    """Command a constant velocity."""
    for step in range(round(duration_s * STEPS_PER_S)):
        if step % 12 == 0:
            simulator.send(Twist(v_mps=v_mps, w_radps=w_radps))
        simulator.step()


def wait(simulator: Simulator, duration_s: float) -> None:
    """Step without commands."""
    for _ in range(round(duration_s * STEPS_PER_S)):
        simulator.step()


def shifted(x_m: float, y_m: float) -> tuple[tuple[float, float], ...]:
    """Return a square of 1 m about a point."""
    return tuple((x_m + x, y_m + y) for x, y in SQUARE)


def turned_by(before_rad: float, after_rad: float) -> float:
    """Return the signed difference of two headings."""
    return math.remainder(after_rad - before_rad, 2 * math.pi)
