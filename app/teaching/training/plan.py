"""Plan of a training run: its images, its start and its recipe, checked and put down on disk.

The images are linked into the folder of the run as a data set, annotated ones only: what is
deleted or annotated later does not change a run that has begun. A quarter of the frames of a class
is held back and never trained on, in no later run either, nor after an export and an import: the
split goes with a frame, and with what shows the same; a held-back frame that shows the same as one
that was trained on is in no run.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

from app.teaching.frames.frame_record import TrainingSplit
from app.teaching.frames.frame_store import FrameStore
from app.teaching.json_files import json_of
from navcore.errors import BadConfiguration, Refused, StorageFailed
from navcore.files import link_or_copy, read_whole, write_whole
from navcore.learning.data.card import CARD_NAME, KINDS, SPLITS, Counts, Split
from navcore.learning.data.dataset import load_dataset
from navcore.learning.data.writer import write_text
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.toml_config import from_table
from web.interface.teaching import NOTHING_NAME, CapturedFrame

PLAN_NAME, DATA_NAME, START_NAME = "plan.json", "data", "start.safetensors"
MAX_PLAN_BYTES = 1_000_000
LEAST_FRAMES = 3
"""Smallest number of annotated frames that show a class: two to learn from, one held back."""
_RENAMED = {"pull": "l2_penalty", "sure": "confidence_threshold"}
"""Present names of the numbers of a recipe, by those of earlier releases."""
HELD_EVERY = 4
"""One of this many frames of a class is held back, the second, the sixth, … of its new ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingPlan:
    """What a run trains; the file `plan.json`."""

    name: str
    """Name of the version that comes of it."""
    start_name: str
    """Name of the version that it starts from."""
    start_path: str
    """Weights file that it starts from, relative to the folder of the run, which has a copy."""
    class_names: tuple[str, ...]
    """Annotated classes, those that the network knows among them."""
    created_unix_s: float
    """When it was planned, seconds since 1970."""
    threads: int
    """Number of threads that compute."""
    size: tuple[int, int] | None = None
    """Working size of the network (height, width); None for that of the start."""
    recipe: TeachingRecipe
    """Numbers of the training."""


def taught_names(frames: Sequence[CapturedFrame]) -> tuple[str, ...]:
    """Return the annotated classes but `background`, in the order of their first frame."""
    names = [name for frame in frames for name in frame.class_names]
    return tuple(name for name in dict.fromkeys(names) if name != NOTHING_NAME)


def held_back(
    frames: Sequence[CapturedFrame],
    before: Mapping[str, TrainingSplit] | None = None,
    near_duplicates: Sequence[Set[str]] = (),
) -> set[str]:
    """Return the ids of the frames to hold back, about a quarter of those of each class.

    `before` are the splits of the frames in earlier trainings. They stay, so that no network is
    judged by what it, or the one that it starts from, was trained on; only a class of which all
    frames were trained on has one of these held back. Of each group of `near_duplicates` all
    frames that were in no training go the same way, that of the others if there are any; unless
    no group of a class fits into its quarter, of which single frames are held back then. Raises
    `Refused` when there are too few frames of a class.
    """
    names, before = taught_names(frames), _with_near_duplicates(before or {}, near_duplicates)
    if not names:
        raise Refused(
            "nothing is annotated; mark the pixels of a class in at least "
            f"{LEAST_FRAMES} captured frames"
        )
    held = {frame.id for frame in frames if before.get(frame.id) == "valid"}
    by_class = [[frame.id for frame in frames if name in frame.class_names] for name in names]
    for name, showing in zip(names, by_class, strict=True):
        if len(showing) < LEAST_FRAMES:
            raise Refused(
                f"{name}: {len(showing)} annotated frames show it, at least {LEAST_FRAMES} are "
                "needed: two to learn from and one to check with"
            )
    filled: set[str] = set()
    together = {one: group for group in near_duplicates for one in group}
    for showing in sorted(by_class, key=len):
        wanted = len(showing[1::HELD_EVERY])
        new = [one for one in showing if one not in held and one not in before]
        if not new and not held.intersection(showing):
            wanted, new = 1, showing
        # Those of a rarer class last, which has its quarter already.
        others = [[one for one in new if (one in filled) == late] for late in (False, True)]
        ordered = [one for part in others for one in _spread(part)]
        for group in (together.get(one, {one}) for one in ordered):
            if len((held | group).intersection(showing)) <= wanted:
                held |= group
        if not held.intersection(showing):
            held.update(ordered[:wanted])
        filled.update(showing)
    held &= {frame.id for frame in frames}
    for name in names:
        left = [f.id for f in frames if name in f.class_names and f.id not in held]
        if not left:
            raise Refused(f"{name}: all frames that show it are held back; annotate one more of it")
    return held


def _contradicting(
    before: Mapping[str, TrainingSplit], near_duplicates: Sequence[Set[str]]
) -> set[str]:
    """Return the frames that were held back and show the same as one that was trained on, as an
    import may bring them: no network is to be judged by them, nor trained on them."""
    return {
        one
        for group in near_duplicates
        if any(before.get(other) == "train" for other in group)
        for one in group
        if before.get(one) == "valid"
    }


def _with_near_duplicates(
    before: Mapping[str, TrainingSplit], groups: Sequence[Set[str]]
) -> dict[str, TrainingSplit]:
    """Return the splits, with those of frames that show the same as one that was in a training; as
    one that was trained on, if there is one."""
    splits = dict(before)
    for group in groups:
        known = {before[one] for one in group if one in before}
        for one in group if known else ():
            splits.setdefault(one, "train" if "train" in known else "valid")
    return splits


def _spread(ids: Sequence[str]) -> list[str]:
    """Return ids with the second, the sixth, … first: neighbours show nearly the same."""
    return [*ids[1::HELD_EVERY], *(one for i, one in enumerate(ids) if i % HELD_EVERY != 1)]


def prepare(
    folder: Path, store: FrameStore, plan: TrainingPlan, asked: Sequence[str] = ()
) -> TrainingPlan:
    """Put a run down in a new folder, with a copy of the network that it starts from, and return
    its plan with the annotated classes.

    `asked` are classes that must be among them. Raises `Refused` for too few frames and a class
    without pixels, `StorageFailed` when the disk is full; then nothing is left of the folder.
    """
    with store.held():
        before, near_duplicates = store.splits(), store.near_duplicates()
        out = _contradicting(before, near_duplicates)
        frames = [frame for frame in store.all() if frame.annotated and frame.id not in out]
        names = taught_names(frames)
        for name in asked:
            if name.casefold() not in (one.casefold() for one in names):
                raise Refused(f"{name}: no pixel of any captured frame is annotated as it")
        held = held_back(frames, before, near_duplicates)
        try:
            _link(folder / DATA_NAME, store.folder, frames, held)
            shutil.copyfile(plan.start_path, folder / START_NAME)
            plan = dataclasses.replace(plan, class_names=names, start_path=START_NAME)
            store.note_splits({one.id: "valid" if one.id in held else "train" for one in frames})
            write_whole(folder / PLAN_NAME, json_of(plan))
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise StorageFailed(
                f"{folder}: the run cannot be prepared: {error.strerror or error}"
            ) from error
        except StorageFailed:
            shutil.rmtree(folder, ignore_errors=True)
            raise
    return plan


def read_plan(folder: Path) -> TrainingPlan:
    """Read the plan of a run; raises `BadConfiguration`."""
    path = folder / PLAN_NAME
    try:
        table = json.loads(read_whole(path, at_most=MAX_PLAN_BYTES))
        # A plan of an earlier release holds numbers that no longer exist, or have other names.
        names = {field.name for field in dataclasses.fields(TeachingRecipe)}
        recipe = {_RENAMED.get(key, key): value for key, value in table["recipe"].items()}
        table["recipe"] = {key: recipe[key] for key in names & recipe.keys()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable: {error!s:.200}") from None
    return from_table(TrainingPlan, table, str(path))


def _link(data: Path, source: Path, frames: Sequence[CapturedFrame], held: set[str]) -> None:
    """Make the data set of a run of links to the stored images."""
    dataset = load_dataset(source)
    by_name = {Path(files[0]).stem: files for files in dataset.files["train"]}
    chosen: dict[Split, list[tuple[str, str, str]]] = {split: [] for split in SPLITS}
    for frame in frames:
        chosen["valid" if frame.id in held else "train"].append(by_name[frame.id])
    for split, listed in chosen.items():
        for files in listed:
            for path in files:
                target = data / path
                target.parent.mkdir(parents=True, exist_ok=True)
                link_or_copy(source / path, target)
        for column, kind in enumerate(KINDS):
            lines = "".join(f"{files[column]}\n" for files in listed)
            write_text(data / f"{split}_{kind}.txt", lines)
    counts = Counts(train=len(chosen["train"]), valid=len(chosen["valid"]))
    card = dataclasses.replace(dataset.card, counts=counts)
    write_text(data / CARD_NAME, json.dumps(dataclasses.asdict(card), indent=1))
