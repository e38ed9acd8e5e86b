"""The pages with results, and what their tables are made of.

A file of `results/` is the `summary.json` of a campaign, named after its world or suite
(`kinds.file_name`), or the `replay.json` of a recording with annotated objects, named after its
folder.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from app.evaluation.suites import Suite
from app.evaluation.tables.driving import CROSSINGS, DOORS, MISSIONS, RANDOM, SHORT, world
from app.evaluation.tables.localisation import SEARCHES, TRACKING
from app.evaluation.tables.perception import (
    LIGHT,
    PRINTS,
    REAL_THINGS,
    RECORDINGS,
    TEACHING,
    WALKS,
)
from app.evaluation.tables.table import Result, Row, Table, single
from navcore.errors import BadConfiguration

ROOT = Path(__file__).parents[3]
RESULTS = Path(__file__).parents[1] / "results"
BEGIN, END = "<!-- results -->\n", "<!-- /results -->\n"
"""Lines of a page between which its table stands."""
HASH = re.compile(r"([0-9a-f]{12})[0-9a-f]{52}")
"""A SHA-256, of which a table shows the beginning."""


def _origin_row(result: Result) -> Row:
    return (
        world(result) + (", localisation" if result["suite"] == Suite.LOCALISATION else ""),
        *(result.get(key, "–") for key in ("latency", "people", "odometry", "gnss")),
        HASH.sub(r"\1…", result["segmenter"]),
        "; ".join(result["versions"]),
        "; ".join(result["machines"]),
        f"`{result['command']}`",
    )


ORIGINS = Table(
    shows=lambda _: True,
    columns=(
        *("world", "latency", "people", "odometry", "GNSS"),
        *("segmenter", "version", "machine", "command"),
    ),
    rows=single(_origin_row),
    always=True,
)
FULL = (
    *(RANDOM, MISSIONS, WALKS, LIGHT, RECORDINGS, REAL_THINGS, PRINTS, DOORS, CROSSINGS),
    *(TEACHING, TRACKING, SEARCHES, ORIGINS),
)
"""The tables of the page about evaluation, in their order."""


def kept_results(folder: Path = RESULTS) -> list[Result]:
    """Return the kept summaries in the order of their worlds' names."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def full_table(results: Sequence[Result]) -> str:
    """Return the tables of the page about evaluation: figures, failures and origin."""
    return "\n".join(filter(None, (table.of(results) for table in FULL)))


PAGES: Mapping[str, Callable[[Sequence[Result]], str]] = {
    "README.md": SHORT.of,
    "app/evaluation/README.md": full_table,
}
"""Pages with results, and what makes their tables."""


def with_table(page: str, table: str) -> str:
    """Return a page with the table between its two lines; raises `BadConfiguration` without
    them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise BadConfiguration(f"the page has no lines {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}{table}{END}{after}"


def rewrite() -> None:
    """Rewrite the tables of all pages."""
    results = kept_results()
    for name, table_of in PAGES.items():
        path = ROOT / name
        page = path.read_text(encoding="utf-8")
        path.write_text(with_table(page, table_of(results)), encoding="utf-8")
