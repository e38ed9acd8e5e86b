"""Comparison of the benchmark of two revisions: run in turn, so that both meet the same machine.

Each revision is measured by its own benchmark, in processes of its own; the figures are those of
the printed tables, so that any two revisions with the same rows can be compared.
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from rich.table import Table

from navcore.errors import BadConfiguration

PAIRS = 6
"""Number of runs of each revision: the median of all ratios lies between the least and the largest
of six with a probability of 97 %."""
Key = tuple[int, str, str]
"""Number of the table, and the names of row and column."""
Figures = dict[Key, float]
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?(?=[ ,%]|$)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """One figure of the new revision against the same of the old one."""

    old: float
    """Median of the old revision, in the unit of the table."""
    new: float
    """Median of the new revision."""
    median: float
    """Median of new ÷ old over the pairs."""
    least: float
    """Least new ÷ old of a pair."""
    most: float
    """Largest new ÷ old of a pair."""


def comparison_table(revision: str, arguments: Sequence[str], pairs: int = PAIRS) -> Table:
    """Run `bench` with the same arguments in a revision and in the present files, in turn; return
    the table of all ratios.

    Raises `BadConfiguration` for an unknown revision, where a benchmark fails, and where the two
    have no figure in common.
    """
    here = Path(__file__).parents[2]
    with tempfile.TemporaryDirectory(prefix="bench-compare-") as folder:
        old = Path(folder)
        _extract(here, revision, old)
        for side in (old, here):
            _run(side, arguments)  # compiles the kernels
        measured = list(_pairs(old, here, arguments, pairs))
    table = Table("figure", "column", "old", "new", "new ÷ old", f"of {pairs} pairs")
    table.title = f"bench {' '.join(arguments)}: {revision} against the present files, in turn"
    found = ratios(measured)
    if not found:
        raise BadConfiguration(
            f"bench {' '.join(arguments)} prints no figure that {revision} prints, too"
        )
    for (_, row, column), ratio in found.items():
        table.add_row(
            row,
            column,
            f"{ratio.old:.3f}",
            f"{ratio.new:.3f}",
            f"{ratio.median:.2f}",
            f"{ratio.least:.2f} to {ratio.most:.2f}",
        )
    return table


def figures(printed: str) -> Figures:
    """Return the numbers in the tables of a printed benchmark: those that cells begin with, without
    their units."""
    found: Figures = {}
    number, header = 0, list[str]()
    for line in printed.splitlines():
        if line.startswith("┃"):
            number, header = number + 1, _cells(line, "┃")
        elif line.startswith("│"):
            row, *values = _cells(line, "│")
            for column, value in zip(header[1:], values, strict=False):
                if leading := _NUMBER.match(value):
                    found[number, row, column] = float(leading[0])
    return found


def ratios(pairs: Sequence[tuple[Figures, Figures]]) -> dict[Key, Ratio]:
    """Return the ratios of the figures that every run of both revisions has, unless 0."""
    common = [
        key
        for key in pairs[0][0]
        if all(key in run and run[key] > 0 for pair in pairs for run in pair)
    ]
    result = {}
    for key in common:
        each = [new[key] / old[key] for old, new in pairs]
        result[key] = Ratio(
            old=statistics.median(old[key] for old, _ in pairs),
            new=statistics.median(new[key] for _, new in pairs),
            median=statistics.median(each),
            least=min(each),
            most=max(each),
        )
    return result


def _pairs(
    old: Path, new: Path, arguments: Sequence[str], count: int
) -> Iterator[tuple[Figures, Figures]]:
    for turn in range(count):
        sides = (old, new) if turn % 2 == 0 else (new, old)
        runs = {side: figures(_run(side, arguments)) for side in sides}
        yield runs[old], runs[new]


def _cells(line: str, border: str) -> list[str]:
    return [cell.strip() for cell in line.strip(border).split(border)]


def _extract(repository: Path, revision: str, folder: Path) -> None:
    archive = subprocess.run(
        ["git", "archive", "--format=tar", revision], cwd=repository, capture_output=True
    )
    if archive.returncode:
        raise BadConfiguration(
            f"--against {revision}: expected a revision of the repository that holds the source, "
            f"git says: {archive.stderr.decode().strip()}"
        )
    with tarfile.open(fileobj=BytesIO(archive.stdout)) as files:
        files.extractall(folder, filter="data")


def _run(folder: Path, arguments: Sequence[str]) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "240"}
    run = subprocess.run(
        [sys.executable, "-m", "app", "bench", *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    if run.returncode:
        raise BadConfiguration(
            f"bench {' '.join(arguments)} failed in {folder}: {run.stderr.strip()[-500:]}"
        )
    return run.stdout
