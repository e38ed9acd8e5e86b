"""`python -m tests.reliability`: measure the promises about faults, as `make reliability` does.

Prints a table; exit code 0 only when all promises are met.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from tests.reliability.main import measure_reliability


def reliability(
    row: Annotated[
        list[int] | None, typer.Option(min=1, max=26, help="Only this row; repeat for more.")
    ] = None,
    factor: Annotated[
        float, typer.Option(min=0.01, max=1000.0, help="Multiplies the number of trials.")
    ] = 1.0,
) -> None:
    """Measure the promises about faults and print them; exit code 0 only when all are met."""
    sys.exit(measure_reliability(rows=frozenset(row or ()), factor=factor))


if __name__ == "__main__":
    typer.run(reliability)
