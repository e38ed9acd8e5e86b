"""Multi-object tracking of people: those who walk, and those whom the segmenter labels.

A walking person is no part of the map: the points are removed (`PeopleTracker.trail`) where the
person is and where the person was before being recognised as walking. A person who stands for a
while is an obstacle like any other, and stays a person.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList
from navcore.perception.labels import Labels
from navcore.perception.people.detector import Cells, Cluster, PersonDetector
from navcore.perception.people.track import KalmanTrack, Track
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile


class PeopleTracker:
    """Tracks of everything of a person's size; `follow` returns those that are people."""

    def __init__(
        self,
        profile: RobotProfile = HUSKY,
        *,
        non_cooperative: bool = False,
        config: PerceptionConfig = DEFAULT_PERCEPTION,
    ) -> None:
        """Start without tracks, none of which will lead through the robot's footprint; with
        `non_cooperative`, as in `PeopleConfig`, false positives are preferred to late
        detections."""
        self._profile = profile
        self._non_cooperative = non_cooperative
        self._config = config.people
        self._min_confidence = config.min_person_confidence
        self._detector = PersonDetector(config.people.detector)
        self._tracks, self._next_id = list[KalmanTrack](), 1
        self._now_ns, self._trail = 0, list[Cells]()

    def follow(
        self, frame: Frame, labels: Labels, beware: BewareList, ground_m: FloatImage | None = None
    ) -> tuple[Track, ...]:
        """Return all people after one more frame, those out of sight at their predicted positions.

        `ground_m` is that of `ground_heights`, 0 by default.
        """
        step_s = (frame.stamp_ns - self._now_ns) / 1e9
        if not 0 <= step_s <= self._config.max_gap_s:
            self._detector, self._tracks = PersonDetector(self._config.detector), []
        before_ns, self._now_ns, self._trail = self._now_ns, frame.stamp_ns, []
        clusters = self._detector.detect(frame, self._person_pixels(labels, beware), ground_m)
        for one in self._tracks:
            lost = one.seen_ns < before_ns
            one.predict(step_s, lost=lost)
            if lost and one.walks:
                one.stop_before(self._profile, frame.pose)
        self._match(clusters, frame.stamp_ns)
        self._tracks = [one for one in self._tracks if not self._is_lost(one, frame, step_s)]
        self._tracks = [one for one in self._tracks if not self._has_returned(one)]
        for one in self._tracks:
            self._note_cells(one)
        return tuple(one.track(frame.stamp_ns) for one in self._tracks if one.is_person)

    def trail(self, spec: GridSpec, T_map_odom: Pose2 = IDENTITY) -> Indices:
        """Return the (N,) cells of the map, row · cols + col, of walking people."""
        if not self._trail:
            return np.empty(0, dtype=np.int64)
        # With their neighbours: the outline of the body is noisy, and has fewer pixels than make a
        # cell occupied.
        coarse = self._detector.movable_around(np.vstack(self._trail), self._now_ns / 1e9)
        cell_m = self._config.detector.cell_m
        per_cell = math.ceil(cell_m / spec.resolution_m) + 1
        y, x = (
            coarse[:, axis, None] * cell_m + (np.arange(per_cell) + 0.5) / per_cell * cell_m
            for axis in (0, 1)
        )
        points = np.stack(np.broadcast_arrays(x[:, None, :], y[:, :, None]), axis=-1)
        return spec.cells_at(T_map_odom.to_parent(points.reshape(-1, 2)))

    def is_free_floor(self, positions: Floats) -> Bools:
        """Return (N,) at which of (N, 2) positions in metres of odometry's frame no person stands:
        the newest frame shows their floor."""
        return self._detector.is_free_floor(positions)

    @property
    def positions(self) -> Floats:
        """(N, 2) positions in metres of odometry's frame of all people, in sight or not."""
        people = [(one.x_m, one.y_m) for one in self._tracks if one.is_person]
        return np.array(people, dtype=np.float64).reshape(-1, 2)

    def _match(self, clusters: list[Cluster], now_ns: int) -> None:
        """Assign clusters to the nearest tracks, known people first; start tracks with the rest."""
        pairs = sorted(
            (
                not one.is_person,
                math.hypot(one.x_m - cluster.x_m, one.y_m - cluster.y_m),
                one.id,
                index,
            )
            for one in self._tracks
            for index, cluster in enumerate(clusters)
            if self._may_be(one, cluster, now_ns)
        )
        by_id, taken = {one.id: one for one in self._tracks}, set[int]()
        for _, distance_m, track_id, index in pairs:
            if distance_m <= self._config.gate_m and track_id in by_id and index not in taken:
                by_id.pop(track_id).update(clusters[index], now_ns)
                taken.add(index)
        for index, cluster in enumerate(clusters):
            if index not in taken:
                self._tracks.append(
                    KalmanTrack(
                        id=self._next_id,
                        first=cluster,
                        now_ns=now_ns,
                        non_cooperative=self._non_cooperative,
                        config=self._config.track,
                    )
                )
                self._next_id += 1

    def _may_be(self, one: KalmanTrack, cluster: Cluster, now_ns: int) -> bool:
        """Return whether a cluster may be the object of a track.

        Where a person who walked out of sight is expected, a chair that comes into view is not the
        person: the person would be followed no longer, wherever they are.
        """
        unseen_s = (now_ns - one.seen_ns) / 1e9
        if not one.walks or unseen_s <= self._config.doubtful_s:
            return True
        came = cluster.on_new_floor > self._config.track.min_new_floor
        return came or cluster.labelled > self._config.track.min_labelled

    def _note_cells(self, one: KalmanTrack) -> None:
        """Keep the cells of a person movable, and add those of a walking one to the trail."""
        now_s = self._now_ns / 1e9
        if one.is_person and one.seen_ns == self._now_ns:
            self._detector.keep_movable(one.cells, now_s)
        if not one.walks:
            return
        self._trail += [*one.on_map, one.cells]
        one.on_map = []
        if self._now_ns - one.seen_ns < self._config.unseen_s * 1e9:
            # A leg at the border of the image is too little to be assigned to the person, and yet
            # on the map.
            disc = self._detector.cells_within(one.x_m, one.y_m, one.radius_m)
            self._trail.append(self._detector.newly_occupied(disc, now_s))

    def _has_returned(self, lost: KalmanTrack) -> bool:
        """Return whether a person who was lost from sight is now followed by another track."""
        x_m, y_m = lost.last_seen_at(self._now_ns)
        for one in self._tracks:
            distance_m = math.hypot(one.first.x_m - x_m, one.first.y_m - y_m)
            if (
                distance_m <= self._config.return_m
                and lost.is_person
                and one.walks
                and lost.seen_ns < one.born_ns <= self._now_ns == one.seen_ns
            ):
                one.walking_speed_mps = max(one.walking_speed_mps, lost.walking_speed_mps)
                return True
        return False

    def _is_lost(self, one: KalmanTrack, frame: Frame, step_s: float) -> bool:
        config, unseen_s = self._config, (frame.stamp_ns - one.seen_ns) / 1e9
        if not one.is_person:
            return unseen_s >= config.object_unseen_s
        # A person who was lost from sight at one position and is not seen at the predicted one may
        # have turned back in between, and takes a moment to be told from other things again.
        positions = (one.x_m, one.y_m), one.last_seen_at(frame.stamp_ns)
        too_near = one.before_robot and frame.scan is None
        is_missed = unseen_s > 0 and all(
            self._detector.is_floor(*at, one.radius_m, frame.stamp_ns / 1e9)
            or (not too_near and self._detector.looks_at(frame, *at, one.radius_m))
            for at in positions
        )
        # Too near, or at the border of the image, they may have stepped aside, and be back soon.
        is_past = unseen_s > 0 and all(
            self._detector.sees_past(frame, *at, one.radius_m) for at in positions
        )
        one.missed_s = one.missed_s + step_s if is_missed else 0.0
        one.past_s = one.past_s + step_s if is_past else 0.0
        if one.missed_s >= config.unseen_s or one.past_s >= config.past_s:
            return True
        longest_s = config.walking_unseen_s if one.walks else config.standing_unseen_s
        return unseen_s >= longest_s and not self._turns_round(frame)

    def _turns_round(self, frame: Frame) -> bool:
        """Return whether the robot turns in place, and the next frame may show who is out of sight:
        it may be looking for them."""
        turns = abs(frame.twist.w_radps) >= self._config.turning_radps
        return turns and abs(frame.twist.v_mps) < self._config.turning_mps

    def _person_pixels(self, labels: Labels, beware: BewareList) -> Bools:
        """Return the (H, W) pixels that are a person's with enough confidence, whether that class
        is enabled or not: people are avoided in any case."""
        person = np.zeros(labels.class_ids.shape, dtype=np.bool_)
        for class_id in beware.people_ids[:1]:
            for one in labels.all_hypotheses:
                shown = one.class_ids == class_id
                if shown.any():  # mostly not: then confidence need not be read
                    person |= shown & (one.confidence >= self._min_confidence)
        return person
