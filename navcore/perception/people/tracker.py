"""People who walk, and people whom the segmenter recognises: followed from frame to frame at
constant velocity.

Whoever moves is no part of the map: his points are taken off it (`PeopleTracker.trail`) where he is
and where he was while nobody knew yet that he walks. Whoever stands still for a while is an
obstacle like any other, and stays a person.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import PERSON, BewareList
from navcore.perception.colour_segmenter import PERSON_SURE
from navcore.perception.ground import Image
from navcore.perception.labels import Labels
from navcore.perception.people.detector import (
    CELL_M,
    Cells,
    Cluster,
    PersonDetector,
    cells_within,
    looks_at,
)
from navcore.perception.people.track import KalmanTrack, Track
from navcore.robot.frame import Frame

GATE_M = 0.45
"""A cluster this near to where somebody should be is he."""
UNSEEN_S, ELSEWHERE_S, STAYS_S = 1.0, 8.0, 20.0
"""He is forgotten after this where the camera looks and does not see him, and where it does not
look if he walked or stood."""
GONE_S = 0.25
"""And after this where the camera sees the floor, both where he should be by now and where he was
lost from sight."""
RETURN_M = 1.0
"""Who comes into sight as near as this to where somebody was lost from it is he."""
LONGEST_GAP_S = 2.0
"""After a longer gap between two pictures, or when time runs backwards, nobody is where he was."""


class PeopleTracker:
    """All that is followed: everything of a person's size; `follow` returns what of it is a person."""

    def __init__(self, *, non_cooperative: bool = False) -> None:
        """`non_cooperative`: as in `PeopleConfig`; better take something for a walker that is none
        than notice one late."""
        self._heedless = non_cooperative
        self._ground, self._followed, self._next_id = PersonDetector(), list[KalmanTrack](), 1
        self._now_ns, self._trail = 0, list[Cells]()

    def follow(
        self, frame: Frame, labels: Labels, beware: BewareList, ground_m: Image | None = None
    ) -> tuple[Track, ...]:
        """Everybody, after one more frame; somebody out of sight where he should be by now.
        `ground_m`: see `terrain.py`."""
        now_s, step_s = frame.stamp_ns / 1e9, (frame.stamp_ns - self._now_ns) / 1e9
        if not 0 <= step_s <= LONGEST_GAP_S:
            self._ground, self._followed = PersonDetector(), []
        before_ns, self._now_ns, self._trail = self._now_ns, frame.stamp_ns, []
        clusters = self._ground.look(frame, _named(labels, beware), ground_m)
        for followed in self._followed:
            followed.predict(step_s, lost=followed.seen_ns < before_ns)
        self._match(clusters, frame.stamp_ns)
        self._followed = [one for one in self._followed if not self._is_lost(one, frame)]
        self._followed = [one for one in self._followed if not self._is_back(one)]
        for one in self._followed:
            if one.is_person and one.seen_ns == frame.stamp_ns:
                self._ground.keep_loose(one.cells, now_s)
            if one.walks:
                self._trail += [*one.on_map, one.cells]
                one.on_map = []
                if frame.stamp_ns - one.seen_ns < UNSEEN_S * 1e9:
                    # A leg at the border of the picture is too little to be told for him, and yet
                    # on the map.
                    self._trail.append(
                        self._ground.newly_occupied(
                            cells_within(one.x_m, one.y_m, one.radius_m), now_s
                        )
                    )
        return tuple(one.track(frame.stamp_ns) for one in self._followed if one.is_person)

    def trail(self, spec: GridSpec) -> npt.NDArray[np.int64]:
        """(N,) cells of the map, row · cols + col, that belong to whoever walks: what is there is
        not there for long."""
        if not self._trail:
            return np.empty(0, dtype=np.int64)
        # The cells beside them, too: the body's edge is noisy, and has fewer pixels than make a
        # cell held.
        coarse = self._ground.loose_about(np.vstack(self._trail), self._now_ns / 1e9)
        per_cell = math.ceil(CELL_M / spec.resolution_m) + 1
        y, x = (
            coarse[:, axis, None] * CELL_M + (np.arange(per_cell) + 0.5) / per_cell * CELL_M
            for axis in (0, 1)
        )
        rows = np.floor((y - spec.origin_y_m) / spec.resolution_m).astype(np.int64)[:, :, None]
        cols = np.floor((x - spec.origin_x_m) / spec.resolution_m).astype(np.int64)[:, None, :]
        inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
        return np.unique((rows * spec.cols + cols)[inside])

    def is_free_floor(self, places: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """(N,) at which of (N, 2) places of the map frame nobody stands: the newest frame shows
        their floor."""
        return self._ground.is_free_floor(places)

    def _match(self, clusters: list[Cluster], now_ns: int) -> None:
        """Each cluster to the nearest that is followed, known people first; what is left over is
        followed from now on."""
        pairs = sorted(
            (
                not one.is_person,
                math.hypot(one.x_m - cluster.x_m, one.y_m - cluster.y_m),
                one.id,
                index,
            )
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
                self._followed.append(
                    KalmanTrack(
                        id=self._next_id,
                        first=cluster,
                        now_ns=now_ns,
                        non_cooperative=self._heedless,
                    )
                )
                self._next_id += 1

    def _is_back(self, lost: KalmanTrack) -> bool:
        """Whether somebody who was lost from sight has come back into it as another."""
        x_m, y_m = lost.lost_at(self._now_ns)
        for one in self._followed:
            near = math.hypot(one.first.x_m - x_m, one.first.y_m - y_m) <= RETURN_M
            if (
                near
                and lost.is_person
                and one.walks
                and lost.seen_ns < one.born_ns <= self._now_ns == one.seen_ns
            ):
                one.pace_mps = max(one.pace_mps, lost.pace_mps)
                return True
        return False

    def _is_lost(self, one: KalmanTrack, frame: Frame) -> bool:
        unseen_s = (frame.stamp_ns - one.seen_ns) / 1e9
        if not one.is_person:
            return unseen_s >= GONE_S
        # Whoever was lost from sight at one place and is not seen at the other may have turned back
        # in between.
        places = (one.x_m, one.y_m), one.lost_at(frame.stamp_ns)
        if unseen_s >= GONE_S and all(
            self._ground.is_floor(*at, one.radius_m, frame.stamp_ns / 1e9) for at in places
        ):
            return True
        if all(looks_at(frame, *at, one.radius_m) for at in places):
            return unseen_s >= UNSEEN_S
        return unseen_s >= (ELSEWHERE_S if one.walks else STAYS_S)


def _named(labels: Labels, beware: BewareList) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that are surely a person's, whether the list is on about people or not: nobody
    is driven into unseen."""
    for entry in beware.classes:
        if entry.name == PERSON:
            claims = [
                (one.class_ids == entry.class_id) & (one.confidence >= PERSON_SURE)
                for one in labels.all_hypotheses
            ]
            return np.asarray(np.logical_or.reduce(claims))
    return np.zeros(labels.class_ids.shape, dtype=np.bool_)
