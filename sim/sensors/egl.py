"""PyBullet's EGL renderer: location of its plugin, and whether it works on this machine.

It renders into the GL context that was made last in the process, so only one simulator at a time
may have it.

The plugin ends the whole process where EGL is missing, so it is first tried in a process of its
own: this file, run as a script, renders one image.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path

from sim.bullet import pybullet

SYMBOL = "_eglRendererPlugin"
PROBE_TIMEOUT_S = 30.0
"""Longest time of the probe; a renderer that needs longer for its first image is useless."""
_in_use = threading.Lock()
"""Held by the one client in this process that renders with EGL: a fact about the process, not about
a simulator."""
_SIDE = 32
_RED = [1.0, 0.0, 0.0, 1.0]


@cache
def egl_works() -> bool:
    """Return whether the EGL renderer loads here and shows a red box as red. Probed once a process,
    because it takes a second."""
    if _plugin() is None:
        return False
    probe = [sys.executable, "-P", str(Path(__file__).resolve())]
    try:
        return (
            subprocess.run(
                probe, capture_output=True, timeout=PROBE_TIMEOUT_S, check=False
            ).returncode
            == 0
        )
    except (OSError, subprocess.TimeoutExpired):
        return False


def load_egl(client: int) -> int:
    """Return the handle of the plugin in a client, negative while another client has it; call only
    where `egl_works`."""
    plugin = _plugin()
    if plugin is None or not _in_use.acquire(blocking=False):
        return -1
    handle = int(pybullet.loadPlugin(plugin, SYMBOL, physicsClientId=client))
    if handle < 0:
        _in_use.release()
    return handle


def unload_egl(client: int, handle: int) -> None:
    """Release the plugin for the next client, before this one disconnects."""
    pybullet.unloadPlugin(handle, physicsClientId=client)
    _in_use.release()


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
