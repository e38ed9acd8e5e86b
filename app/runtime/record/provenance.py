"""Where a measured figure comes from: machine, version of the code, network."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from navcore.perception.esanet.inference.network_file import SHIPPED

ROOT = Path(__file__).parents[3]


@cache
def machine() -> str:
    """Return processor, number of cores and Python version of this machine."""
    model = platform.processor() or platform.machine()
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}"


@cache
def version() -> str:
    """Return the version of the package, with the commit where it runs from a checkout; a `+` means
    that files differ from the commit."""
    released = importlib.metadata.version("bewarenav")
    with suppress(OSError, subprocess.CalledProcessError):
        commit = subprocess.run(
            ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=12", "--dirty=+"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout.strip()
        return f"{released}, commit {commit}"
    return released


def shipped_sha256() -> str:
    """Return the SHA-256 of the weights of the shipped network."""
    return hashlib.sha256(SHIPPED.read_bytes()).hexdigest()


WHERE = ("--shard", "--workers", "--engine", "--address", "--out")
"""Options that say where something is computed and stored, and change no result."""


def command_line(arguments: Sequence[str] | None = None) -> str:
    """Return the command with which this process was started, without the options of `WHERE`."""
    given = iter(sys.argv[1:] if arguments is None else arguments)
    kept = []
    for argument in given:
        if argument in WHERE:
            next(given, None)
        elif argument.partition("=")[0] not in WHERE:
            kept.append(argument)
    return shlex.join(["bewarenav", *kept])
