"""Availability of the renderers in tests."""

from __future__ import annotations

import os

import pytest

from sim.sensors.egl import egl_works


def need_egl() -> None:
    """Skip the test where EGL does not work; fail in continuous integration."""
    if egl_works():
        return
    text = "EGL does not work here: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
    if os.environ.get("CI") == "true":
        pytest.fail(text)
    pytest.skip(text)
