"""Relocalisation: where in a kept map the robot is, believed only when new data says so again.

A high score proves nothing: rooms are alike. A place is believed when clearly more speaks for it
than for every other, scans that played no part in the first answer give the same one, and single
scans have fitted there for some seconds. Until then it is ambiguous.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from navcore.config.localisation.relocalisation import DEFAULT_RELOCALISATION, RelocalisationConfig
from navcore.geometry.transform import Matrix, Pose2
from navcore.localisation.relocalisation.gathered_scans import GatheredScans, Travel
from navcore.localisation.relocalisation.place_check import PlaceCheck, check_place
from navcore.localisation.relocalisation.place_fit import (
    PlaceFit,
    doubt_of,
    elsewhere,
    evaluate_place,
    fit_beside,
    fit_place,
    is_clearly_better,
    is_same_place,
    rivals_of,
)
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.place_search import PlaceSearch
from navcore.localisation.relocalisation.submap import View, submap_of
from navcore.localisation.scans.scan import Scan

SMOOTHED_SCANS = 5
"""Scans over which the share of fitting points is averaged."""
SEARCH_FAILED = "the search failed; drive on or turn round to search again"
"""What is missing after a search that could not be computed."""


class RelocalisationState(StrEnum):
    """How far the search has come."""

    SEARCHING = "searching"
    """No place fits yet; more has to be seen."""
    AMBIGUOUS = "ambiguous"
    """Several places fit, or none well enough; more has to be seen."""
    CONFIRMING = "confirming"
    """One place fits best; new scans have to say so again."""
    ACCEPTED = "accepted"
    """The place is believed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceProposal:
    """What relocalisation says at one moment."""

    state: RelocalisationState
    """How far the search has come."""
    reason: str
    """What is missing, for the operator; empty before the first search, and for nothing."""
    T_map_odom: Pose2 | None = None
    """Pose of odometry's frame in the map at the best place; None without one."""
    covariance: Matrix | None = None
    """(3, 3) covariance of the robot's pose there: x, y along the map's axes in metres, yaw in
    radians."""
    candidates: tuple[PlaceFit, ...] = ()
    """Places of which any may be the one, as far as the last search tells; best first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchTask:
    """What a thread has to search; `search_task` does it."""

    everything: tuple[View, ...]
    """All scans that odometry still connects, at least one, oldest first."""
    recent: tuple[View, ...]
    """Those of the last metres, over which odometry has hardly drifted."""
    newest: tuple[View, ...] = ()
    """Scans since the place was first found; none while these are too few to confirm it."""
    has_only_turned: bool = False
    """Whether the newest scans were taken at about one position."""
    has_looked_round: bool = False
    """Whether all scans together show everything around the robot."""
    given: Pose2 | None = None
    """T_map_base of the newest scan if a place to be checked is right; None without one."""
    last: Pose2 | None = None
    """The same of a lost robot if it is about where odometry has it since the place was believed
    last; None where that tells nothing."""

    @property
    def T_odom_base(self) -> Pose2:
        """Pose of the robot at the newest scan, in odometry's frame: places are those of it."""
        return self.everything[-1][0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchResult:
    """Places found for a task, best first."""

    task: SearchTask
    """What was searched."""
    points: int
    """Number of points of all scans; those of one surface within a cell count as one."""
    everything: tuple[PlaceFit, ...]
    """Places of all scans."""
    newest: tuple[PlaceFit, ...] | None
    """Places of the new scans alone; None while these show too little to confirm a place."""
    again: PlaceFit | None
    """Fit of the new scans alone at the best place of all scans; None without either. A search may
    take the new scans along a wall, where all scans together do not slip."""
    mirrored: tuple[PlaceFit, ...]
    """Places of the mirrored scans, the control: none of them is real, so what a wrong place scores
    in this map is seen by them."""
    given: PlaceFit | None = None
    """Fit near the place to be checked; None without one, or if too little was seen."""
    moved: PlaceFit | None = None
    """Fit of the recent scans near the place to be checked; None as `given` is, of these scans."""
    unmoved: PlaceFit | None = None
    """What of them fits at that place itself."""
    last: PlaceCheck | None = None
    """What the scans say about the place that was believed last; None without one."""

    def beside(self, rules: RelocalisationConfig) -> PlaceFit | None:
        """Return the fit near the place to be checked if the robot is there and not at that place
        itself: the first looks have taken one stretch of a wall, or one shelf, for the next."""
        fit, unmoved = self.moved, self.unmoved
        if fit is None or unmoved is None or fit.fit_share < rules.moved_fit_share:
            return None
        is_better = is_clearly_better(fit, unmoved, rules)
        if not is_better or fit.contradiction(rules) or fit.sigma_m > rules.click_sigma_m:
            return None
        return fit

    def still_there(self, rules: RelocalisationConfig) -> PlaceFit | None:
        """Return the fit at about the place that was believed last if the robot is there: what it
        sees fits there as it must at an operator's place, and nowhere else clearly better.

        Rooms are alike, and a robot that was disturbed or pushed is most probably still where it
        was: of places that fit alike, that is the one.
        """
        if self.last is None or not self.last.is_accepted:
            return None
        fit = self.last.fit
        others = elsewhere(self.everything, fit.T_map_base, rules)
        is_worse = any(is_clearly_better(one, fit, rules) for one in others)
        return None if is_worse else fit


def search_task(
    task: SearchTask,
    place_map: PlaceMap,
    config: RelocalisationConfig = DEFAULT_RELOCALISATION,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> SearchResult | None:
    """Return the places of a task, or None if it was cancelled, which is asked after each slice of
    the searches and for each place that is refined: about every 0.1 s."""
    everything = submap_of(task.everything)
    newest = submap_of(task.newest) if task.newest else None
    if newest is not None and len(newest) < config.search.least_points:
        newest = None
    given = moved = unmoved = None
    if task.given is not None:
        recent = submap_of(task.recent)
        if len(everything) >= config.search.least_points:
            given = fit_place(everything, task.given, place_map, config.fit)
        if len(recent) >= config.search.least_points:
            moved = fit_place(recent, task.given, place_map, config.fit)
            unmoved = evaluate_place(recent, task.given, place_map, config.fit)
    last = None if task.last is None else check_place(everything, task.last, place_map, config)
    found: list[tuple[PlaceFit, ...]] = []
    for submap in (everything, newest, everything.mirrored):
        is_control = len(found) == 2
        if submap is None or (is_control and given is None and doubt_of(found[0], config)):
            found.append(())  # nothing would be believed anyway
            continue
        search = PlaceSearch(submap, place_map, config)
        while not search.advance():
            if is_cancelled():
                return None
        found.append(tuple(search.candidates()))
    again = None
    if found[0]:
        best = fit_beside(everything, found[0][0], place_map, config, is_cancelled)
        found[0] = (best, *found[0][1:])
        if newest is not None:
            again = fit_place(newest, best.T_map_base, place_map, config.fit)
            again = fit_beside(newest, again, place_map, config, is_cancelled)
        if is_cancelled():
            return None
    return SearchResult(
        task=task,
        points=len(everything),
        everything=found[0],
        newest=None if newest is None else found[1],
        again=again,
        mirrored=found[2],
        given=given,
        moved=moved,
        unmoved=unmoved,
        last=last,
    )


class Relocaliser:
    """Gathers scans, says what to search and decides when a place is believed; nothing here takes
    more than a millisecond but `search_task`, which belongs into a thread."""

    def __init__(
        self, place_map: PlaceMap, config: RelocalisationConfig = DEFAULT_RELOCALISATION
    ) -> None:
        """Begin without any scan."""
        self._map = place_map
        self._config = config
        self._seen = GatheredScans(config=config)
        self._searched: Travel | None = None
        self._leading: Pose2 | None = None
        self._leading_since = 0
        self._shares: list[float] = []
        self._tracked_s = 0.0
        """Time in seconds between consecutive scans that have fitted at the leading place."""
        self._has_fitted = False
        """Whether the newest scan is one of these."""
        self.proposal = PlaceProposal(state=RelocalisationState.SEARCHING, reason="")
        """What is known now."""

    def reconsidered(self) -> Relocaliser:
        """Return a search that goes on with the same scans and believes nothing yet."""
        again = Relocaliser(self._map, self._config)
        again._seen, again._searched = self._seen.copy(), self._searched
        return again

    def observe(self, scan: Scan, T_odom_base: Pose2, seen_s: float) -> None:
        """Take one more scan with the odometry of its moment. `seen_s`: time in seconds before it
        that it may tell of."""
        self._seen.add(scan, T_odom_base)
        has_fitted, self._has_fitted = self._has_fitted, False
        if self._leading is None or not len(scan) or not self._fits(scan, T_odom_base):
            return
        self._tracked_s += seen_s if has_fitted else 0.0
        self._has_fitted = True

    def next_task(
        self, T_map_odom: Pose2 | None = None, last: Pose2 | None = None
    ) -> SearchTask | None:
        """Return what to search now, or None until enough new has been seen; `T_map_odom` is a
        place to be checked beside, and `last` the one that was believed last, in the same way."""
        if self._seen.is_empty or not self._has_moved:
            return None
        self._searched = self._seen.travel
        newest: tuple[View, ...] = ()
        has_only_turned = False
        if self._leading is not None:
            newest, has_only_turned = self._seen.newest(self._leading_since)
        everything = self._seen.everything
        T_odom_base, _ = everything[-1]
        return SearchTask(
            everything=everything,
            recent=self._seen.recent,
            newest=newest,
            has_only_turned=has_only_turned,
            has_looked_round=self._seen.has_looked_round,
            given=None if T_map_odom is None else T_map_odom @ T_odom_base,
            last=None if last is None else last @ T_odom_base,
        )

    @property
    def _has_moved(self) -> bool:
        """Whether the robot has come far enough since the last search for another one."""
        if self._searched is None:
            return True
        driven_m = self._seen.travel.driven_m - self._searched.driven_m
        turned_rad = self._seen.travel.turned_rad - self._searched.turned_rad
        return driven_m >= self._config.search_m or turned_rad >= math.radians(
            self._config.search_turn_deg
        )

    def take(self, result: SearchResult) -> PlaceProposal:
        """Return what a finished search changes."""
        if self.proposal.state is RelocalisationState.ACCEPTED:
            return self.proposal
        best, others = result.everything[0] if result.everything else None, result.everything[1:]
        doubt = doubt_of(result.everything, self._config) or self._mirror_doubt(result)
        if best is None or doubt:
            self._leading = None
            self.proposal = PlaceProposal(
                state=RelocalisationState.AMBIGUOUS if best else RelocalisationState.SEARCHING,
                reason=doubt,
                candidates=(best, *rivals_of(best, others, self._config)) if best else (),
            )
            return self.proposal
        T_map_odom = best.T_map_base @ result.task.T_odom_base.inverse()
        if self._leading is None or not is_same_place(
            best.T_map_base, self._expected(result), self._config
        ):
            self._leading_since = self._seen.count
            self._shares, self._tracked_s, self._has_fitted = [], 0.0, False
        self._leading = T_map_odom
        lacking = self._unconfirmed(result)
        # Odometry has drifted least in the newest scans: they say best where the robot is now.
        newest = self._again(result) or best
        self.proposal = PlaceProposal(
            state=RelocalisationState.CONFIRMING if lacking else RelocalisationState.ACCEPTED,
            reason=lacking,
            T_map_odom=newest.T_map_base @ result.task.T_odom_base.inverse(),
            covariance=newest.covariance,
            candidates=(newest,),
        )
        return self.proposal

    def _fits(self, scan: Scan, T_odom_base: Pose2) -> bool:
        """Return whether a scan tells of the leading place, and the newest ones fit there; those
        that do not end the time for which they have."""
        assert self._leading is not None
        fit = evaluate_place(
            submap_of([(T_odom_base, scan)]),
            self._leading @ T_odom_base,
            self._map,
            self._config.fit,
        )
        if fit.agreeing_share is None:
            return False  # the map shows nothing here that would tell
        self._shares = [*self._shares, fit.agreeing_share][-SMOOTHED_SCANS:]
        if sum(self._shares) / len(self._shares) < self._config.tracked_share:
            self._tracked_s = 0.0
            return False
        return True

    def _unconfirmed(self, result: SearchResult) -> str:
        """Return what the leading place still lacks, or nothing."""
        if result.newest is None:
            return "one place fits; drive on or turn round to confirm it"
        again = self._again(result)
        if again is None:
            return "what has been seen since fits better elsewhere"
        if doubt := doubt_of([again], self._config):
            return f"not confirmed yet: {doubt}"
        if again.closeness < self._config.least_closeness:
            return "what has been seen since fits only roughly; drive on to confirm the place"
        if result.task.has_only_turned and not self._is_beyond_doubt(result):
            return "one place fits from here; drive on to confirm it"
        if self._tracked_s < self._config.tracked_s:
            return f"scans have fitted there for {self._tracked_s:.1f} s"
        return ""

    def _again(self, result: SearchResult) -> PlaceFit | None:
        """Return the best place again as the new scans alone show it; None if they fit clearly
        better elsewhere."""
        again, best = result.again, result.everything[0]
        if again is None or result.newest is None:
            return None
        if not is_same_place(again.T_map_base, best.T_map_base, self._config):
            return None
        is_worse = any(is_clearly_better(one, again, self._config) for one in result.newest)
        return None if is_worse else again

    def _mirror_doubt(self, result: SearchResult) -> str:
        """Return the doubt in a place that fits no better than the mirrored scans do: a map in
        which these find a place would be believed wherever the robot is."""
        if rivals_of(result.everything[0], result.mirrored, self._config):
            return "what has been seen fits as well when mirrored; drive on until something differs"
        return ""

    def _is_beyond_doubt(self, result: SearchResult) -> bool:
        """Return whether the robot has seen everything around it, by far the most speaks for one
        place, and hardly anything against it: then a turn at one position is enough."""
        rules, (best, *others) = self._config, result.everything
        rivals = rivals_of(best, [*others, *result.mirrored], rules, margin=rules.turn_margin)
        is_like_the_map = best.contradicted_share < rules.turn_contradicted_share
        return result.task.has_looked_round and is_like_the_map and not rivals

    def _expected(self, result: SearchResult) -> Pose2:
        """Return T_map_base at the leading place."""
        assert self._leading is not None
        return self._leading @ result.task.T_odom_base
