"""Timer of how long the safety gate has kept the robot from its motion, before a zone, an object of
the beware list or an obstacle: after that the recovery tries another motion.

A value with its transition, one for each command.
"""

from __future__ import annotations

from dataclasses import dataclass

from navcore.config.safety import DEFAULT_SAFETY
from navcore.safety.gate import Cause, GateDecision

HELD_NS = 1_000_000_000
"""Time for which the gate has to keep the robot from its motion, before a zone or an object of the
beware list, until the recovery tries another, nanoseconds."""
CONTACT_HELD_NS = HELD_NS + round(DEFAULT_SAFETY.collision.memory_s * 1e9)
"""The same before an obstacle, which the gate remembers for a while where nothing is any more."""
_HOLDING = {Cause.BEWARE_AHEAD, Cause.CONTACT_IMMINENT}
"""Reasons for which the gate keeps the robot from a motion, and may let it make another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldTimer:
    """Stamps of frames since which the robot is held, in nanoseconds; as it is made, of a robot
    that is not."""

    by_rules_ns: int | None = None
    """Since when zones and the beware list are all that keeps it; None when they are not."""
    by_anything_ns: int | None = None
    """Since when they and obstacles are; None when they are not."""

    def after(self, verdict: GateDecision, stamp_ns: int | None) -> HeldTimer:
        """Return the timer after a command; `stamp_ns`: stamp of the newest frame, if there is
        one."""
        causes = {reason.cause for reason in verdict.reasons}
        if stamp_ns is None or not causes or causes - _HOLDING:
            return HeldTimer()
        by_rules = stamp_ns if self.by_rules_ns is None else self.by_rules_ns
        return HeldTimer(
            by_rules_ns=None if Cause.CONTACT_IMMINENT in causes else by_rules,
            by_anything_ns=stamp_ns if self.by_anything_ns is None else self.by_anything_ns,
        )

    def is_over(self, stamp_ns: int) -> bool:
        """Return whether the robot has been held for so long by a frame that it has to try another
        motion."""
        since = (self.by_rules_ns, HELD_NS), (self.by_anything_ns, CONTACT_HELD_NS)
        return any(began is not None and stamp_ns - began >= lasts for began, lasts in since)
