"""Networks of a console: exchanged between two frames, rolled back, and kept over a restart."""

from __future__ import annotations

import dataclasses
import io
import shutil
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import Perception, colour_perception
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.teaching.networks import live_networks
from app.teaching.networks.live_networks import Compose, LiveNetworks, composed_at_start
from app.teaching.networks.versions import (
    COLOUR_RULES,
    MODEL_NAME,
    START,
    VersionStore,
    write_version,
)
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.mission.beware_list import BewareClass, BewareList, default_beware_list
from navcore.perception.esanet.inference.selection import EngineBenchmark
from navcore.perception.labels import Labels, LabelSource, with_full_confidence
from navcore.robot.frame import Frame
from tests.app.teaching.scenes import frame_at
from web.interface.teaching import NetworkVersion

NETWORK = SegmenterChoice(kind="network")


class Constant:
    """Segmenter that calls every pixel one class."""

    def __init__(self, class_id: int) -> None:
        self._class_id = class_id

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the class everywhere."""
        return with_full_confidence(np.full(frame.depth_m.shape, self._class_id, dtype=np.uint8))

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return that the network finds its class."""
        return LabelSource.NETWORK if entry.class_id == self._class_id else LabelSource.NOTHING


def perception_of(choice: SegmenterChoice) -> Perception:
    """Return a perception whose class is the number in the name of its version; 1 at the start."""
    name = "1" if choice.weights is None else choice.weights.parent.name.split()[-1]
    if name == "13":
        raise BadConfiguration("the weights are damaged")
    return dataclasses.replace(
        colour_perception(),
        segmenter=Constant(int(name)),
        title=f"network {name}",
        choice=dataclasses.replace(choice, kind="network"),
    )


def store_of(folder: Path, *numbers: int, not_found: tuple[str, ...] = ()) -> VersionStore:
    """Return a folder with versions `taught N`."""
    for number in numbers:
        version = folder / f"taught {number}"
        version.mkdir(parents=True)
        (version / MODEL_NAME).write_bytes(b"weights")
        write_version(
            version,
            NetworkVersion(
                name=version.name,
                origin="training",
                sha256="0" * 64,
                class_names=("background", "shoe"),
                created_unix_s=float(number),
                not_found=not_found,
            ),
        )
    return VersionStore(folder)


def networks_of(
    versions: VersionStore,
    live: LivePerception,
    used: str = START,
    compose: Compose = perception_of,
    choice: SegmenterChoice = NETWORK,
) -> LiveNetworks:
    """Return the networks of a console that started with the version `used`."""
    return LiveNetworks(
        versions,
        live,
        choice=choice,
        used=used,
        compose=compose,
        try_out=lambda one: None,
    )


def eventually(holds: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def label_of(live: LivePerception) -> int:
    """Return the class that the segmenter in use gives a frame."""
    return int(live.segment(frame_at(1.0), default_beware_list()).class_ids[0, 0])


def test_a_network_is_exchanged_rolled_back_and_kept_over_a_restart(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2, 3)
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live)
    assert networks.used == START and label_of(live) == 1
    for number in (2, 3):
        networks.use(f"taught {number}")
        eventually(lambda: networks.exchange is None)
        assert (networks.used, label_of(live)) == (f"taught {number}", number)
        assert live.title == f"network {number}"
    again = composed_at_start(versions, SegmenterChoice(), perception_of)
    assert again.used == "taught 3" and again.perception.title == "network 3"
    assert networks.roll_back() == "taught 2"
    assert label_of(live) == 2  # at once: it is still in memory
    assert networks.roll_back() == START
    eventually(lambda: networks.exchange is None)
    assert (networks.used, label_of(live)) == (START, 1)
    with pytest.raises(Refused, match="no other network"):
        networks.roll_back()


def test_a_network_that_cannot_run_changes_nothing(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 13)
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live)
    networks.use("taught 13")
    eventually(lambda: networks.exchange is None)
    assert networks.trouble == "the weights are damaged"
    assert (networks.used, label_of(live)) == (START, 1)
    versions.note_used([START, "taught 13"])
    assert composed_at_start(versions, SegmenterChoice(), perception_of).used == START


@pytest.mark.parametrize("engine", ["auto", "openvino int8"])
def test_an_exchange_measures_the_engine_in_use_and_tries_the_others_where_it_is_wrong(
    tmp_path: Path, engine: str
) -> None:
    asked = []

    def compose(choice: SegmenterChoice) -> Perception:
        asked.append((choice.engine, choice.measured))
        if choice.measured:
            raise BadConfiguration("openvino int8: agrees in 50.00% of the pixels")
        return perception_of(choice)

    start = perception_of(SegmenterChoice(engine="openvino int8"))
    networks = networks_of(
        store_of(tmp_path, 2),
        LivePerception(start),
        compose=compose,
        choice=dataclasses.replace(NETWORK, engine=engine),
    )
    networks.use("taught 2")
    eventually(lambda: networks.exchange is None)
    assert (networks.used, networks.trouble) == ("taught 2", None)
    assert asked == [("openvino int8", True), ("auto", False)]


@pytest.mark.parametrize("broken", [{"openvino int8"}, {"openvino int8", "auto"}])
def test_the_way_back_to_the_shipped_network_never_ends_at_the_colour_rules(
    tmp_path: Path, broken: set[str]
) -> None:
    asked = []

    def compose(choice: SegmenterChoice) -> Perception:
        """Compose as a start does: no network is a warning alone, unless one is asked for."""
        asked.append((choice.engine, choice.measured))
        if choice.engine not in broken:
            return perception_of(choice)
        if choice.kind == "network" or choice.weights is not None:
            raise BadConfiguration(f"{choice.engine}: agrees in 50.00% of the pixels")
        return colour_perception("The network does not run")

    versions = store_of(tmp_path, 2)
    versions.note_used([START, "taught 2"])
    taught = SegmenterChoice(weights=versions.weights_of("taught 2"), engine="openvino int8")
    live = LivePerception(perception_of(taught))
    networks = networks_of(
        versions, live, used="taught 2", compose=compose, choice=SegmenterChoice(kind="auto")
    )
    assert networks.roll_back() == START
    eventually(lambda: networks.exchange is None)
    assert asked == [("openvino int8", True), ("auto", False)]
    if "auto" in broken:
        assert networks.trouble == "auto: agrees in 50.00% of the pixels"
        assert (networks.used, label_of(live)) == ("taught 2", 2)
    else:
        assert (networks.used, networks.trouble, label_of(live)) == (START, None, 1)


@pytest.mark.parametrize(
    ("used_ms", "new_ms", "refused"),
    [(60.0, 250.0, True), (130.0, 250.0, False), (20.0, 90.0, False), (None, 250.0, False)],
)
def test_a_network_much_slower_than_the_one_in_use_is_not_used(
    tmp_path: Path, used_ms: float | None, new_ms: float, refused: bool
) -> None:
    def compose(choice: SegmenterChoice) -> Perception:
        """Compose a network whose engine is measured while the robot drives."""
        p50_ms = used_ms if choice.weights is None else new_ms
        if p50_ms is None and choice.measured:
            raise BadConfiguration("the weights of the network in use are gone")
        trial = EngineBenchmark(
            name="torch f32", p50_ms=p50_ms or 0.0, agreement=1.0, is_accurate=True
        )
        made = perception_of(dataclasses.replace(choice, engine=trial.name))
        return dataclasses.replace(made, trials=(trial,) if choice.measured else ())

    live = LivePerception(compose(SegmenterChoice()))
    networks = networks_of(store_of(tmp_path, 2), live, compose=compose)
    networks.use("taught 2")
    eventually(lambda: networks.exchange is None)
    if not refused:
        assert (networks.used, networks.trouble, label_of(live)) == ("taught 2", None, 2)
        return
    assert networks.trouble is not None
    assert "torch f32 takes 250 ms for an image with this network, torch" in networks.trouble
    assert "60 ms with the one in use" in networks.trouble
    assert (networks.used, label_of(live)) == (START, 1)


def test_other_weights_and_the_colour_rules_are_not_replaced_at_a_start(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2)
    versions.note_used([START, "taught 2"])
    for choice in (SegmenterChoice(kind="colour"), SegmenterChoice(weights=Path("own 4/x"))):
        assert composed_at_start(versions, choice, perception_of).used == START


def test_a_version_in_use_stays_and_an_unknown_one_is_refused(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2, 3)
    networks = networks_of(versions, LivePerception(perception_of(SegmenterChoice())))
    networks.use("taught 2")
    eventually(lambda: networks.exchange is None)
    for name in (START, "taught 2"):
        with pytest.raises(Refused):
            networks.delete(name)
    with pytest.raises(NotKnown):
        networks.use("taught 9")
    networks.delete("taught 3")
    assert [one.name for one in versions.all()] == ["taught 2"]


def test_what_does_not_find_its_class_is_used_by_force_alone(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2, not_found=("shoe",))
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live)
    with pytest.raises(Refused, match="does not find shoe yet: mark more images"):
        networks.use("taught 2")
    assert label_of(live) == 1
    networks.use("taught 2", force=True)
    eventually(lambda: networks.exchange is None)
    assert label_of(live) == 2


def test_a_damaged_upload_is_refused_in_words(tmp_path: Path) -> None:
    networks = networks_of(VersionStore(tmp_path), LivePerception(perception_of(SegmenterChoice())))
    with pytest.raises(BadConfiguration, match="not a safetensors file"):
        networks.add("mine", io.BytesIO(b"no network"))
    with pytest.raises(BadConfiguration, match="name of a version"):
        networks.add("../mine", io.BytesIO())
    assert list(tmp_path.iterdir()) == []


def test_an_upload_on_a_full_disk_leaves_its_name_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(folder: Path, version: NetworkVersion) -> None:
        raise StorageFailed(f"{folder} cannot be written: No space left on device")

    networks = networks_of(VersionStore(tmp_path), LivePerception(perception_of(SegmenterChoice())))
    monkeypatch.setattr(live_networks, "_check", lambda path: None)
    with monkeypatch.context() as context:
        context.setattr(live_networks, "write_version", full)
        with pytest.raises(StorageFailed, match="No space left"):
            networks.add("mine", io.BytesIO(b"weights"))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / ".weights-killed").mkdir()
    assert networks.add("mine", io.BytesIO(b"weights")).name == "mine"
    assert (tmp_path / "mine" / MODEL_NAME).read_bytes() == b"weights"
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_version_that_is_gone_blocks_no_exchange(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2, 3)
    versions.note_used([START, "taught 2", "taught 3"])
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live, used="taught 3")
    shutil.rmtree(tmp_path / "taught 2")
    assert networks.roll_back() == START
    eventually(lambda: networks.exchange is None)
    assert (networks.used, versions.used()) == (START, [START])


def used_in_turn(networks: LiveNetworks, *numbers: int) -> None:
    """Use versions `taught N`, one after the other."""
    for number in numbers:
        networks.use(f"taught {number}")
        eventually(lambda: networks.exchange is None)


def test_the_way_back_over_a_deleted_version_leads_to_another_one(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2, 3)
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live)
    used_in_turn(networks, 2, 3, 2)
    networks.delete("taught 3")
    assert versions.used() == [START, "taught 2"] and networks.previous == START
    assert networks.roll_back() == START
    eventually(lambda: networks.exchange is None)
    assert (networks.used, label_of(live)) == (START, 1) and networks.previous is None


def test_what_a_crash_left_of_a_deleted_version_in_the_history_blocks_no_way_back(
    tmp_path: Path,
) -> None:
    versions = store_of(tmp_path, 2, 3)
    versions.note_used([START, "taught 2", "taught 9", "taught 2", "taught 3"])
    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live, used="taught 3")
    for name in ("taught 2", START):
        assert networks.previous == name == networks.roll_back()
        eventually(lambda: networks.exchange is None)
        assert networks.used == name


def test_a_version_that_is_deleted_while_another_one_is_prepared_is_gone_from_the_history(
    tmp_path: Path,
) -> None:
    versions, composing, deleted = store_of(tmp_path, 2, 3, 4), threading.Event(), threading.Event()
    versions.note_used(["taught 2", "taught 3", "taught 4"])

    def slowly(choice: SegmenterChoice) -> Perception:
        composing.set()
        assert deleted.wait(10)
        return perception_of(choice)

    live = LivePerception(perception_of(SegmenterChoice()))
    networks = networks_of(versions, live, used="taught 4", compose=slowly)
    assert networks.roll_back() == "taught 3"
    assert composing.wait(10)
    networks.delete("taught 2")
    with pytest.raises(Refused, match="in use"):
        networks.delete("taught 3")
    deleted.set()
    eventually(lambda: networks.exchange is None)
    assert (networks.used, networks.previous, versions.used()) == ("taught 3", None, ["taught 3"])


@pytest.mark.parametrize("is_restarted", [False, True])
def test_the_way_back_leads_to_the_colour_rules_where_they_drove(
    tmp_path: Path, is_restarted: bool
) -> None:
    versions, live = store_of(tmp_path, 2), LivePerception(colour_perception())

    def compose(choice: SegmenterChoice) -> Perception:
        return colour_perception() if choice.kind == "colour" else perception_of(choice)

    networks = networks_of(versions, live, compose=compose)
    assert networks.used is None and networks.previous is None
    for name in (START, "taught 2"):
        networks.use(name)
        eventually(lambda: networks.exchange is None)
    assert versions.used() == [COLOUR_RULES, START, "taught 2"]
    if is_restarted:
        networks = networks_of(versions, live, used="taught 2", compose=compose)
    for name, title in ((START, "network 1"), (COLOUR_RULES, "colour rules")):
        assert networks.roll_back() == name
        eventually(lambda: networks.exchange is None)
        assert (live.title, versions.used()[-1]) == (title, name)
    assert networks.used is None and networks.previous is None
    with pytest.raises(NotKnown):
        networks.use(COLOUR_RULES)
    with pytest.raises(BadConfiguration, match="name of a version"):
        networks.add(COLOUR_RULES, io.BytesIO())


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (BadConfiguration("the weights are damaged"), "the weights are damaged"),
        (OSError(5, "Input/output error"), "OSError: [Errno 5] Input/output error"),
        (RuntimeError("no engine"), "RuntimeError: no engine"),
    ],
)
def test_a_start_without_the_network_that_was_in_use_says_so(
    tmp_path: Path, failure: Exception, said: str
) -> None:
    versions = store_of(tmp_path, 2)
    versions.note_used([START, "taught 2"])

    def compose(choice: SegmenterChoice) -> Perception:
        if choice.weights is not None:
            raise failure
        return perception_of(choice)

    started = composed_at_start(versions, SegmenterChoice(), compose)
    expected = f"the network 'taught 2', which was in use, cannot be used: {said}"
    assert (started.used, started.perception.warning) == (START, expected)
    assert started.perception.title == "network 1"


def test_one_network_is_uploaded_at_a_time(tmp_path: Path) -> None:
    networks = networks_of(VersionStore(tmp_path), LivePerception(perception_of(SegmenterChoice())))
    with networks.import_file(), pytest.raises(Refused, match="uploaded already"):
        networks.import_file()
    networks.import_file().close()


def test_an_upload_is_checked_at_the_lowest_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\nnice >&2\nexit 1\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    with pytest.raises(BadConfiguration, match="the file: 19"):
        live_networks._check(tmp_path / MODEL_NAME)


def test_the_network_of_the_start_is_read_again_only_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights, hashed = tmp_path / "own.safetensors", list[Path]()
    weights.write_bytes(b"weights")
    sha256 = live_networks._sha256

    def noted(path: Path) -> str:
        hashed.append(path)
        return sha256(path)

    monkeypatch.setattr(live_networks, "_sha256", noted)
    networks = networks_of(
        VersionStore(tmp_path / "versions"),
        LivePerception(perception_of(SegmenterChoice())),
        choice=dataclasses.replace(NETWORK, weights=weights),
    )
    first, again = (networks.all()[0].sha256 for _ in range(2))
    assert first == again and hashed == [weights]
    weights.write_bytes(b"other weights")
    assert networks.all()[0].sha256 != first
    weights.unlink()
    assert networks.all() == []


def test_a_version_with_the_number_of_a_year_is_none_of_the_trainings(tmp_path: Path) -> None:
    versions = store_of(tmp_path, 2)
    (tmp_path / "2025").mkdir()
    assert versions.new_name() == "taught 3"


def test_an_upload_that_is_checked_holds_no_exchange_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    networks = networks_of(store_of(tmp_path, 2), LivePerception(perception_of(SegmenterChoice())))
    checking, ended = threading.Event(), threading.Event()

    def check(path: Path) -> None:
        checking.set()
        ended.wait(10)

    monkeypatch.setattr(live_networks, "_check", check)
    upload = threading.Thread(target=networks.add, args=("mine", io.BytesIO(b"weights")))
    upload.start()
    assert checking.wait(10)
    networks.use("taught 2")
    eventually(lambda: networks.used == "taught 2")
    assert upload.is_alive()
    ended.set()
    upload.join(10)
    assert [one.name for one in networks.versions.all()] == ["taught 2", "mine"]


def test_an_exchange_takes_no_effect_once_the_console_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_networks, "JOIN_S", 0.0)
    versions, go = store_of(tmp_path, 2), threading.Event()
    live = LivePerception(perception_of(SegmenterChoice()))

    def compose(choice: SegmenterChoice) -> Perception:
        go.wait(30)
        return perception_of(choice)

    networks = networks_of(versions, live, compose=compose)
    networks.use("taught 2")
    networks.close()
    go.set()
    eventually(lambda: networks.exchange is None)
    assert (networks.used, label_of(live), versions.used()) == (START, 1, [])
