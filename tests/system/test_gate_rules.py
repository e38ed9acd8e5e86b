"""The gate keeps the robot out of zones and off the beware list when the planners do not."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest

from app.episode.episode import Episode, EpisodeSettings
from app.runtime.control import robot_controller
from navcore.behaviours.supervisor import Behaviour
from navcore.control.motion import Motion
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.safety.keep_out_monitor import KeepOuts
from sim.scenario.schema import Marking, Scenario
from sim.sensors.faults import Fault
from tests.reliability.fault_runs import CAMERA
from tests.reliability.fault_runs import OPEN_FLOOR as OPEN
from tests.reliability.planning import drive_blindly

ACROSS = ((-5.0, -3.0), (-3.0, -3.0), (-3.0, 3.0), (-5.0, 3.0))
"""A zone across the robot's path, 3 m ahead of its start."""
SKIDDING = Fault(sensor="wheels", kind="wrong", from_s=0.0, scale=1.05)
LATE = Fault(sensor="planner", kind="slow", from_s=0.0, delay_s=0.2)


def driven(
    *faults: Fault,
    zones: tuple[tuple[tuple[float, float], ...], ...] = (),
    world: Scenario = OPEN,
    beware: BewareList | None = None,
    supervise: Callable[..., tuple[Behaviour, Motion]] = Behaviour.after,
) -> dict[str, Any]:
    """The report of a drive by a local planner that only drives straight on at full speed."""
    episode = Episode(
        dataclasses.replace(world, faults=faults),
        EpisodeSettings(
            beware=beware or default_beware_list(),
            max_time_s=5.0,
            camera=CAMERA,
            zones=zones,
            stages=dataclasses.replace(drive_blindly(), supervise=supervise),
        ),
        seed=0,
    )
    try:
        return episode.run()
    finally:
        episode.close()


@pytest.mark.parametrize("faults", [(), (LATE,), (SKIDDING,)], ids=["ignores", "late", "skids"])
def test_a_planner_that_ignores_a_zone_does_not_bring_the_robot_into_it(
    faults: tuple[Fault, ...],
) -> None:
    report = driven(*faults, zones=(ACROSS,))
    assert report["zone_intrusions"] == 0
    assert 1.8 < report["distance_m"] < 2.6  # it came near, and stopped
    assert any(stop["reason"] == "beware_ahead" for stop in report["stops"])


def test_without_the_check_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_controller, "KeepOuts", lambda **_: KeepOuts())
    assert driven(zones=(ACROSS,))["zone_intrusions"] > 0


def test_the_recovery_is_told_that_the_gate_holds_the_robot_before_a_zone() -> None:
    told: list[bool] = []

    def supervise(*inputs: Any, held: bool, **others: Any) -> tuple[Behaviour, Motion]:
        told.append(held)
        return Behaviour.after(*inputs, **others)  # which goes on driving blindly

    report = driven(zones=(ACROSS,), supervise=supervise)
    stands_s = report["stops"][-1]["duration_s"]
    assert stands_s > 1.5
    assert 1 <= sum(told) <= stands_s  # once a second
    told.clear()
    driven(supervise=supervise)  # control: without a zone nothing holds it
    assert told and not any(told)


RED = dataclasses.replace(
    OPEN, markings=(Marking(name="red floor", polygon=ACROSS, colour=(200, 20, 20)),)
)
"""A red floor marking where the zone was."""


def test_a_planner_that_ignores_the_beware_list_does_not_bring_the_robot_onto_it() -> None:
    assert driven(world=RED)["beware_intrusions"] == 0


def test_without_the_check_the_robot_drives_over_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_controller, "KeepOuts", lambda **_: KeepOuts())
    assert driven(world=RED)["beware_intrusions"] > 0
