"""Progress of a training run, written by its process and read by the console."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass, field
from pathlib import Path

from app.teaching.json_files import json_of
from navcore.errors import BadConfiguration, StorageFailed
from navcore.files import read_whole, write_whole
from navcore.toml_config import from_table
from web.interface.teaching import CurvePoint, TrainingPhase

PROGRESS_NAME, LOOKS_NAME = "progress.json", "looks"
MAX_BYTES = 10_000_000


@dataclass(slots=True, kw_only=True)
class RunProgress:
    """How far a run is; the file `progress.json`."""

    phase: TrainingPhase = "waiting"
    """What it does."""
    done: int = 0
    """Number of images or steps that are done in this phase."""
    of: int = 0
    """Their number in total."""
    losses: list[CurvePoint] = field(default_factory=list)
    """Least loss since the point before, by step."""
    mious: list[CurvePoint] = field(default_factory=list)
    """Mean IoU of the taught classes in the held-back frames, by step."""
    looks: int = 0
    """Number of validation images."""
    message: str = ""
    """Why it failed; empty unless it has."""


def write_progress(folder: Path, progress: RunProgress) -> None:
    """Replace the file in one go."""
    write_whole(folder / PROGRESS_NAME, json_of(progress))


def read_progress(folder: Path) -> RunProgress:
    """Read the progress of a run; one that waits where nothing is written yet."""
    path = folder / PROGRESS_NAME
    if not path.exists():
        return RunProgress()
    try:
        table = json.loads(read_whole(path, at_most=MAX_BYTES))
        for name in ("losses", "mious"):
            table[name] = [from_table(CurvePoint, point, name) for point in table[name]]
        return RunProgress(**table)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable: {error!s:.200}") from None


def note_end(folder: Path, phase: TrainingPhase, message: str = "") -> None:
    """Write how a run ended; on a full disk only its log says it."""
    with contextlib.suppress(StorageFailed, BadConfiguration):
        progress = read_progress(folder)
        progress.phase, progress.message = phase, message
        write_progress(folder, progress)
