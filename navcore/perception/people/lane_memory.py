"""Lanes of people who walk to and fro, and where on them one may be out of sight.

A person who walked past the camera and came back is expected again, long after the track has been
given up: about their lane a robot that has not looked knows only that they are somewhere on it. So
every position of a lane has the time from which the person may be there: at once where they were
seen last, from there on as fast as they walk, and not where the camera shows the floor. This is a
reachable set as for phantom road users at the border of the field of view, kept to where people
have been seen to walk and a little beyond: how far they go is rarely seen.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION, LaneMemoryConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.perception.people.track import Track

_DEFAULT = DEFAULT_PERCEPTION.people.lanes
_NOTE = np.dtype(
    [
        ("at", np.float64, 2),  # x and y in metres of odometry's frame
        ("walked_s", np.float64),  # when a person was last seen walking there
        ("person", np.int64),  # the person's newest track
        ("again", np.bool_),  # whether a person has walked there more than once
        ("beyond", np.bool_),  # whether no person has: it lies beyond the end of a lane
        ("possible_s", np.float64),  # from when a person may be there
    ]
)
_END_M = 1.0
"""Length in metres of the end of a lane that gives its direction."""


class LaneMemory:
    """Positions where people walked lately, in odometry's frame."""

    def __init__(self, config: LaneMemoryConfig = _DEFAULT) -> None:
        self._config = config
        self._notes = np.empty(0, dtype=_NOTE)
        self._expected = np.zeros(0, dtype=np.bool_)
        self._speed_mps = 0.0

    @property
    def positions(self) -> Points:
        """(N, 2) positions in metres, a step apart, and those beyond the ends of lanes."""
        return np.asarray(self._notes["at"])

    @property
    def hidden(self) -> Points:
        """(H, 2) positions where a person who walks to and fro may be; none while a track says
        where the person is."""
        return self.positions[self._expected]

    def follow(
        self,
        people: tuple[Track, ...],
        now_s: float,
        *,
        is_free: Callable[[Points], Bools],
        is_closed: Callable[[Points], Bools],
    ) -> None:
        """Take in the people of one more image. `is_free` and `is_closed` tell at which of (N, 2)
        positions it shows free floor, and which are known to be occupied for long."""
        self._forget(now_s)
        longest_s = self._config.extended_s
        walking = [one for one in people if one.speed_mps > 0 and one.unseen_s <= longest_s]
        grown = {one.id for one in walking if self._note(one, now_s)}
        if len(self._notes) == 0:
            self._expected = np.zeros(0, dtype=np.bool_)
            return
        lanes = self._lanes()
        for person in grown.intersection(lanes):
            self._extend(person, is_closed)
        self._expected = np.zeros(len(self._notes), dtype=np.bool_)
        if not lanes:
            return
        self._notes["possible_s"][is_free(self.positions)] = np.inf
        for person in lanes:
            lane = np.flatnonzero(self._notes["person"] == person)
            self._expected[lane] = self._expect(lane, people, now_s)

    def _lanes(self) -> list[int]:
        """Return the people who walk to and fro."""
        persons, counts = np.unique(self._notes["person"][self._notes["again"]], return_counts=True)
        return [int(one) for one in persons[counts >= self._config.min_again]]

    def _expect(self, lane: Indices, people: tuple[Track, ...], now_s: float) -> Bools:
        """Follow the time from which the person of a lane may be at each position; return (N,)
        where they may be now, nowhere while a track tells where they are."""
        positions, possible_s = self.positions[lane], self._notes["possible_s"]
        lost = [
            (now_s - one.unseen_s, *one.at(-one.unseen_s))
            for one in people
            if one.walking_speed_mps > 0
            and _apart_m(positions, np.array([one.at(-one.unseen_s)])).min() < self._config.width_m
        ]
        if lost:
            seen_s, *at = np.array(lost).T
            reached_s = seen_s + _apart_m(positions, np.column_stack(at)) / self._speed_mps
            possible_s[lane] = reached_s.min(axis=1)
            return np.zeros(len(lane), dtype=np.bool_)
        from_s = np.maximum(possible_s[lane], now_s)
        reached_s = from_s + _apart_m(positions, positions) / self._speed_mps
        possible_s[lane] = np.minimum(possible_s[lane], reached_s.min(axis=1))
        return np.asarray(possible_s[lane] <= now_s)

    def _forget(self, now_s: float) -> None:
        if len(self._notes) == 0:
            self._speed_mps = 0.0
            return
        age_s = now_s - self._notes["walked_s"]
        kept = (age_s >= 0) & (age_s < self._config.remembered_s)
        kept[: -self._config.max_positions] = False
        self._notes = self._notes[kept]

    def _note(self, one: Track, now_s: float) -> bool:
        """Note a person who walks; return whether the position is a new one."""
        config, notes, at = self._config, self._notes, (one.x_m, one.y_m)
        self._speed_mps = max(self._speed_mps, one.walking_speed_mps)
        apart_m = np.where(notes["beyond"], np.inf, np.hypot(*(notes["at"] - at).T))
        near = int(apart_m.argmin()) if len(notes) else 0
        if len(notes) == 0 or apart_m[near] >= config.spacing_m:
            new = np.array([(at, now_s, one.id, False, False, np.inf)], dtype=_NOTE)
            self._notes = np.concatenate([notes, new])
            return True
        person, walked_s = notes["person"], notes["walked_s"]
        # Between the two visits the person was elsewhere, not only standing.
        left = person[near] != one.id or walked_s[person == one.id].max() > walked_s[near]
        if left and now_s - walked_s[near] > config.again_s:
            notes["again"][near] = True
            # Out of sight in between, the same person got another number.
            person[person == person[near]] = one.id
        walked_s[near], person[near] = now_s, one.id
        return bool(left)

    def _extend(self, person: int, is_closed: Callable[[Points], Bools]) -> None:
        """Let the lane of a person go on straight beyond both ends, as far as it is not closed."""
        theirs = self._notes["person"] == person
        self._notes = self._notes[~(theirs & self._notes["beyond"])]
        lane = self._notes[self._notes["person"] == person]
        middle = lane["at"].mean(axis=0)
        _, _, axes = np.linalg.svd(lane["at"] - middle, full_matrices=False)
        along = (lane["at"] - middle) @ axes[0]
        steps = np.arange(1, round(self._config.beyond_m / self._config.spacing_m) + 1)
        for end in (lane[along.argmin()], lane[along.argmax()]):
            around = lane["at"][np.hypot(*(lane["at"] - end["at"]).T) <= _END_M]
            course = end["at"] - around.mean(axis=0)
            length_m = float(np.hypot(*course))
            if length_m == 0.0:
                continue
            added = np.repeat(end, len(steps))
            added["at"] += steps[:, None] * self._config.spacing_m * course / length_m
            added["again"], added["beyond"], added["possible_s"] = False, True, np.inf
            open_ahead = np.logical_and.accumulate(~is_closed(added["at"]))
            self._notes = np.concatenate([self._notes, added[open_ahead]])


def _apart_m(first: Points, second: Points) -> Floats:
    """(N, M) distances in metres of (N, 2) and (M, 2) positions."""
    apart: npt.NDArray[np.float64] = first[:, None] - second
    return np.hypot(apart[..., 0], apart[..., 1])
