"""What a start says of the segmenter that it prepares."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.runtime.start.preparation import prepared_perception
from app.runtime.start.progress_lines import LOADING_NETWORK, Progress
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.errors import BadConfiguration
from navcore.robot.profile import HUSKY


def test_the_colour_rules_alone_load_no_network_and_say_so_of_none() -> None:
    said: list[Progress] = []
    perception = prepared_perception(
        SegmenterChoice(kind="colour"), say=said.append, sensor=HUSKY.depth_sensor
    )
    assert perception.title == "colour rules"
    assert LOADING_NETWORK not in {one.step for one in said}


def test_a_network_that_is_loaded_is_named_as_a_step(tmp_path: Path) -> None:
    said: list[Progress] = []
    absent = SegmenterChoice(kind="network", weights=tmp_path / "absent.safetensors")
    with pytest.raises(BadConfiguration, match="absent"):
        prepared_perception(absent, say=said.append, sensor=HUSKY.depth_sensor)
    assert LOADING_NETWORK in {one.step for one in said}
