"""The reliability promises of the console and the navigation, measured: `make reliability` prints
them in one table.

The same functions with fewer trials are the tests, where each has a control: without the protection
its promise is broken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console as Terminal
from rich.table import Table

from navcore.warmup import warm_up
from tests.reliability import (
    beside_training,
    ending,
    hostile,
    planning,
    startup,
    stopping,
    storage,
    teleop,
)
from tests.reliability.result import Measurement


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """One promise."""

    number: int
    """Row number of the promise in the table."""
    fault: str
    """The injected fault."""
    promise: str
    """Behaviour that is promised under the fault."""
    measure: Callable[[int], Measurement]
    """Function that measures the promise over a number of trials."""
    trials: int
    """Default number of trials."""


ROWS = (
    Promise(
        number=1,
        fault="camera off, stuck, slow, late, intermittent",
        promise="zero when the image content is older than 0.5 s, and driving again afterwards",
        measure=stopping.silent_camera,
        trials=10,
    ),
    Promise(
        number=2,
        fault="planner hangs (wall clock)",
        promise="no command is sent that is older than 0.25 s",
        measure=stopping.hung_planner,
        trials=10,
    ),
    Promise(
        number=3,
        fault="console frozen or killed while driving",
        promise="still within 0.25 s and braking",
        measure=stopping.frozen_console,
        trials=50,
    ),
    Promise(
        number=4,
        fault="NaN, Inf, zero, negative, wrong-shape depth, nonsense in pose and lens",
        promise="refused; nothing non-finite in map, grid or velocity",
        measure=stopping.malformed_frames,
        trials=10_000,
    ),
    Promise(
        number=5,
        fault="odometry jump, yaw flip, repeated and backward stamp",
        promise="zero within 0.25 s, nothing put on the map",
        measure=stopping.jumping_odometry,
        trials=12,
    ),
    Promise(
        number=5,
        fault="none: 10 s of driving at random",
        promise="no false alarm",
        measure=stopping.false_alarms,
        trials=60,
    ),
    Promise(
        number=6,
        fault="segmentation raises, takes 2 s, gives NaN",
        promise="the loop survives, the robot stands meanwhile and drives on afterwards",
        measure=stopping.failing_segmentation,
        trials=6,
    ),
    Promise(
        number=7,
        fault="planner over its budget of work",
        promise='"time budget exceeded", and the robot is held; within 10 ms of a whole search',
        measure=planning.over_budget,
        trials=50,
    ),
    Promise(
        number=8,
        fault="goal in an obstacle, in a zone, outside, walled in; start blocked",
        promise="five different reasons within 200 ms, no motion",
        measure=planning.impossible_goals,
        trials=5,
    ),
    Promise(
        number=9,
        fault="zone drawn under the robot",
        promise="stands, and moves only when told to leave",
        measure=planning.zone_under_robot,
        trials=50,
    ),
    Promise(
        number=10,
        fault="zone drawn across the path while driving",
        promise="the footprint is never inside",
        measure=planning.zone_across_path,
        trials=10,
    ),
    Promise(
        number=11,
        fault="an obstacle appears at stopping distance + 0.3 m, the planner is blind",
        promise="no contact",
        measure=planning.sudden_obstacle,
        trials=10,
    ),
    Promise(
        number=12,
        fault="emergency stop during teleoperation; planner hung, database locked, cloud "
        "streaming, 20 MB uploaded",
        promise="latched zero, p99 within 50 ms idle and 150 ms loaded (wall clock)",
        measure=teleop.emergency_stops,
        trials=40,
    ),
    Promise(
        number=13,
        fault="page closed, frozen, or its messages delayed, during teleoperation",
        promise="standstill within 0.5 s (wall clock)",
        measure=teleop.lost_teleop,
        trials=50,
    ),
    Promise(
        number=14,
        fault="kill -9 while saving zones",
        promise="no acknowledged save is lost",
        measure=storage.kills,
        trials=1000,
    ),
    Promise(
        number=15,
        fault="disk full, read-only, database locked",
        promise="refused with its reason, old data whole",
        measure=storage.refusing_disks,
        trials=30,
    ),
    Promise(
        number=16,
        fault="two operators edit one zone",
        promise="the second is refused with both versions, no update lost",
        measure=storage.two_editors,
        trials=50,
    ),
    Promise(
        number=17,
        fault="wall clock an hour off, and jumping by another",
        promise="no command differs",
        measure=storage.jumping_clocks,
        trials=4,
    ),
    Promise(
        number=18,
        fault="the port is taken",
        promise="ends with code 2, names port and remedy, within 2 s (wall clock)",
        measure=startup.busy_ports,
        trials=3,
    ),
    Promise(
        number=19,
        fault="every key of world, robot and beware list mistyped, out of range or unknown",
        promise="refused, and the key is named",
        measure=startup.bad_values,
        trials=100,
    ),
    Promise(
        number=20,
        fault="SIGTERM while driving, and a start on the same data",
        promise="ends with code 0 within 5 s, nothing stored is lost, the next robot stands",
        measure=ending.ended_consoles,
        trials=20,
    ),
    Promise(
        number=22,
        fault="NaN, 1e999, lone surrogates, depth and size to every route",
        promise="a refusal, never 5xx",
        measure=hostile.hostile_requests,
        trials=10_000,
    ),
    Promise(
        number=23,
        fault="nonsense on every websocket",
        promise="other clients go on, every command is within the limits",
        measure=hostile.hostile_frames,
        trials=1000,
    ),
    Promise(
        number=24,
        fault="foreign host, foreign origin, no log-in, on every route",
        promise="refused before any handler runs",
        measure=hostile.foreign_requests,
        trials=100,
    ),
    Promise(
        number=25,
        fault="paths that lead elsewhere, weights that are a program",
        promise="nothing outside is read, nothing is executed",
        measure=hostile.path_traversal,
        trials=500,
    ),
    Promise(
        number=26,
        fault="a training runs beside the console, while the robot drives",
        promise="no command comes later than 0.25 s after the one before (wall clock)",
        measure=beside_training.training_beside,
        trials=600,
    ),
)


def measure_reliability(*, rows: frozenset[int] = frozenset(), factor: float = 1.0) -> int:
    """Measure and print the promises; return 0 when all are met, else 1. `factor` multiplies the
    trials, `rows` selects some."""
    warm_up()
    table = Table(
        "row", "fault", "promise", "trials", "measured", "met", title="When things go wrong"
    )
    terminal, met = Terminal(), True
    with terminal.status("") as status:
        for row in ROWS:
            if rows and row.number not in rows:
                continue
            status.update(f"row {row.number}: {row.fault}")
            measurement = row.measure(max(1, round(row.trials * factor)))
            met = met and measurement.met
            verdict = "[green]yes" if measurement.met else "[red]NO"
            table.add_row(
                str(row.number),
                row.fault,
                row.promise,
                str(measurement.trials),
                measurement.measured,
                verdict,
            )
    terminal.print(table)
    return 0 if met else 1
