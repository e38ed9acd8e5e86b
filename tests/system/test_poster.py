"""Depth and colour together: the robot drives over a print of a cup and avoids a real cup.

A wall has one door with the print in it: a robot that takes the print for a cup finds no path. The
shipped network, which sees depth itself, takes no print for a cup, so the check by depth is tried
with a segmenter that believes every print; without that check, the print closes the door.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from shapely import LineString, box

from app.episode.episode import Episode, EpisodeSettings
from app.runtime.start.segmentation import Perception, compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.perception.perception import (
    DEFAULT_PERCEPTION,
    DepthFilterConfig,
    PerceptionConfig,
)
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, default_beware_list
from navcore.perception.colour_segmenter import matches_colour
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
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
BLUE_CUP = """
[[items]]
kind = "cup"
at = [0.0, 0.05]
"""
ENOUGH_S = 9.0
"""Time to the goal with the door open, simulated seconds: the first test reaches it in that."""


@pytest.fixture(scope="module")
def perception() -> Perception:
    # Runs on every processor of the tests, and takes a quarter of the time of single precision.
    made = compose(SegmenterChoice(kind="network", engine="openvino-int8"))
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


@pytest.mark.long
def test_a_real_cup_in_the_door_closes_it(tmp_path: Path, perception: Perception) -> None:
    report, _ = drive(tmp_path, CUP.format(x=0.0), perception)
    assert not report["success"]
    assert report["beware_intrusions"] == 0
    assert report["collisions"] == 0


class Gullible:
    """A network that takes everything of the colour of cups for a cup, prints too."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        cup = beware.named("cup")
        assert cup.colour is not None
        # In one piece, as a network labels it: camera noise changes the hue of single pixels.
        blue = cv2.medianBlur(matches_colour(frame.rgb, cup.colour).astype(np.uint8), 5) > 0
        return Labels(
            class_ids=np.where(blue, np.uint8(cup.class_id), np.uint8(NOTHING)),
            confidence=np.full(blue.shape, 0.95, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK if entry.name == "cup" else LabelSource.NOTHING


def gullible(config: PerceptionConfig = DEFAULT_PERCEPTION) -> Perception:
    """Return perception with a segmenter that believes prints."""
    return Perception(
        segmenter=FusedSegmenter(Gullible(), config),
        title="gullible",
        identity="gullible",
        choice=SegmenterChoice(),
    )


def test_depth_refutes_a_print_that_the_segmenter_takes_for_a_cup(tmp_path: Path) -> None:
    report, driven = drive(tmp_path, PRINT, gullible())
    assert report["success"], report
    assert driven.intersects(box(-0.25, -0.25, 0.25, 0.25))


def test_without_the_check_by_depth_the_same_print_closes_the_door(tmp_path: Path) -> None:
    believes = DepthFilterConfig(relief_share=0.0)
    config = dataclasses.replace(DEFAULT_PERCEPTION, depth=believes)
    report, driven = drive(tmp_path, PRINT, gullible(config))
    assert not report["success"]
    assert not driven.intersects(box(-0.25, -0.25, 0.25, 0.25))


def test_depth_does_not_refute_a_real_cup(tmp_path: Path) -> None:
    report, driven = drive(tmp_path, BLUE_CUP, gullible())
    assert not report["success"]
    assert report["beware_intrusions"] == 0
    assert not driven.intersects(box(-0.05, 0.0, 0.05, 0.1))
