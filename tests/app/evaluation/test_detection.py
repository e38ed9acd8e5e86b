"""The detection benchmark: what counts as found and as false, and the intervals of its rates."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.perception import detection
from app.evaluation.perception.detection_counts import DetectionCounts, Walks, summary
from app.evaluation.suites import Suite
from app.runtime.start.segmentation import colour_perception
from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, default_beware_list
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from sim.dataset.renderer import SceneRenderer

NAMES = BEWARE_CLASSES[1:]
SHORT_DRIVE = 1003
"""Seed of a drive of 0.9 m past a person and a wet-floor sign."""


class Truth:
    """A segmenter with the renderer's labels, or with one label of one corner of every image."""

    def __init__(self, *, corner: str | None = None, blind: bool = False) -> None:
        self.labels = np.zeros((1, 1), dtype=np.uint8)
        self._corner, self._blind = corner, blind
        ids = default_beware_list().ids
        self._ids = np.array([NOTHING, *(ids.get(name, NOTHING) for name in BEWARE_CLASSES)])

    def segment(self, frame: Frame, beware: object) -> Labels:
        found = self._ids[self.labels].astype(np.uint8)
        if self._blind or self._corner is not None:
            found[:] = NOTHING
        if self._corner is not None:
            near = (frame.depth_m > 0) & (frame.depth_m < 2.0)
            found[near] = default_beware_list().ids[self._corner]
        return Labels(class_ids=found, confidence=np.full(found.shape, 0.99, np.float32))

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


def counts_of(
    truth: Truth, monkeypatch: pytest.MonkeyPatch, beware: BewareList | None = None
) -> DetectionCounts:
    """Return the counts of the short drive with a segmenter that is told the truth."""
    render = SceneRenderer.render

    def seen(self: SceneRenderer, *args: object) -> tuple[object, ...]:
        rgb, depth_m, truth.labels = render(self, *args)  # type: ignore[arg-type]
        return rgb, depth_m, truth.labels

    monkeypatch.setattr(SceneRenderer, "render", seen)
    return detection.walk_of_seed(truth, beware or default_beware_list(), SHORT_DRIVE)


def test_a_segmenter_that_knows_the_truth_finds_everything_and_nothing_false(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts = counts_of(Truth(), monkeypatch)
    assert counts.seen.total() == counts.found.total() == counts.named.total() == 2
    assert counts.false.total() == 0
    assert counts.walked_m == pytest.approx(0.9)


def test_a_blind_one_finds_nothing_and_what_is_not_there_is_false(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blind = counts_of(Truth(blind=True), monkeypatch)
    assert (blind.seen.total(), blind.found.total(), blind.false.total()) == (2, 0, 0)
    assert counts_of(Truth(corner="spill"), monkeypatch).false["spill"] >= 1


CONES = BewareList(
    classes=(
        BewareClass(
            name="cone",
            network_class="wet-floor sign",
            class_id=default_beware_list().ids["wet-floor sign"],
        ),
        dataclasses.replace(default_beware_list().named("person"), enabled=False),
    )
)
"""A list that calls a class by another name, and has no other that is switched on."""


def test_what_counts_are_the_classes_of_the_operators_list_by_those_of_the_network(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts = counts_of(Truth(), monkeypatch, CONES)
    assert counts.seen == counts.found == counts.named == Counter({"wet-floor sign": 1})
    assert counts.false.total() == 0
    sees_signs = counts_of(Truth(corner="wet-floor sign"), monkeypatch, CONES)
    assert sees_signs.false["wet-floor sign"] >= 1 and "cone" not in sees_signs.false
    suite = detection.walks(colour_perception(), CONES)
    assert suite.names == ("wet-floor sign",)
    assert detection.walks(colour_perception(), default_beware_list()).names == NAMES


def drive(*, found: int, seen: int, false: int, walked_m: float = 5.0) -> DetectionCounts:
    """Return the counts of one drive past cables."""
    return DetectionCounts(
        seen=Counter(cable=seen),
        found=Counter(cable=found),
        false=Counter(cup=false),
        walked_m=walked_m,
    )


def test_rates_are_of_all_drives_together_and_thin_things_are_told_apart() -> None:
    told = summary([drive(found=1, seen=2, false=0), drive(found=2, seen=2, false=3)], NAMES)
    assert (told["found_in_time"], told["found_of_thin"], told["found_of_others"]) == (
        0.75,
        "3/4",
        "0/0",
    )
    assert told["false_items_per_10_m"] == 3.0
    low, high = told["found_in_time_ci95"]
    assert low < 0.75 < high
    assert told["false_items_per_10_m_ci95"] == (0.0, 6.0)


def test_intervals_become_narrower_with_more_drives_and_exist_for_one() -> None:
    few = [drive(found=1, seen=2, false=0), drive(found=2, seen=2, false=1)]

    def width(drives: list[DetectionCounts]) -> float:
        low, high = summary(drives, NAMES)["false_items_per_10_m_ci95"]
        return float(high - low)

    assert width(few * 20) < width(few)
    assert summary(few[:1], NAMES)["false_items_per_10_m_ci95"] == (0.0, 7.378)
    assert summary([drive(found=0, seen=0, false=0)], NAMES)["found_in_time_ci95"] == (0.0, 1.0)


def test_walks_are_recorded_and_an_interrupted_suite_walks_only_the_rest(tmp_path: Path) -> None:
    walked: list[int] = []

    def walk(seed: int) -> DetectionCounts:
        walked.append(seed)
        if seed == 2002 and walked.count(seed) == 1:
            raise KeyboardInterrupt
        return DetectionCounts(
            seen=Counter(teddy=1), found=Counter(teddy=seed % 2), walked_m=4.0, refused=("grey",)
        )

    suite = Walks(
        suite=Suite.ONE_CLICK,
        names=("teddy", "vase"),
        perception=colour_perception(),
        beware=BewareList(classes=()),
        rules="rules of mapping",
        walk=walk,
    )
    with pytest.raises(KeyboardInterrupt):
        suite.run(range(2000, 2004), out=tmp_path)
    told = suite.run(range(2000, 2004), out=tmp_path)
    assert walked == [2000, 2001, 2002, 2002, 2003]
    assert (told["found"], told["things_in_view"], told["walked_m"]) == (2, 4, 16.0)
    assert told["found_by_class"] == {"teddy": "2/4"} and "found_of_thin" not in told
    assert told["seeds"] == [2000, 2001, 2002, 2003] and told["refused"] == ["grey"] * 4
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["found"] == 2
    other = dataclasses.replace(suite, suite=Suite.FINDING)
    with pytest.raises(BadConfiguration, match="another suite"):
        other.run(range(2000, 2004), out=tmp_path)
    other = dataclasses.replace(suite, rules="others")
    with pytest.raises(BadConfiguration, match="other rules of mapping"):
        other.run(range(2000, 2004), out=tmp_path)


def test_the_rules_of_a_walk_are_those_by_which_it_maps_and_judges(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rules = detection.walks(colour_perception(), CONES).rules
    assert detection.walks(colour_perception(), CONES).rules == rules
    other = MappingConfig(floor_m=MappingConfig().floor_m / 2)
    for name, value in (("MappingConfig", lambda: other), ("IN_TIME_M", 1.0)):
        with monkeypatch.context() as changed:
            changed.setattr(detection, name, value)
            assert repr(detection.walks(colour_perception(), CONES).rules) != repr(rules)
