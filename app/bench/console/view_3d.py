"""Benchmark of the console: a map of 150 m × 150 m in cells of 5 cm with two million points, shown
in one 3D view.

The latency is measured end to end, through viser and the gateway: from the moment a changed map is
available to the moment its message has arrived at a client on this machine. Each change is one
camera frame: the points within 5 m ahead of the robot are measured again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import cast

import numpy as np
import numpy.typing as npt
from rich.table import Table
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from app.bench.console.viser_client import SUBPROTOCOL, camera, names_in
from navcore.costmap.costmap import Costmap
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Phase
from navcore.robot.profile import HUSKY, RobotProfile
from web.interface.operations import RobotService
from web.interface.snapshots import Cloud, State, TickSnapshot
from web.server import ConsoleServer

SIDE_M, CELL_M, POINTS = 150.0, 0.05, 2_000_000
"""Side of the map, cell size, and number of points."""
VIEW_M = 5.0
"""Side of the square that one camera frame measures again."""
CHANGES = 60
"""Number of measured changes."""
PERIOD_S = 0.5
"""Time from one change to the next."""
TIMEOUT_S = 60.0
"""Time after which a missing message ends the benchmark."""
SPEC = GridSpec.centred(size_m=(SIDE_M, SIDE_M), resolution_m=CELL_M)
NO_POINTS: npt.NDArray[np.float64] = np.empty((0, 2))


@dataclass(slots=True)
class _World:
    """The part of a robot service that the 3D view reads; `observe` changes the map."""

    profile: RobotProfile = HUSKY
    robot_urdf: None = None
    zones: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(stored=()))
    beware: SimpleNamespace = field(
        default_factory=lambda: SimpleNamespace(list=default_beware_list())
    )
    _generator: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    _serial: int = 1
    _at: tuple[float, float] = (-60.0, -60.0)
    _cloud: Cloud | None = None
    _picture: TickSnapshot | None = None

    def build(self) -> None:
        """Build two million points, most of them low, and their cells."""
        xy = self._generator.uniform(-SIDE_M / 2 + 1, SIDE_M / 2 - 1, (POINTS, 2))
        points = np.column_stack([xy, self._generator.exponential(0.5, POINTS)]).astype(np.float32)
        rgb = self._generator.integers(0, 255, (POINTS, 3), dtype=np.uint8)
        self._cloud = Cloud(
            serial=1, points_map=points, rgb=rgb, class_ids=np.zeros(POINTS, dtype=np.uint8)
        )
        occupied = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
        cells = np.floor((xy[::40] + SIDE_M / 2) / CELL_M).astype(np.int64)
        occupied[cells[:, 1], cells[:, 0]] = True
        self._set_map(occupied)

    def observe(self) -> None:
        """Move the robot by half a metre and measure the area around it again."""
        cloud, picture = self._cloud, self._picture
        assert cloud is not None and picture is not None
        self._serial += 1
        self._at = (self._at[0] + 0.5, self._at[1] + 0.3)
        points, rgb = cloud.points_map.copy(), cloud.rgb.copy()
        near = np.flatnonzero((np.abs(points[:, :2] - np.array(self._at)) < VIEW_M / 2).all(axis=1))
        points[near] += self._generator.normal(0, 0.01, (len(near), 3)).astype(np.float32)
        rgb[near] = self._generator.integers(0, 255, (len(near), 3), dtype=np.uint8)
        occupied = picture.occupancy.masks[0].bools.copy()
        row, col = SPEC.cell(*self._at)
        reach = round(VIEW_M / 2 / CELL_M)
        occupied[row - reach : row + reach, col - reach : col + reach] = (
            self._generator.random((2 * reach, 2 * reach)) < 0.02
        )
        self._set_map(occupied)
        self._cloud = Cloud(
            serial=self._serial, points_map=points, rgb=rgb, class_ids=cloud.class_ids
        )

    def _set_map(self, occupied: npt.NDArray[np.bool_]) -> None:
        geometric, nothing = CellMask.of(occupied), CellMask.of(np.zeros_like(occupied))
        occupancy = Costmap(
            spec=SPEC,
            layers={0: geometric},
            margins_m={},
            zones=nothing,
            wide_zones=(),
            free=CellMask.of(~occupied),
            version=self._serial,
        )
        pose = Pose2(x_m=self._at[0], y_m=self._at[1], yaw_rad=0.0)
        self._picture = TickSnapshot(
            serial=1,
            pose=pose,
            T_map_camera=np.eye(4),
            intrinsics=Intrinsics(width=32, height=24, fx=20.0, fy=20.0, cx=16.0, cy=12.0),
            rgb=np.zeros((24, 32, 3), dtype=np.uint8),
            labels=np.zeros((24, 32), dtype=np.uint8),
            confidence=np.zeros((24, 32), dtype=np.float32),
            occupancy=occupancy,
            seen_mask=geometric,
            grid_version=self._serial,
            path=NO_POINTS,
            waypoints=NO_POINTS,
            driven=NO_POINTS,
        )

    def state(self) -> State:
        """Return the state of a robot that stands."""
        return State(
            stamp_s=0.0,
            scenario="bench",
            robot=HUSKY.name,
            phase=Phase.IDLE,
            moving=False,
            summary="",
            stop_latched=False,
            reasons=(),
            pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
            twist=STANDSTILL,
            command=STANDSTILL,
            queue=(),
            reached=(),
            distance_to_goal_m=None,
            travelled_m=0.0,
            explored_m2=0.0,
            replans=0,
            tick_ms=0.0,
            frame_age_s=0.0,
            zones_version=0,
            beware_version=0,
            beware_enabled=1,
            segmenter="none",
            segmenter_warning=None,
        )

    def newest_tick(self) -> TickSnapshot | None:
        """Return the newest map."""
        return self._picture

    def cloud(self) -> Cloud | None:
        """Return the newest points."""
        return self._cloud


def console_table(changes: int = CHANGES) -> Table:
    """Change the map `changes` times; return a table of latency and traffic."""
    world = _World()
    world.build()
    server = ConsoleServer(cast(RobotService, world), port=0)
    server.start()
    try:
        whole, latency_ms, sent = _measured(server, world, changes)
    finally:
        server.stop()
    p50, p99 = np.percentile(latency_ms, [50, 99])
    mean = float(np.mean(sent))
    table = Table(
        "what",
        "figure",
        title=f"live map, {SIDE_M:g} m × {SIDE_M:g} m, {POINTS / 1e6:g} million points, one view",
    )
    table.add_row("the whole scene, once", f"{whole / 1e6:.2f} MB")
    table.add_row(
        "one change of the map", f"{mean / 1e3:.0f} kB, 1/{whole / mean:.0f} of the whole"
    )
    table.add_row(f"at {1 / PERIOD_S:g} changes a second", f"{mean / PERIOD_S / 1e3:.0f} kB/s")
    table.add_row("from change to message, p50", f"{p50:.0f} ms")
    table.add_row("from change to message, p99", f"{p99:.0f} ms")
    return table


def _measured(
    server: ConsoleServer, world: _World, changes: int
) -> tuple[int, list[float], list[int]]:
    """Return the bytes of the whole scene, and of each change its milliseconds until the points
    have arrived and its bytes."""
    address = server.url.replace("http", "ws") + "/viewer"
    with connect(address, subprotocols=[SUBPROTOCOL], proxy=None, max_size=None) as client:
        client.send(camera())
        whole = _read_until_quiet(client)
        latency_ms, sent = [], []
        for _ in range(changes):
            began = time.perf_counter()
            world.observe()
            changed = time.perf_counter()
            total = _read_until(
                client, lambda names: any(name.startswith("/cloud/") for name in names)
            )
            latency_ms.append((time.perf_counter() - changed) * 1e3)
            sent.append(
                total + _read_for(client, max(PERIOD_S - (time.perf_counter() - began), 0.05))
            )
    return whole, latency_ms, sent


def _read_until(client: Connection, wanted: Callable[[set[str]], bool]) -> int:
    total = 0
    while True:
        frame = cast(bytes, client.recv(timeout=TIMEOUT_S))
        total += len(frame)
        if wanted(names_in(frame)):
            return total


def _read_for(client: Connection, seconds: float) -> int:
    total, until = 0, time.perf_counter() + seconds
    while (left := until - time.perf_counter()) > 0:
        try:
            total += len(cast(bytes, client.recv(timeout=left)))
        except TimeoutError:
            break
    return total


def _read_until_quiet(client: Connection) -> int:
    """Read the whole scene: until nothing has arrived for two seconds. Returns its bytes."""
    total = _read_until(client, lambda names: any(name.startswith("/cloud/") for name in names))
    while (more := _read_for(client, 2.0)) > 0:
        total += more
    return total
