"""Benchmark of real things: what a network labels of things on tables that a real camera saw.

The images are those of the Object Segmentation Database (Richtsfeld et al. 2012) in folders of one
split each: `NN.rgb.jpg`, `NN.depth.png` in millimetres and `NN.instance.png` with 0 for void, 1 for
the table and a number from 2 on for each thing. Their names are not annotated, so a thing counts as
labelled when enough of its pixels are of any class of the beware list: most are boxes, cups,
bottles and bowls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console as Terminal

from app.evaluation.campaign import write_summary
from app.evaluation.origin import origin_here
from app.evaluation.suites import Suite
from app.runtime.start.segmentation import Perception
from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import IDENTITY, STANDSTILL, camera_mount
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

LEAST_SHARE = 0.3
"""Share of a thing's pixels that have to be labelled for it to count."""
LEAST_CONFIDENCE = 0.5
"""Confidence from which a pixel counts as labelled."""
TABLE = 1
"""Number of the table among the instances; things have larger ones, void 0."""
KINECT_PX = 525.0
"""Focal length of the camera."""
Instances = npt.NDArray[np.uint8]


@dataclass(slots=True, kw_only=True)
class Labelled:
    """Counts over the images of a split."""

    images: int = 0
    """Number of images."""
    things: int = 0
    """Number of things."""
    as_class: Counter[str] = field(default_factory=Counter)
    """Number of labelled things by the class of most of their labelled pixels."""
    table_px: int = 0
    """Number of pixels of the tables."""
    labelled_table_px: int = 0
    """Number of these that have a label."""

    def count(self, instances: Instances, labels: Labels, names: Mapping[int, str]) -> None:
        """Count an image: `instances` (H, W) and its labels, of classes with these names."""
        sure = labels.confidence >= LEAST_CONFIDENCE
        classes = np.where(sure, labels.class_ids, NOTHING)
        self.images += 1
        on_table = classes[instances == TABLE]
        self.table_px += len(on_table)
        self.labelled_table_px += int(np.count_nonzero(on_table != NOTHING))
        for number in np.unique(instances[instances > TABLE]).tolist():
            own = classes[instances == number]
            found = own[own != NOTHING]
            self.things += 1
            if len(found) > LEAST_SHARE * len(own):
                self.as_class[names[int(np.bincount(found).argmax())]] += 1


def splits_in(folder: Path) -> dict[str, list[Path]]:
    """Return the instances of the images by the name of their split; raises `BadConfiguration` for
    a folder without splits."""
    splits = {
        split.name: sorted(split.glob("*.instance.png")) for split in sorted(folder.glob("*/"))
    }
    splits = {name: paths for name, paths in splits.items() if paths}
    if not splits:
        raise BadConfiguration(f"--images {folder}: holds no folder with NN.instance.png")
    return splits


def evaluate_table_tops(
    perception: Perception, beware: BewareList, splits: Mapping[str, Sequence[Path]], *, out: Path
) -> dict[str, Any]:
    """Label all images of the splits, see `splits_in`, print the counts, write `summary.json`;
    return the summary. Raises `BadConfiguration` for a perception without a network."""
    if perception.examples is None:
        raise BadConfiguration(
            f"the suite '{Suite.TABLE_TOPS}' needs a network; {perception.title} has none"
        )
    found = {
        name: _summary(_labelled(perception.examples, beware, paths))
        for name, paths in splits.items()
    }
    told = origin_here(Suite.TABLE_TOPS, segmenter=perception.identity) | {"labelled_things": found}
    out.mkdir(parents=True, exist_ok=True)
    write_summary(told, out)
    for name, one in found.items():
        Terminal().print(
            f"{name}: {one['labelled']} of {one['things']} things labelled, "
            f"{one['table_share']:.2%} of the tables; {one['by_class']}"
        )
    return told


def _labelled(network: NetworkSegmenter, beware: BewareList, paths: Sequence[Path]) -> Labelled:
    counts = Labelled()
    names = {entry.class_id: entry.name for entry in beware.classes}
    for frame, instances in _images(paths):
        counts.count(instances, network.segment(frame, beware), names)
    return counts


def _images(paths: Sequence[Path]) -> Iterator[tuple[Frame, Instances]]:
    for number, path in enumerate(paths):
        stem = str(path).removesuffix(".instance.png")
        instances = _read(path)
        rgb, depth = _read(Path(f"{stem}.rgb.jpg"))[..., ::-1], _read(Path(f"{stem}.depth.png"))
        if rgb.shape != (*instances.shape, 3) or depth.shape != instances.shape:
            raise BadConfiguration(
                f"{stem}: colours {rgb.shape}, depth {depth.shape} and instances "
                f"{instances.shape} are not of one size"
            )
        height, width = instances.shape
        yield (
            Frame(
                stamp_ns=number,
                rgb=np.ascontiguousarray(rgb),
                depth_m=(depth / 1000.0).astype(np.float32),
                intrinsics=Intrinsics(
                    width=width,
                    height=height,
                    fx=KINECT_PX,
                    fy=KINECT_PX,
                    cx=(width - 1) / 2,
                    cy=(height - 1) / 2,
                ),
                T_base_camera=camera_mount(x_m=0.0, y_m=0.0, z_m=1.0, pitch_down_rad=0.6),
                pose=IDENTITY,
                twist=STANDSTILL,
            ),
            instances,
        )


def _read(path: Path) -> npt.NDArray[Any]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise BadConfiguration(f"{path}: no image")
    return np.asarray(image)


def _summary(counts: Labelled) -> dict[str, Any]:
    return {
        "images": counts.images,
        "things": counts.things,
        "labelled": counts.as_class.total(),
        "by_class": dict(counts.as_class.most_common()),
        "table_share": counts.labelled_table_px / max(1, counts.table_px),
    }
