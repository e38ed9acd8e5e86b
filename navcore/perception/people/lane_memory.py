"""Lanes of people who walk to and fro, and where on them one may be out of sight.

A person who walked past the camera and came back is expected again, long after the track has been
given up: about their lane a robot that has not looked knows only that they are somewhere on it. So
every position of a lane has the time from which the person may be there: at once where they were
seen last, from there on as fast as they walk, and not where the camera shows the floor. This is a
reachable set as for phantom road users at the border of the field of view, kept to where people
have been seen to walk.
"""

from __future__ import annotations

import numpy as np

from navcore.config.perception.perception import DEFAULT_PERCEPTION, LaneMemoryConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.perception.people.track import Track

_DEFAULT = DEFAULT_PERCEPTION.people.lanes


class LaneMemory:
    """Positions where people walked lately, in odometry's frame."""

    def __init__(self, config: LaneMemoryConfig = _DEFAULT) -> None:
        self._config = config
        self.positions: Points = np.empty((0, 2))
        """(N, 2) positions in metres, a step apart."""
        self._walked_s: Floats = np.empty(0)
        """(N,) time at which a person was last seen walking there."""
        self._ids: Indices = np.empty(0, dtype=np.int64)
        """(N,) number of the person who walked there last, that of the person's newest track."""
        self._again: Bools = np.empty(0, dtype=np.bool_)
        """(N,) whether a person has walked there more than once."""
        self._possible_s: Floats = np.empty(0)
        """(N,) time from which a person may be there."""
        self._expected = np.zeros(0, dtype=np.bool_)
        self._speed_mps = 0.0

    def follow(self, people: tuple[Track, ...], is_free: Bools, now_s: float) -> None:
        """Take in the people of one more image; `is_free` (N,): at which of the positions it shows
        free floor."""
        self._possible_s[is_free] = np.inf
        self._forget(now_s)
        longest_s = self._config.extended_s
        self._note(
            [one for one in people if one.speed_mps > 0 and one.unseen_s <= longest_s], now_s
        )
        self._expected = np.zeros(len(self.positions), dtype=np.bool_)
        for person in np.unique(self._ids[self._again]).tolist():
            lane = np.flatnonzero(self._ids == person)
            if self._again[lane].sum() >= self._config.min_again:
                self._expected[lane] = self._expect(lane, people, now_s)

    def _expect(self, lane: Indices, people: tuple[Track, ...], now_s: float) -> Bools:
        """Follow the time from which the person of a lane may be at each position; return (N,)
        where they may be now, nowhere while a track tells where they are."""
        positions, possible_s = self.positions[lane], self._possible_s[lane]
        lost = [
            (now_s - one.unseen_s, *one.at(-one.unseen_s))
            for one in people
            if one.walking_speed_mps > 0
            and np.hypot(*(positions - one.at(-one.unseen_s)).T).min() < self._config.width_m
        ]
        if lost:
            seen_s, *at = np.array(lost).T
            reached_s = seen_s + _apart_m(positions, np.column_stack(at)) / self._speed_mps
            self._possible_s[lane] = reached_s.min(axis=1)
            return np.zeros(len(lane), dtype=np.bool_)
        reached_s = np.maximum(possible_s, now_s) + _apart_m(positions, positions) / self._speed_mps
        self._possible_s[lane] = np.minimum(possible_s, reached_s.min(axis=1))
        return np.asarray(self._possible_s[lane] <= now_s)

    @property
    def hidden(self) -> Points:
        """(H, 2) positions where a person who walks to and fro may be; none while a track says
        where the person is."""
        return self.positions[self._expected]

    def _forget(self, now_s: float) -> None:
        if len(self.positions) == 0:
            self._speed_mps = 0.0
            return
        kept = (now_s - self._walked_s >= 0) & (now_s - self._walked_s < self._config.remembered_s)
        kept[: -self._config.max_positions] = False
        if not kept.all():
            self.positions, self._walked_s = self.positions[kept], self._walked_s[kept]
            self._ids, self._again = self._ids[kept], self._again[kept]
            self._possible_s = self._possible_s[kept]

    def _note(self, walking: list[Track], now_s: float) -> None:
        config = self._config
        for one in walking:
            self._speed_mps = max(self._speed_mps, one.walking_speed_mps)
            apart_m = np.hypot(*(self.positions - (one.x_m, one.y_m)).T)
            if len(apart_m) and apart_m.min() < config.spacing_m:
                near = int(apart_m.argmin())
                # Between the two visits the person was elsewhere, not only standing.
                since_s = self._walked_s[self._ids == one.id].max(initial=-np.inf)
                left = self._ids[near] != one.id or since_s > self._walked_s[near]
                if left and now_s - self._walked_s[near] > config.again_s:
                    self._again[near] = True
                    # Out of sight in between, the same person got another number.
                    self._ids[self._ids == self._ids[near]] = one.id
                self._walked_s[near], self._ids[near] = now_s, one.id
                continue
            self.positions = np.vstack([self.positions, (one.x_m, one.y_m)])
            self._walked_s = np.append(self._walked_s, now_s)
            self._ids = np.append(self._ids, one.id)
            self._again = np.append(self._again, False)
            self._possible_s = np.append(self._possible_s, np.inf)


def _apart_m(first: Points, second: Points) -> Floats:
    """(N, M) distances in metres of (N, 2) and (M, 2) positions."""
    apart = first[:, None] - second
    return np.hypot(apart[..., 0], apart[..., 1])
