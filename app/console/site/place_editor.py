"""Where the robot is in the map: told to the operator, and set by the operator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.runtime.control.robot_controller import RobotController
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.errors import Refused
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.relocalisation.place_check import PlaceCheck as CheckedPlace
from navcore.localisation.relocalisation.place_check import check_place
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.submap import submap_of
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tasks import PrepareSearch
from navcore.mission.mission import Goal, checked
from web.interface.localisation import PlaceCheck, PlaceOut
from web.interface.meant_site import require_meant_site

SIGMAS = 2.0
"""Standard deviations of the ellipse that is shown."""
UNCHECKED = np.diag([0.5, 0.5, math.radians(10.0)]) ** 2
"""(3, 3) covariance of a pose that no scan has confirmed."""

_SHOWN = "An operator has shown the robot its place."


class PlaceEditor:
    """Satisfies the console's port `PlaceEdits`. Safe from any thread."""

    def __init__(
        self, controller: RobotController, tell: Callable[[str], None] = lambda text: None
    ) -> None:
        """`tell` logs a sentence."""
        self._controller, self._tell = controller, tell
        self._place_map: tuple[ScanMap, int, PlaceMap] | None = None

    def status(self) -> PlaceOut:
        """Return how well the robot knows where it is."""
        place, searching = self._controller.place, self._controller.intent.searching
        on_trial = place.is_known and self._controller.navigator.map_is_on_trial
        text = in_words(place)
        variances, axes = np.linalg.eigh(place.covariance[:2, :2])
        minor, major = SIGMAS * np.sqrt(np.maximum(variances, 0.0))
        return PlaceOut(
            state=place.state,
            text=f"{text} It is not confirmed yet." if on_trial else text,
            major_m=round(float(major), 3),
            minor_m=round(float(minor), 3),
            axis_rad=round(math.atan2(axes[1, 1], axes[0, 1]), 3),
            yaw_sigma_rad=round(math.sqrt(max(float(place.covariance[2, 2]), 0.0)), 4),
            match_share=None if place.match_share is None else round(place.match_share, 3),
            since_m=round(place.since_m, 2),
            candidates=place.candidates,
            on_trial=on_trial,
            searching=searching,
            T_map_odom=place.T_map_odom,
        )

    def check(self, pose: Pose2) -> PlaceCheck:
        """Match the newest scan near a pose; raises `BadGeometry` for one too far away."""
        scan = self._scan()
        return _answer(scan, self._checked(scan, pose))

    def place(self, pose: Pose2, *, force: bool) -> PlaceCheck:
        """Set the robot's pose to where the newest scan fits best near a pose; with `force` to the
        pose itself where it does not fit."""
        self._controller.require_standing("show its place")
        site_id, scan = self._controller.intent.site_id, self._scan()
        require_meant_site()
        stood = self._controller.place.T_driven_base
        found = self._checked(scan, pose)
        answer, covariance = _answer(scan, found), found.fit.covariance
        if not found.is_accepted:
            if not force:
                raise Refused(answer.text)
            answer = replace(answer, pose=pose, scan=pose.to_parent(scan.points_base))
            covariance = UNCHECKED
        # It may have been driven by hand since the scan: the tables of a large map take seconds.
        self._controller.require_standing("show its place")
        moved = stood.inverse() @ self._controller.place.T_driven_base
        self._controller.place_robot(
            answer.pose @ moved, covariance, is_sure=found.is_accepted, site_id=site_id
        )
        against = f"An operator has put the robot where the check spoke against it: {answer.text}"
        self._tell(_SHOWN if found.is_accepted else against)
        return answer

    def search(self) -> None:
        """Look for the robot's place in the whole map while it turns round."""
        site_id = self._controller.intent.site_id
        require_meant_site()
        self._controller.search_place(site_id=site_id)

    def _scan(self) -> Scan:
        scan = self._controller.navigator.localisation.scan
        if scan is None:
            raise Refused("the camera has not delivered an image yet")
        return scan

    def _checked(self, scan: Scan, pose: Pose2) -> CheckedPlace:
        # A place to which the map cannot grow is refused as a goal there is.
        checked(Goal(id=0, x_m=pose.x_m, y_m=pose.y_m), self._controller.navigator.map.spec)
        rules = self._controller.navigator.config.localisation.relocalisation
        searched = self._controller.navigator.localisation.searched_map
        tables = self._tables(searched, rules)
        return check_place(submap_of([(IDENTITY, scan)]), pose, tables, rules)

    def _tables(self, searched: ScanMap, rules: RelocalisationConfig) -> PlaceMap:
        """Return the search tables of a map, made again where it has changed."""
        made, version = self._place_map, searched.version
        if made is not None and made[0] is searched and made[1] == version:
            return made[2]
        tables = PrepareSearch.of(searched, rules).run(lambda: False)
        self._place_map = searched, version, tables
        return tables


def _answer(scan: Scan, found: CheckedPlace) -> PlaceCheck:
    fit = found.fit
    text = f"{fit.fit_share:.0%} of what the camera sees fits the map here."
    if found.reason:
        text = f"{found.reason[0].upper()}{found.reason[1:]}."
    return PlaceCheck(
        pose=fit.T_map_base,
        match_share=round(fit.fit_share, 3) if len(scan) else None,
        fits=found.is_accepted,
        text=text,
        scan=fit.T_map_base.to_parent(scan.points_base),
    )


def require_known(place: LocalisationEstimate) -> None:
    """Raise `Refused` while the robot does not know where it is."""
    if place.state is LocalisationState.CHECKING:
        raise Refused("the robot is still comparing what it sees with the map; try again shortly")
    if not place.is_known:
        raise Refused("the robot does not know where it is; show its place on the map")


def in_words(place: LocalisationEstimate) -> str:
    """Return what the robot knows of its place, and what the search for it lacks."""
    words = _state_in_words(place)
    return f"{words} So far: {place.reason}." if place.reason else words


def _state_in_words(place: LocalisationEstimate) -> str:
    sigma = f"± {SIGMAS * place.sigma_m:.2f} m"
    match place.state:
        case LocalisationState.LOCATED:
            share = "" if place.match_share is None else f", {place.match_share:.0%} fits the map"
            return f"Located ({sigma}{share})."
        case LocalisationState.DEAD_RECKONING:
            return f"By the wheels alone since {place.since_m:.0f} m ({sigma})."
        case LocalisationState.CHECKING:
            return "Comparing what the camera sees with the map."
        case LocalisationState.AMBIGUOUS:
            count = len(place.candidates)
            which = "its place" if count < 2 else f"which of {count} places it is at"
            return (
                f"Unsure about {which}: let it look round, drive it by hand, or show its place on "
                "the map."
            )
        case LocalisationState.LOST:
            return "Lost: let it look round, drive it by hand, or show its place on the map."
