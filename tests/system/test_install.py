"""`make setup` installs with uv what pip would: from the same indexes, and with uv's bars."""

from __future__ import annotations

import runpy
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INSTALL = runpy.run_path(str(ROOT / ".ci" / "install"))


def test_uv_asks_the_indexes_that_pip_is_configured_for(tmp_path: Path) -> None:
    listing = f"""\
:env:.index-url='https://mirror.example/simple'
global.extra-index-url='file://{tmp_path} file://{tmp_path}/missing'
global.index-url='https://other.example/simple'
install.find-links='{tmp_path}/missing'
list.format='columns'
"""
    settings = INSTALL["configured"](listing)
    assert list(INSTALL["sources"](settings)) == [
        "--default-index",
        "https://mirror.example/simple",
        "--index",
        f"file://{tmp_path}",
    ]
    assert list(INSTALL["sources"](INSTALL["configured"](""))) == []
    assert "@.ci/install" in (ROOT / "Makefile").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("failing", "installers"), [("", ["uv"]), ("-m uv", ["uv", "pip"]), ("--quiet", ["pip"])]
)
def test_uv_shows_how_far_it_is_and_pip_installs_where_uv_cannot(
    failing: str, installers: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing silences the installer; `failing` is part of the command that fails, if any does."""
    ran = list[str]()

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        ran.append(" ".join(command))
        fails = bool(failing) and failing in ran[-1]
        return subprocess.CompletedProcess(command, int(fails), stdout="")

    monkeypatch.setattr(subprocess, "run", run)
    assert INSTALL["main"]("python", ["--editable", "."]) == 0
    installing = [command for command in ran if command.endswith("--editable .")]
    assert [command.split()[2] for command in installing] == installers
    assert not any(word in command for command in installing for word in ("-q", "--no-progress"))
