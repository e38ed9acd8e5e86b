"""Checks of the values of a map file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration


def require(rules: Mapping[str, bool | np.bool_], where: str) -> None:
    """Raise `BadConfiguration` for the first part whose values no map has; `where` names the
    file."""
    for name, fits in rules.items():
        if not fits:
            raise BadConfiguration(
                f"{where}: {name}: has values that no map has; this file is not from this program"
            )


def within(
    values: npt.NDArray[np.integer | np.floating], low: float, high: float | npt.NDArray[np.float64]
) -> bool:
    """Return whether all values are in a range; False with NaN."""
    # Written so that NaN is outside the range.
    return bool(((values >= low) & (values <= high)).all())
