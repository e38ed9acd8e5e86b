"""Configuration of the behaviour beside people."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PeopleConfig:
    """How the robot behaves beside people."""

    personal_m: float = ranged(0.0, 1.0, default=0.25)
    """Room left between the body and somebody who walks …"""
    personal_per_s: float = ranged(0.0, 0.5, default=0.1)
    """… and so much more for each second that he is predicted ahead."""
    headway_s: float = ranged(0.0, 3.0, default=0.8)
    """The robot is past a place so long before somebody comes there, or it waits …"""
    waiting_s: float = ranged(0.0, 10.0, default=3.0)
    """… where nobody will come for so long."""
    settled_s: float = ranged(0.0, 60.0, default=8.0)
    """Whoever walked is expected to do so again for so long after he stopped, or was lost from
    sight."""
    passing_s: float = ranged(0.0, 10.0, default=1.5)
    """Nowhere that somebody who has only stopped can come to within this time does the robot pass
    him: it waits."""
    near_m: float = ranged(0.0, 3.0, default=1.0)
    """Nearer to somebody than this …"""
    near_mps: float = ranged(0.1, 1.0, default=0.5)
    """… no part of the body is faster than this."""
    lane_s: float = ranged(0.5, 600.0, default=6.0)
    """Who has kept the robot waiting for so long has his lane left to him, where the way beside it
    is hardly longer."""
    patience_s: float = ranged(1.0, 600.0, default=15.0)
    """After waiting for so long at one place the robot goes by where people are, no longer by where
    they may come to; the second rule above holds all the same."""
    reaction_s: float = ranged(0.1, 1.0, default=0.45)
    """From somebody's change of mind to the moment the wheels brake."""
    braking_mps2: float = ranged(0.5, 5.0, default=2.5)
    """Deceleration then; the platform's own is higher."""
    non_cooperative: bool = False
    """Whether what moves about looks out for nobody, as vehicles on a track: standing still before
    it would be no help, so the robot drives on where it will not be met and gets out of the way,
    and the rules above but for the room do not hold."""
