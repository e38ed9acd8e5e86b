"""Installation by `make setup`, which takes minutes, says how far it is."""

from __future__ import annotations

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_installing_is_a_bar_of_packages_found_then_installed(tmp_path: Path) -> None:
    progress = runpy.run_path(str(ROOT / ".ci" / "install"))["Progress"](tmp_path, 4)
    for line in ("Collecting numpy>=2", "Downloading numpy-2.1-cp311.whl (16.0 MB)"):
        progress.read(line)
    empty, half = "-" * 30, f"{'#' * 15}{'-' * 15}"
    assert progress.text(7.0) == (
        f"Downloading packages [{'#' * 7}{empty[7:]}] 1 / 4, 7 s numpy (16.0MB)"
    )
    progress.read("Installing collected packages: numpy, scipy")
    (tmp_path / "numpy-2.1.dist-info").mkdir()
    (tmp_path / "numpy-2.1.dist-info" / "METADATA").touch()
    assert progress.text(20.4) == f"Installing packages [{half}] 1 / 2, 20 s"
    assert "@.ci/install" in (ROOT / "Makefile").read_text(encoding="utf-8")
