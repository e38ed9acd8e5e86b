"""`bewarenav drive` with a map file."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.cli.drive import DriveSettings, drive
from app.cli.options import SegmenterOptions
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


def test_a_map_in_which_the_robot_is_not_sure_of_its_place_stays_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "room.npz"
    first = driven(kept)
    assert "not sure" not in capsys.readouterr().err  # a new map is no one else's
    assert driven(kept) == first
    assert "room.npz stays as it was: the robot was not sure of its place" in " ".join(
        capsys.readouterr().err.split()
    )
    monkeypatch.setattr(Navigator, "map_is_on_trial", False)  # control
    assert driven(kept) != first
