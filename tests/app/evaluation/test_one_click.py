"""The benchmark of classes by example: what there is to find at a site."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from app.evaluation.perception import one_click
from navcore.mission.beware_list import NOTHING, BewareClass
from navcore.mission.prototype import Prototype
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from sim.dataset.renderer import UNSEEN_LABEL, SceneRenderer

ANY = Prototype(
    network="any",
    centre=(0.0,) * 4,
    spread=(1.0,) * 4,
    radius=1.0,
    weights=(0.0,) * 4,
    threshold=0.0,
    typical=1.0,
    max_size_m=2.0,
    min_height_m=0.0,
    max_height_m=2.0,
    clicks=3,
)
"""A prototype that is never compared with an image."""
BOTH_IN_VIEW = 2000
"""Seed of a walk on which the thing that was clicked comes into view as well as the other."""


class Truth:
    """A segmenter with the renderer's labels of the newest image."""

    labels: npt.NDArray[np.uint8]

    def segment(self, frame: Frame, beware: object) -> Labels:
        found = np.where(self.labels == UNSEEN_LABEL, one_click.LIST_ID, NOTHING).astype(np.uint8)
        return Labels(class_ids=found, confidence=np.full(found.shape, 0.99, np.float32))

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


@pytest.mark.long
def test_the_thing_that_was_clicked_is_not_to_be_found_but_no_false_item(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truth, render = Truth(), SceneRenderer.render

    def seen(self: SceneRenderer, *args: Any) -> tuple[Any, ...]:
        rgb, depth_m, truth.labels = render(self, *args)
        return rgb, depth_m, truth.labels

    monkeypatch.setattr(SceneRenderer, "render", seen)
    monkeypatch.setattr(one_click, "_taught", lambda *_: ANY)
    monkeypatch.setattr(one_click, "FusedSegmenter", lambda network, sensor: network)
    counts = one_click.click_and_walk(truth, BOTH_IN_VIEW)  # type: ignore[arg-type]
    assert counts.seen == counts.found == counts.named == Counter(teddy=1)
    assert counts.false.total() == 0
