"""Benchmark of prints: at which distance depth tells a print of a thing from the thing.

Each seed makes one empty world for each class of the beware list that a print can show. A print of
the class lies on the floor, then the thing itself in its place, and the robot's camera sees both
from the same distances. The network claims what it labels as the class on enough of its pixels. A
claim is refuted that the checks by depth of `FusedSegmenter` take away before the map is made. A
network may claim too few prints to judge the checks by, so these are also given the true outline of
every print and thing, as a network would label it that believes both.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.campaign import HERE, Campaign, write_summary
from app.evaluation.origin import origin_of
from app.evaluation.perception.detection import ENOUGH_PX
from app.evaluation.perception.print_figures import DISTANCES_M, limit
from app.evaluation.perception.print_sites import (
    KINDS,
    Sight,
    Site,
    renderer_of,
    sights,
    site_of,
    site_rules,
)
from app.evaluation.suites import Suite
from app.runtime.record.provenance import command_line, machine, version
from app.runtime.start.segmentation import Perception
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.dataset.renderer import SceneRenderer

LEAST_SHARE = 0.3
"""Share of the pixels of a print or a thing that have to be labelled for it to count as claimed."""
SURE_SHARE = 0.9
"""Share of the prints that have to be refuted, and of the things that must not be, for the checks
to decide rightly at a distance."""
COUNTS = ("in_view", "claimed", "refuted", "outlines_refuted")
"""What is counted at each distance."""
TAKEN_FOR = "taken_for"
"""Key of the other classes that a print or a thing is taken for after the checks."""
Views = dict[str, Any]
"""For each of `COUNTS` whether it holds at each of `DISTANCES_M`; and `TAKEN_FOR`, a list of names.
"""


class GivenLabels:
    """A network that says what it was given."""

    def __init__(self, labels: Labels) -> None:
        self._labels = labels

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the given labels, whatever the frame."""
        return self._labels

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return that every class is the network's."""
        return LabelSource.NETWORK


def evaluate_prints(
    perception: Perception,
    beware: BewareList,
    *,
    seeds: Sequence[int],
    out: Path,
    size: tuple[int, int] = CameraStream().size,
) -> dict[str, Any]:
    """Look at a print and a thing of each class for each seed with images of `size` (columns,
    rows), print a table, write `summary.json`; return the summary.

    Raises `BadConfiguration` for a perception without a network, or a list without a class that a
    print can show.
    """
    if perception.examples is None:
        raise BadConfiguration(
            f"the suite '{Suite.PRINTS}' needs a network; {perception.title} has none"
        )
    network, known = perception.examples, by_network_alone(beware)
    entries = printable(known)
    if not entries:
        raise BadConfiguration(
            f"the suite '{Suite.PRINTS}' needs a class that is switched on, of {', '.join(KINDS)}"
        )

    def look(seed: int) -> dict[str, Any]:
        origin = {"seed": seed, "version": version(), "machine": machine()}
        return origin | look_at(network, known, seed, size)

    campaign = Campaign(
        suite=Suite.PRINTS,
        key="seed",
        rules=(
            *(str(Suite.PRINTS), perception.identity, known.classes, size, DISTANCES_M),
            *(site_rules(), HUSKY.depth_sensor, ENOUGH_PX, LEAST_SHARE),
        ),
        holds="another suite, network, beware list, image size or other distances, sites or checks",
        drive=look,
        drive_alone=look,
    )
    reports = campaign.run(seeds, fleet=HERE, out=out)
    told = {
        **origin_of(Suite.PRINTS, command_line(), reports, segmenter=perception.identity),
        "images": list(size),
        "printed": {entry.name: _summary(entry, reports) for entry in entries},
    }
    write_summary(told, out)
    table = Table(
        *("class", "prints claimed", "come through", "depth decides rightly up to"),
        title=f"{len(reports)} prints of each class",
    )
    for name, found in told["printed"].items():
        claimed, through = (len(found[key]) for key in ("claimed_seeds", "let_through_seeds"))
        table.add_row(name, str(claimed), str(through), limit(found))
    Terminal().print(table)
    return told


def by_network_alone(beware: BewareList) -> BewareList:
    """Return the classes that are switched on, without their colour rules and examples: what these
    label is not what is judged."""
    classes = (dataclasses.replace(entry, colour=None, prototype=None) for entry in beware.enabled)
    return BewareList(classes=tuple(classes))


def printable(beware: BewareList) -> tuple[BewareClass, ...]:
    """Return the classes of a list that a print can show."""
    return tuple(entry for entry in beware.classes if entry.detected_as in KINDS)


def look_at(
    network: Segmenter, beware: BewareList, seed: int, size: tuple[int, int] = CameraStream().size
) -> dict[str, Any]:
    """Return what is claimed and refuted at the sites of a seed, by class; it succeeds if no print
    of a class with a least height comes through the checks."""
    renderer = renderer_of(seed, size)
    report: dict[str, Any] = {"prints": {}, "things": {}}
    success = True
    for entry in printable(beware):
        site = site_of(seed, entry.detected_as)
        for name, sight in zip(("prints", "things"), sights(site, renderer), strict=True):
            report[name][entry.name] = _looks(network, beware, entry, renderer, site, sight)
        success &= entry.min_height_m is None or not _comes_through(report["prints"][entry.name])
    return report | {"success": success}


def claims(labels: Labels, entry: BewareClass, outline: Bools) -> bool:
    """Return whether labels bind the robot by a class on enough of the (H, W) pixels of an
    outline."""
    own = (labels.class_ids == entry.class_id) & (labels.confidence >= entry.min_confidence)
    return bool(np.count_nonzero(own & outline) >= LEAST_SHARE * np.count_nonzero(outline))


def _looks(
    network: Segmenter,
    beware: BewareList,
    entry: BewareClass,
    renderer: SceneRenderer,
    site: Site,
    sight: Sight,
) -> Views:
    renderer.build(sight.scene)
    views: Views = {name: [] for name in COUNTS}
    others: set[str] = set()
    for number, away_m in enumerate(DISTANCES_M):
        frame, outline = sight.view(renderer, site.pose(away_m), site.rng(3 + number))
        in_view = np.count_nonzero(outline) >= ENOUGH_PX
        claimed, refuted, outline_refuted = False, False, False
        if in_view:
            said = network.segment(frame, beware)
            left = _checked(said, frame, beware)
            claimed = claims(said, entry, outline)
            refuted = claimed and not claims(left, entry, outline)
            others.update(
                other.name
                for other in beware.classes
                if other is not entry and claims(left, other, outline)
            )
            outlined = Labels(
                class_ids=np.where(outline, np.uint8(entry.class_id), np.uint8(NOTHING)),
                confidence=np.ones(outline.shape, dtype=np.float32),
            )
            outline_refuted = not claims(_checked(outlined, frame, beware), entry, outline)
        for name, holds in zip(COUNTS, (in_view, claimed, refuted, outline_refuted), strict=True):
            views[name].append(bool(holds))
    return views | {TAKEN_FOR: sorted(others)}


def _checked(said: Labels, frame: Frame, beware: BewareList) -> Labels:
    """Return the labels that are left after the checks by depth."""
    return FusedSegmenter(GivenLabels(said), HUSKY.depth_sensor).segment(frame, beware)


def _comes_through(views: Views) -> bool:
    """Return whether a claim is left after the checks at any distance."""
    return any(
        claimed and not refuted
        for claimed, refuted in zip(views["claimed"], views["refuted"], strict=True)
    )


def _summary(entry: BewareClass, reports: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    counts = {
        name: {
            count: np.sum([report[name][entry.name][count] for report in reports], axis=0).tolist()
            for count in COUNTS
        }
        for name in ("prints", "things")
    }
    by_seed = {report["seed"]: report["prints"][entry.name] for report in reports}
    return counts | {
        "min_height_m": entry.min_height_m,
        "claimed_seeds": [seed for seed, views in by_seed.items() if any(views["claimed"])],
        TAKEN_FOR: dict(
            Counter(name for views in by_seed.values() for name in views[TAKEN_FOR]).most_common()
        ),
        "let_through_seeds": [seed for seed, views in by_seed.items() if _comes_through(views)],
        "decides_up_to_m": decides_up_to(counts["prints"], counts["things"]),
    }


def decides_up_to(
    prints: Mapping[str, Sequence[int]], things: Mapping[str, Sequence[int]]
) -> float | None:
    """Return the largest distance in metres up to which the checks decide rightly at every distance
    at which prints and things are in view; None if they do at none. Both count the outlines that
    are refuted at each of `DISTANCES_M`."""
    limit_m = None
    for number, away_m in enumerate(DISTANCES_M):
        flat, whole = (kind["outlines_refuted"][number] for kind in (prints, things))
        flats, wholes = (kind["in_view"][number] for kind in (prints, things))
        if not (flats and wholes):
            continue
        if flat < SURE_SHARE * flats or wholes - whole < SURE_SHARE * wholes:
            break
        limit_m = away_m
    return limit_m
