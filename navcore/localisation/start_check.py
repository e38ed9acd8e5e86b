"""Confirmation of a place in a map: of a start by its first looks, and of a start and of a place
that a search has found by what is seen on the first metres from there."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.localisation import StartConfig
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Matrix, Pose2, wrap_angle
from navcore.localisation.new_way import NewWay
from navcore.localisation.relocalisation.place_fit import (
    PlaceFit,
    doubt_of,
    elsewhere,
    is_clearly_better,
    is_same_place,
    rivals_of,
)
from navcore.localisation.relocalisation.relocalisation import SearchResult


class StartCheck:
    """Believes the place once the scans have fitted there for a while, unless more speaks for
    another place of the map.

    Where too little is in view to tell, the place is believed as it was given if the robot can
    stand nowhere else: nothing speaks against it, and the robot goes on by dead reckoning. If it
    can, the place stays open until enough comes into view. Much in view where the map shows nothing
    is no such case: this may be another map.
    """

    def __init__(self, config: StartConfig, rules: RelocalisationConfig) -> None:
        self._config, self._rules = config, rules
        self._is_better_elsewhere: bool | None = None
        self._looked_s: float | None = None
        self._seen_s: float | None = None
        self._fits_s: float | None = None
        self.is_looking = True
        """Whether the time for which the first looks may take is not over."""

    @property
    def covariance(self) -> Matrix:
        """(3, 3) covariance of the place that was given."""
        sigma_rad = math.radians(self._config.sigma_deg)
        return np.diag([self._config.sigma_m, self._config.sigma_m, sigma_rad]) ** 2

    def take(self, result: SearchResult) -> None:
        """Receive what a search of the whole map says about the place: of few points many places
        explain more by chance."""
        if result.given is not None:
            tells = result.points >= self._config.telling_points
            rivals = _rivals(result, result.given, self._rules)
            is_better = _is_worse(result.given, rivals, self._rules)
            self._is_better_elsewhere = tells and is_better

    def after(
        self,
        share: float | None,
        points: int,
        seen_s: float,
        *,
        may_be_elsewhere: bool,
        is_searching: bool = False,
    ) -> bool | None:
        """Return whether the place is believed after one more frame, whose scan has `points` of
        which a share fits the saved map, None where it shows none of them; None while it is
        open, and while the first search of the map is under way (`is_searching`). `seen_s`: time in
        seconds before the frame that it may tell of."""
        config = self._config
        self._looked_s = _with(self._looked_s, seen_s)
        if self._seen_s is not None or share is not None or points >= config.telling_points:
            self._seen_s = _with(self._seen_s, seen_s)
        fits = share is not None and share >= config.share
        self._fits_s = _with(self._fits_s, seen_s) if fits else None
        if _has_passed(self._fits_s, config.fitting_s):
            waits = self._is_better_elsewhere is None and is_searching
            if not waits or _has_passed(self._fits_s, config.decide_s):
                return not self._is_better_elsewhere
            return None
        if _has_passed(self._seen_s, config.decide_s):
            return False
        waits = _has_passed(self._looked_s, config.decide_s)
        self.is_looking = self._seen_s is not None or not waits
        return None if self.is_looking or may_be_elsewhere else True


def _with(so_far_s: float | None, seen_s: float) -> float:
    """Return the time in seconds since the first frame after one more; None before the first."""
    return 0.0 if so_far_s is None else so_far_s + seen_s


def _has_passed(so_far_s: float | None, seconds: float) -> bool:
    return so_far_s is not None and so_far_s >= seconds


class Probation:
    """The first metres from a place that the first looks, or a search, have confirmed.

    Rooms are alike: a wrong map fits, too, where the robot stands. What the robot has seen on its
    way has to fit as well, nothing of the map may speak against it, and neither another place of
    the map nor the mirrored scans may fit as well. Where little fits, but nothing else does better,
    much of it is new, as in a room that the map does not show yet: the place stays open.
    """

    def __init__(self, config: StartConfig, rules: RelocalisationConfig) -> None:
        self._config, self._rules = config, rules
        self._unfit_m, self._proof = 0.0, NewWay(config.probation_m)
        self._is_unfit, self._doubts = False, 0
        self._verdict: bool | None = None
        self._other: Pose2 | None = None
        self._agreeing = 0
        self.is_new = False
        """Whether little of what was seen fits: the robot is where the map does not tell."""
        self.correction: tuple[Pose2, Matrix] | None = None
        """The place beside this one that the searches which refute it have found alone: T_map_odom,
        and the (3, 3) covariance of the robot's pose there."""

    def take(self, result: SearchResult) -> None:
        """Receive what a search says about the place."""
        given, rules = result.given, self._rules
        if given is None or self._verdict is not None:
            return
        rivals = _rivals(result, given, rules)
        fits = given.fit_share >= rules.least_fit_share
        self._is_unfit, self.is_new = not fits and len(rivals) > 0, not fits
        if fits:
            self._unfit_m = 0.0
        is_worse = _is_worse(given, rivals, rules)
        self._doubts = self._doubts + 1 if is_worse or given.refutation(rules) else 0
        self._note_other(result, given if is_worse else None)
        if self._doubts >= self._config.doubts:
            self._verdict = False
        elif self._proof.is_enough and not (self._doubts or rivals):
            self._verdict = True if fits else None

    def _note_other(self, result: SearchResult, given: PlaceFit | None) -> None:
        """Note the place beside the given one, which fits clearly worse, that a search has found
        alone, and whether the searches before it have found the same."""
        before, self._other = self._other, None
        best, rules = result.everything[0] if result.everything else None, self._rules
        if (
            given is None
            or best is None
            or doubt_of(result.everything, rules)
            or rivals_of(best, result.mirrored, rules)
            or not _is_sure(best, rules)
            or not _is_beside(best, given, self._config)
        ):
            self._agreeing = 0
            return
        T_odom_base = result.task.T_odom_base
        is_same = before is not None and is_same_place(best.T_map_base, before @ T_odom_base, rules)
        self._other = best.T_map_base @ T_odom_base.inverse()
        self._agreeing = self._agreeing + 1 if is_same else 1
        if self._agreeing >= self._config.doubts:
            self.correction = self._other, best.covariance

    def after(self, moved_m: float, T_odom_base: Pose2) -> bool | None:
        """Return whether the place is right after one more frame, before which the robot has moved
        by some metres; None while it is open."""
        self._proof.follow(T_odom_base)
        self._unfit_m += moved_m if self._is_unfit else 0.0
        return False if self._unfit_m >= self._config.unfit_m else self._verdict


def _is_sure(place: PlaceFit, rules: RelocalisationConfig) -> bool:
    """Return whether as much fits at a place, and as closely, as the robot is moved there for."""
    return (
        place.fit_share >= rules.moved_fit_share
        and place.closeness >= rules.least_closeness
        and place.sigma_m <= rules.click_sigma_m
    )


def _is_beside(place: PlaceFit, other: PlaceFit, config: StartConfig) -> bool:
    here, there = place.T_map_base, other.T_map_base
    turn = abs(wrap_angle(here.yaw_rad - there.yaw_rad))
    is_near = here.distance_to(there.x_m, there.y_m) <= config.beside_m
    return is_near and turn <= math.radians(config.beside_deg)


def _is_worse(given: PlaceFit, rivals: list[PlaceFit], rules: RelocalisationConfig) -> bool:
    """Return whether clearly more speaks for one of its rivals than for a place."""
    return any(is_clearly_better(one, given, rules) for one in rivals)


def _rivals(result: SearchResult, given: PlaceFit, rules: RelocalisationConfig) -> list[PlaceFit]:
    """Return the other places, and those of the mirrored scans, that fit nearly as well as the
    given one."""
    others = elsewhere(result.everything, given.T_map_base, rules)
    return rivals_of(given, [*others, *result.mirrored], rules)
