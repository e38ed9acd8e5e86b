"""What is installed, what is missing, and what to do about it."""

from __future__ import annotations

import importlib.metadata
import platform
import shutil
import sys

import typer

PACKAGES = ("numpy", "numba", "opencv-python-headless", "torch", "pybullet", "viser", "fastapi", "uvicorn", "shapely")


def examine() -> int:
    """Print one line a part; 0 when everything that is needed is there."""
    missing = 0
    _say(True, f"Python {platform.python_version()} ({sys.executable})")
    for package in PACKAGES:
        try:
            _say(True, f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            missing += 1
            _say(False, f"{package} is missing: run `make setup`")
    _say(*_renderer())
    found = shutil.which("chromium")
    _say(
        bool(found), f"chromium {found}" if found else "chromium is missing, needed for browser tests: apt-get install chromium"
    )
    return 1 if missing else 0


def _renderer() -> tuple[bool, str]:
    from sim.scenario import load_scenario
    from sim.simulator import Simulator

    with Simulator(load_scenario("empty_room"), seed=0) as simulator:
        if simulator.renderer == "egl":
            return True, "camera renderer: EGL"
    return False, "camera renderer: TINY, slower; for EGL: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"


def _say(good: bool, text: str) -> None:
    typer.echo(f"{'ok  ' if good else 'MISS'} {text}")
