"""Depth and colour together: the robot drives over a print of a cup and avoids a real cup.

A wall has one door with the print in it: a robot that takes the print for a cup finds no path. The
shipped network, which sees depth itself, takes no print for a cup, so the check by depth is tried
with a segmenter that believes every print; without that check, the print closes the door.

`evaluate prints` found no print either that the network takes for what stands up where depth can
tell. So the network itself is deceived by its depth input: it sees a print that looks like the
thing, with the depth of the thing, and the check sees the true depth. Without the check the map
holds the print.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from shapely import LineString, box

from app.episode.episode import Episode, EpisodeSettings
from app.evaluation.perception.detection import CELL_M, picture
from app.evaluation.perception.print_sites import renderer_of, site_of, with_print, with_thing
from app.evaluation.perception.prints import GivenLabels, by_network_alone
from app.runtime.start.segmentation import Perception, compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import (
    DEFAULT_PERCEPTION,
    DepthFilterConfig,
    ObservationConfig,
    PerceptionConfig,
)
from navcore.costmap.costmap import layer_grid
from navcore.grid.grid import GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, default_beware_list
from navcore.perception.colour_segmenter import matches_colour
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
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
KEPT_PRINTS = {"cup": 1006, "bottle": 1001, "box": 1001}
"""Seeds of prints of `evaluate prints` that are drawn to look like the thing from a viewpoint."""
APPROACH_M = (2.0, 1.8, 1.6, 1.4, 1.2, 1.0)
"""Distances from which the camera sees them, one after the other."""
UNCHECKED = dataclasses.replace(DEFAULT_PERCEPTION, depth=DepthFilterConfig(relief_share=0.0))
"""Perception without the check by depth."""
ENOUGH_S = 9.0
"""Time to the goal with the door open, simulated seconds: the first test reaches it in that."""


@pytest.fixture(scope="module")
def perception() -> Perception:
    # Runs on every processor of the tests, and takes a quarter of the time of single precision.
    made = compose(
        SegmenterChoice(kind="network", engine="openvino-int8"), sensor=HUSKY.depth_sensor
    )
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
        segmenter=FusedSegmenter(Gullible(), HUSKY.depth_sensor, config),
        title="gullible",
        identity="gullible",
        choice=SegmenterChoice(),
    )


def test_depth_refutes_a_print_that_the_segmenter_takes_for_a_cup(tmp_path: Path) -> None:
    report, driven = drive(tmp_path, PRINT, gullible())
    assert report["success"], report
    assert driven.intersects(box(-0.25, -0.25, 0.25, 0.25))


def test_without_the_check_by_depth_the_same_print_closes_the_door(tmp_path: Path) -> None:
    report, driven = drive(tmp_path, PRINT, gullible(UNCHECKED))
    assert not report["success"]
    assert not driven.intersects(box(-0.25, -0.25, 0.25, 0.25))


def test_depth_does_not_refute_a_real_cup(tmp_path: Path) -> None:
    report, driven = drive(tmp_path, BLUE_CUP, gullible())
    assert not report["success"]
    assert report["beware_intrusions"] == 0
    assert not driven.intersects(box(-0.05, 0.0, 0.05, 0.1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Cells of a class on the map after the camera has come near."""

    print_: int
    """Of a print that the network sees as it is, without the check."""
    deceived: int
    """Of the print, with the depth of the thing for the network, and without the check."""
    deceived_checked: int
    """The same with the check, which sees the true depth."""
    thing_checked: int
    """Of the thing, with the check."""


@pytest.fixture(scope="module", params=list(KEPT_PRINTS.items()), ids=list(KEPT_PRINTS))
def approach(request: pytest.FixtureRequest, perception: Perception) -> Approach:
    kind, seed = request.param
    network, beware = perception.examples, by_network_alone(default_beware_list())
    assert network is not None
    renderer, site = renderer_of(seed), site_of(seed, kind)
    frames: dict[bool, list[Frame]] = {}
    printed, sheet = with_print(site, renderer)
    assert sheet.picture.number >= renderer.prints, "the seed's print is not drawn for a viewpoint"
    for is_print, scene in ((True, printed), (False, with_thing(site))):
        renderer.build(scene)
        frames[is_print] = [
            picture(renderer, scene, site.pose(away_m), site.rng(3), number)[0]
            for number, away_m in enumerate(APPROACH_M)
        ]
    prints, things = frames[True], frames[False]
    mixed = [
        dataclasses.replace(flat, depth_m=whole.depth_m)
        for flat, whole in zip(prints, things, strict=True)
    ]
    said = [[network.segment(frame, beware) for frame in seen] for seen in (prints, mixed, things)]

    def held(frames: list[Frame], labels: list[Labels], config: PerceptionConfig) -> int:
        reach_m = site.scene.reach_m
        spec = GridSpec.centred(
            size_m=(2 * reach_m[0] + 8.0, 2 * reach_m[1] + 8.0), resolution_m=CELL_M
        )
        cloud = PointMap(spec, MappingConfig())
        for frame, one in zip(frames, labels, strict=True):
            found = FusedSegmenter(GivenLabels(one), HUSKY.depth_sensor, config).segment(
                frame, beware
            )
            cloud.insert(observe(frame, found, beware, spec, ObservationConfig()), frame, found)
        grid = layer_grid(cloud, beware, ())
        return int(np.count_nonzero(grid.beware[beware.named(kind).class_id]))

    return Approach(
        print_=held(prints, said[0], UNCHECKED),
        deceived=held(prints, said[1], UNCHECKED),
        deceived_checked=held(prints, said[1], DEFAULT_PERCEPTION),
        thing_checked=held(things, said[2], DEFAULT_PERCEPTION),
    )


def test_the_check_keeps_off_the_map_what_a_deceived_network_takes_for_the_thing(
    approach: Approach,
) -> None:
    assert approach.deceived_checked == 0


def test_without_the_check_the_map_holds_what_a_deceived_network_says(approach: Approach) -> None:
    assert approach.deceived > 0


def test_the_network_that_sees_its_true_depth_takes_the_print_for_nothing(
    approach: Approach,
) -> None:
    assert approach.print_ == 0


def test_the_thing_that_looks_like_the_print_is_on_the_map(approach: Approach) -> None:
    assert approach.thing_checked > 0
