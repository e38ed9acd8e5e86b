"""Somebody who is followed: where he is, how he walks, and how sure that is; a Kalman filter at
constant velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from navcore.perception.people.detector import RADIUS_M, Cells, Cluster

ACCEL_MPS2 = 3.0
"""How suddenly people change their pace, standard deviation."""
WALKS_MPS, STANDS_MPS = 0.3, 0.15
"""Faster than this he walks, slower than that he stands."""
MOVED_M = 0.25
"""He must have come this far from where he was first seen, or from where he has stood …"""
RESTS_M = 0.35
"""… and who stays as near as this to one place stands there, however his estimate trembles."""
FRESH = 0.5
"""And this much of him must be where floor was seen."""
STANDS_S = 1.0
"""Who has stood for so long is an obstacle."""
WIDTH_SHARE = 0.3
"""Of a new width in that which he is taken to have."""
PACE_SHARE = 0.2
"""Of a new speed in the pace that somebody is taken to walk at, so that one hasty estimate does not
make him a runner."""
LABELLED = 0.3
"""With this share of his pixels labelled a person's a picture calls him one."""
PICTURE_SHARE = 0.3
"""Of a new picture in how often pictures call him one: a single one that calls a doorpost a person
makes nobody of it."""
NAMED, UNNAMED = 0.45, 0.1
"""Called so as often as this of late he is one, as seldom as that he is not, unless he has walked.
"""
SLOWS_MPS2 = 0.05
"""So quickly the fastest that he was seen to walk is forgotten while he is seen to walk slower: one
estimate may be far off."""
BRISK = 0.5
"""Slower than this share of his pace somebody is about to stop or to turn, and where to is not
known."""
LONGEST_STEP_S = 0.3
"""Between two pictures further apart than this nobody can say that he stood."""
CUT_M = 0.3
"""As much of him may lie beyond the border of the picture: his middle is so much less certain then.
"""
WIDER_PER_S, WIDEST_M = 0.1, 0.3
"""Out of sight one who walks takes up so much more room, for nobody knows."""


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
    pace_mps: float = 0.0
    """The fastest that he has been seen to walk of late; 0 for somebody who never did."""
    stood_s: float = 0.0
    """For how long he has been seen to stand."""
    course_rad: float = 0.0
    """Direction in which he walked last, map frame; means nothing for somebody who never did."""

    @property
    def speed_mps(self) -> float:
        """How fast he walks."""
        return math.hypot(self.vx_mps, self.vy_mps)

    def at(self, t_s: float) -> tuple[float, float]:
        """(x, y) where he will be so many seconds after the frame, if he walks on as he does."""
        return self.x_m + t_s * self.vx_mps, self.y_m + t_s * self.vy_mps


@dataclass(slots=True)
class KalmanTrack:
    """A Kalman filter at constant velocity, the same along x and y, and what is known of whom it
    follows."""

    id: int
    first: Cluster
    now_ns: int
    non_cooperative: bool = False
    """Whether whatever moves is taken for somebody who walks, without asking whether it came where
    floor was seen."""
    x_m: float = 0.0
    y_m: float = 0.0
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    P: npt.NDArray[np.float64] = field(default_factory=lambda: np.diag([0.0, 1.0]))
    cells: Cells = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    on_map: list[Cells] = field(default_factory=list)
    """Where the map may show him, because nobody knew that he walks."""
    is_person: bool = False
    named: float = 0.0
    """How often pictures have called him a person of late."""
    walks: bool = False
    rests_x_m: float = 0.0
    """Where he may be standing …"""
    rests_y_m: float = 0.0
    rested_s: float = 0.0
    """… and for how long he has been seen there."""
    fresh: float = 0.0
    slow_s: float = 0.0
    radius_m: float = RADIUS_M
    lately_mps: float = 0.0
    pace_mps: float = 0.0
    course_rad: float = 0.0
    born_ns: int = 0
    seen_ns: int = 0

    def __post_init__(self) -> None:
        self.x_m, self.y_m, self.born_ns = self.first.x_m, self.first.y_m, self.now_ns
        self.rests_x_m, self.rests_y_m = self.x_m, self.y_m
        self.radius_m = self.first.radius_m
        self.P[0, 0] = _noise_m(self.first) ** 2
        self._note(self.first, self.now_ns)
        self.fresh = self.first.fresh

    def predict(self, step_s: float, *, lost: bool) -> None:
        """Walk on; who stood when he was lost from sight is thought to stay there, whatever the
        last noise said."""
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
        if self.first.cut and not cluster.cut:
            self.first = cluster  # from here on one can tell how far he has come
        self._note(cluster, now_ns)
        speed = math.hypot(self.vx_mps, self.vy_mps)
        step_s = min(step_s, LONGEST_STEP_S)
        self.slow_s = self.slow_s + step_s if speed < STANDS_MPS else 0.0
        self._rest(step_s)
        if self.walks:
            self.lately_mps += PACE_SHARE * (speed - self.lately_mps)
            self.pace_mps = max(self.pace_mps - SLOWS_MPS2 * step_s, self.lately_mps)
            self.walks = self.slow_s < STANDS_S
            if speed > BRISK * self.pace_mps:
                self.course_rad = math.atan2(self.vy_mps, self.vx_mps)
        elif self._sets_out(speed):
            self.walks = self.is_person = True
            self.lately_mps = self.pace_mps = max(WALKS_MPS, self.pace_mps)
            self.course_rad = math.atan2(self.vy_mps, self.vx_mps)

    def lost_at(self, now_ns: int) -> tuple[float, float]:
        """(x, y) where he was seen last."""
        unseen_s = (now_ns - self.seen_ns) / 1e9
        return self.x_m - unseen_s * self.vx_mps, self.y_m - unseen_s * self.vy_mps

    def track(self, now_ns: int) -> Track:
        """As a value; who stands has no velocity."""
        unseen_s = (now_ns - self.seen_ns) / 1e9
        return Track(
            id=self.id,
            x_m=self.x_m,
            y_m=self.y_m,
            vx_mps=self.vx_mps if self.walks else 0.0,
            vy_mps=self.vy_mps if self.walks else 0.0,
            radius_m=self.radius_m + (min(WIDER_PER_S * unseen_s, WIDEST_M) if self.walks else 0.0),
            age_s=(now_ns - self.born_ns) / 1e9,
            last_seen_ns=self.seen_ns,
            unseen_s=unseen_s,
            pace_mps=self.pace_mps,
            stood_s=self.rested_s,
            course_rad=self.course_rad,
        )

    def _rest(self, step_s: float) -> None:
        if math.hypot(self.x_m - self.rests_x_m, self.y_m - self.rests_y_m) < RESTS_M:
            self.rested_s += step_s
        else:
            self.rests_x_m, self.rests_y_m, self.rested_s = self.x_m, self.y_m, 0.0

    def _note(self, cluster: Cluster, now_ns: int) -> None:
        self.seen_ns, self.cells = now_ns, cluster.cells
        self.radius_m += WIDTH_SHARE * (cluster.radius_m - self.radius_m)
        self.named += PICTURE_SHARE * (float(cluster.labelled > LABELLED) - self.named)
        self.is_person = self.pace_mps > 0 or self.named > (UNNAMED if self.is_person else NAMED)
        if not self.walks:
            self.on_map = [*self.on_map[-49:], cluster.cells]

    def _sets_out(self, speed: float) -> bool:
        """Whether this is nothing but somebody who walks: it goes, it came where floor was, and in
        the way it says it goes."""
        out_x, out_y = self.x_m - self.first.x_m, self.y_m - self.first.y_m
        if self.is_person:
            came_m = math.hypot(self.x_m - self.rests_x_m, self.y_m - self.rests_y_m)
            return speed > WALKS_MPS and (speed > 2 * math.sqrt(self.P[1, 1]) or came_m > MOVED_M)
        came_m = math.hypot(out_x, out_y)
        along = out_x * self.vx_mps + out_y * self.vy_mps > 0.7 * came_m * speed
        came = self.fresh > FRESH or self.non_cooperative
        return (
            came and along and speed > WALKS_MPS and came_m > max(MOVED_M, 3 * _noise_m(self.first))
        )


def _noise_m(cluster: Cluster) -> float:
    """Standard deviation of a cluster's middle: half a cell, and stereo depth scatters with the
    square of the distance."""
    return 0.05 + 0.004 * cluster.range_m**2 + (CUT_M if cluster.cut else 0.0)
