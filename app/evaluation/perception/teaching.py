"""Benchmark of teaching: things that no network was trained on are annotated, taught and looked for
elsewhere, and the known classes are compared before and after.

Each teaching is a site of its own: a random world of the test split with two things of one kind of
`sim.models.unseen_items`. Frames around the first thing are annotated with its true pixels, some of
them held back as in the console; the network learns from the others and rendered images. It is
judged on frames around the second thing, and, for the known classes, on rendered images that are
the same for all teachings and of which none was trained on.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.campaign import write_summary
from app.evaluation.origin import origin_here
from app.evaluation.perception.detection import TEST_SHARD
from app.evaluation.perception.one_click import Site, site_of, views
from app.evaluation.suites import Suite
from app.teaching.frames.frame_record import UNITS_PER_M
from app.teaching.training.comparison import LEAST_IOU
from app.teaching.training.paired_counts import PairedCounts
from app.teaching.training.plan import HELD_EVERY
from app.teaching.training.rehearsal import around_objects, labels_of, rendered
from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.teaching.class_teaching import ClassTeacher, grown_network
from navcore.learning.teaching.taught_rows import Encoded
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.perception.esanet.network.preprocess import Size
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, load
from sim.dataset.generate import shard_seed
from sim.dataset.renderer import UNSEEN_LABEL, SceneRenderer
from sim.dataset.scene import Spot
from sim.models.unseen_items import UNSEEN_ITEMS

FRAMES = 8
"""Number of frames around each thing."""
SIZE = Size(height=256, width=416)
"""Working size of the network, a quarter of that of a drive: the suite then takes minutes."""
RENDERED = 120
"""Number of rendered images on which the known classes are judged."""
SURE_LOSS = 0.01
"""Loss of IoU of a known class that the interval must not exclude for the suite to succeed."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Judged:
    """An encoded image, its true labels, and what the network of the start finds in it."""

    encoded: Encoded
    truth: LabelArray
    was: LabelArray


class TeachingSuite:
    """Teachings from one network, and the counts of what each changed."""

    def __init__(self, weights: Path, seed: int, *, recipe: TeachingRecipe | None = None) -> None:
        """`seed` gives the rendered images. Raises `BadConfiguration` for a file that cannot be
        trained on."""
        if weights.suffix != ".safetensors":
            raise BadConfiguration(f"{weights}: only a .safetensors file can be taught a class")
        self.start = load(weights)
        self.known = self.start.card.num_classes
        self.depth = self.start.card.depth.in_unit(UNITS_PER_M)
        """Statistics of the network's depth in millimetres, the unit of all images here."""
        self.recipe = recipe or TeachingRecipe(seed=seed)
        self._images = self._teacher(grown_network(self.start, ("thing",)))
        names = self.start.card.class_names
        self._rehearsed = [
            self._encoded(around_objects(one, names))
            for one in rendered("train", self.recipe.rehearsal, names, self.recipe.seed)
        ]
        self._rendered = self._judged(rendered("test", RENDERED, names, self.recipe.seed))
        self.on_rendered = PairedCounts(self.known + 1)
        self.on_frames = PairedCounts(self.known + 1)
        self.taught: list[dict[str, Any]] = []

    def teach(self, seed: int) -> dict[str, Any] | None:
        """Teach the thing of a site; return what came of it, None where it is seen from no free
        place."""
        kind = list(UNSEEN_ITEMS)[seed % len(UNSEEN_ITEMS)]
        renderer = SceneRenderer(seed=shard_seed(seed, "test", TEST_SHARD), size=(424, 240))
        rng = np.random.default_rng((seed, 25))
        site = site_of(renderer, rng, kind=kind)
        renderer.build(site.scene)
        shown, others = (
            list(self._frames(renderer, site, thing, rng)) for thing in (site.first, site.second)
        )
        learned = [one for place, one in enumerate(shown) if place % HELD_EVERY != 1]
        if len(learned) < 2 or not others:
            return None
        teacher = self._teacher(grown_network(self.start, (kind,)))
        teacher.rehearsed = self._rehearsed
        for frame in learned:
            only = np.where(frame.labels == self.known + 1, frame.labels, 0).astype(np.uint8)
            annotated = dataclasses.replace(frame, labels=only)
            teacher.captured.append(teacher.encoded(annotated, self.depth, own_labels=True))
        for _ in teacher.losses():
            pass
        here = self._counted(teacher, self._judged(others))
        there = self._counted(teacher, self._rendered)
        self.on_frames.merge(here)
        self.on_rendered.merge(there)
        found = here.ious(self.known)
        result = {
            "seed": seed,
            "kind": kind,
            "frames": len(learned),
            "steps": teacher.step,
            "iou": round(found[1], 4) if found else None,
        }
        self.taught.append(result)
        return result

    def summary(self) -> dict[str, Any]:
        """Return all figures: of the taught things, and of each known class."""
        return {
            "recipe": dataclasses.asdict(self.recipe),
            "taught": self.taught,
            "found": sum((one["iou"] or 0.0) >= LEAST_IOU for one in self.taught),
            "known": {
                name: {
                    images: _change(counts, index)
                    for images, counts in (
                        ("rendered", self.on_rendered),
                        ("frames", self.on_frames),
                    )
                }
                for index, name in enumerate(self.start.card.class_names)
            },
        }

    def _teacher(self, grown: TrainedNetwork) -> ClassTeacher:
        return ClassTeacher(grown.network, SIZE, self.recipe, [self.known], known=self.known)

    def _encoded(self, sample: Sample) -> Encoded:
        """Encode an image: with one thing more, the same whichever it is."""
        return self._images.encoded(sample, self.depth)

    def _judged(self, samples: Iterable[Sample]) -> list[_Judged]:
        judged = []
        for sample in samples:
            encoded = self._encoded(sample)
            # The row of the thing is 0 in that network, and counts for nothing.
            was = self._images.predicted(encoded, self.known)
            judged.append(_Judged(encoded=encoded, truth=encoded.labels, was=was))
        return judged

    def _frames(
        self, renderer: SceneRenderer, site: Site, thing: Spot, rng: np.random.Generator
    ) -> Iterable[Sample]:
        for frame, labels in views(renderer, site, thing, rng, FRAMES):
            known = labels_of(self.start.card.class_names)[labels]
            truth = np.where(labels == UNSEEN_LABEL, self.known + 1, known).astype(np.uint8)
            depth_mm = np.round(frame.depth_m * UNITS_PER_M).astype(np.uint16)
            yield Sample(rgb=frame.rgb, depth=depth_mm, labels=truth)

    def _counted(self, teacher: ClassTeacher, images: Sequence[_Judged]) -> PairedCounts:
        counts = PairedCounts(self.known + 1)
        for image in images:
            counts.add(image.truth, image.was, teacher.predicted(image.encoded))
        return counts


def evaluate_teaching(weights: Path, seeds: Sequence[int], *, out: Path) -> bool:
    """Teach on the site of every seed, print the tables and write `summary.json`.

    Return what `has_succeeded` does.
    """
    terminal = Terminal()
    suite = TeachingSuite(weights, seeds[0])
    for one in seeds:
        result = suite.teach(one)
        terminal.print(result or f"{one}: the thing is seen from no free place")
    identity = hashlib.sha256(weights.read_bytes()).hexdigest()
    segmenter = f"network sha256 {identity}, {SIZE.width} × {SIZE.height}, f32"
    summary: dict[str, Any] = {
        **origin_here(Suite.TEACHING, segmenter=segmenter),
        "episodes": len(seeds),
        "seeds": list(seeds),
        **suite.summary(),
    }
    out.mkdir(parents=True, exist_ok=True)
    write_summary(summary, out)
    terminal.print(_table(summary))
    return has_succeeded(summary)


def has_succeeded(summary: dict[str, Any]) -> bool:
    """Return whether something was taught, every thing is found, and no known class has lost for
    sure.

    The frames of the sites may show a class too rarely for an interval; the rendered images are the
    same for all teachings, so that one without an interval there was not judged.
    """
    changes = [
        (images, figure["change"])
        for of in summary["known"].values()
        for images, figure in of.items()
        if figure["old"] is not None
    ]
    kept = all(
        images != "rendered" if change is None else change[1] > -SURE_LOSS
        for images, change in changes
    )
    taught = summary["taught"]
    return bool(taught) and kept and summary["found"] == len(taught)


def _change(counts: PairedCounts, index: int) -> dict[str, Any]:
    ious, change = counts.ious(index), counts.interval(index)
    return {
        "old": round(ious[0], 4) if ious else None,
        "new": round(ious[1], 4) if ious else None,
        "change": [round(value, 4) for value in change] if change else None,
    }


def _table(summary: dict[str, Any]) -> Table:
    table = Table("class", "images", "old", "new", "change, 95 %")
    for name, figures in summary["known"].items():
        for images, figure in figures.items():
            if figure["old"] is not None:
                low, high = figure["change"] or (float("nan"), float("nan"))
                table.add_row(
                    name,
                    images,
                    f"{figure['old']:.3f}",
                    f"{figure['new']:.3f}",
                    f"{low:+.3f} … {high:+.3f}",
                )
    return table
