"""Injected faults: their effect on sensors and wheels, the same in every run, and refusals."""

from __future__ import annotations

import dataclasses
import math
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from navcore.errors import BadConfiguration, BadFrame
from navcore.robot.frame import Frame, check_frame
from sim.scenario.load import WORLDS, load_scenario
from sim.sensors.faults import EVERY_KIND, KINDS, Fault, FaultSchedule
from sim.simulator import Simulator
from tests.sim.worlds import blind, drive, open_floor

ROOM = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")


def frames(*faults: Fault, seconds: float = 1.0) -> list[Frame]:
    """Return all frames of a straight run, ten a second."""
    seen: list[Frame] = []
    world = dataclasses.replace(load_scenario("empty_room"), faults=faults)
    with Simulator(world, seed=0, camera_size=(64, 48)) as simulator:
        for _ in range(round(seconds * 20)):
            drive(simulator, 0.5, 0.0, 0.05)
            frame = simulator.newest_frame()
            if frame is not None and (not seen or frame is not seen[-1]):
                seen.append(frame)
    return seen


def fault(sensor: Any, kind: Any, **more: float) -> Fault:
    return Fault(**{"sensor": sensor, "kind": kind, "from_s": 0.45, **more})


CLEAN = frames()


def digest(seen: list[Frame]) -> list[tuple[object, ...]]:
    return [(f.stamp_ns, f.pose, f.twist, f.depth_m.tobytes(), f.rgb.tobytes()) for f in seen]


@pytest.mark.long
@pytest.mark.parametrize("kind", EVERY_KIND)
@pytest.mark.parametrize("sensor", ["camera", "depth", "rgb", "odometry"])
def test_every_fault_changes_the_frames_from_its_moment_on_and_the_same_way_again(
    sensor: str, kind: str
) -> None:
    faulty, again = (digest(frames(fault(sensor, kind))) for _ in range(2))
    clean = digest(CLEAN)
    # # NaN is not equal to itself, but the texts of the values are.
    assert str(faulty) == str(again)
    assert faulty[:5] == clean[:5]
    assert str(faulty) != str(clean)


def test_an_ended_fault_leaves_no_trace() -> None:
    over = digest(frames(fault("camera", "stuck", from_s=0.2, until_s=0.5)))
    assert over[6:] == digest(CLEAN)[6:]
    assert over[4] != digest(CLEAN)[4]


def test_a_stuck_camera_repeats_the_image_with_new_stamps_and_poses() -> None:
    stuck = frames(fault("camera", "stuck"))
    assert len({f.depth_m.tobytes() for f in stuck[5:]}) == 1
    assert [f.stamp_ns for f in stuck] == [f.stamp_ns for f in CLEAN]
    assert [f.pose for f in stuck] == [f.pose for f in CLEAN]


def test_a_camera_that_is_off_slow_or_intermittent_delivers_fewer_frames() -> None:
    assert len(frames(fault("camera", "off"))) == 5
    assert len(frames(fault("camera", "slow", period_s=0.4))) == 7
    assert 5 <= len(frames(fault("camera", "intermittent", share=0.8))) < 10


def test_a_delayed_camera_delivers_old_frames_with_their_own_stamps() -> None:
    late = frames(fault("camera", "delayed", delay_s=0.3, from_s=0.0))
    # # The first is taken one step after the start, so it is not due yet 0.3 s later, and then
    # there is a newer one.
    assert digest(late) == digest(CLEAN)[1:-3]


def test_a_delayed_sensor_holds_no_more_values_than_its_delay_also_while_it_is_no_fault() -> None:
    values = [np.array([t]) for t in range(100)]
    held = [weakref.ref(value) for value in values]
    schedule = FaultSchedule((fault("depth", "delayed", from_s=1e6, delay_s=2.0),), (0,))
    for t_s in range(100):
        assert schedule._apply("depth", values[t_s], float(t_s)) is values[t_s]
    values.clear()
    assert [ref() is not None for ref in held] == [False] * 97 + [True] * 3


def test_a_fault_without_an_end_never_ends() -> None:
    assert fault("camera", "off").is_active(1e9)


def test_nonsense_frames_are_refused() -> None:
    for frame in frames(fault("camera", "garbage"))[5:]:
        with pytest.raises(BadFrame):
            check_frame(frame)


def test_wrong_values_are_wrong_by_the_given_amount() -> None:
    faulty = frames(
        fault("depth", "wrong", scale=2.0),
        fault("odometry", "wrong", shift_m=0.5),
        fault("stamps", "wrong", delay_s=0.2),
    )
    before, after = CLEAN[-1], faulty[-1]
    np.testing.assert_allclose(after.depth_m, 2 * before.depth_m)
    assert after.pose.x_m - before.pose.x_m == pytest.approx(0.5, abs=1e-3)
    assert before.stamp_ns - after.stamp_ns == 200_000_000


def test_blocked_wheels_hold_the_robot_and_a_wrong_gyro_turns_it() -> None:
    held = dataclasses.replace(open_floor(), faults=(fault("wheels", "stuck", from_s=0.0),))
    with blind(held) as simulator:
        drive(simulator, 0.5, 0.0, 1.0)
        assert simulator.true_pose().distance_to(0.0, 0.0) < 0.01
    with blind(open_floor()) as simulator:
        simulator.inject(fault("gyro", "wrong", turn_deg=20.0, from_s=0.0))
        drive(simulator, 0.5, 0.0, 1.0)
        # it steers against a rotation that does not happen
        assert simulator.true_pose().yaw_rad < -math.radians(10)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('sensor = "lidar"\nkind = "off"\nfrom_s = 1', r"faults\[0\].sensor"),
        ('sensor = "camera"\nkind = "broken"\nfrom_s = 1', r"faults\[0\].kind"),
        (
            'sensor = "planner"\nkind = "garbage"\nfrom_s = 1',
            r"faults\[0\].kind: 'garbage' does not happen to planner",
        ),
        ('sensor = "camera"\nkind = "off"', "from_s"),
        ('sensor = "camera"\nkind = "off"\nfrom_s = 2\nuntil_s = 1', r"faults\[0\].until_s"),
        ('sensor = "camera"\nkind = "off"\nfrom_s = -1', r"faults\[0\].from_s"),
        ('sensor = "camera"\nkind = "off"\nfrom_s = 1\nhow = 3', "'how'"),
        ('sensor = "camera"\nkind = "intermittent"\nfrom_s = 1\nshare = 1.5', r"faults\[0\].share"),
    ],
)
def test_a_malformed_fault_is_refused_by_key(table: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(f"{ROOM}\n[[faults]]\n{table}\n", encoding="utf-8")
    with pytest.raises(BadConfiguration, match=words):
        load_scenario(path)


def test_a_valid_fault_is_read_and_an_impossible_one_is_not_injected(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_text(
        f'{ROOM}\n[[faults]]\nsensor = "camera"\nkind = "off"\nfrom_s = 1\nuntil_s = 2\n',
        encoding="utf-8",
    )
    world = load_scenario(path)
    assert world.faults == (Fault(sensor="camera", kind="off", from_s=1.0, until_s=2.0),)
    with blind(world) as simulator:
        with pytest.raises(BadConfiguration, match="planner"):
            simulator.inject(Fault(sensor="planner", kind="stuck", from_s=0.0))
        assert simulator.faults == world.faults


def test_every_kind_of_fault_can_happen_to_every_sensor() -> None:
    assert all(
        set(EVERY_KIND) == set(KINDS[sensor])
        for sensor in ("camera", "depth", "rgb", "odometry", "gyro", "wheels")
    )
