"""`bewarenav drive` with a map file, and recording."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from app.cli.drive import DriveSettings, drive
from app.cli.options import SegmenterOptions
from app.replay.recording import open_recording
from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project_pixels
from navcore.navigator import Navigator


def driven(kept: Path) -> bytes:
    """The map file after a drive of two seconds, which is too short to be sure of a place."""
    settings = DriveSettings(
        scenario="empty_room",
        goal=["-1,-2.5"],
        max_time=2.0,
        kept=kept,
        segmentation=SegmenterOptions(segmenter="colour"),
    )
    with pytest.raises(SystemExit):
        drive(settings)
    return kept.read_bytes()


def test_a_map_is_kept_without_what_was_seen_where_the_robot_is_not_sure_of_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "room.npz"
    first = driven(kept)
    assert "not sure" not in capsys.readouterr().err  # a new map is no one else's
    assert driven(kept) == first
    assert "room.npz is without what was seen last: the robot was not sure" in " ".join(
        capsys.readouterr().err.split()
    )
    monkeypatch.setattr(Navigator, "held_map", None)  # control
    assert driven(kept) != first


def test_a_drive_is_recorded_and_the_recording_is_read_back(tmp_path: Path) -> None:
    settings = DriveSettings(
        scenario="empty_room",
        goal=["-1,-2.5"],
        max_time=3.0,
        report=tmp_path / "report.json",
        record=tmp_path / "recording",
        segmentation=SegmenterOptions(segmenter="colour"),
    )
    with pytest.raises(SystemExit):
        drive(settings)
    recording = open_recording(tmp_path / "recording")
    assert 20 <= len(recording) <= 31
    assert np.diff(recording.numbers).min() == 3  # ten images a second, counted at 30 Hz
    depth_m, lens = recording.depth_m(0), recording.intrinsics
    assert recording.rgb(0).shape == (*depth_m.shape, 3) == (lens.height, lens.width, 3)
    # Where the camera says that it sees the floor, its points lie on it.
    rows, cols = np.nonzero(depth_m[-20:] > 0)
    rows += depth_m.shape[0] - 20
    points = back_project_pixels(rows, cols, depth_m[rows, cols], lens)
    pose = recording.T_world_camera[0]
    assert abs(np.median(points @ pose[2, :3] + pose[2, 3])) < 0.02
    travelled = np.diff(recording.T_world_camera[[0, -1], :2, 3], axis=0)
    driven_m = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["distance_m"]
    assert 0.0 < float(np.hypot(*travelled[0])) <= driven_m + 0.4  # the camera is 0.35 m ahead
    with pytest.raises(BadConfiguration, match="holds a recording already"):
        drive(settings)
    with pytest.raises(BadConfiguration, match="is a folder"):
        drive(dataclasses.replace(settings, report=tmp_path))
