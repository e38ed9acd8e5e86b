"""The simulated robot as a process of its own in real time, with its own clock, link and time-out.

Physics and camera never hold the console's interpreter lock, and the driver's time-out stops the
robot when the console hangs. The link carries JSON headers and raw pixels, nothing executable.
"""

from __future__ import annotations

import itertools
import json
import math
import multiprocessing
import signal
import threading
import time
from dataclasses import asdict
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from app.runtime.message_queue import LatestMessageQueue
from navcore.config.safety import DEFAULT_SAFETY
from navcore.errors import BewareNavError
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan
from navcore.robot.profile import RobotProfile
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.sensors.gnss_settings import GnssKind
from sim.simulator import Simulator

COMMAND_LIFE_NS = DEFAULT_SAFETY.gate.command_life_ns
START_S = 60.0
"""Longest time until the first frame, seconds."""
MAX_BEHIND_S = 0.1
"""Lag behind real time that the simulator makes up, seconds; a longer lag is given up, and the
world stood still meanwhile."""
NEWEST = slice(-1000, None)
"""Contacts, intrusions and stops that the report with each frame lists: a run may last days."""
JOIN_S = 2.0
"""Longest wait for the end of the process and of the thread, seconds."""


class SimulatorFailed(BewareNavError):  # noqa: N818 - named after what happened, as all of them
    """The simulator process did not start or has died."""


class SimulatorProcess:
    """A `Robot` whose wheels and camera are simulated in another process. Stamps are those of the
    machine's monotonic clock."""

    def __init__(
        self,
        scenario: str,
        *,
        seed: int,
        profile: RobotProfile,
        odometry: OdometryGrade = OdometryGrade.TYPICAL,
        gnss: GnssKind | None = None,
    ) -> None:
        self.profile = profile
        self._frame: Frame | None = None
        self._report: dict[str, Any] = {}
        self._news = threading.Condition()
        self._ended = False
        self._told = itertools.count()
        context = multiprocessing.get_context("spawn")
        self._link, far_end = context.Pipe()
        self._process = context.Process(
            target=_serve,
            args=(far_end, scenario, seed, str(odometry), gnss, profile),
            daemon=True,
            name="simulator",
        )
        self._process.start()
        far_end.close()
        self._outbox = LatestMessageQueue(self._link, "to-simulator")
        self._reader = threading.Thread(target=self._sense, name="sense", daemon=True)
        self._reader.start()
        with self._news:
            self._news.wait_for(lambda: self._frame is not None or self._ended, START_S)
        if self._frame is None:
            self.close()
            raise SimulatorFailed(f"the simulator ended, or sent no frame within {START_S:g} s")

    def now_ns(self) -> int:
        """Return the time of the machine's monotonic clock in nanoseconds."""
        return time.monotonic_ns()

    def newest_frame(self) -> Frame | None:
        """Return the newest frame of the link; None before the first."""
        return self._frame

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """Return the newest frame once it is another than `after`; None when none comes in time.
        Raises `SimulatorFailed` when none will come any more."""
        with self._news:
            self._news.wait_for(lambda: self._frame is not after or self._ended, timeout_s)
            if self._frame is not after:
                return self._frame
        if self._ended:
            self._process.join(timeout=JOIN_S)
            code = self._process.exitcode
            raise SimulatorFailed(
                f"the simulator has ended with exit code {code}; start the console again"
            )
        return None

    def send(self, twist: Twist) -> None:
        """Send a velocity, which expires in the robot's driver."""
        message = {"kind": "twist", "v": twist.v_mps, "w": twist.w_radps, "stamp_ns": self.now_ns()}
        self._outbox.post("twist", json.dumps(message).encode())

    def watch_zones(self, polygons: list[list[tuple[float, float]]]) -> None:
        """Tell the referee the zones in force."""
        self._tell(kind="zones", polygons=polygons)

    def note_stop(self, reason: str | None) -> None:
        """Tell the referee why the robot is held; None when it is not."""
        self._tell(kind="stop", reason=reason)

    def new_run(self) -> None:
        """Let the referee start a new judgement."""
        self._tell(kind="new_run")

    def referee_report(self) -> dict[str, Any]:
        """Return the judgement since the last `new_run`, as of the newest frame."""
        return self._report

    def close(self) -> None:
        """Stop the wheels and end the process."""
        self._tell(kind="close")
        self._process.join(timeout=JOIN_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._outbox.close()
        self._reader.join(timeout=JOIN_S)
        self._link.close()

    def _tell(self, **message: Any) -> None:
        self._outbox.post(f"told {next(self._told)}", json.dumps(message).encode())

    def _sense(self) -> None:
        try:
            while True:
                frame, report = _decode(self._link.recv_bytes())
                with self._news:
                    self._frame, self._report = frame, report
                    self._news.notify_all()
        except (EOFError, OSError):
            return
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()


def _serve(
    link: Connection,
    scenario: str,
    seed: int,
    odometry: str,
    gnss: GnssKind | None,
    profile: RobotProfile,
) -> None:
    """Run the simulator in real time: send each frame, execute the messages."""
    # Ctrl-C is for the console, which sends zero and then closes the link.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    outbox = LatestMessageQueue(link, "frames")
    world = load_scenario(scenario, profile)
    with Simulator(
        world,
        seed=seed,
        robot=profile,
        odometry=odometry,
        gnss=gnss,
    ) as simulator:
        # Machine's clock minus simulated clock. It grows only by pauses of the world: between the
        # stamps of two frames never passes less time than in the world, even while a lag is made
        # up.
        frame, lead_ns = None, time.monotonic_ns() - simulator.now_ns()
        while _obey(link, simulator):
            behind_ns = time.monotonic_ns() - simulator.now_ns() - lead_ns
            if behind_ns > MAX_BEHIND_S * 1e9:
                lead_ns += behind_ns
            elif behind_ns <= 0:
                time.sleep(min(-behind_ns / 1e9 + 1e-3, 0.01))
                continue
            simulator.step()
            if simulator.newest_frame() is not frame:
                frame = simulator.newest_frame()
                if frame is not None:
                    # A frame that a fault made late or wrongly dated stays so on the machine's
                    # clock.
                    report = simulator.referee.summary(NEWEST)
                    outbox.post("frame", _encode(frame, frame.stamp_ns + lead_ns, report))


def _obey(link: Connection, simulator: Simulator) -> bool:
    """Execute all waiting messages; False when the link is closed."""
    try:
        while link.poll():
            message = json.loads(link.recv_bytes())
            match message["kind"]:
                case "twist" if time.monotonic_ns() - message["stamp_ns"] < COMMAND_LIFE_NS:
                    simulator.send(Twist(v_mps=message["v"], w_radps=message["w"]))
                case "zones":
                    simulator.referee.set_zones(
                        tuple(np.array(polygon) for polygon in message["polygons"])
                    )
                case "stop":
                    simulator.referee.note_stop(message["reason"])
                case "new_run":
                    simulator.new_run()
                case "close":
                    return False
    except (EOFError, OSError):
        return False
    return True


def _encode(frame: Frame, stamp_ns: int, report: dict[str, Any]) -> bytes:
    header = {
        "intrinsics": asdict(frame.intrinsics),
        "mount": frame.T_base_camera.ravel().tolist(),
        "pose": asdict(frame.pose),
        "twist": asdict(frame.twist),
        "tilt": [frame.roll_rad, frame.pitch_rad],
        "fixes": [_encoded_fix(fix, stamp_ns - frame.stamp_ns) for fix in frame.fixes],
        "stamp_ns": stamp_ns,
        # Of a faulty depth camera it may differ from that of the intrinsics.
        "depth_shape": frame.depth_m.shape,
        "is_part_uncoloured": frame.uncoloured is not None,
        "scan": None
        if frame.scan is None
        else {"x_m": frame.scan.x_m, "max_range_m": frame.scan.max_range_m},
        # JSON has no infinity: a clearance that was never measured is null.
        "referee": {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in report.items()
        },
    }
    text = json.dumps(header).encode()
    text += b" " * (-(4 + len(text)) % 8)  # aligns the depth, as compiled code requires
    unknown = b"" if frame.uncoloured is None else frame.uncoloured.tobytes()
    ranges = b"" if frame.scan is None else frame.scan.ranges_m.tobytes()
    pixels = frame.depth_m.tobytes() + frame.rgb.tobytes() + unknown
    return len(text).to_bytes(4, "little") + text + pixels + ranges


def _encoded_fix(fix: PositionFix, lead_ns: int) -> dict[str, Any]:
    """Return a fix as JSON, its stamp on the machine's clock."""
    return {
        **asdict(fix),
        "stamp_ns": fix.stamp_ns + lead_ns,
        "covariance": fix.covariance.tolist(),
        "source": str(fix.source),
    }


def _decoded_fix(fields: dict[str, Any]) -> PositionFix:
    return PositionFix(
        **{
            **fields,
            "covariance": np.array(fields["covariance"]),
            "source": FixSource(fields["source"]),
        }
    )


def _decode(message: bytes) -> tuple[Frame, dict[str, Any]]:
    split = 4 + int.from_bytes(message[:4], "little")
    header = json.loads(message[4:split])
    intrinsics = Intrinsics(**header["intrinsics"])
    shape, pixels = (intrinsics.height, intrinsics.width), intrinsics.height * intrinsics.width
    depth_shape = header["depth_shape"]
    colours = split + 4 * math.prod(depth_shape)
    unknown = colours + 3 * pixels
    end = unknown + pixels * header["is_part_uncoloured"]
    return Frame(
        stamp_ns=header["stamp_ns"],
        rgb=np.frombuffer(message, np.uint8, 3 * pixels, colours).reshape(*shape, 3),
        depth_m=np.frombuffer(message, np.float32, math.prod(depth_shape), split).reshape(
            depth_shape
        ),
        uncoloured=np.frombuffer(message, np.bool_, pixels, unknown).reshape(shape)
        if header["is_part_uncoloured"]
        else None,
        intrinsics=intrinsics,
        T_base_camera=np.array(header["mount"]).reshape(4, 4),
        pose=Pose2(**header["pose"]),
        twist=Twist(**header["twist"]),
        roll_rad=header["tilt"][0],
        pitch_rad=header["tilt"][1],
        fixes=tuple(_decoded_fix(fix) for fix in header["fixes"]),
        scan=None
        if header["scan"] is None
        else LaserScan(ranges_m=np.frombuffer(message[end:], np.float32), **header["scan"]),
    ), header["referee"]
