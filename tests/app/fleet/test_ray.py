"""A Ray cluster of two nodes gives what one process gives, also when a node is killed."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None,
    reason="ray is not installed: `make test-fleet` installs it and runs this",
)


@pytest.mark.parametrize("proof", ["node_loss", "episodes", "images"])
@needs_ray
def test_a_cluster_of_two_nodes_gives_what_one_process_gives(proof: str, tmp_path: Path) -> None:
    """In a process of its own: Ray's threads and warnings are none of the other tests'."""
    root = str(Path(__file__).parents[3])
    ended = subprocess.run(
        [sys.executable, "-m", "tests.app.fleet.two_nodes", proof, str(tmp_path)],
        cwd=root,
        env={**os.environ, "PYTHONPATH": root, "RAY_USAGE_STATS_ENABLED": "0"},
        capture_output=True,
        text=True,
        timeout=500,
    )
    assert ended.returncode == 0, ended.stderr[-4000:]
