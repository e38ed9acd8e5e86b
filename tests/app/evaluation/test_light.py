"""The benchmark of light: each disturbance meets the same walks, and labels are judged by truth."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.evaluation.perception import detection
from app.evaluation.perception.light import evaluate_light
from app.evaluation.perception.light_figures import row_of
from app.runtime.start.segmentation import colour_perception
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareList, default_beware_list
from sim.dataset.renderer import LABELS, SceneRenderer
from sim.rendering.lighting import PLAIN, Lighting
from tests.app.evaluation.test_detection import CONES, SHORT_DRIVE, Truth

DARK = Lighting(exposure=0.1)


class BlindInTheDark(Truth):
    """A network that knows the truth of images that are bright enough."""

    def segment(self, frame: Any, beware: object) -> Any:
        self._blind = frame.rgb.mean() < 60
        return super().segment(frame, beware)


def test_a_network_that_is_blind_in_the_dark_loses_there_and_nowhere_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth, render = BlindInTheDark(), SceneRenderer.render

    def seen(self: SceneRenderer, *args: Any) -> Any:
        rgb, depth_m, truth.labels = render(self, *args)
        return rgb, depth_m, truth.labels

    monkeypatch.setattr(SceneRenderer, "render", seen)
    perception = dataclasses.replace(colour_perception(), examples=truth)  # type: ignore[arg-type]
    told = evaluate_light(
        perception,
        default_beware_list(),
        seeds=[SHORT_DRIVE],
        out=tmp_path,
        disturbances={"none": PLAIN, "dark": DARK},
    )
    light, dark = told["disturbances"]["none"], told["disturbances"]["dark"]
    assert (light["mean_iou"], light["found"], light["things_in_view"]) == (1.0, 2, 2)
    assert dark["mean_iou"] < 0.5 and (dark["found"], dark["things_in_view"]) == (0, 2)
    assert dark["iou_by_class"]["person"] == 0.0
    assert row_of(light)[:2] == ("1.000", "2 of 2")
    assert json.loads((tmp_path / "summary.json").read_text())["seeds"] == [SHORT_DRIVE]
    monkeypatch.setattr(detection, "IN_TIME_M", 1.0)
    with pytest.raises(BadConfiguration, match="other rules of mapping"):
        evaluate_light(
            perception,
            default_beware_list(),
            seeds=[SHORT_DRIVE],
            out=tmp_path,
            disturbances={"none": PLAIN, "dark": DARK},
        )


def test_what_the_list_does_not_have_is_background(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth, render = Truth(), SceneRenderer.render

    def seen(self: SceneRenderer, *args: Any) -> Any:
        rgb, depth_m, labels = render(self, *args)
        truth.labels = np.where(labels == LABELS["wet-floor sign"], labels, 1).astype(np.uint8)
        return rgb, depth_m, labels

    monkeypatch.setattr(SceneRenderer, "render", seen)
    perception = dataclasses.replace(colour_perception(), examples=truth)  # type: ignore[arg-type]
    only = BewareList(classes=(CONES.classes[0],))
    told = evaluate_light(
        perception, only, seeds=[SHORT_DRIVE], out=tmp_path, disturbances={"none": PLAIN}
    )["disturbances"]["none"]
    assert told["iou_by_class"] == {"background": 1.0, "wet-floor sign": 1.0}
    assert told["things_in_view"] == told["found"] == 1
    assert told["found_by_class"] == {"wet-floor sign": "1/1"}


def test_colour_rules_alone_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="needs a network"):
        evaluate_light(colour_perception(), default_beware_list(), seeds=[0], out=tmp_path)
