"""Settings of the GNSS receiver, in world files and on the command line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged

GnssKind = Literal["none", "rtk", "plain"]
"""Receiver: none; RTK, by carrier phase with the corrections of a base station, to centimetres;
plain, by code, to metres and with an error that wanders slowly."""
UNLIMITED_S = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gnss:
    """The receiver of a world's robot."""

    kind: Literal["rtk", "plain"]
    """Kind of the receiver."""
    rate_hz: float = ranged(0.1, 20.0, default=5.0)
    """Rate of the fixes."""
    outages_s: tuple[tuple[float, float], ...] = ranged(0.0, UNLIMITED_S, default=())
    """Intervals [from, until] of simulated time without a fix."""


def carried(of_world: Gnss | None, wanted: GnssKind | None) -> Gnss | None:
    """Return the receiver that the robot carries: that of the world, or the wanted kind with the
    rate and the outages of the world."""
    if wanted is None:
        return of_world
    if wanted == "none":
        return None
    return Gnss(kind=wanted) if of_world is None else replace(of_world, kind=wanted)


def check_gnss(gnss: Gnss, where: str) -> None:
    """Raise `BadConfiguration`, which names the key, for an impossible outage."""
    for i, (begin_s, end_s) in enumerate(gnss.outages_s):
        if end_s <= begin_s:
            raise BadConfiguration(
                f"{where}.gnss.outages_s[{i}]: ends at {end_s:g} s, not after it begins at "
                f"{begin_s:g} s"
            )
