"""Pixels that may show a person are left out of scans, wherever in the image."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.geometry.transform import camera_mount
from navcore.localisation.excluded import excluded_pixels
from navcore.perception.labels import Labels
from navcore.perception.people.track import Track
from tests.navcore.localisation.scans.test_scan import LENS, frame_of

REACH_M = 0.55
"""Radius of a person with arms and bags in metres."""


@pytest.mark.parametrize("aside_m", [-1.2, -0.5, 0.0, 0.5, 1.2])
def test_all_columns_that_may_show_a_person_are_left_out(aside_m: float) -> None:
    shape = LENS.height, LENS.width
    person = Track(
        id=1, x_m=1.5, y_m=aside_m, vx_mps=0.0, vy_mps=0.0, radius_m=0.3, age_s=0.0, last_seen_ns=0
    )
    rays, depth_m = (np.arange(LENS.width) - LENS.cx) / LENS.fx, np.zeros(shape)
    for z in np.linspace(1.5 - REACH_M, 1.5 + REACH_M, 101):
        depth_m[:, np.hypot(rays * z + aside_m, z - 1.5) < 0.99 * REACH_M] = z
    mount = camera_mount(x_m=0.0, y_m=0.0, z_m=0.9, pitch_down_rad=0.0)
    frame = dataclasses.replace(frame_of(depth_m.astype(np.float32)), T_base_camera=mount)
    nothing = Labels(
        class_ids=np.zeros(shape, dtype=np.uint8), confidence=np.zeros(shape, dtype=np.float32)
    )
    shown = depth_m > 0.0
    assert shown.any()
    assert excluded_pixels(frame, nothing, (person,))[shown].all()
