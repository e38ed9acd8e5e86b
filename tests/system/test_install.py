"""`make setup` installs with uv what pip would: from the same indexes."""

from __future__ import annotations

import runpy
from pathlib import Path

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
