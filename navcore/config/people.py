"""Configuration of the behaviour beside people."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PeopleConfig:
    """How the robot behaves beside people."""

    personal_m: float = ranged(0.0, 1.0, default=0.25)
    """Clearance in metres between the body and a walking person."""
    personal_per_s: float = ranged(0.0, 0.5, default=0.1)
    """Growth of this clearance in metres for each second that the person is predicted ahead."""
    headway_s: float = ranged(0.0, 3.0, default=0.8)
    """Time in seconds by which the robot must have left a position before a person reaches it;
    otherwise it waits."""
    waiting_s: float = ranged(0.0, 10.0, default=3.0)
    """Time in seconds for which no person may reach the position where the robot waits, nor the
    robot itself after a turn that takes them out of view."""
    settled_s: float = ranged(0.0, 60.0, default=8.0)
    """Time in seconds for which a person who stopped, or was lost from sight, is expected to walk
    on."""
    passing_s: float = ranged(0.0, 10.0, default=1.5)
    """The robot keeps out of the disc that a person who has only stopped can reach in this time in
    seconds: it waits."""
    near_m: float = ranged(0.0, 3.0, default=1.0)
    """Distance to a person in metres within which the speed is limited to `near_mps`, and a blocked
    robot waits for one who may walk on before it recovers (`recovery.people_s`)."""
    near_mps: float = ranged(0.1, 1.0, default=0.5)
    """Greatest speed in metres per second of any part of the body within `near_m` of a person."""
    lane_s: float = ranged(0.5, 600.0, default=6.0)
    """Time in seconds for which a person must have kept the robot waiting before the robot leaves
    the lane of that person free, where the path beside it is hardly longer."""
    patience_s: float = ranged(1.0, 600.0, default=15.0)
    """Time in seconds of waiting at one position after which the robot avoids where people are, no
    longer where they may come to; `near_m` and `near_mps` still hold."""
    cautious_s: float = ranged(0.0, 10.0, default=2.0)
    """Time in seconds of driving or turning on for which the robot is no faster than
    `cautious_mps` after it has waited for people of whom one was out of sight: they may be about to
    come into view."""
    cautious_mps: float = ranged(0.05, 1.0, default=0.2)
    """Greatest speed in metres per second of any part of the body in that time."""
    reaction_s: float = ranged(0.1, 1.0, default=0.45)
    """Time in seconds from a person's change of motion to the braking of the wheels."""
    braking_mps2: float = ranged(0.5, 5.0, default=2.5)
    """Deceleration in metres per second squared for a person; the platform's own is higher."""
    non_cooperative: bool = False
    """Whether moving obstacles avoid nothing, as vehicles on a track: stopping before them would
    not help, so the robot drives on where it will not be met and moves out of their path, and of
    the values above only the clearances apply."""
