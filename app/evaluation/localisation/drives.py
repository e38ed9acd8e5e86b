"""Recorded drives: driven once with nearly perfect odometry, kept as scans, and replayed with the
odometry of many runs without rendering again."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from app.episode.episode import Episode, EpisodeSettings
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.files import read_whole, write_whole
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.localisation.scans.keyframe_store import restored, stored
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.mapping.storage.stored_scans import KINDS, scan_parts, scans_of
from navcore.mission.beware_list import BewareList
from navcore.navigator import TickResult
from navcore.robot.frame import Frame
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.schema import Scenario

EVERY = 2
"""Every how many frames of a drive is kept."""
FRAME_NS = 200_000_000
"""Time between two frames that are kept, nanoseconds."""
_LOOK_FIRST_S = 1.0
_MOST_BYTES = 500_000_000
_LENS = Intrinsics(width=1, height=1, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
_MOUNT = np.eye(4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """A recorded drive of N frames."""

    stamps_ns: tuple[int, ...]
    """Time of each frame in nanoseconds."""
    by_odometry: tuple[Pose2, ...]
    """T_odom_base of each by nearly perfect odometry."""
    pitch_rad: tuple[float, ...]
    """Pitch of each by the accelerometer, radians."""
    true_poses: tuple[Pose2, ...]
    """True T_map_base of each."""
    scans: tuple[Scan, ...]
    """Scan of each."""

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.stamps_ns)

    @property
    def distance_m(self) -> float:
        """Distance driven in metres."""
        pairs = zip(self.true_poses, self.true_poses[1:], strict=False)
        return sum(a.distance_to(b.x_m, b.y_m) for a, b in pairs)

    def first(self, count: int) -> Drive:
        """Return the drive up to a number of frames."""
        return Drive(
            stamps_ns=self.stamps_ns[:count],
            by_odometry=self.by_odometry[:count],
            pitch_rad=self.pitch_rad[:count],
            true_poses=self.true_poses[:count],
            scans=self.scans[:count],
        )

    def frame(self, k: int, T_odom_base: Pose2, stamp_ns: int | None = None) -> Frame:
        """Return a frame without a picture at a pose by another odometry, by default at the time of
        frame `k`."""
        return Frame(
            stamp_ns=self.stamps_ns[k] if stamp_ns is None else stamp_ns,
            rgb=np.zeros((1, 1, 3), dtype=np.uint8),
            depth_m=np.ones((1, 1), dtype=np.float32),
            intrinsics=_LENS,
            T_base_camera=_MOUNT,
            pose=T_odom_base,
            twist=STANDSTILL,
            pitch_rad=self.pitch_rad[k],
        )


def record(
    world: Scenario,
    beware: BewareList,
    *,
    seed: int,
    goals: Sequence[tuple[float, float]] = (),
    max_time_s: float = 600.0,
    config: NavigatorConfig | None = None,
) -> Drive:
    """Drive a mission in a world that a seed has made, with nearly perfect odometry, and keep every
    second frame."""
    episode = Episode(
        world,
        EpisodeSettings(
            beware=beware, goals=tuple(goals), max_time_s=max_time_s, randomised=True,
            odometry=OdometryGrade.IDEAL, config=config,
        ),
        seed=seed,
    )  # fmt: skip
    recorder = DriveRecorder(episode)
    try:
        episode.run(look_first_s=_LOOK_FIRST_S)
    finally:
        episode.close()
    return recorder.drive


class DriveRecorder:
    """Keeps what an episode sees, every second frame, from its making on."""

    def __init__(self, episode: Episode) -> None:
        """Note each tick of an episode whose ticks take no time."""
        self._episode, self._ticks = episode, 0
        self._kept: list[tuple[int, Pose2, float, Pose2, Scan]] = []
        episode.on_decision = self._note

    def _note(self, _: float, result: TickResult) -> None:
        self._ticks += 1
        scan = self._episode.controller.navigator.localisation.scan
        if self._ticks % EVERY == 0 and scan is not None:
            frame = result.frame
            by_odometry = result.place.T_map_odom.inverse() @ frame.pose
            true = self._episode.simulator.true_pose()
            self._kept.append((frame.stamp_ns, by_odometry, frame.pitch_rad, true, scan))

    @property
    def drive(self) -> Drive:
        """What was kept."""
        stamps, by_odometry, pitches, true_poses, scans = zip(*self._kept, strict=True)
        return Drive(
            stamps_ns=stamps,
            by_odometry=by_odometry,
            pitch_rad=pitches,
            true_poses=true_poses,
            scans=scans,
        )


def kept_drive(
    folder: Path,
    world: Scenario,
    beware: BewareList,
    *,
    seed: int,
    config: NavigatorConfig,
    backwards: bool = False,
) -> Drive:
    """Return the drive of a seed to the goals of a world that a seed has made, from its file in a
    folder or driven now and kept there; `backwards` takes the goals in reverse order."""
    goals = tuple(reversed(world.goals)) if backwards else world.goals
    return kept(
        folder,
        f"{world.name}-{seed}{'-back' if backwards else ''}",
        (world, beware.classes, config, seed, goals),
        lambda: record(world, beware, seed=seed, goals=goals, config=config),
    )


def kept(folder: Path, name: str, made_of: object, recorded: Callable[[], Drive]) -> Drive:
    """Return the drive of a file in a folder, or what `recorded` returns, which is kept there.

    The `repr` of what a drive is `made_of` is part of the name of its file: one that was recorded
    in another world, with another list, configuration or start is not found.
    """
    digest = hashlib.sha256(repr(made_of).encode()).hexdigest()[:12]
    path = folder / f"{name}-{digest}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        save_drive(path, recorded())
    return load_drive(path)  # as every later call sees it, in single precision


def save_drive(path: Path, drive: Drive) -> None:
    """Write a drive atomically; raises `StorageFailed`."""
    keyframes = [
        Keyframe(pose_id=k, T_map_base=pose, scan=scan)
        for k, (pose, scan) in enumerate(zip(drive.true_poses, drive.scans, strict=True))
    ]
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {
        "stamps_ns": np.array(drive.stamps_ns, dtype=np.int64),
        "by_odometry": _rows(drive.by_odometry),
        "pitch_rad": np.array(drive.pitch_rad),
        "true_poses": _rows(drive.true_poses),
        **scan_parts(stored(keyframes)),
    }
    np.savez_compressed(buffer, **arrays)
    write_whole(path, buffer.getvalue())


def load_drive(path: Path) -> Drive:
    """Return the drive of a file; raises `BadConfiguration` for one that holds none."""
    data = read_whole(path, at_most=_MOST_BYTES)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        true_poses = _poses(arrays["true_poses"])
        parts = {name: arrays[name] for name in KINDS}
        keyframes = restored(scans_of(parts, len(true_poses), str(path)), true_poses)
        return Drive(
            stamps_ns=tuple(int(stamp) for stamp in arrays["stamps_ns"]),
            by_odometry=_poses(arrays["by_odometry"]),
            pitch_rad=tuple(float(pitch) for pitch in arrays["pitch_rad"]),
            true_poses=true_poses,
            scans=tuple(keyframe.scan for keyframe in keyframes),
        )
    except (KeyError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise BadConfiguration(f"{path}: holds no recorded drive: {error}") from None


def _rows(poses: Sequence[Pose2]) -> npt.NDArray[np.float64]:
    return np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses]).reshape(-1, 3)


def _poses(rows: npt.NDArray[np.float64]) -> tuple[Pose2, ...]:
    return tuple(Pose2(x_m=float(x), y_m=float(y), yaw_rad=float(yaw)) for x, y, yaw in rows)
