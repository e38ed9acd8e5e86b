"""The localiser: one estimate per frame, from odometry, scans and absolute positions.

A match against a saved map is an absolute position. A match against the map that the robot is
making is not: that map is wherever the robot took itself to be. It counts for little. The motion
since a scan of half a metre ago is measured beside it, wherever the map lies.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, difference, growth, wrap_angle
from navcore.localisation.estimate import LocalisationEstimate, PlaceCorrection
from navcore.localisation.graph.edges import ConstantErrors, Edge
from navcore.localisation.graph.pose_graph import AbsolutePose
from navcore.localisation.scans.matching import Match
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.correction import CorrectionFlow
from navcore.localisation.tracking.displacement import DisplacementSearch
from navcore.localisation.tracking.keyframe_chain import KeyframeChain, KnownPoses
from navcore.localisation.tracking.odometry_model import OdometryStep
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.pose_matcher import PoseMatcher
from navcore.localisation.tracking.recent_odometry import RecentOdometry
from navcore.localisation.tracking.refused_fixes import RefusedFixes
from navcore.localisation.tracking.refused_matches import RefusedMatches
from navcore.localisation.tracking.scan_to_scan.recent_scans import RecentScans, is_elsewhere
from navcore.localisation.tracking.scan_to_scan.scan_odometry import ScanOdometry
from navcore.localisation.tracking.tracking_state import TrackingState
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame

_DEFAULT = LocalisationConfig()
_MOVED_M, _MOVED_RAD = 0.05, math.radians(1.0)
"""Motion after which a scan says something new about a map."""
_COVARIANCES = 256
"""Number of the newest keyframes whose covariances are kept: a closed loop corrects newer ones."""
_PLACED = np.diag([0.3, 0.3, math.radians(8.0)]) ** 2
"""Covariance of a pose that was given without one."""
_SURE = np.array([0.1, 0.1, math.radians(5.0)]) ** 2
"""Largest variances along the map's axes of a fix that takes doubt back. It needs a heading: of a
robot that was turned by other means than its wheels, the position is right and the scans are not
where they are expected."""
_DISPLACED = np.diag([0.25, 0.25, math.radians(6.0)]) ** 2
"""Covariance of a motion without the wheels, or of an error of the saved map."""
_DOUBTED_S = 0.5
"""Time in seconds of contradicting frames from which the place is looked for beside the estimate:
a person who passes contradicts the map for less, and the search takes longer than the rest."""


class Localiser:
    """Where the robot is, frame by frame; no thread, no clock."""

    def __init__(
        self,
        pose_ids: KnownPoses,
        config: LocalisationConfig = _DEFAULT,
    ) -> None:
        """`pose_ids` is the map's list of poses, which this one appends to."""
        self._config = config
        self._matcher = PoseMatcher(config)
        self._saved = ScanMap(config.match)
        self._pose_ids = pose_ids
        self._chain = KeyframeChain(pose_ids, config)
        self._relative: dict[int, Matrix] = {}
        """(3, 3) `PoseFilter.relative` at each keyframe of the session by its ID."""
        self._filter: PoseFilter | None = None
        self._recent = RecentScans(config)
        self._scan_odometry = ScanOdometry(config)
        self._refused = RefusedFixes(config.tracking)
        self._refused_matches = RefusedMatches(config, self._matcher, _DISPLACED)
        self._displacement = DisplacementSearch(config)
        self._flow = CorrectionFlow(config.tracking)
        self._odometry: tuple[Pose2, int] = (IDENTITY, 0)
        self._recent_odometry = RecentOdometry()
        self._state = TrackingState(config.tracking)
        self._unmatched = (math.inf, math.inf)
        self._continues = True
        self.scan: Scan | None = None
        """Scan of the newest frame; None before the first."""
        self.saved_share: float | None = None
        """Share of the newest scan that fits the saved map, 0 to 1, of the points near it; None
        where most of the scan is not."""
        self.is_confirmed = True
        """Whether the place is believed: else nothing is kept of what is seen."""
        self.place_correction: PlaceCorrection | None = None
        """Correction at the newest frame by position fixes, or by scans that fit beside the
        estimate, if they contradicted it for so long that it was wrong."""
        self.is_agreed = False
        """Whether the matches of some metres have told that correction: then it is proven."""
        self.pushed_m = 0.0
        """Distance in metres by which the robot was pushed, or its wheels have slipped, as the
        newest scan tells in a new map."""
        self.moved_m = 0.0
        """Motion before the newest frame in metres; a radian counts as half a metre."""
        self.seen_s = 0.0
        """Time before it in seconds that it may tell of."""

    def follow(self, frame: Frame, scan: Scan) -> LocalisationEstimate:
        """Return the estimate for one more frame and its scan."""
        self.scan, self.place_correction, self.pushed_m = scan, None, 0.0
        self.is_agreed = False
        step = self._advance(frame)
        share: float | None = None
        self.saved_share = None
        if not self._state.is_lost:
            share = self._observe(scan, step, frame.stamp_ns)
            self._flow.follow(
                self._pose, frame.pose, standing=step.is_standing(self._config.odometry)
            )
        else:
            self._flow.jump(self._pose, frame.pose)
        is_known = self.is_confirmed and not self._state.is_lost
        if is_known and self._flow.pending is None:
            self._keep(scan, frame)
        return self.estimate(frame, share)

    @property
    def pending(self) -> Pose2 | None:
        """T_map_base that a large correction leads to, which waits until the robot stands; None if
        none waits."""
        return self._flow.pending

    @property
    def constant_errors(self) -> ConstantErrors:
        """What is known of the constant errors of odometry."""
        return self._require_filter().constant_errors

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """All keyframes, those of the saved map first."""
        return self._saved.keyframes + self._chain.map.keyframes

    @property
    def saved_map(self) -> ScanMap:
        """Surfaces of the saved map."""
        return self._saved

    @property
    def own_map(self) -> ScanMap:
        """Surfaces that this session added."""
        return self._chain.map

    def take_edges(self) -> tuple[Edge, ...]:
        """Return the edges between consecutive keyframes since the last call."""
        return self._chain.take_edges()

    def take_fixes(self) -> tuple[AbsolutePose, ...]:
        """Return the poses of keyframes that fixes have measured since the last call."""
        return self._chain.take_fixes()

    def load(self, keyframes: Iterable[Keyframe]) -> None:
        """Take the keyframes of a saved map, whose poses are constants from now on."""
        self._saved.replace(keyframes)

    def return_to(self, keyframes: Iterable[Keyframe]) -> bool:
        """Forget the keyframes of this session, but for those of former keyframes that are not in
        the saved map: they become part of it, or, where there is none, stay those of this session;
        return whether the saved map has changed."""
        known = {keyframe.pose_id for keyframe in self._saved.keyframes}
        added = [keyframe for keyframe in keyframes if keyframe.pose_id not in known]
        self._chain, self._relative = KeyframeChain(self._pose_ids, self._config), {}
        if not known:  # else loops would be closed no more
            self._chain.map.replace(added)
            return False
        for keyframe in added:
            self._saved.put(keyframe)
        return len(added) > 0

    def correct(self, poses: Mapping[int, Pose2], known: tuple[int, Matrix] | None = None) -> None:
        """Move keyframes of this session to corrected poses by ID, and the robot with the newest;
        those of a saved map stay. `known`: ID and (3, 3) covariance of the last that was corrected
        by itself, to which the growth since is added; None if the robot's stays."""
        frozen = {keyframe.pose_id for keyframe in self._saved.keyframes}
        motion = self._chain.correct({i: poses[i] for i in poses if i not in frozen})
        if motion is not None and self._filter is not None:
            own = self._filter
            own.move(motion)
            self._scan_odometry.clear()
            if known is not None:
                pose_id, covariance = known
                before, then = own.relative, self._relative.get(pose_id, own.relative)
                own.place(own.pose, covariance + growth(before, then), with_map=True)
                self._relative = {
                    i: growth(own.relative, growth(before, held))
                    for i, held in self._relative.items()
                }

    def move_keyframes(self, poses: Mapping[int, Pose2]) -> None:
        """Move keyframes of this session to corrected poses by ID; the robot stays, and odometry
        does not tell how it lies to them: a new chain begins."""
        self._chain.correct(poses)
        self._chain.restart()

    def place(self, T_map_base: Pose2, covariance: Matrix | None, frame: Frame) -> None:
        """Set the pose of the robot at a frame: given by the operator or found by relocalisation;
        the only way on from `LOST`."""
        if self._filter is None:
            self._advance(frame)
        if (frame.pose, frame.stamp_ns) != self._odometry:  # which may have jumped
            self._recent_odometry.clear()
            self._recent_odometry.add(frame.pose, frame.stamp_ns)
        self._odometry = (frame.pose, frame.stamp_ns)
        self._place(T_map_base, _PLACED if covariance is None else np.asarray(covariance))

    def _place(self, T_map_base: Pose2, covariance: Matrix) -> None:
        """Set the pose of the robot at the newest frame."""
        self._require_filter().place(T_map_base, covariance)
        self._flow.jump(T_map_base, self._odometry[0])
        self._chain.restart()
        self._begin_again()
        self._unmatched = (math.inf, math.inf)
        self._state.place(self._odometry[1])

    def fuse(self, fix: PositionFix, alike: float = 1.0) -> bool:
        """Fuse an absolute position, one of `alike` fixes whose errors are the same; returns
        whether it was believed.

        It is compared with where the robot was at its stamp, by the odometry since; one from before
        that is dropped. It must lie within the gate around the expected pose, or agree with others
        that contradict it for so long that the robot must have been moved (`place_correction`).
        What contradicts is told by the error of a single fix, however many share it. A lost robot
        is placed by fixes with a heading alone.
        """
        is_lost = self._state.is_lost
        motion = self._recent_odometry.since(fix.stamp_ns)
        if self._filter is None or motion is None or (is_lost and fix.yaw_rad is None):
            return False
        expected = self._pose @ motion.inverse()
        measured = Pose2(x_m=fix.x_m, y_m=fix.y_m, yaw_rad=fix.yaw_rad or 0.0)
        count = 2 if fix.yaw_rad is None else 3
        residual = difference(measured, expected)[:count]
        rows, covariance = np.eye(3), np.asarray(fix.covariance)[:count, :count]
        rows[:2, 2] = self._pose.y_m - expected.y_m, expected.x_m - self._pose.x_m
        rows = rows[:count]
        known = rows @ self._filter.covariance_by_motion @ rows.T
        if is_lost or self._matcher.excludes(residual, known + covariance):
            if self._refused.add(fix.stamp_ns, residual[:2], covariance[:2, :2]):
                if fix.yaw_rad is None:
                    measured = dataclasses.replace(measured, yaw_rad=expected.yaw_rad)
                self._move_to(measured @ motion, covariance, fix.source)
                return True
        else:
            self._refused.confirm(residual[:2], covariance[:2, :2])
            if self._refused_matches.are_contradicted(residual[:2], covariance[:2, :2]):
                self._refused_matches.clear()
        if is_lost or self._matcher.excludes(residual, known + alike * covariance):
            return False
        self._chain.fix(fix, _measured(self._pose, residual, rows), rows)
        self._filter.fuse_position(residual, rows, alike * covariance)
        if fix.yaw_rad is not None and (np.diag(covariance) <= _SURE).all():
            self._state.forget_doubt()  # whatever the scans show there
        return True

    def _move_to(self, there: Pose2, covariance: Matrix, source: FixSource) -> None:
        """Set the estimate to a pose of which `covariance` tells what was measured, the heading or
        not, and begin to track again from there."""
        spread = _PLACED.copy()
        spread[: len(covariance), : len(covariance)] = covariance
        self._shift(there, spread, source)

    def shift(self, there: Pose2, covariance: Matrix) -> None:
        """Correct the estimate to a pose, T_map_base with its (3, 3) covariance, that all scans of
        the last metres tell (`place_correction`), and begin to track again from there."""
        self._shift(there, covariance, None)

    def _shift(self, there: Pose2, spread: Matrix, source: FixSource | None) -> None:
        """Correct the estimate to a pose, and begin to track again from there."""
        shift_m = self._pose.distance_to(there.x_m, there.y_m)
        self.place_correction = PlaceCorrection(source=source, shift_m=shift_m)
        if self._state.is_lost:
            self._place(there, spread)
            return
        self._require_filter().place(there, spread)
        self._chain.restart()
        self._begin_again()

    def _begin_again(self) -> None:
        """Forget what was seen and measured where the robot is not any more."""
        self._recent.clear()
        self._scan_odometry.clear()
        self._refused.clear()
        self._refused_matches.clear()
        self._displacement.clear()
        self._continues = True
        self._state.forget_doubt()

    @property
    def _pose(self) -> Pose2:
        return self._require_filter().pose

    def _require_filter(self) -> PoseFilter:
        if self._filter is None:
            raise RuntimeError("the localiser has no pose before its first frame")
        return self._filter

    def _advance(self, frame: Frame) -> OdometryStep:
        """Follow odometry to a frame."""
        if self._filter is None:
            self._filter = PoseFilter(frame.pose, self._config.odometry)
            self._odometry = (frame.pose, frame.stamp_ns)
            self._state.since_ns = frame.stamp_ns
        before, stamp_ns = self._odometry
        step = OdometryStep.between(
            before,
            frame.pose,
            (frame.stamp_ns - stamp_ns) / 1e9,
            pitch_rad=frame.pitch_rad,
        )
        self._odometry = (frame.pose, frame.stamp_ns)
        self._recent_odometry.add(frame.pose, frame.stamp_ns)
        self._filter.predict(step)
        self._chain.advance(step)
        self._state.since_m += step.distance_m
        self.moved_m = step.distance_m + abs(step.turn_rad) / 2
        self.seen_s = step.seen_s
        self._refused_matches.move(self.moved_m)
        moved_m, moved_rad = self._unmatched
        self._unmatched = (moved_m + step.distance_m, moved_rad + abs(step.turn_rad))
        return step

    def _observe(self, scan: Scan, step: OdometryStep, stamp_ns: int) -> float | None:
        """Match the scan and fuse it; returns the share of points that fit, None if too few points
        can say."""
        least = self._config.match.min_points
        if not len(self._saved):  # which tells the position better than any motion
            self._measure_motion(scan, stamp_ns)
        if len(scan) < least:
            self._state.reckon(stamp_ns)
            return None
        continues = self._recent.are_continued(scan, self._odometry[0], step)
        if continues is None and not self._continues:
            continues = False  # until the surfaces of before are seen again
        self._continues = continues is not False
        found: Match | None = None
        contradicted = False
        for scan_map, absolute in ((self._saved, True), (self._chain.map, False)):
            if not len(scan_map):
                continue
            result = self._matcher.match(scan, scan_map, self._require_filter(), absolute=absolute)
            if absolute and 2 * result.near >= result.points:
                self.saved_share = result.share_of_near
            if absolute and is_elsewhere(result, scan, scan_map, self._config):
                contradicted = True
                break
            if result.near < least:
                continue
            found = result
            # The robot's own map may fit by chance at a place to which the robot was carried.
            is_possible = absolute or continues is not False
            fits = self._fits(result, absolute=absolute)
            is_excluded = fits and self._excludes(result)
            if absolute and fits and not is_excluded:
                is_possible = self._confirms(scan, result)
            if is_possible and fits and not is_excluded:
                self._fuse(scan, result, absolute=absolute)
                self._state.trust(step)
                self._displacement.clear()
                self._state.locate(stamp_ns)
                return result.share if absolute else result.share_of_near
            # Where little of the scan is near the map, the rest is new, and so may this be.
            is_mapped = 2 * result.near >= result.points
            least_fit = self._config.start.share
            is_unfit = result.near >= least_fit * result.points and result.share < least_fit
            if absolute and self._corrects(scan, is_telling=is_excluded or is_unfit):
                break
            if absolute and is_mapped and result.share_of_near <= self._config.tracking.lost_share:
                contradicted = True
                break
        # Where only the robot's own map contradicts, that may have drifted; where there is no map,
        # the scan still continues the last ones.
        if contradicted or not self._continues:
            self._state.doubt(step, stamp_ns)
            self._look_beside(scan, step)
        else:
            if continues:
                self._state.trust(step)
            self._state.reckon(stamp_ns)
        return None if found is None else found.share_of_near

    def _measure_motion(self, scan: Scan, stamp_ns: int) -> None:
        """Follow the motion by scans alone, which also tell when the robot was pushed."""
        push = self._scan_odometry.follow(scan, self._require_filter(), stamp_ns)
        if push is None:
            return
        self.pushed_m = math.hypot(push.motion.x_m, push.motion.y_m)
        self._chain.push(*push)
        self._recent.push(push.motion, self._odometry[0])

    def _fits(self, result: Match, *, absolute: bool) -> bool:
        """Return whether a scan fits a map well enough to be believed."""
        rules = self._config.tracking
        return (
            result.fitting >= self._config.match.min_points
            and result.share_of_near >= rules.located_share
            and (not absolute or result.share >= rules.located_share)
        )

    def _excludes(self, result: Match) -> bool:
        """Return whether odometry excludes a match."""
        shift = difference(result.pose, self._pose)
        covariance = self._require_filter().covariance_by_motion + self._matcher.floor
        return self._matcher.excludes(shift, covariance)

    def _fuse(self, scan: Scan, result: Match, *, absolute: bool) -> None:
        moved_m, moved_rad = self._unmatched
        if moved_m < _MOVED_M and moved_rad < _MOVED_RAD:
            return  # the same view again would say the same with the same errors
        self._unmatched = (0.0, 0.0)
        matcher, own = self._matcher, self._require_filter()
        expected = own.covariance_by_motion if absolute else own.covariance_within
        scale = matcher.scale(result.points, absolute=absolute)
        prior = np.asarray(np.linalg.inv(expected), dtype=np.float64)
        pull, information = result.alone(own.pose, prior, scale)
        own.fuse_match(pull, information, matcher.floor, absolute=absolute)
        if absolute:
            return
        surfaces = self._chain.map.covariance_at(result.pose, scan, self._config.match.fine_m)
        if surfaces is not None:
            own.bound(surfaces + matcher.error(result))

    def _confirms(self, scan: Scan, result: Match) -> bool:
        """Return whether a match with the saved map that the estimate does not exclude holds, and
        forget the fixes and matches that it contradicts. Where the scan fits better at the place of
        those, it has found surfaces beside the right ones."""
        shift, covariance = difference(result.pose, self._pose)[:2], self._matcher.error(result)
        if self._refused_matches.are_contradicted(shift, covariance[:2, :2]):
            if self._looks_elsewhere(scan) is not False:
                return False
            self._refused_matches.clear()
        self._refused.confirm(shift, covariance[:2, :2])
        return True

    def _looks_elsewhere(self, scan: Scan) -> bool | None:
        """Return what the refused matches say of one more scan (`RefusedMatches.look`)."""
        own = self._require_filter()
        return self._refused_matches.look(scan, self._saved, own, self._odometry[0])

    def _look_beside(self, scan: Scan, step: OdometryStep) -> None:
        """Correct the estimate if scans that contradict it fit the saved map beside it."""
        is_tracked = len(self._saved) and not self._state.is_lost
        if not (is_tracked and self.is_confirmed and self._state.doubt_s >= _DOUBTED_S):
            return
        found = self._displacement.find(
            scan, self._saved, self._pose, self._odometry[0], step.seen_s
        )
        if found is not None:
            self._correct_to(found)

    def _corrects(self, scan: Scan, *, is_telling: bool) -> bool:
        """Correct the estimate if matches that it excludes have agreed for long enough; returns
        whether they have. `is_telling`: whether the newest scan may speak against the estimate."""
        refused = self._refused_matches
        if self.is_confirmed and (is_telling or refused.is_open) and refused.is_due():
            self._looks_elsewhere(scan)
        if refused.told is None:
            return False
        self._correct_to(refused.told)
        self.is_agreed = True
        return True

    def _correct_to(self, found: Match) -> None:
        """Correct the estimate to a match beside it."""
        information = self._matcher.scale(found.points, absolute=True) * found.information
        spread = np.linalg.inv(information + np.linalg.inv(_DISPLACED)) + self._matcher.floor
        self._shift(found.pose, spread, None)

    def _keep(self, scan: Scan, frame: Frame) -> None:
        """Make a keyframe of a scan from a new pose."""
        if len(scan) < self._config.match.min_points or not self._continues:
            return
        self._recent.add(scan, frame.pose)
        if self._state.doubt_s == 0.0:
            pose = self._flow.T_map_odom @ frame.pose
            behind = difference(self._pose, pose)
            covariance = self._require_filter().covariance_but_scale + np.outer(behind, behind)
            keyframe = self._chain.add(scan, pose, frame.stamp_ns, covariance, self.constant_errors)
            if keyframe is not None:
                self._relative[keyframe.pose_id] = self._require_filter().relative
                while len(self._relative) > _COVARIANCES:
                    del self._relative[next(iter(self._relative))]

    def lose(self, stamp_ns: int) -> None:
        """Forget the pose: the robot is lost until it is placed."""
        self._state.lose(stamp_ns)

    def estimate(self, frame: Frame, share: float | None = None) -> LocalisationEstimate:
        """Return the estimate for the newest frame, whose scan fits the map by a share."""
        applied = self._flow.T_map_odom @ frame.pose
        behind = difference(self._pose, applied)
        besides = np.outer(behind, behind)
        # As long as fixes or matches contradict it, the robot may be where they have it.
        for offset in (self._refused.offset(frame.stamp_ns), self._refused_matches.offset):
            besides[:2, :2] += np.outer(offset, offset)
        if len(self._saved):
            besides = besides + self._matcher.floor
        return LocalisationEstimate(
            T_map_odom=self._flow.T_map_odom,
            T_map_base=applied,
            covariance=self._require_filter().covariance + besides,
            covariance_by_motion=self._require_filter().covariance_by_motion + besides,
            state=self._state.state,
            match_share=share,
            since_ns=self._state.since_ns,
            since_m=self._state.since_m,
            offset=self._require_filter().offset,
            moved=self._require_filter().moved,
            place_correction=self.place_correction,
            pushed_m=self.pushed_m,
        )


def _measured(pose: Pose2, residual: Matrix, rows: Matrix) -> Pose2:
    """Return the pose that a fix tells: (M,) its difference from what it is at a pose, and (M, 3)
    the derivative by that. A heading that it does not tell is that of the pose."""
    turn = float(residual[2]) if len(residual) > 2 else 0.0
    x, y = (residual[:2] - turn * rows[:2, 2]).tolist()
    return Pose2(x_m=pose.x_m + x, y_m=pose.y_m + y, yaw_rad=wrap_angle(pose.yaw_rad + turn))
