"""Training runs: what they refuse, what they keep, cancelling and resuming."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

import navcore.files
from app.teaching.__main__ import CANCELLED, DONE
from app.teaching.frames.frame_archive import add_archive, exported
from app.teaching.frames.frame_record import TrainingSplit
from app.teaching.frames.frame_store import FrameStore
from app.teaching.networks import versions
from app.teaching.networks.versions import MODEL_NAME, VersionStore, write_version
from app.teaching.training import plan, progress, run
from app.teaching.training.live_trainings import LiveTrainings
from app.teaching.training.lock import holder_of
from app.teaching.training.plan import (
    DATA_NAME,
    PLAN_NAME,
    TrainingPlan,
    held_back,
    prepare,
    read_plan,
)
from app.teaching.training.progress import LOOKS_NAME, PROGRESS_NAME, read_progress
from app.teaching.training.run import STATE_NAME, Cancelled, TeachingRun
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.learning.data.card import SPLITS
from navcore.learning.data.dataset import load_dataset
from navcore.learning.data.images import LabelArray
from navcore.learning.teaching.class_teaching import ClassTeacher
from navcore.learning.teaching.taught_rows import Encoded
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.perception.esanet import build
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights.weights_file import WeightsCard, load, save
from tests.app.teaching.scenes import frame_at
from tests.app.teaching.test_frame_store import block_of
from web.interface.teaching import CapturedFrame, NetworkVersion, TrainingOrder, TrainingRun

CLASSES = ("background", "cup")
SIZE = Size(height=64, width=96)
RECIPE = TeachingRecipe(rehearsal=0, rendered_test=0)
KEPT = ["looks", "model.safetensors", "plan.json", "progress.json", "version.json"]
"""What a finished run leaves in its folder."""


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Compute with one thread, as the process of a run does."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def small_network(path: Path, *, units_per_m: float = 1000.0, size: Size | None = SIZE) -> Path:
    """Write a small network with random weights, the same for any unit of its depth, and return
    its file."""
    torch.manual_seed(0)
    card = WeightsCard(
        variant="r18-nbt1d",
        num_classes=len(CLASSES),
        width=0.125,
        class_names=CLASSES,
        depth=DepthStatistics(
            mean=2.0 * units_per_m, std=1.0 * units_per_m, units_per_m=units_per_m
        ),
        source_sha256="0" * 64,
        size=size,
    )
    save(build("r18-nbt1d", len(CLASSES), width=0.125).eval(), card, path, half=True)
    return path


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small network with random weights."""
    return small_network(tmp_path_factory.mktemp("start") / "start.safetensors")


@pytest.fixture
def frames(tmp_path: Path) -> FrameStore:
    """Four frames in which a shoe is annotated."""
    store = FrameStore(tmp_path / "frames")
    for x_m, brightness in ((1.0, 120), (2.0, 90), (3.0, 60), (4.0, 30)):
        stored = store.add_frame(frame_at(x_m, brightness=brightness), "operator")
        assert stored is not None
        store.annotate(stored.id, block_of("shoe"))
    return store


def planned(folder: Path, frames: FrameStore, start: Path, *, steps: int = 60) -> Path:
    """Prepare a run and return its folder."""
    wanted = TrainingPlan(
        name=folder.name,
        start_name="start",
        start_path=str(start),
        class_names=(),
        created_unix_s=0.0,
        threads=1,
        recipe=dataclasses.replace(RECIPE, steps=steps),
    )
    prepare(folder, frames, wanted)
    return folder


def test_a_taught_class_leaves_the_weights_of_all_others_as_they_are(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    folder = planned(tmp_path / "taught 1", frames, start)
    version = TeachingRun(folder).run()
    assert VersionStore(tmp_path).all() == [version]
    assert version.class_names == (*CLASSES, "shoe") and version.taught == ("shoe",)
    assert [one.images for one in version.figures] == ["rendered", "rendered", "captured"]
    assert version.figures[2].old is None and version.figures[2].pixels > 0
    assert version.figures[2].new is not None and version.figures[2].new > 0.8
    assert version.not_found == () and sorted(path.name for path in folder.iterdir()) == KEPT
    old, new = (load(path).network.state_dict() for path in (start, folder / MODEL_NAME))
    for key, tensor in new.items():
        kept = tensor[: len(CLASSES)] if tensor.shape != old[key].shape else tensor
        assert torch.equal(kept, old[key]), key


def test_a_start_whose_depth_is_in_another_unit_learns_the_same(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    other = small_network(tmp_path / "eighths.safetensors", units_per_m=8000.0)
    folders = [
        planned(tmp_path / f"taught {number}", frames, path, steps=5)
        for number, path in enumerate((start, other))
    ]
    made = [TeachingRun(folder).run() for folder in folders]
    one, eighths = (load(folder / MODEL_NAME) for folder in folders)
    assert eighths.card.depth.units_per_m == 8000.0
    learned, expected = (of.network.state_dict() for of in (eighths, one))
    assert all(torch.equal(learned[key], expected[key]) for key in expected)
    assert made[0].figures == made[1].figures and made[0].kept_share == made[1].kept_share


def test_a_resumed_run_ends_as_an_uninterrupted_one(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    whole, halved = (planned(tmp_path / name, frames, start) for name in ("a", "b"))
    TeachingRun(whole).run()
    half = TeachingRun(halved)
    half._is_cancelled = lambda: bool(half.progress.losses)  # after the first validation
    with pytest.raises(Cancelled):
        half.run()
    assert not (halved / MODEL_NAME).exists()
    TeachingRun(halved).run()
    one, other = (load(folder / MODEL_NAME).network.state_dict() for folder in (whole, halved))
    assert all(torch.equal(one[key], other[key]) for key in one)


def test_a_run_keeps_the_network_that_it_starts_from(tmp_path: Path, frames: FrameStore) -> None:
    gone = small_network(tmp_path / "gone.safetensors")
    folder = planned(tmp_path / "taught 1", frames, gone, steps=5)
    with pytest.raises(Cancelled):
        TeachingRun(folder, lambda: True).run()
    gone.unlink()
    assert TeachingRun(folder).run().taught == ("shoe",)


def test_a_start_without_a_working_size_is_taught_at_that_of_the_camera(
    tmp_path: Path, frames: FrameStore
) -> None:
    start = small_network(tmp_path / "any.safetensors", size=None)
    folder = planned(tmp_path / "taught 1", frames, start, steps=5)
    TeachingRun(folder).run()
    assert load(folder / MODEL_NAME).card.size == Size(height=64, width=96)


def test_a_training_that_does_not_fit_into_memory_is_refused_before_it_begins(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free_bytes = run.available_bytes()
    assert free_bytes is not None and free_bytes > 0
    folder = planned(tmp_path / "taught 1", frames, start)
    monkeypatch.setattr(run, "available_bytes", lambda: 100_000_000)
    with pytest.raises(
        BadConfiguration, match=r"4 images take 0\.5 GB of memory, 0\.1 GB are free"
    ):
        TeachingRun(folder).run()
    assert TeachingRun(folder).progress.phase == "waiting"


def test_the_curve_of_the_iou_judges_what_is_taught(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never_a_shoe(teacher: ClassTeacher, image: Encoded) -> LabelArray:
        """Return what the old network finds, which it is right in."""
        return np.where((image.labels > 0) & (image.labels < 3), image.labels - 1, 0).astype(
            np.uint8
        )

    monkeypatch.setattr(ClassTeacher, "predicted", never_a_shoe)
    training = TeachingRun(planned(tmp_path / "taught 1", frames, start, steps=5))
    training.run()
    assert {point.value for point in training.progress.mious} == {0.0}


def test_the_number_of_images_of_a_phase_is_the_same_from_its_beginning(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[str, int]] = []
    monkeypatch.setattr(run, "WRITE_EVERY_S", 0.0)
    monkeypatch.setattr(
        run, "write_progress", lambda _, progress: told.append((progress.phase, progress.of))
    )
    TeachingRun(planned(tmp_path / "taught 1", frames, start, steps=5)).run()
    assert {of for phase, of in told if phase == "comparing"} == {1}


def test_a_disk_that_is_full_at_the_end_spoils_no_training(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trainings = trainings_of(tmp_path, frames, start)
    folder = planned(tmp_path / "versions" / "taught 1", frames, start, steps=5)

    def write_last(folder: Path, version: NetworkVersion) -> None:
        write_version(folder, version)
        refuse_writes(monkeypatch, progress, PROGRESS_NAME)

    monkeypatch.setattr(run, "write_version", write_last)
    TeachingRun(folder).run()
    assert read_progress(folder).phase == "comparing"
    assert (newest(trainings).phase, newest(trainings).message) == ("done", "")


def test_the_plan_of_an_earlier_release_is_still_read(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    folder = planned(tmp_path / "taught 1", frames, start)
    path = folder / PLAN_NAME
    table = json.loads(path.read_text(encoding="utf-8"))
    recipe = table["recipe"] | {"learning_rate": 0.005, "crop": 192, "pull": 0.25, "sure": 0.75}
    del recipe["l2_penalty"], recipe["confidence_threshold"]
    path.write_text(json.dumps(table | {"recipe": recipe}), encoding="utf-8")
    read = read_plan(folder).recipe
    assert read == dataclasses.replace(RECIPE, l2_penalty=0.25, confidence_threshold=0.75)


def shown(number: int, *names: str) -> CapturedFrame:
    """Return a frame that shows classes."""
    return CapturedFrame(
        id=str(number),
        source="operator",
        width=8,
        height=8,
        annotated=True,
        class_names=names,
        version=0,
    )


def splits_of(frames: Sequence[CapturedFrame], held: set[str]) -> dict[str, TrainingSplit]:
    """Return the splits that a training leaves."""
    return {one.id: "valid" if one.id in held else "train" for one in frames}


def test_a_frame_that_was_trained_on_is_never_held_back_nor_the_other_way_round() -> None:
    frames = [shown(i, "shoe") for i in range(16)]
    held = held_back(frames)
    assert len(held) == 4
    before = splits_of(frames, held)
    left = [one for one in frames if one.id not in ("0", "2", "5")]
    assert held_back(left, before) == held - {"5"}
    more = held_back([*left, *(shown(i, "shoe") for i in range(20, 31))], before)
    assert held - {"5"} <= more and len(more) == 6
    assert not any(before.get(one) == "train" for one in more)


def test_frames_that_show_the_same_are_of_one_split() -> None:
    frames = [shown(i, "shoe") for i in range(8)]
    assert held_back(frames) == {"1", "5"}
    assert held_back(frames, near_duplicates=[{"1", "4"}]) == {"1", "4"}
    assert held_back(frames, near_duplicates=[{"0", "1", "gone"}, {"5", "7"}]) == {"0", "1"}


def test_a_group_larger_than_a_quarter_is_trained_on_or_divided() -> None:
    frames = [shown(i, "shoe") for i in range(20)]
    large = {str(i) for i in range(15)}
    assert held_back(frames, near_duplicates=[large]) == {str(i) for i in range(15, 20)}
    everything = {one.id for one in frames}
    assert held_back(frames, near_duplicates=[everything]) == {"1", "5", "9", "13", "17"}


def test_what_shows_the_same_as_a_frame_of_a_training_has_its_split() -> None:
    frames = [shown(i, "shoe") for i in range(8)]
    before: dict[str, TrainingSplit] = {"0": "train", "2": "valid"}
    assert held_back(frames, before, [{"0", "1"}]) == {"2", "4"}
    assert held_back(frames, before, [{"1", "2"}]) == {"1", "2"}
    assert "1" not in held_back(frames, before, [{"0", "1", "2"}])


def test_an_import_never_trains_on_what_was_held_back(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    planned(tmp_path / "taught 1", frames, start)
    other = FrameStore(tmp_path / "other")
    with exported(frames) as archive:
        assert add_archive(other, archive) == 4
    other.delete("000001")  # of those that are left another one would be held back
    planned(tmp_path / "taught 2", other, start)
    assert [name for name, split in other.splits().items() if split == "valid"] == ["000002"]


def test_a_second_import_of_an_image_does_not_move_it_into_the_other_split(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    with exported(frames) as before_the_training:
        planned(tmp_path / "taught 1", frames, start)
        assert add_archive(frames, before_the_training) == 4
    assert len(frames.all()) == 8 and len(frames.splits()) == 4
    planned(tmp_path / "taught 2", frames, start)
    assert list(frames.splits().values()) == 2 * ["train", "valid", "train", "train"]


def test_what_was_held_back_and_shows_the_same_as_a_trained_frame_is_in_no_run(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    with exported(frames) as before_the_training:
        planned(tmp_path / "taught 1", frames, start)
        add_archive(frames, before_the_training)
    frames.note_splits({"000006": "train"})  # as another console had it
    groups = frames.near_duplicates()
    assert {"000002", "000006"} in groups
    planned(tmp_path / "taught 2", frames, start)
    data = load_dataset(tmp_path / "taught 2" / DATA_NAME)
    used = {split: {Path(one[0]).stem for one in data.files[split]} for split in SPLITS}
    assert used["valid"]
    assert not any(group & used["train"] and group & used["valid"] for group in groups)
    assert "000002" not in used["train"] | used["valid"]
    assert frames.splits()["000002"] == "valid"


def test_of_a_class_that_was_only_trained_on_one_frame_is_held_back() -> None:
    frames = [shown(i, "shoe") for i in range(5)]
    held = held_back(frames)
    left = [one for one in frames if one.id not in held]
    assert len(held_back(left, splits_of(frames, held))) == 1


def test_of_every_class_a_quarter_is_held_back() -> None:
    both, cups = (
        [shown(i, "shoe", "cup") for i in range(4)],
        [shown(i, "cup") for i in range(4, 40)],
    )
    held = held_back([*both, *cups])
    assert len(held) == 10 and len(held & {one.id for one in both}) == 1


def test_a_run_keeps_the_split_of_its_frames(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    planned(tmp_path / "taught 1", frames, start)
    expected = {"000001": "train", "000002": "valid", "000003": "train", "000004": "train"}
    assert frames.splits() == FrameStore(frames.folder).splits() == expected
    frames.delete("000001")
    planned(tmp_path / "taught 2", frames, start)
    assert frames.splits()["000002"] == "valid"


def test_too_few_frames_and_a_class_without_pixels_are_refused(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    assert held_back([shown(i, "shoe") for i in range(6)]) == {"1", "5"}
    with pytest.raises(Refused, match="nothing is annotated"):
        held_back([shown(1, "background")])
    with pytest.raises(Refused, match="bag: 2 annotated frames"):
        held_back([*(shown(i, "shoe") for i in range(3)), shown(8, "bag"), shown(9, "bag")])
    trainings = trainings_of(tmp_path, frames, start)
    with pytest.raises(Refused, match="no pixel"):
        trainings.start(TrainingOrder(class_names=("bag",)))
    assert trainings.newest() is None


def trainings_of(tmp_path: Path, frames: FrameStore, start: Path) -> LiveTrainings:
    """Return the training runs of a console."""
    return LiveTrainings(
        VersionStore(tmp_path / "versions"), frames, lambda name: (name or "start", start)
    )


def eventually(holds: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + 200
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_class_is_asked_for_whatever_its_case_and_a_failing_start_is_told(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise OSError(12, "Cannot allocate memory")

    trainings = trainings_of(tmp_path, frames, start)
    monkeypatch.setattr(subprocess, "Popen", broken)
    with pytest.raises(StorageFailed, match="cannot be started: Cannot allocate memory"):
        trainings.start(TrainingOrder(class_names=("Shoe",)))
    assert newest(trainings).class_names == ("shoe",)


def test_a_validation_image_that_is_missing_or_cannot_be_read_is_told(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    trainings = trainings_of(tmp_path, frames, start)
    with pytest.raises(NotKnown):
        trainings.look(0)
    folder = planned(tmp_path / "versions" / "taught 1", frames, start)
    with pytest.raises(NotKnown):
        trainings.look(0)
    (folder / LOOKS_NAME / "0.png").mkdir(parents=True)
    with pytest.raises(StorageFailed, match="Is a directory"):
        trainings.look(0)


@pytest.mark.long
def test_the_process_of_a_run_gives_way_to_the_robot_and_is_cancelled_and_resumed(
    tmp_path: Path, frames: FrameStore, start: Path
) -> None:
    trainings = trainings_of(tmp_path, frames, start)
    folder = tmp_path / "versions" / trainings.start(TrainingOrder(rehearsal=0)).name
    eventually(lambda: (folder / LOOKS_NAME).exists())
    with pytest.raises(Refused, match="is running"):
        trainings.start(TrainingOrder())
    pid, process = holder_of(folder), trainings._process
    assert pid is not None and os.getpriority(os.PRIO_PROCESS, pid) == 19
    assert Path(f"/proc/{pid}/oom_score_adj").read_text(encoding="ascii") == "1000\n"
    again = trainings_of(tmp_path, frames, start)  # as after a restart of the console
    assert again.cancel().phase == "cancelled" and not newest(again).running
    assert process is not None and process.wait(10) == CANCELLED
    assert not (folder / MODEL_NAME).exists()
    again.resume()
    eventually(lambda: not newest(again).running)
    assert again._process is not None and again._process.wait(10) == DONE
    assert newest(again).phase == "done" and newest(again).looks == 1
    assert np.isfinite([point.value for point in newest(again).losses]).all()
    with pytest.raises(Refused, match="no training to resume"):
        again.resume()


def newest(trainings: LiveTrainings) -> TrainingRun:
    """Return the newest run."""
    shown = trainings.newest()
    assert shown is not None
    return shown


def refuse_writes(monkeypatch: pytest.MonkeyPatch, module: ModuleType, name: str) -> None:
    """Let a module write no file of a name any more, as on a full disk."""
    whole = navcore.files.write_whole

    def full(path: Path, data: bytes) -> None:
        if path.name == name:
            raise StorageFailed(f"{path} cannot be written: No space left on device")
        whole(path, data)

    monkeypatch.setattr(module, "write_whole", full)


def test_on_a_full_disk_no_half_of_a_run_is_left(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_writes(monkeypatch, plan, PLAN_NAME)
    trainings = trainings_of(tmp_path, frames, start)
    with pytest.raises(StorageFailed, match="No space left"):
        trainings.start(TrainingOrder())
    assert trainings.newest() is None and not list((tmp_path / "versions").glob("*"))
    assert all(frame.annotated for frame in frames.all())


def test_a_disk_that_fills_up_ends_a_training_in_words_and_it_can_be_resumed(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = planned(tmp_path / "taught 1", frames, start)
    with monkeypatch.context() as full:
        refuse_writes(full, run, STATE_NAME)
        with pytest.raises(StorageFailed, match="No space left"):
            TeachingRun(folder).run()
    assert not (folder / MODEL_NAME).exists()
    assert TeachingRun(folder).run().taught == ("shoe",)


def test_a_new_training_removes_those_that_nothing_came_of(
    tmp_path: Path, frames: FrameStore, start: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trainings = trainings_of(tmp_path, frames, start)
    monkeypatch.setattr(trainings, "_launch", lambda folder: None)
    for _ in range(3):
        trainings.start(TrainingOrder())
    assert [path.name for path in (tmp_path / "versions").iterdir()] == ["taught 3"]
    monkeypatch.setattr(versions, "MAX_VERSIONS", 0)
    with pytest.raises(Refused, match="delete one first"):
        trainings.start(TrainingOrder())
    assert [path.name for path in (tmp_path / "versions").iterdir()] == ["taught 3"]
