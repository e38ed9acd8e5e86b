"""Other planners on the same grids: pyastar2d and scikit-image, in a virtual environment of their
own, so that the project does not need them."""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
import sys
import tomllib
import venv
from collections.abc import Callable
from pathlib import Path

import numpy as np

from app.bench.planning.plain_astar import length_by_astar
from navcore.errors import BadConfiguration
from navcore.grid.grid import BoolGrid, Cell

Query = Callable[[Cell, Cell], object]
_ROOT = Path(__file__).parents[3]
FOLDER = _ROOT / "build" / "bench-peers"
"""The virtual environment of the peers."""


def install_peers(folder: Path = FOLDER) -> None:
    """Install the group `bench` of `pyproject.toml` into a virtual environment, once, and make its
    packages importable after the own ones. Raises `BadConfiguration` where that fails."""
    ready = folder / "ready"
    if not ready.exists():
        with (_ROOT / "pyproject.toml").open("rb") as file:
            wanted = tomllib.load(file)["project"]["optional-dependencies"]["bench"]
        venv.create(folder, with_pip=True, clear=True)
        pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", *wanted]
        # The same numpy as here: its compiled interface is that of the peers.
        run = subprocess.run([*pip, f"numpy=={np.__version__}"], capture_output=True, text=True)
        if run.returncode:
            raise BadConfiguration(f"--peers: pip cannot install {wanted}: {run.stderr[-500:]}")
        ready.touch()
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = str(folder / "lib" / version / "site-packages")
    if packages not in sys.path:
        sys.path.append(packages)


def peers() -> dict[str, Callable[[BoolGrid], Query]]:
    """Return each peer that is there as a function from a grid to a function that answers a
    query."""
    found: dict[str, Callable[[BoolGrid], Query]] = {
        "numba A*": lambda blocked: lambda start, goal: length_by_astar(blocked, start, goal)
    }
    if importlib.util.find_spec("pyastar2d"):
        found["pyastar2d"] = _pyastar
    if importlib.util.find_spec("skimage"):
        found["MCP_Geometric"] = _mcp
    return found


def _pyastar(blocked: BoolGrid) -> Query:
    module = importlib.import_module("pyastar2d")
    weights = np.where(blocked, np.inf, 1.0).astype(np.float32)
    return lambda start, goal: module.astar_path(weights, start, goal, allow_diagonal=True)


def _mcp(blocked: BoolGrid) -> Query:
    module, weights = importlib.import_module("skimage.graph"), np.where(blocked, -1.0, 1.0)

    def query(start: Cell, goal: Cell) -> object:
        search = module.MCP_Geometric(weights)
        search.find_costs([start], [goal])
        return search.traceback(goal)

    return query
