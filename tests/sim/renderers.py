"""Which renderers the tests may count on."""

from __future__ import annotations

import os

import pytest

from sim.sensors.egl import egl_works


def need_egl() -> None:
    """Skip where EGL does not work; in continuous integration it must."""
    if egl_works():
        return
    text = "EGL does not work here: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
    if os.environ.get("CI") == "true":
        pytest.fail(text)
    pytest.skip(text)
