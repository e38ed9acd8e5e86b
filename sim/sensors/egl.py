"""PyBullet's EGL renderer: where its plugin lies, and whether it works on this machine.

Its pictures come from whichever GL context was made last in the process, so only one simulator at a
time may have it.

The plugin ends the whole process where EGL is missing, so it is tried out in a process of its own
first: this file, run as a script, renders one picture.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path

import pybullet

SYMBOL = "_eglRendererPlugin"
PROBE_S = 30.0
"""A renderer that needs longer than this for its first picture is of no use."""
_taken = threading.Lock()
"""Held by the one client in this process that renders with EGL: a fact about the process, not about
a simulator."""
_SIDE = 32
_RED = [1.0, 0.0, 0.0, 1.0]


@cache
def egl_works() -> bool:
    """Whether the EGL renderer loads here and shows a red box as red. Asked once a process, as it
    takes a second."""
    if _plugin() is None:
        return False
    probe = [sys.executable, "-P", str(Path(__file__).resolve())]
    try:
        return (
            subprocess.run(probe, capture_output=True, timeout=PROBE_S, check=False).returncode == 0
        )
    except (OSError, subprocess.TimeoutExpired):
        return False


def load_egl(client: int) -> int:
    """The plugin's handle within a client; negative when another client has it. Only where
    `egl_works`."""
    plugin = _plugin()
    if plugin is None or not _taken.acquire(blocking=False):
        return -1
    handle = int(pybullet.loadPlugin(plugin, SYMBOL, physicsClientId=client))
    if handle < 0:
        _taken.release()
    return handle


def unload_egl(client: int, handle: int) -> None:
    """Let the next client have it; before this one disconnects."""
    pybullet.unloadPlugin(handle, physicsClientId=client)
    _taken.release()


def _plugin() -> str | None:
    found = importlib.util.find_spec("eglRenderer")
    return found.origin if found else None


def _shows_red() -> bool:
    client = pybullet.connect(pybullet.DIRECT, options=f"--width={_SIDE} --height={_SIDE}")
    if load_egl(client) < 0:
        return False
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=[1, 1, 1], rgbaColor=_RED, physicsClientId=client
    )
    pybullet.createMultiBody(0, -1, shape, [3, 0, 0], physicsClientId=client)
    view = pybullet.computeViewMatrix([0, 0, 0], [1, 0, 0], [0, 0, 1])
    lens = pybullet.computeProjectionMatrixFOV(40, 1, 0.1, 10)
    *_, rgba, depth, _ = pybullet.getCameraImage(
        _SIDE,
        _SIDE,
        view,
        lens,
        renderer=pybullet.ER_BULLET_HARDWARE_OPENGL,
        physicsClientId=client,
    )
    red, green, blue = (int(rgba[_SIDE // 2][_SIDE // 2][channel]) for channel in range(3))
    metres = 0.1 * 10 / (10 - (10 - 0.1) * float(depth[_SIDE // 2][_SIDE // 2]))
    return red > 60 and max(green, blue) < 40 and abs(metres - 2.0) < 0.02


if __name__ == "__main__":
    sys.exit(0 if _shows_red() else 1)
