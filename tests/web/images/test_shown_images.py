"""Camera images are held as long as an operator needs to click on one."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from navcore.errors import Refused
from tests.web.fake_operations import FakeOperations
from web.images.shown_images import ShownImages


def test_a_large_image_is_held_for_seconds_and_an_old_one_is_not(
    operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, picture = ShownImages(), operations.newest_tick()
    assert picture is not None
    large = np.zeros((480, 848), np.uint8)
    for tick in range(40):
        monkeypatch.setattr("time.monotonic", itertools.repeat(0.2 * tick).__next__)
        confidence = large.astype(np.float32)
        shown.note(
            dataclasses.replace(picture, serial=tick, labels=large, confidence=confidence),
            operations.beware.list,
        )
    assert shown.named("15").class_ids.shape == large.shape  # 4.8 s old
    with pytest.raises(Refused, match="click again"):
        shown.named("10")
