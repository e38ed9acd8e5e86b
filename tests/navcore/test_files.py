"""Files are written whole or not at all, and nothing is left of a draft."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from navcore.errors import BadConfiguration, StorageFailed
from navcore.files import is_there, remove_drafts, write_whole
from navcore.mission.beware_sets import beware_list_of
from navcore.perception.esanet.inference.network_file import check_name


class KilledError(BaseException):
    """The process ends here."""


@pytest.mark.parametrize(
    ("error", "raised"), [(OSError("full"), StorageFailed), (KilledError(), KilledError)]
)
def test_what_was_half_written_is_removed_and_the_older_file_stays(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    raised: type[BaseException],
) -> None:
    def end(*_: object) -> NoReturn:
        raise error

    write_whole(tmp_path / "map.npz", b"older")
    monkeypatch.setattr(os, "fsync", end)
    with pytest.raises(raised):
        write_whole(tmp_path / "map.npz", b"newer")
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"older"]


def test_drafts_of_a_killed_process_are_removed_and_nothing_else_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def end(*_: object, **__: object) -> NoReturn:
        raise KilledError

    others = {"map.npz", ".map.npz.bak", ".map.npz.previous", ".other.npz.abcdefgh"}
    for name in others:
        (tmp_path / name).touch()
    with monkeypatch.context() as killed, pytest.raises(KilledError):
        killed.setattr(os, "fsync", end)
        killed.setattr(Path, "unlink", end)
        write_whole(tmp_path / "map.npz", b"newer")
    assert len(list(tmp_path.iterdir())) == len(others) + 1
    remove_drafts(tmp_path / "map.npz")
    assert {file.name for file in tmp_path.iterdir()} == others


@pytest.mark.parametrize("check", [is_there, check_name, beware_list_of])
@pytest.mark.parametrize("reason", ["name", "folder"])
def test_a_path_that_cannot_be_looked_at_is_refused(
    check: Callable[[Path], object], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, words = Path("x" * 300 + ".onnx"), "File name too long"
    if reason == "folder":

        def refuse(*_: object, **__: object) -> NoReturn:
            raise PermissionError(errno.EACCES, "Permission denied")

        monkeypatch.setattr(Path, "stat", refuse)
        path, words = Path("closed/mine.onnx"), "Permission denied"
    with pytest.raises(BadConfiguration, match=f"onnx: not readable: {words}"):
        check(path)
