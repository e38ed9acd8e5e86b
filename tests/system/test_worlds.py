"""A short mission in each world, with the shipped network and the latency of the console."""

from __future__ import annotations

import pytest

from app.episode.latency import live_latency
from app.episode.task import Task, episode_of
from app.runtime.record.provenance import shipped_sha256
from app.runtime.start.segmentation import Perception, compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.mission.beware_list import default_beware_list
from navcore.robot.profile import HUSKY
from sim.scenario.load import load_scenario

GOALS = {
    "clutter": (-3.4, 1.0),
    "office": (-9.0, -6.0),
    "indoor": (-25.6, 3.0),
    "forest": (-31.5, -32.5),
}
"""A goal some metres from the start of each world."""


@pytest.fixture(scope="module")
def perception() -> Perception:
    """The shipped network on an engine that needs no trial."""
    return compose(
        SegmenterChoice(kind="network", engine="openvino-int8"), sensor=HUSKY.depth_sensor
    )


@pytest.mark.parametrize("world", GOALS)
def test_a_short_mission_is_driven_with_the_shipped_network(
    world: str, perception: Perception
) -> None:
    task = Task(
        scenario=load_scenario(world),
        goals=(GOALS[world],),
        latency=live_latency(),
        max_time_s=60.0,  # some seeds back off in the clutter's passage and take 41 s
    )
    episode = episode_of(task, 0, robot=HUSKY, beware=default_beware_list(), perception=perception)
    try:
        report = episode.run()
    finally:
        episode.close()
    assert shipped_sha256() in report["segmenter"]
    assert (report["scenario"], report["latency"]) == (world, "live")
    assert (report["ended"], report["causes"]) == ("all goals", [])
    assert report["success"] is True and report["distance_m"] > 2.5
