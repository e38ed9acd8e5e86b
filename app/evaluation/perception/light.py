"""Benchmark of light: the walks of `detection` under each disturbance of `sim.rendering.lighting`.

Every disturbance meets the same worlds and poses. Of each image the labels of the network alone are
compared with the truth (mean IoU over all classes of the list), and the map is judged as in
`detection`: what it holds before the robot is 1.5 m away, and what it holds that is not there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.campaign import HERE, Campaign, write_summary
from app.evaluation.origin import origin_of
from app.evaluation.perception.detection import ENOUGH_PX, listed_classes, walk_of_seed, walk_rules
from app.evaluation.perception.detection_counts import DetectionCounts
from app.evaluation.perception.detection_counts import summary as rates_of
from app.evaluation.perception.light_figures import row_of
from app.evaluation.suites import Suite
from app.runtime.record.provenance import command_line, machine, version
from app.runtime.start.segmentation import Perception
from navcore.errors import BadConfiguration
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.learning.training.metrics import confusion_matrix, ious, mean_iou
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.dataset.renderer import LABELS
from sim.dataset.scene import BACKGROUND
from sim.rendering.lighting import DISTURBANCES, Lighting

TURN_RADPS = 1.0
"""Yaw rate with which the image moves while it is exposed, where that takes time."""
CLASSES = len(BEWARE_CLASSES)
Confusion = npt.NDArray[np.int64]


class WatchedNetwork:
    """A network whose newest labels are kept, to be compared with the truth."""

    def __init__(self, network: NetworkSegmenter) -> None:
        self._network = network
        self.newest: Labels | None = None
        """Labels of the newest frame, before anything refutes them; None before the first."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the labels of the network."""
        self.newest = self._network.segment(frame, beware)
        return self.newest

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return what the network has for an entry."""
        return self._network.source_of(entry)


def evaluate_light(
    perception: Perception,
    beware: BewareList,
    *,
    seeds: Sequence[int],
    out: Path,
    size: tuple[int, int] = CameraStream().size,
    disturbances: Mapping[str, Lighting] = DISTURBANCES,
) -> dict[str, Any]:
    """Walk through the world of each seed under each disturbance with images of `size` (columns,
    rows), print a table, write `summary.json`; return the summary.

    Raises `BadConfiguration` for a perception without a network whose labels can be told apart.
    """
    if perception.examples is None:
        raise BadConfiguration(
            f"the suite '{Suite.LIGHT}' needs a network; {perception.title} has none"
        )
    network = perception.examples

    def drive(seed: int) -> dict[str, Any]:
        walks = {
            name: _walk(network, beware, seed, lighting, size)
            for name, lighting in disturbances.items()
        }
        origin = {"seed": seed, "version": version(), "machine": machine()}
        return origin | {"disturbances": walks, "success": walks["none"]["success"]}

    campaign = Campaign(
        suite=Suite.LIGHT,
        key="seed",
        rules=(
            str(Suite.LIGHT),
            "classes of the list",
            perception.identity,
            beware.classes,
            size,
            tuple(disturbances.items()),
            walk_rules(),
            TURN_RADPS,
        ),
        holds="another suite, network, beware list, image size or other disturbances, or of other "
        "rules of mapping",
        drive=drive,
        drive_alone=drive,
    )
    reports = campaign.run(seeds, fleet=HERE, out=out)
    told = {
        **origin_of(Suite.LIGHT, command_line(), reports, segmenter=perception.identity),
        "images": list(size),
        "disturbances": {name: _summary(reports, name, beware) for name in disturbances},
    }
    write_summary(told, out)
    _show(told)
    return told


def _walk(
    network: NetworkSegmenter,
    beware: BewareList,
    seed: int,
    lighting: Lighting,
    size: tuple[int, int],
) -> dict[str, Any]:
    """Return the counts of a walk and the confusion matrix of the network's labels."""
    watched, confusion = WatchedNetwork(network), np.zeros((CLASSES, CLASSES), dtype=np.int64)
    class_of, label_of = _network_classes(beware), _true_labels(beware)

    def compare(truth: npt.NDArray[np.uint8]) -> None:
        assert watched.newest is not None
        np.add(
            confusion,
            confusion_matrix(label_of[truth], class_of[watched.newest.class_ids], CLASSES),
            out=confusion,
        )

    counts = walk_of_seed(
        FusedSegmenter(watched, HUSKY.depth_sensor),
        beware,
        seed,
        size,
        lighting=lighting,
        turn_radps=TURN_RADPS,
        on_image=compare,
    )
    return counts.report() | {"confusion": confusion.tolist()}


def _network_classes(beware: BewareList) -> npt.NDArray[np.uint8]:
    """Return (256,) the number of the class in `BEWARE_CLASSES` by class id; background where the
    list has none of its name."""
    numbers = np.zeros(256, dtype=np.uint8)
    for entry in beware.classes:
        if entry.detected_as in BEWARE_CLASSES:
            numbers[entry.class_id] = BEWARE_CLASSES.index(entry.detected_as)
    return numbers


def _true_labels(beware: BewareList) -> npt.NDArray[np.uint8]:
    """Return (256,) the true label by that of the data set: background where the list has no class
    of its name, which the network then cannot label."""
    known = {entry.detected_as for entry in beware.classes}
    labels = np.arange(256, dtype=np.uint8)
    for name in BEWARE_CLASSES[1:]:
        if name not in known:
            labels[LABELS[name]] = LABELS[BACKGROUND]
    return labels


def _summary(reports: Sequence[Mapping[str, Any]], name: str, beware: BewareList) -> dict[str, Any]:
    walks = [report["disturbances"][name] for report in reports]
    confusion = np.sum([walk["confusion"] for walk in walks], axis=0)
    # A class of a few pixels at the rim of an image has no IoU worth a mean.
    confusion[confusion.sum(axis=1) < ENOUGH_PX] = 0
    by_class = zip(BEWARE_CLASSES, ious(confusion), strict=True)
    return {
        "mean_iou": round(mean_iou(confusion), 4),
        "iou_by_class": {one: round(float(iou), 3) for one, iou in by_class if np.isfinite(iou)},
    } | rates_of([DetectionCounts.of(walk) for walk in walks], listed_classes(beware))


def _show(told: Mapping[str, Any]) -> None:
    table = Table(
        *("disturbance", "mIoU", "found in time", "of thin ones", "false per 10 m"),
        title="{} × {}, {} walks".format(*told["images"], told["episodes"]),
    )
    for name, measured in told["disturbances"].items():
        table.add_row(name, *row_of(measured))
    Terminal().print(table)
