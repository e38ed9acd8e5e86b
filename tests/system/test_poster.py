"""Depth and colour together: the robot drives over a print of a cup and avoids a real cup.

With the shipped network. A wall has one door with the print in it: a robot that takes the print for
a cup finds no path.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapely import LineString, box

from app.episode.episode import Episode, EpisodeSettings
from app.runtime.segmentation import Perception, compose
from app.runtime.segmenter_choice import SegmenterChoice
from navcore.mission.beware_list import default_beware_list
from sim.scenario.load import load_scenario

ROOM = """
name = "poster"
size_m = [9.0, 6.0]
start = [-2.2, 0.0, 0.0]
goals = [[2.4, 0.0]]
[map]
size_m = [10.0, 7.0]
resolution_m = 0.05
[[walls]]
points = [[-4.44, -2.94], [4.44, -2.94], [4.44, 2.94], [-4.44, 2.94], [-4.44, -2.94]]
[[walls]]
points = [[0.0, -2.94], [0.0, -0.7]]
[[walls]]
points = [[0.0, 0.7], [0.0, 2.94]]
"""
PRINT = """
[[prints]]
shows = "cup"
at = [0.0, 0.0]
yaw_deg = 180
size_m = [0.5, 0.5]
on = "floor"
"""
CUP = """
[[items]]
kind = "cup"
at = [{x}, 0.05]
colour = [190, 40, 40]
"""
ENOUGH_S = 9.0
"""Time to the goal with the door open, simulated seconds: the first test reaches it in that."""


@pytest.fixture(scope="module")
def perception() -> Perception:
    # In single precision as torch, pixel by pixel, in half the time.
    made = compose(SegmenterChoice(kind="network", engine="onnxruntime"))
    assert made.warning is None
    return made


def drive(folder: Path, text: str, perception: Perception) -> tuple[dict[str, object], LineString]:
    file = folder / "poster.toml"
    file.write_text(ROOM + text, encoding="utf-8")
    episode = Episode(
        load_scenario(file),
        EpisodeSettings(beware=default_beware_list(), max_time_s=ENOUGH_S, perception=perception),
        seed=0,
    )
    try:
        return episode.run(), LineString(np.array(episode.driven))
    finally:
        episode.close()


def test_the_robot_passes_a_printed_cup_and_avoids_the_real_one(
    tmp_path: Path, perception: Perception
) -> None:
    report, driven = drive(tmp_path, PRINT + CUP.format(x=1.5), perception)
    assert report["success"], report
    assert report["beware_intrusions"] == 0
    assert driven.intersects(box(-0.25, -0.25, 0.25, 0.25))


def test_a_real_cup_in_the_door_closes_it(tmp_path: Path, perception: Perception) -> None:
    report, _ = drive(tmp_path, CUP.format(x=0.0), perception)
    assert not report["success"]
    assert report["beware_intrusions"] == 0
    assert report["collisions"] == 0
