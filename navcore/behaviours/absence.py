"""How long people who walk to and fro stay out of sight.

A robot that waits beside the lane of a person sees a part of it. Once the person has left that
part, they may come back at once, or not at all; the robot waits for some seconds, and sets off just
when they are back. But who walks to and fro has done so before: after an absence on a side the
robot takes it that the next one there lasts nearly as long, and after two as the shorter of them.
It crosses as soon as the person has gone, or not before they have come and gone again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from navcore.config.behaviours import AbsenceConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import Pose2
from navcore.perception.people.track import Track

_DEFAULT = AbsenceConfig()


@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """A value with its transition, one for each tick."""

    at: Pose2 | None = None
    """Pose, map frame, where the robot waited last with people who walk in view, or saw them first;
    None before that."""
    lasted: tuple[tuple[bool, float], ...] = ()
    """Whether people had left the view to the left, and for how many seconds they were out of
    sight, for each absence, oldest first."""
    is_left: bool = False
    """Whether they were seen last on the left."""
    who: frozenset[int] = frozenset()
    """Numbers of the tracks that were seen last, on that side."""
    seen_ns: int = 0
    """Stamp in nanoseconds at which they were seen last."""
    now_ns: int = 0
    """Stamp of the newest tick in nanoseconds."""
    crosses: bool = False
    """Whether the robot has set off while they are away."""

    def after(
        self,
        motion: Motion,
        people: tuple[Track, ...],
        pose: Pose2,
        stamp_ns: int,
        config: AbsenceConfig = _DEFAULT,
    ) -> Absence:
        """Return the state after one more tick; people and pose are in the map frame."""
        now = replace(self, now_ns=stamp_ns)
        is_away = self.at is not None and self.at.distance_to(pose.x_m, pose.y_m) > config.place_m
        if is_away and not self.crosses:
            now = Absence(now_ns=stamp_ns)
        waits = motion.outcome in (ControllerState.WAIT_FOR_PEOPLE, ControllerState.BACK)
        in_view = [
            person
            for person in people
            if person.walking_speed_mps > 0.0 and person.unseen_s < config.in_view_s
        ]
        if in_view:
            return now._seen(in_view, pose, stamp_ns, config, waits=waits)
        left_s = now.stays_s(config) - now.gone_s
        if waits:
            return replace(now, crosses=left_s >= config.cross_s)
        # To a robot that has set off they are on their way back from the end of that time on, and
        # not since they left: else they could be anywhere all at once, and it would stop there.
        are_followed = any(person.id in now.who for person in people)
        return replace(now, crosses=now.crosses and (left_s >= 0.0 or are_followed))

    def _seen(
        self,
        people: list[Track],
        pose: Pose2,
        stamp_ns: int,
        config: AbsenceConfig,
        *,
        waits: bool,
    ) -> Absence:
        """Return the state after a tick with people in view, of a robot that waits or not."""

        def is_left(person: Track) -> bool:
            bearing = math.atan2(person.y_m - pose.y_m, person.x_m - pose.x_m)
            return math.sin(bearing - pose.yaw_rad) > 0.0

        nearest = min(people, key=lambda person: pose.distance_to(person.x_m, person.y_m))
        side = is_left(nearest)
        gone_s, lasted = self.gone_s, self.lasted
        if self.at is not None and config.least_s <= gone_s <= config.most_s:
            lasted = (*lasted, (self.is_left, gone_s))[-config.remembered :]
        return replace(
            self,
            at=pose if waits or self.at is None else self.at,
            lasted=lasted,
            is_left=side,
            who=frozenset(person.id for person in people if is_left(person) == side),
            seen_ns=stamp_ns,
            crosses=False,
        )

    @property
    def gone_s(self) -> float:
        """Time in seconds since a person who walks was in view."""
        return (self.now_ns - self.seen_ns) / 1e9

    def stays_s(self, config: AbsenceConfig = _DEFAULT) -> float:
        """Return the time in seconds for which people who have left on that side stay away; 0
        before they have done so."""
        return config.share * min(self._lasted_there, default=0.0)

    def expects_return(self, config: AbsenceConfig = _DEFAULT) -> bool:
        """Return whether a robot that waits had better go on waiting until they are back."""
        lasted = self._lasted_there
        if self.crosses or not lasted or self.gone_s <= config.in_view_s:
            return False
        return self.gone_s < config.longest_share * max(lasted) + config.longest_besides_s

    @property
    def _lasted_there(self) -> list[float]:
        """The last two absences, in seconds, after people had left on that side."""
        return [seconds for is_left, seconds in self.lasted if is_left == self.is_left][-2:]
