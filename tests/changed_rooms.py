"""Print the test folders of the rooms that differ from the last commit, for `make check`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path, PurePosixPath

PACKAGES = ("app", "navcore", "sim", "web")
ALWAYS = ("tests/system/test_words.py", "tests/system/test_public_api.py")
"""Tests that concern every file and take seconds."""


def tests_of(changed: list[str]) -> list[str]:
    """Return the existing tests of changed files: a test itself, else the folder that mirrors the
    file's room."""
    found = set(ALWAYS)
    for name in changed:
        path = PurePosixPath(name)
        if path.parts[0] == "tests" and path.name.startswith("test_"):
            found.add(name)
        elif path.parts[0] in PACKAGES:
            found.update(_mirror(path))
    return sorted(name for name in found if Path(name).exists())


def _mirror(path: PurePosixPath) -> list[str]:
    """The deepest test folder of a file's room; of a file outside of any room its own test."""
    if len(path.parts) == 2:
        return [f"tests/{path.parts[0]}/test_{path.stem}.py"]
    room = PurePosixPath("tests", *path.parts[:-1])
    while len(room.parts) > 2 and not Path(room).is_dir():
        room = room.parent
    return [str(room)] if len(room.parts) > 2 else []


def changed_files() -> list[str]:
    """Return the files that differ from the last commit, untracked ones included."""
    listed = ["git", "diff", "--name-only", "HEAD"], ["git", "ls-files", "-o", "--exclude-standard"]
    runs = [subprocess.run(line, capture_output=True, text=True, check=True) for line in listed]
    return [name for run in runs for name in run.stdout.splitlines()]


if __name__ == "__main__":
    sys.stdout.write("\n".join(tests_of(changed_files())) + "\n")
