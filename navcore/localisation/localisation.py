"""Localisation of one robot: tracking frame by frame, and finding the place again when it is lost.

Searches take longer than a frame: `next_task` says what to compute, any thread may compute it, and
`take` receives the outcome before a later frame.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig, StartConfig
from navcore.geometry.arrays import FloatImage
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, difference, wrap_angle
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.excluded import excluded_pixels
from navcore.localisation.fixes import TagMap, fixes_of
from navcore.localisation.fresh_fixes import FreshFixes
from navcore.localisation.global_search import GlobalSearch
from navcore.localisation.loops.loop_closer import CloseLoops, LoopCloser
from navcore.localisation.loops.loop_closure import LoopCandidates, LoopClosures
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.relocalisation import (
    SEARCH_FAILED,
    PlaceProposal,
    RelocalisationState,
    SearchResult,
)
from navcore.localisation.scans.scan import Keyframe, Scan, scan_of
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.start_check import Probation, StartCheck
from navcore.localisation.tasks import PrepareSearch, SearchPlaces
from navcore.localisation.tracking.localiser import Localiser
from navcore.localisation.tracking.odometry_model import DrivenOdometry, travel_covariance
from navcore.mapping.points.pose_ids import PoseIds
from navcore.perception.labels import Labels
from navcore.perception.people.track import Track
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

FIX_LIFE_NS = 2_000_000_000
"""Time in nanoseconds for which an absolute position locates the robot."""
Task = CloseLoops | PrepareSearch | SearchPlaces
PlaceFix = tuple[Pose2, Matrix | None]
"""T_map_driven, and the (3, 3) covariance of the robot's pose there."""
Outcome = LoopClosures | LoopCandidates | PlaceMap | SearchResult


class Localisation:
    """One estimate per frame; no thread, no clock."""

    def __init__(self, pose_ids: PoseIds, config: LocalisationConfig, sensor: DepthSensor) -> None:
        """`pose_ids` is the map's list of poses, `sensor` the depth camera of the scans."""
        self.tracker = Localiser(pose_ids, config)
        """Frame by frame."""
        self._pose_ids, self._config, self._sensor = pose_ids, config, sensor
        self._driven = DrivenOdometry(config.odometry)
        """What the search goes by, since the tracker's pose stays at standstill as well."""
        self._loops = LoopCloser(config.loops, config.graph, config.match)
        self._fixes, self._fixed_ns = FreshFixes(), -FIX_LIFE_NS
        self.tags = TagMap({})
        """Tags whose poses in the map are known."""
        self.closures: LoopClosures | None = None
        """Loop closures that wait to be applied to the map and to the poses alike."""
        self._start: StartCheck | None = None
        """Check of the place at which the robot has started; None once it has ended."""
        self._last: Pose2 | None = None
        """The place at the end of the session before, which is tried where the first looks or
        metres contradict odometry's: T_map_base until the first frame, then T_map_driven."""
        self._may_be_elsewhere = False
        """Whether that is another place than odometry's."""
        self._kept: LocalisationEstimate | None = None
        """Estimate of before another map was used, from which the next frame goes on."""
        self._probation: Probation | None = None
        """First metres from a place that may be wrong; None once it is believed for good."""
        self._search = GlobalSearch(config.relocalisation)
        self._is_lost, self._T_map_driven = False, IDENTITY
        self._may_be_there = False
        """Whether a lost robot may be where odometry has it."""
        self._still: PlaceFix | None = None
        """Place of a lost robot that is where odometry has it, as a search has found."""
        self._beside: tuple[Pose2, Matrix] | None = None
        """Place beside the believed one, which the next frame takes over."""

    def update(
        self, frame: Frame, labels: Labels, people: tuple[Track, ...], ground_m: FloatImage
    ) -> LocalisationEstimate:
        """Return the estimate for one more frame.

        The frame's pose is T_odom_base, and `people` are in odometry's frame as well; `ground_m`
        is that of `ground_heights`.
        """
        excluded = excluded_pixels(frame, labels, people)
        scan = scan_of(frame, self._sensor, excluded, ground_m, self._config.scan)
        if scan.may_be_a_person(self._config.scan):
            # On a bare floor the pose would follow the person, and the wheels' scale with it.
            scan = scan.emptied()
        return self.follow(frame, scan)

    def follow(self, frame: Frame, scan: Scan) -> LocalisationEstimate:
        """Return the estimate for one more frame, whose pose is T_odom_base, and its scan."""
        self._driven.follow(frame.pose, frame.stamp_ns)
        estimate = self._followed(frame, scan)
        driven = self._driven
        return dataclasses.replace(estimate, T_driven_base=driven.pose, travel=driven.travel)

    def _followed(self, frame: Frame, scan: Scan) -> LocalisationEstimate:
        if self._kept is not None:
            moved = self._kept.T_driven_base.inverse() @ self._driven.pose
            there = self._kept.T_map_base @ moved
            self.tracker.place(there, self._kept.covariance + self._drift_since(self._kept), frame)
            self._kept = None
        elif self._start is not None and self.tracker.scan is None:
            self.tracker.place(frame.pose, self._start.covariance, frame)
            if self._last is not None:
                self._may_be_elsewhere = _are_apart(self._last, frame.pose, self._config.start)
                self._last = self._last @ self._driven.pose.inverse()
        self.tracker.is_confirmed = self._start is None
        estimate = self.tracker.follow(frame, scan)
        self._search.move(self.tracker.moved_m)
        self._loops.note(self.tracker.take_edges(), self.tracker.take_fixes())
        beside, self._beside = self._beside, None
        if beside is not None and estimate.state is not LocalisationState.LOST:
            T_map_driven, covariance = beside
            self.tracker.shift(T_map_driven @ self._driven.pose, covariance)
            estimate = self.tracker.estimate(frame, estimate.match_share)
            self._prove(by_search=True)
        elif self.tracker.is_agreed and not self.is_on_trial:
            self._restart_chain()
        elif self.tracker.place_correction is not None:  # by scans: rooms are alike
            self._prove()
        is_believed = not self.is_on_trial
        estimate = self._confirmed(self._fixed(frame, estimate), frame)
        was_lost, self._is_lost = self._is_lost, estimate.state is LocalisationState.LOST
        # Also where a correction still waits for the robot to stand.
        believed = self.tracker.pending or estimate.T_map_base
        self._T_map_driven = believed @ self._driven.pose.inverse()
        if self._is_lost and not was_lost:
            self._begin_search(may_be_there=is_believed and not self.has_saved_map)
        if not self._is_searching:
            self._search.forget_scans()
            return estimate
        estimate = self._searched(estimate, frame)
        if self._is_lost and self._search.is_put_off:
            return dataclasses.replace(estimate, reason=SEARCH_FAILED)
        return estimate

    def _begin_search(self, *, may_be_there: bool) -> None:
        """Look for a lost robot, which `may_be_there` where odometry has it: only its own scans of
        the last metres have said otherwise."""
        self._is_lost, self._may_be_there, self._still = True, may_be_there, None
        self._beside = None
        self._search.retry()
        self._search.reconsider()  # what it has found is what led here
        if not self.has_saved_map:
            self._search.forget_map()  # it has grown since it was searched last

    @property
    def _is_searching(self) -> bool:
        """Whether the place is looked for in the whole map: that of a lost robot, or, beside the
        one at which it started, whatever speaks against that."""
        return self._is_lost or self.is_on_trial

    @property
    def is_on_trial(self) -> bool:
        """Whether the place in a saved map is not believed for good: that of a start, or one that a
        search has found."""
        return self._start is not None or self._probation is not None

    @property
    def has_saved_map(self) -> bool:
        """Whether there is a saved map to compare scans with."""
        return len(self.tracker.saved_map) > 0

    @property
    def is_in_new(self) -> bool:
        """Whether the place is on trial where little of what was seen is on the saved map, so that
        its metres tell nothing."""
        return self._probation is not None and self._probation.is_new

    def _searched(self, estimate: LocalisationEstimate, frame: Frame) -> LocalisationEstimate:
        """Return the estimate of a robot that is looked for in the whole map."""
        self._search.follow(self.tracker.scan, self._driven.pose, self.tracker.seen_s)
        proposal = self._search.proposal
        if proposal is None or not self._is_lost:
            return estimate
        found = self._still
        if proposal.state is RelocalisationState.ACCEPTED and proposal.T_map_odom is not None:
            found = proposal.T_map_odom, proposal.covariance
        return _ambiguous(estimate, proposal) if found is None else self._found(found, frame)

    def _found(self, place: PlaceFix, frame: Frame) -> LocalisationEstimate:
        """Return the estimate at a place that a search has found, which is on probation."""
        self._T_map_driven, covariance = place
        self.tracker.place(self._T_map_driven @ self._driven.pose, covariance, frame)
        self._is_lost, self._still, self._last = False, None, None
        self._prove(by_search=True)
        return self.tracker.estimate(frame)

    def _prove(self, *, by_search: bool = False) -> None:
        """Put the place that was found on probation. One that a search has found has to fit what
        led to it, too, and so has any other that is to replace it: corridors are alike."""
        if by_search:
            self._search.reconsider()
        else:
            self._search.forget_scans()
        self._search.forget_answer()
        self._probation = Probation(self._config.start, self._config.relocalisation)
        self._restart_chain()

    def _fixed(self, frame: Frame, estimate: LocalisationEstimate) -> LocalisationEstimate:
        """Return the estimate with the absolute positions of a frame, which locate the robot for a
        while."""
        fresh = list(self._fixes.of(fixes_of(frame, self.tags), frame.stamp_ns))
        for fix, alike in fresh:
            if self.tracker.fuse(fix, alike):
                self._fixed_ns = frame.stamp_ns
        if fresh:
            estimate = self.tracker.estimate(frame, estimate.match_share)
        if self.tracker.place_correction is not None:
            self._restart_chain()
        if self._is_fixed(frame) and estimate.state is LocalisationState.DEAD_RECKONING:
            return dataclasses.replace(estimate, state=LocalisationState.LOCATED, since_m=0.0)
        return estimate

    def _confirmed(self, estimate: LocalisationEstimate, frame: Frame) -> LocalisationEstimate:
        """Return the estimate, which is ambiguous until the scans have confirmed the place at which
        the robot started in a saved map.

        What they contradict, then or on the first metres, is lost, unless the robot may be where it
        was at the end of the session before: then that place is checked in the same way.
        """
        is_lost = estimate.state is LocalisationState.LOST
        if is_lost and not self._is_lost and self._start is None:
            # It fitted until now: the robot was carried, and what it saw before is of elsewhere.
            self._search.restart()
        share, points = self.tracker.saved_share, 0 if self.scan is None else len(self.scan)
        if self._probation is not None and not is_lost:
            verdict = self._probation.after(self.tracker.moved_m, self._driven.pose)
            if verdict is not None:
                self._probation = None
            if verdict:
                self._last = None
            if verdict is False:
                self._search.reconsider()
                return self._refuted(estimate, frame)
        if self._start is None:
            return self._refuted(estimate, frame) if is_lost and self._last else estimate
        verdict = False
        if not is_lost:
            may_be_elsewhere = self._may_be_elsewhere and not self._is_fixed(frame)
            verdict = self._start.after(
                share,
                points,
                self.tracker.seen_s,
                may_be_elsewhere=may_be_elsewhere,
                is_searching=self._search.has_asked,
            )
        if verdict is None:
            return self._unconfirmed(estimate, self._start)
        self._start = None
        if verdict:
            self._probation = Probation(self._config.start, self._config.relocalisation)
            if not self._may_be_elsewhere:
                self._last = None
            return estimate
        return self._refuted(estimate, frame)

    def _refuted(self, estimate: LocalisationEstimate, frame: Frame) -> LocalisationEstimate:
        """Return the estimate after a place was refuted: of a start, the place at the end of the
        session before is checked once; else the robot is lost."""
        if self._last is None:
            return self._lost(estimate, frame)
        last = self._last @ self._driven.pose
        self._start, self._probation = self._start_check(), None
        self._last, self._may_be_elsewhere = None, True
        self._search.forget_scans()  # what is searched is compared with the place now given
        self.tracker.place(last, self._start.covariance, frame)
        return self._unconfirmed(self.tracker.estimate(frame), self._start)

    def _start_check(self) -> StartCheck:
        self._search.forget_answer()
        return StartCheck(self._config.start, self._config.relocalisation)

    def _unconfirmed(
        self, estimate: LocalisationEstimate, start: StartCheck
    ) -> LocalisationEstimate:
        """Return the estimate of a robot that waits until the scans have told whether a place is
        right."""
        places = [estimate.T_map_base]
        if self._last is not None and self._may_be_elsewhere:
            places.append(self._last @ self._driven.pose)
        return dataclasses.replace(
            estimate,
            state=LocalisationState.CHECKING if start.is_looking else LocalisationState.AMBIGUOUS,
            candidates=tuple(places),
        )

    def _is_fixed(self, frame: Frame) -> bool:
        """Whether an absolute position has located the robot lately."""
        return 0 <= frame.stamp_ns - self._fixed_ns < FIX_LIFE_NS

    def _lost(self, estimate: LocalisationEstimate, frame: Frame) -> LocalisationEstimate:
        if estimate.state is not LocalisationState.LOST:
            self.tracker.lose(frame.stamp_ns)
        return dataclasses.replace(estimate, state=LocalisationState.LOST, since_ns=frame.stamp_ns)

    def next_task(self) -> Task | None:
        """Return what to compute now beside the tick; None for nothing."""
        if not self._is_searching:
            if self.closures is not None or self.has_saved_map:
                return None
            return self._loops.next_task(
                self.tracker.own_map.keyframe, self.tracker.constant_errors
            )
        given = None if self._is_lost else self._T_map_driven
        last = self._T_map_driven if self._is_lost and self._may_be_there else None
        return self._search.next_task(self.searched_map, given=given, last=last)

    def take(self, outcome: Outcome) -> None:
        """Receive the outcome of a task."""
        if isinstance(outcome, LoopCandidates):
            self._loops.keep(outcome)
            return
        if isinstance(outcome, LoopClosures):
            if not self._is_lost and self._loops.has(outcome):
                self.closures = outcome
            return
        if not self._is_searching:
            return
        if isinstance(outcome, PlaceMap):
            self._search.take_map(outcome)
            return
        if not self._search.take(outcome):
            return
        if (
            self._is_lost
            and self._may_be_there
            and (fit := outcome.still_there(self._config.relocalisation))
        ):
            T_base_driven = outcome.task.T_odom_base.inverse()
            self._still = fit.T_map_base @ T_base_driven, fit.covariance
        if self._start is not None and self._search.is_newest(outcome):
            self._start.take(outcome)
        if self._probation is not None:
            self._probation.take(outcome)
            self._beside = self._probation.correction or self._beside
            if fit := outcome.beside(self._config.relocalisation):
                T_base_driven = outcome.task.T_odom_base.inverse()
                self._beside = fit.T_map_base @ T_base_driven, fit.covariance

    def put_off_search(self) -> None:
        """Search no more until the robot has moved: the last search has failed."""
        self._search.put_off()

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """All keyframes, to be stored with the map."""
        return self.tracker.keyframes

    @property
    def scan(self) -> Scan | None:
        """Scan of the newest frame; None before the first."""
        return self.tracker.scan

    @property
    def searched_map(self) -> ScanMap:
        """The saved map or, without one, the map of this session."""
        return self.tracker.saved_map if self.has_saved_map else self.tracker.own_map

    def place(
        self, T_map_base: Pose2, covariance: Matrix, frame: Frame, *, is_sure: bool = True
    ) -> None:
        """Set the pose of the robot at a frame, with its (3, 3) covariance. Unless it `is_sure`, it
        has to prove itself in the saved map."""
        self.tracker.place(T_map_base, covariance, frame)
        self._is_lost, self._start, self._last = False, None, None
        self._kept = self._probation = self._beside = None
        self._search.restart()
        self._restart_chain()
        if not is_sure and self.has_saved_map:
            self._probation = Probation(self._config.start, self._config.relocalisation)

    def accept_jump(self, before: LocalisationEstimate, frame: Frame) -> None:
        """Follow odometry that has jumped since an estimate: the robot may be where it was then, or
        where the frame's pose has it, and is as uncertain. A place on trial has to
        prove itself from there on, and a lost robot stays lost; what was seen before the jump is no
        part of its search."""
        there = before.T_map_odom @ frame.pose
        jump = difference(there, before.T_map_base)
        self.tracker.place(there, before.covariance + np.outer(jump, jump), frame)
        if self._is_lost:
            self.tracker.lose(frame.stamp_ns)
        self._kept = self._still = self._beside = None
        if self.tracker.scan is not None:  # until then it is a place on the map, not by odometry
            self._last = None
        self._search.restart()
        self._fixes = FreshFixes()  # as the clock may have jumped as well
        if self._start is not None:
            self._start = self._start_check()
        if self._probation is not None:
            self._probation = Probation(self._config.start, self._config.relocalisation)
        self._restart_chain()

    def corrected(self, closures: LoopClosures) -> tuple[dict[int, Pose2], Pose2]:
        """Return the poses by ID that closures lead to, and T_new_old of the robot."""
        return self._loops.corrected(closures, self._pose_ids.poses)

    def correct(self, closures: LoopClosures, poses: Mapping[int, Pose2]) -> None:
        """Apply closures to keyframes and pose; `poses` are those of `corrected` before the map was
        corrected by them, as its list of poses has moved since."""
        newest = list(closures.poses)[-1]  # in the order of driving
        self.tracker.correct(poses, (newest, closures.graph.covariances([newest])[newest]))
        self._loops.take(closures)
        self.closures = None

    def move_keyframes(self, poses: Mapping[int, Pose2]) -> None:
        """Move keyframes of this session to corrected T_map_base by ID, and not the robot; the map
        was corrected by the same poses. Loops are closed among what is seen from now on alone, as
        odometry would move the others back."""
        self.tracker.move_keyframes(poses)
        self._restart_chain()

    def _drift_since(self, left: LocalisationEstimate) -> Matrix:
        """Return the (3, 3) covariance by which the driving since an estimate has made the pose
        more uncertain."""
        return travel_covariance(self._driven.travel - left.travel, self._config.odometry)

    def _is_certain(self, covariance: Matrix) -> bool:
        """Return whether a pose is at least as certain as a start is taken to be."""
        at_start = StartCheck(self._config.start, self._config.relocalisation).covariance
        return bool((np.diag(covariance) <= np.diag(at_start)).all())

    def return_to(self, keyframes: Iterable[Keyframe]) -> None:
        """Return to the keyframes that the map had, whose poses are constants now: forget what was
        made since at a wrong place."""
        if self.tracker.return_to(keyframes) or not self.has_saved_map:
            self._search.forget_map()
        self._restart_chain()

    def _restart_chain(self) -> None:
        self.tracker.take_edges()
        self.tracker.take_fixes()
        self._loops.restart(known=len(self._pose_ids))
        self.closures = None

    @property
    def waits_for_standstill(self) -> bool:
        """Whether a correction is too large to be applied while the robot drives."""
        return self.tracker.pending is not None

    def search(self, stamp_ns: int) -> None:
        """Forget the place and what was seen so far, as the robot may have been carried since, and
        look for the place in the whole map."""
        self.tracker.lose(stamp_ns)
        self._kept = self._start = self._last = self._probation = None
        self._search.restart()
        self._begin_search(may_be_there=False)

    def load(
        self,
        keyframes: Iterable[Keyframe],
        last: Pose2 | None = None,
        *,
        kept: LocalisationEstimate | None = None,
    ) -> None:
        """Take the keyframes of a saved map, whose poses are constants, and begin again: odometry's
        pose counts as the place in the map until the scans have confirmed it, or contradict it.

        `last`: T_map_base at the end of the session before, which is tried next; None if unknown.
        `kept`: the estimate in this map from before another one was used, if odometry has gone on
        since: then it holds as long as nothing contradicts it, unless so much was driven since that
        the robot would be less certain than at a start.
        """
        if kept is not None and not self._is_certain(self._drift_since(kept)):
            kept = None
        self.tracker = Localiser(self._pose_ids, self._config)
        self.tracker.load(keyframes)
        self._search.begin_map()
        self._is_lost = False
        self._restart_chain()
        has_map = self.has_saved_map
        self._kept, self._probation, self._beside = kept, None, None
        self._start = self._start_check() if has_map and kept is None else None
        self._fixes, self._fixed_ns = FreshFixes(), -FIX_LIFE_NS
        self._last = last if has_map and kept is None else None
        self._may_be_elsewhere = False


def _are_apart(place: Pose2, other: Pose2, config: StartConfig) -> bool:
    """Return whether two places are not the same within two standard deviations of a start."""
    turn = abs(wrap_angle(place.yaw_rad - other.yaw_rad))
    is_far = place.distance_to(other.x_m, other.y_m) > 2.0 * config.sigma_m
    return is_far or turn > 2.0 * math.radians(config.sigma_deg)


def _ambiguous(estimate: LocalisationEstimate, proposal: PlaceProposal) -> LocalisationEstimate:
    """Return the estimate of a lost robot with the places that its search has found."""
    estimate = dataclasses.replace(estimate, reason=proposal.reason)
    if proposal.state is RelocalisationState.SEARCHING or not proposal.candidates:
        return estimate
    return dataclasses.replace(
        estimate,
        state=LocalisationState.AMBIGUOUS,
        is_searched=True,
        candidates=tuple(place.T_map_base for place in proposal.candidates),
    )
