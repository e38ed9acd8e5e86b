"""Real things on tables: what counts as labelled, and which folders are refused."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from app.cli.evaluate.settings import EvaluateSettings, check_options
from app.evaluation.perception.table_tops import evaluate_table_tops, splits_in
from app.evaluation.suites import Suite
from app.evaluation.tables.kinds import file_name
from app.evaluation.tables.pages import full_table
from app.runtime.start.segmentation import Perception
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

LIST = BewareList(
    classes=(BewareClass(name="cup", class_id=1), BewareClass(name="box", class_id=2))
)
TABLE, CUP, HALF_SEEN, UNSURE = 1, 2, 3, 4


class LooksAtRed:
    """A network that labels as its class what is red, of a tenth of its brightness in classes, and
    is sure where there is green."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        sure = np.where(frame.rgb[..., 1] > 128, 0.9, 0.4).astype(np.float32)
        return Labels(class_ids=(frame.rgb[..., 0] // 100).astype(np.uint8), confidence=sure)


def images(folder: Path) -> None:
    instances = np.zeros((60, 80), np.uint8)
    instances[20:, :] = TABLE
    rgb = np.zeros((60, 80, 3), np.uint8)
    rgb[..., 1] = 255
    for column, thing in ((5, CUP), (30, HALF_SEEN), (55, UNSURE)):
        instances[30:50, column : column + 20] = thing
    rgb[30:50, 5:25, 0] = 120  # cup
    rgb[30:50, 30:35, 0] = 220  # a quarter of the pixels as a box
    rgb[30:50, 55:75] = (120, 0, 0)  # not sure
    rgb[20:21, :8, 0] = 120  # of the table
    folder.mkdir(parents=True)
    cv2.imwrite(str(folder / "00.instance.png"), instances)
    cv2.imwrite(str(folder / "00.depth.png"), np.full((60, 80), 900, np.uint16))
    # PNG within: JPEG would mix the colours at the edges.
    (folder / "00.rgb.jpg").write_bytes(cv2.imencode(".png", rgb[..., ::-1])[1].tobytes())


def perception(network: Any) -> Perception:
    return cast(Perception, SimpleNamespace(examples=network, title="made", identity="made"))


def test_a_thing_counts_when_enough_of_it_is_labelled_surely(tmp_path: Path) -> None:
    images(tmp_path / "images" / "test")
    told = evaluate_table_tops(
        perception(LooksAtRed()), LIST, splits_in(tmp_path / "images"), out=tmp_path / "out"
    )
    found = told["labelled_things"]["test"]
    assert (found["images"], found["things"], found["labelled"]) == (1, 3, 1)
    assert found["by_class"] == {"cup": 1}
    assert found["table_share"] == pytest.approx(8 / (40 * 80 - 3 * 400))
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == told
    assert "1 of 3" in full_table([told])
    assert file_name(told) == told["suite"] == Suite.TABLE_TOPS


def test_what_cannot_be_judged_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="holds no folder with"):
        splits_in(tmp_path)
    with pytest.raises(BadConfiguration, match="needs a network"):
        evaluate_table_tops(perception(None), LIST, {}, out=tmp_path / "out")
    images(tmp_path / "test")
    cv2.imwrite(str(tmp_path / "test" / "00.depth.png"), np.zeros((10, 10), np.uint16))
    with pytest.raises(BadConfiguration, match="not of one size"):
        evaluate_table_tops(
            perception(LooksAtRed()), LIST, splits_in(tmp_path), out=tmp_path / "out"
        )
    for suite, folder in (("office", tmp_path), (Suite.TABLE_TOPS, None)):
        with pytest.raises(BadConfiguration, match="--images"):
            check_options(EvaluateSettings(suite=suite, images=folder))
