"""Networks of a running console: versions, the exchange of the one in use, and the way back."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import SLOW_MS, SLOWER, Perception
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.teaching.networks.versions import (
    COLOUR_RULES,
    MODEL_NAME,
    START,
    VersionStore,
    check_version_name,
    write_version,
)
from navcore.errors import BadConfiguration, BewareNavError, Refused, StorageFailed
from navcore.files import sync_folder
from navcore.perception.esanet.inference.network_file import SHIPPED
from web.interface.single_file import SingleFile
from web.interface.teaching import NetworkVersion

CHECK_S = 120.0
"""Time limit of the check of an uploaded file, seconds."""
NICENESS = 19
"""The lowest priority, of that check."""
MAX_HEADER_BYTES = 1 << 20
JOIN_S = 2.0
"""Longest wait for an exchange at the end, seconds. The trials of the engines take longer; they are
given up."""
log = logging.getLogger(__name__)
_DRAFT = ".weights-"
"""Beginning of the name of the folder of an upload that is being checked."""
Compose = Callable[[SegmenterChoice], Perception]
Try = Callable[[Perception], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ComposedPerception:
    """Perception of a start of the console."""

    perception: Perception
    """What segments."""
    used: str
    """Version in use."""


def composed_at_start(
    versions: VersionStore, choice: SegmenterChoice, compose: Compose
) -> ComposedPerception:
    """Compose the version that was in use last, unless other weights or the colour rules were asked
    for; that of the start, with a warning, when it cannot run any more."""
    name = (versions.used() or [START])[-1]
    if name in (START, COLOUR_RULES) or choice.weights is not None or choice.kind == "colour":
        return ComposedPerception(perception=compose(choice), used=START)
    try:
        weights = versions.weights_of(name)
        taught = dataclasses.replace(choice, kind="network", weights=weights)
        return ComposedPerception(perception=compose(taught), used=name)
    except Exception as error:
        warning = f"the network {name!r}, which was in use, cannot be used: {_said(error)}"
        log.warning("%s", warning, exc_info=not isinstance(error, BewareNavError))
    perception = compose(choice)
    perception = dataclasses.replace(perception, warning=perception.warning or warning)
    return ComposedPerception(perception=perception, used=START)


class LiveNetworks:
    """Satisfies `web.interface.teaching.Networks`."""

    def __init__(
        self,
        versions: VersionStore,
        live: LivePerception,
        *,
        choice: SegmenterChoice,
        used: str,
        compose: Compose,
        try_out: Try,
    ) -> None:
        """`choice`: options of the start. `compose` makes a perception, `try_out` runs it on a
        frame before it is used."""
        self.versions = versions
        self._live, self._choice, self._compose, self._try = live, choice, compose, try_out
        used = COLOUR_RULES if live.now.choice.kind == "colour" else used
        before = versions.used()
        self._history = versions.history_of(before if before[-1:] == [used] else [used])
        self._before: tuple[str, Perception] | None = None
        self._imported = SingleFile(
            "a network is being uploaded already; wait until that has ended"
        )
        self._exchange: str | None = None
        self._trouble: str | None = None
        self._lock, self._checking = threading.Lock(), threading.Lock()
        self._thread: threading.Thread | None = None
        self._is_closed = False

    @property
    def used(self) -> str | None:
        """Name of the version in use; None while the colour rules drive alone."""
        used = self._history[-1]
        return None if used == COLOUR_RULES else used

    @property
    def previous(self) -> str | None:
        """Name of the version that was in use before, `COLOUR_RULES` for none; None where nothing
        was."""
        history = self._history
        return history[-2] if len(history) > 1 else None

    @property
    def exchange(self) -> str | None:
        """Name of the version that is being prepared."""
        return self._exchange

    @property
    def trouble(self) -> str | None:
        """Why the last exchange did not take place."""
        return self._trouble

    def all(self) -> Sequence[NetworkVersion]:
        """Return all versions, that of the start first."""
        weights = self._choice.weights or SHIPPED
        try:
            found = weights.stat()
            start = [_version_of_start(weights, found.st_mtime_ns, found.st_size)]
        except OSError:
            start = []
        return [*start, *self.versions.all()]

    def start_of(self, name: str | None) -> tuple[str, Path]:
        """Return name and weights file of a version, by default of the one in use."""
        name = name or self.used or START
        weights = self._weights_of(name)
        if not weights.is_file():
            raise Refused("there is no network to start from; upload one")
        return name, weights

    def use(self, name: str, *, force: bool = False) -> None:
        """Prepare a version in a thread, then use it."""
        choice = self._choice_of(name)
        missed = next((one.not_found for one in self.versions.all() if one.name == name), ())
        if missed and not force:
            names = ", ".join(missed)
            raise Refused(
                f"{name!r} does not find {names} yet: mark more images, from other sides and "
                "distances, and train again"
            )
        with self._lock:
            if self._exchange is not None:
                raise Refused(f"the network {self._exchange!r} is being prepared; wait for it")
            if name == self.used:
                raise Refused(f"the network {name!r} is in use already")
            self._begin(name, choice)

    def roll_back(self) -> str:
        """Use the version that was in use before, at once where it is still in memory."""
        with self._lock:
            if self._exchange is not None:
                raise Refused(f"the network {self._exchange!r} is being prepared; wait for it")
            self._history = self.versions.history_of(self._history)
            name = self.previous
            if name is None:
                raise Refused("no other network was in use before")
            if self._before is not None and self._before[0] == name:
                self._take(self._before[1], self._history[:-1])
            elif name == COLOUR_RULES:
                choice = dataclasses.replace(self._choice, kind="colour", weights=None)
                self._begin(name, choice, back=True)
            else:
                self._begin(name, self._choice_of(name), back=True)
        return name

    def import_file(self) -> BinaryIO:
        """Return an empty file for a network that arrives."""

        def file() -> BinaryIO:
            self.versions.folder.mkdir(parents=True, exist_ok=True)
            return cast(BinaryIO, tempfile.TemporaryFile(dir=self.versions.folder))

        try:
            return self._imported.open(file)
        except OSError as error:
            raise StorageFailed(
                f"the network cannot be stored: {error.strerror or error}"
            ) from error

    def add(self, name: str, file: BinaryIO) -> NetworkVersion:
        """Check an uploaded file in a process of its own, which may read it, and store it."""
        check_version_name(name)
        with self._checking:
            with self._lock:
                self._refuse_version(name)
            try:
                return self._stored(name, file)
            except OSError as error:
                raise StorageFailed(
                    f"the network cannot be stored: {error.strerror or error}"
                ) from error

    def _stored(self, name: str, file: BinaryIO) -> NetworkVersion:
        """Store an uploaded file whole or not at all; raises `OSError`."""
        self.versions.folder.mkdir(parents=True, exist_ok=True)
        for left in self.versions.folder.glob(f"{_DRAFT}*"):  # by a console that was killed
            shutil.rmtree(left, ignore_errors=True)
        draft = Path(tempfile.mkdtemp(prefix=_DRAFT, dir=self.versions.folder))
        try:
            path = draft / MODEL_NAME
            with path.open("wb") as copy:
                shutil.copyfileobj(file, copy)
                copy.flush()
                os.fsync(copy.fileno())
            _check(path)
            version = NetworkVersion(
                name=name,
                origin="upload",
                sha256=_sha256(path),
                class_names=_names(path),
                created_unix_s=round(time.time(), 1),
            )
            write_version(draft, version)
            draft.chmod(0o755)
            with self._lock:
                self._refuse_version(name)
                draft.rename(self.versions.folder / name)
            sync_folder(self.versions.folder)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
        return version

    def delete(self, name: str) -> None:
        """Delete a version."""
        with self._lock:
            if name == START:
                raise Refused("the network of the start is no version that can be deleted")
            if name in (self.used, self._exchange):
                raise Refused(f"the network {name!r} is in use; use another one first")
            self.versions.delete(name)
            before, self._history = self._history, self.versions.history_of(self._history)
            if self._history != before:
                self.versions.note_used(self._history)

    def close(self) -> None:
        """Let no exchange take effect any more, and wait a little for one that is going on."""
        with self._lock:
            self._is_closed = True
        if self._thread is not None:
            self._thread.join(JOIN_S)

    def _refuse_version(self, name: str) -> None:
        """Raise `Refused` where no version of this name can be added."""
        if (self.versions.folder / name).exists():
            raise Refused(f"there is a version {name!r} already; take another name")
        self.versions.refuse_if_full()

    def _begin(self, name: str, choice: SegmenterChoice, *, back: bool = False) -> None:
        """Begin to prepare a version, or with `back` the one before; the lock is held."""
        thread = threading.Thread(
            target=self._prepare, args=(name, choice, back), name="exchange", daemon=True
        )
        self._exchange, self._trouble = name, None
        try:
            thread.start()
        except RuntimeError as error:
            self._exchange = None
            raise Refused(f"the network cannot be prepared: {error}") from None
        self._thread = thread

    def _prepare(self, name: str, choice: SegmenterChoice, back: bool) -> None:
        try:
            perception = self._composed(choice)
            if not back:  # the way back is to what this robot has driven with
                self._require_fast(perception)
            self._try(perception)
            with self._lock:
                self._require_open()
                before = self._history[-1], self._live.now
                self._take(perception, self._history[:-1] if back else [*self._history, name])
                self._before = None if back else before
            log.info("the network %r is in use: %s", name, perception.title)
        except Exception as error:
            self._trouble = _said(error)
            unknown = not isinstance(error, BewareNavError)
            log.warning("the network %r is not used: %s", name, error, exc_info=unknown)
        finally:
            self._exchange = None

    def _require_open(self) -> None:
        """Raise `Refused` once the console ends."""
        if self._is_closed:
            raise Refused("the console ends")

    def _composed(self, choice: SegmenterChoice) -> Perception:
        """Compose with the engine in use, measured with this network alone; with the best one, also
        in place of a named one, where that fails, or decides otherwise than torch in f32."""
        now = self._live.now.choice
        if "colour" in (now.kind, choice.kind):
            return self._compose(choice)
        try:
            return self._compose(
                dataclasses.replace(choice, engine=now.engine, smaller=now.smaller, measured=True)
            )
        except BadConfiguration as error:
            self._require_open()  # which ends the process of the trials
            log.info("%s cannot run the network: %s", now.engine, error)
            return self._compose(dataclasses.replace(choice, engine="auto", smaller=False))

    def _require_fast(self, perception: Perception) -> None:
        """Raise `BadConfiguration` for a network that is slow, and much slower than the one in use
        is now: the robot goes on beside the measurement, which makes every network slower. Where
        the one in use cannot be measured there is nothing to compare with."""
        now, image_ms = self._live.now.choice, _median_ms(perception)
        if now.kind != "network" or image_ms <= SLOW_MS:
            return
        try:
            used_ms = _median_ms(self._compose(dataclasses.replace(now, measured=True)))
        except BadConfiguration as error:
            log.warning("the network in use cannot be measured: %s", error)
            return
        if image_ms > SLOWER * used_ms:
            raise BadConfiguration(
                f"{perception.choice.engine} takes {image_ms:.0f} ms for an image with this "
                f"network, {now.engine} {used_ms:.0f} ms with the one in use: use a smaller network"
            )

    def _take(self, perception: Perception, history: Sequence[str]) -> None:
        """Use a perception from the next frame on: first on disk, so that a restart keeps it. The
        lock is held."""
        names = self.versions.history_of(history)
        self.versions.note_used(names)
        self._live.exchange(perception)
        self._history, self._before = names, None

    def _choice_of(self, name: str) -> SegmenterChoice:
        """Return the options of a version: the network or a failure, never the colour rules."""
        weights = self._choice.weights if name == START else self.versions.weights_of(name)
        return dataclasses.replace(self._choice, kind="network", weights=weights)

    def _weights_of(self, name: str) -> Path:
        return self._choice.weights or SHIPPED if name == START else self.versions.weights_of(name)


def _median_ms(perception: Perception) -> float:
    """Return the median time per image of its engine, milliseconds; of one that is remembered the
    time with which it was chosen, 0 where it was never measured."""
    times_ms = {trial.name: trial.p50_ms for trial in perception.trials}
    return times_ms.get(perception.choice.engine, perception.image_ms or 0.0)


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, BewareNavError) else f"{type(error).__name__}: {error}"


def _check(path: Path) -> None:
    """Raise `BadConfiguration` for a file that is no network."""
    lowest = ["nice", "-n", str(NICENESS)]
    command = [*lowest, sys.executable, "-m", "app", "weights", "info", str(path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=CHECK_S, check=False)
    except subprocess.TimeoutExpired:
        raise BadConfiguration("the file: could not be checked in time") from None
    except OSError as error:
        raise StorageFailed(f"the file: cannot be checked: {error}") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        said = lines[-1].replace(f"{path}: ", "") if lines else "is no network"
        raise BadConfiguration(f"the file: {said:.300}")


@functools.lru_cache(maxsize=1)
def _version_of_start(weights: Path, mtime_ns: int, size_bytes: int) -> NetworkVersion:
    """Return the network of the start; the file is read again when its time or size changes."""
    return NetworkVersion(
        name=START, origin="start", sha256=_sha256(weights), class_names=_names(weights)
    )


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _names(path: Path) -> tuple[str, ...]:
    """Return the classes of a weights file from its header, without reading the weights; empty for
    another kind of file."""
    try:
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            header = json.loads(file.read(min(length, MAX_HEADER_BYTES)))
        return tuple(map(str, json.loads(header["__metadata__"]["class_names"])))
    except (OSError, ValueError, KeyError, TypeError):
        return ()
