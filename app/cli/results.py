"""`bewarenav merge` and `bewarenav compare`: campaigns that were driven."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console as Terminal

from navcore.errors import BadConfiguration


def compare(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR…", help="Output folders of evaluated scenarios.")
    ],
) -> None:
    """Print several evaluations side by side, e.g. of the whole system and of its ablations."""
    from app.evaluation.summary import compare as side_by_side

    Terminal(width=None if sys.stdout.isatty() else 60 + 36 * len(folders)).print(
        side_by_side(folders)
    )


def merge(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR…", help="Output folders of all shards.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the whole campaign.")],
    allow: Annotated[
        list[str] | None,
        typer.Option(
            metavar="missing|repeated|versions",
            help="Accept missing episodes, episodes in several shards, or several versions of the "
            "program; may be given several times.",
        ),
    ] = None,
) -> None:
    """Join the shards of a campaign into the folder that one run would have made."""
    from app.evaluation.merge import Allowance, merge_shards

    try:
        allowed = [Allowance(one) for one in allow or []]
    except ValueError as error:
        raise BadConfiguration(f"--allow: {error}; {', '.join(Allowance)} are known") from None
    merge_shards(folders, out=out, allowed=allowed)
