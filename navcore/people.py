"""People who walk, and people whom the segmenter recognises: followed from frame to frame at constant velocity.

Whoever moves is no part of the map: his points are taken off it (`PeopleTracker.trail`) where he is and where he was while
nobody knew yet that he walks. Whoever stands still for a while is an obstacle like any other, and stays a person.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from navcore.beware import BewareList
from navcore.frame import Frame
from navcore.grid import GridSpec
from navcore.segment import Labels
from navcore.sightings import CELL_M, Cells, Cluster, Ground, looks_at

PERSON = "person"
"""What the beware list calls people."""
RADIUS_M = 0.3
"""Of the disc that somebody takes up, feet and arms included."""
ACCEL_MPS2 = 3.0
"""How suddenly people change their pace, standard deviation."""
GATE_M = 0.45
"""A cluster this near to where somebody should be is he."""
WALKS_MPS, STANDS_MPS = 0.3, 0.15
"""Faster than this he walks, slower than that he stands."""
MOVED_M = 0.25
"""He must have come this far from where he was first seen."""
FRESH = 0.5
"""And this much of him must be where floor was seen."""
STANDS_S = 1.0
"""Who has stood for so long is an obstacle."""
UNSEEN_S, ELSEWHERE_S, STAYS_S = 1.0, 4.0, 20.0
"""He is forgotten after this where the camera looks and does not see him, and where it does not look if he walked or stood."""
WIDER_PER_S, WIDEST_M = 0.1, 0.3
"""Out of sight he takes up so much more room, for nobody knows."""
GONE_S = 0.25
"""And after this where the camera sees the floor under his feet."""
LONGEST_GAP_S = 2.0
"""After a longer gap between two pictures, or when time runs backwards, nobody is where he was."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A person, as of the newest frame."""

    id: int
    """Stays with him while he is followed."""
    x_m: float
    """Middle of his body, map frame."""
    y_m: float
    """The same."""
    vx_mps: float
    """His velocity, map frame; exactly 0 when he stands."""
    vy_mps: float
    """The same."""
    radius_m: float
    """Of the disc that he takes up."""
    age_s: float
    """Since he was first seen."""
    last_seen_ns: int
    """Stamp of the last frame that showed him."""
    unseen_s: float = 0.0
    """How long ago that was; until then he walked as he is said to, since then he is thought to."""

    @property
    def speed_mps(self) -> float:
        """How fast he walks."""
        return math.hypot(self.vx_mps, self.vy_mps)

    def at(self, t_s: float) -> tuple[float, float]:
        """(x, y) where he will be so many seconds after the frame, if he walks on as he does."""
        return self.x_m + t_s * self.vx_mps, self.y_m + t_s * self.vy_mps


class PeopleTracker:
    """All that is followed: everything of a person's size; `follow` returns what of it is a person."""

    def __init__(self) -> None:
        self._ground, self._followed, self._next_id = Ground(), list[_Followed](), 1
        self._now_ns, self._trail = 0, list[Cells]()

    def follow(self, frame: Frame, labels: Labels, beware: BewareList) -> tuple[Track, ...]:
        """Everybody, after one more frame; somebody out of sight where he should be by now."""
        now_s, step_s = frame.stamp_ns / 1e9, (frame.stamp_ns - self._now_ns) / 1e9
        if not 0 <= step_s <= LONGEST_GAP_S:
            self._ground, self._followed = Ground(), []
        before_ns, self._now_ns, self._trail = self._now_ns, frame.stamp_ns, []
        clusters = self._ground.look(frame, _named(labels, beware))
        for followed in self._followed:
            followed.predict(step_s, lost=followed.seen_ns < before_ns)
        self._match(clusters, frame.stamp_ns)
        self._followed = [one for one in self._followed if not self._is_lost(one, frame)]
        for one in self._followed:
            if one.is_person and one.seen_ns == frame.stamp_ns:
                self._ground.keep_loose(one.cells, now_s)
            if one.walks:
                self._trail += [*one.on_map, one.cells]
                one.on_map = []
        return tuple(one.track(frame.stamp_ns) for one in self._followed if one.is_person)

    def trail(self, spec: GridSpec) -> npt.NDArray[np.int64]:
        """(N,) cells of the map, row · cols + col, that belong to whoever walks: what is there is not there for long."""
        if not self._trail:
            return np.empty(0, dtype=np.int64)
        # The cells beside them, too: the body's edge is noisy, and has fewer pixels than make a cell held.
        coarse = self._ground.loose_about(np.vstack(self._trail), self._now_ns / 1e9)
        per_cell = math.ceil(CELL_M / spec.resolution_m) + 1
        y, x = (coarse[:, axis, None] * CELL_M + (np.arange(per_cell) + 0.5) / per_cell * CELL_M for axis in (0, 1))
        rows = np.floor((y - spec.origin_y_m) / spec.resolution_m).astype(np.int64)[:, :, None]
        cols = np.floor((x - spec.origin_x_m) / spec.resolution_m).astype(np.int64)[:, None, :]
        inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
        return np.unique((rows * spec.cols + cols)[inside])

    def _match(self, clusters: list[Cluster], now_ns: int) -> None:
        """Each cluster to the nearest that is followed, known people first; what is left over is followed from now on."""
        pairs = sorted(
            (not one.is_person, math.hypot(one.x_m - cluster.x_m, one.y_m - cluster.y_m), one.id, index)
            for one in self._followed
            for index, cluster in enumerate(clusters)
        )
        by_id, taken = {one.id: one for one in self._followed}, set[int]()
        for _, apart_m, name, index in pairs:
            if apart_m <= GATE_M and name in by_id and index not in taken:
                by_id.pop(name).see(clusters[index], now_ns)
                taken.add(index)
        for index, cluster in enumerate(clusters):
            if index not in taken:
                self._followed.append(_Followed(id=self._next_id, first=cluster, now_ns=now_ns))
                self._next_id += 1

    def _is_lost(self, one: _Followed, frame: Frame) -> bool:
        unseen_s = (frame.stamp_ns - one.seen_ns) / 1e9
        if not one.is_person:
            return unseen_s >= GONE_S
        if unseen_s >= GONE_S and self._ground.is_floor(one.x_m, one.y_m, frame.stamp_ns / 1e9):
            return True
        if looks_at(frame, one.x_m, one.y_m):
            return unseen_s >= UNSEEN_S
        return unseen_s >= (ELSEWHERE_S if one.walks else STAYS_S)


@dataclass(slots=True)
class _Followed:
    """A Kalman filter at constant velocity, the same along x and y, and what is known of whom it follows."""

    id: int
    first: Cluster
    now_ns: int
    x_m: float = 0.0
    y_m: float = 0.0
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    P: npt.NDArray[np.float64] = field(default_factory=lambda: np.diag([0.0, 1.0]))
    cells: Cells = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    on_map: list[Cells] = field(default_factory=list)
    """Where the map may show him, because nobody knew that he walks."""
    is_person: bool = False
    walks: bool = False
    fresh: float = 0.0
    slow_s: float = 0.0
    born_ns: int = 0
    seen_ns: int = 0

    def __post_init__(self) -> None:
        self.x_m, self.y_m, self.born_ns = self.first.x_m, self.first.y_m, self.now_ns
        self.P[0, 0] = _noise_m(self.first) ** 2
        self._note(self.first, self.now_ns)
        self.fresh = self.first.fresh

    def predict(self, step_s: float, *, lost: bool) -> None:
        """Walk on; who stood when he was lost from sight is thought to stay there, whatever the last noise said."""
        if lost and self.is_person and not self.walks:
            self.vx_mps = self.vy_mps = 0.0
        self.x_m, self.y_m = self.x_m + step_s * self.vx_mps, self.y_m + step_s * self.vy_mps
        move = np.array([[1.0, step_s], [0.0, 1.0]])
        push = np.array([step_s**2 / 2, step_s])
        self.P = move @ self.P @ move.T + ACCEL_MPS2**2 * np.outer(push, push)

    def see(self, cluster: Cluster, now_ns: int) -> None:
        """Where he really is."""
        step_s = (now_ns - self.seen_ns) / 1e9
        gain = self.P[:, 0] / (self.P[0, 0] + _noise_m(cluster) ** 2)
        off_x, off_y = cluster.x_m - self.x_m, cluster.y_m - self.y_m
        self.x_m, self.y_m = self.x_m + gain[0] * off_x, self.y_m + gain[0] * off_y
        self.vx_mps, self.vy_mps = self.vx_mps + gain[1] * off_x, self.vy_mps + gain[1] * off_y
        self.P = self.P - np.outer(gain, self.P[0])
        self.fresh += 0.5 * (cluster.fresh - self.fresh)
        self._note(cluster, now_ns)
        speed = math.hypot(self.vx_mps, self.vy_mps)
        self.slow_s = self.slow_s + step_s if speed < STANDS_MPS else 0.0
        if self.walks:
            self.walks = self.slow_s < STANDS_S
        elif self._sets_out(speed):
            self.walks = self.is_person = True

    def track(self, now_ns: int) -> Track:
        """As a value; who stands has no velocity."""
        unseen_s = (now_ns - self.seen_ns) / 1e9
        return Track(
            id=self.id,
            x_m=self.x_m,
            y_m=self.y_m,
            vx_mps=self.vx_mps if self.walks else 0.0,
            vy_mps=self.vy_mps if self.walks else 0.0,
            radius_m=RADIUS_M + min(WIDER_PER_S * unseen_s, WIDEST_M),
            age_s=(now_ns - self.born_ns) / 1e9,
            last_seen_ns=self.seen_ns,
            unseen_s=unseen_s,
        )

    def _note(self, cluster: Cluster, now_ns: int) -> None:
        self.seen_ns, self.cells = now_ns, cluster.cells
        self.is_person |= cluster.labelled > 0.3
        if not self.walks:
            self.on_map = [*self.on_map[-49:], cluster.cells]

    def _sets_out(self, speed: float) -> bool:
        """Whether this is nothing but somebody who walks: it goes, it came where floor was, and in the way it says it goes."""
        out_x, out_y = self.x_m - self.first.x_m, self.y_m - self.first.y_m
        if self.is_person:
            return speed > WALKS_MPS and speed > 2 * math.sqrt(self.P[1, 1])
        came_m = math.hypot(out_x, out_y)
        along = out_x * self.vx_mps + out_y * self.vy_mps > 0.7 * came_m * speed
        return speed > WALKS_MPS and came_m > max(MOVED_M, 3 * _noise_m(self.first)) and self.fresh > FRESH and along


def _noise_m(cluster: Cluster) -> float:
    """Standard deviation of a cluster's middle: half a cell, and stereo depth scatters with the square of the distance."""
    return 0.05 + 0.004 * cluster.range_m**2


def _named(labels: Labels, beware: BewareList) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that are surely a person's."""
    for entry in beware.classes:
        if entry.name == PERSON:
            return np.asarray((labels.class_ids == entry.class_id) & (labels.confidence >= entry.min_confidence))
    return np.zeros(labels.class_ids.shape, dtype=np.bool_)
