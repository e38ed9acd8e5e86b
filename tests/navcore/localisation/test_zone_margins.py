"""Margins of zones follow the robot's uncertainty relative to the zone."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from navcore.config.localisation.zone_margins import ZoneMarginConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.transform import Pose2
from navcore.localisation import zone_margins
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.estimate import LocalisationState as State
from navcore.localisation.zone_margins import ZoneMargins
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_growth import (
    covering,
    distance_m,
    grow,
    grown_outlines,
    polygon_of,
    spread_of,
)
from navcore.robot.profile import HUSKY
from sim.truth.random_missions import EXTRA_CLEARANCE_M
from tests.navcore.mission.test_zone_growth import ROOMS

ZONE = Zone(id="z", name="z", polygon=((1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)))


MARGIN_M = 0.15


def margins_of(*, frozen: bool = False) -> ZoneMargins:
    return ZoneMargins(HUSKY, safety_margin_m=MARGIN_M, frozen=frozen)


def place(x_m: float, sigma_m: float) -> LocalisationEstimate:
    return LocalisationEstimate(
        T_map_base=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
        covariance=np.diag([sigma_m**2, (2 * sigma_m) ** 2, 0.0]),
    )


def test_zone_and_margin_contain_what_uncertainty_and_margin_need_at_every_step() -> None:
    margins, needed_before, changes = margins_of(), None, 0
    for step in range(400):
        sigma_m = 0.2 * step / 400
        (grown,) = margins.follow((ZONE,), place(0.1 * step, sigma_m))
        asked_m = GATE.sigmas * sigma_m * np.array([1.0, 2.0])
        needed = grown_outlines(ZONE.polygon, np.diag(np.hypot(asked_m, MARGIN_M)))[0]
        if 2 * GATE.sigmas * sigma_m > ZoneMarginConfig().negligible_m:
            # The circumscribed arcs are polygons themselves: they differ by a millimetre.
            kept = Polygon(grown.polygon).buffer(MARGIN_M + 0.006)
            assert kept.contains(Polygon(needed))
        changes += grown is not needed_before
        needed_before = grown
    assert 2 <= changes <= 40  # every change costs a costmap


def beyond_the_planners_zone_m() -> float:
    """How far at most the gate's area reaches beyond the zone that the planner keeps out of, with
    its margin, while the uncertainty grows, in metres."""
    margins, beyond_m = margins_of(frozen=True), -MARGIN_M
    for step in range(300):
        here = place(0.1 * step, 0.02 + 0.1 * step / 300)
        (planned,) = margins.follow((ZONE,), here)
        gates = grow(ZONE, spread_of(covering(here.covariance[:2, :2]), GATE.sigmas))
        away = shapely.distance(polygon_of(planned.polygon), shapely.points(gates.polygon))
        beyond_m = max(beyond_m, float(away.max()) - MARGIN_M)
    return beyond_m


def test_the_planner_keeps_out_of_all_that_the_gate_forbids() -> None:
    assert beyond_the_planners_zone_m() < -0.02


def test_by_the_margin_alone_the_planner_would_lead_where_the_gate_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(zone_margins, "beyond_margin", lambda spread, _: 0 * spread)
    assert beyond_the_planners_zone_m() > 0.02


def passage_m(sigma_m: float) -> float:
    """Width in metres of the narrowest passage between the zone and a wall to its left that the
    planner leads through."""
    here = place(-10.0, sigma_m)
    round_ = dataclasses.replace(here, covariance=sigma_m**2 * np.eye(3))
    (planned,) = margins_of(frozen=True).follow((ZONE,), round_)
    return HUSKY.width_m + 2 * MARGIN_M + 11.0 - gap_m(planned, -10.0)


def test_a_robot_uncertain_by_a_decimetre_passes_a_zone_that_leaves_what_missions_leave(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left_m = HUSKY.width_m + 2 * (MARGIN_M + EXTRA_CLEARANCE_M)
    assert passage_m(0.1) < left_m - 0.05
    monkeypatch.setattr(zone_margins, "beyond_margin", lambda spread, _: spread)  # control
    assert passage_m(0.1) > left_m


def test_a_zone_drawn_beside_the_robot_is_exact_however_far_it_has_come() -> None:
    margins = margins_of()
    for x_m in np.arange(-50.0, 1.0, 0.5):
        margins.follow((), place(float(x_m), 0.3))
    assert margins.follow((ZONE,), place(1.0, 0.3)) == (ZONE,)
    (later,) = margins.follow((ZONE,), place(20.0, 0.5))
    assert Polygon(later.polygon).area > Polygon(ZONE.polygon).area + 1.0


def test_on_a_way_that_it_drives_every_day_the_newest_drive_alone_is_remembered() -> None:
    margins = margins_of()
    for day in range(5):
        for x_m in np.arange(-10.0, 1.0, 0.3):
            margins.follow((), place(float(x_m), 0.1 * day))
    assert len(margins._trail) <= 23
    assert margins.follow((ZONE,), place(1.0, 0.4)) == (ZONE,)


def test_zones_of_a_loaded_map_belong_to_its_frame() -> None:
    margins = margins_of(frozen=True)
    margins.follow((), place(0.0, 0.2))
    (grown,) = margins.follow((ZONE,), place(1.0, 0.2))
    assert Polygon(grown.polygon).area > Polygon(ZONE.polygon).area + 1.0


def test_growth_is_given_back_when_the_robot_is_certain_again() -> None:
    margins = margins_of(frozen=True)
    assert margins.follow((ZONE,), place(0.0, 0.2)) != (ZONE,)
    assert margins.follow((ZONE,), place(0.0, 0.0)) == (ZONE,)


def growth_m(anchored: LocalisationEstimate, now: LocalisationEstimate) -> float:
    """How far a zone that was drawn beside one place is grown at a later estimate, in metres."""
    margins = margins_of()
    margins.follow((ZONE,), anchored)
    (grown,) = margins.follow((ZONE,), now)
    return math.sqrt(Polygon(grown.polygon).area) - math.sqrt(Polygon(ZONE.polygon).area)


def both(in_map_m: float, by_motion_m: float) -> LocalisationEstimate:
    """An estimate whose position is uncertain by so much in the map, and by its motion."""
    in_map, by_motion = (sigma_m**2 * np.eye(3) for sigma_m in (in_map_m, by_motion_m))
    return LocalisationEstimate(covariance=in_map, covariance_by_motion=by_motion)


def test_a_zone_drawn_at_the_start_is_kept_by_the_position_in_the_map() -> None:
    start = both(0.0, 0.0)
    came_back, never_was = both(0.05, 0.3), both(0.3, 0.3)
    assert 0 < growth_m(start, came_back) < 0.1 < 0.3 < growth_m(start, never_was)


def corrected(before_m: float, after_m: float, *, with_map: bool) -> LocalisationEstimate:
    """An estimate that an absolute position, or a closed loop, has made more certain."""
    shrunk = (before_m**2 - after_m**2) * np.eye(2)
    offset = shrunk if with_map else 2.0 * shrunk
    return dataclasses.replace(both(after_m, after_m), offset=offset)


def test_an_absolute_position_leaves_a_zone_as_uncertain_as_the_robot_was() -> None:
    """The estimate jumps by what it has drifted, and the zone stays where it was drawn."""
    assert growth_m(both(0.3, 0.3), corrected(0.3, 0.02, with_map=False)) > 0.3
    assert growth_m(both(0.03, 0.03), corrected(0.03, 0.02, with_map=False)) < 0.1  # RTK


def test_a_closed_loop_moves_a_zone_with_the_robot() -> None:
    assert growth_m(both(0.3, 0.3), corrected(0.3, 0.05, with_map=True)) == 0.0
    later = dataclasses.replace(
        corrected(0.3, 0.05, with_map=True), covariance_by_motion=0.15**2 * np.eye(3)
    )
    assert growth_m(both(0.3, 0.3), later) > 0.2


def test_a_place_that_is_not_known_is_no_anchor_of_a_zone() -> None:
    margins, lost = margins_of(), dataclasses.replace(place(1.0, 0.1), state=State.LOST)
    margins.follow((), place(-20.0, 0.0))
    margins.follow((), lost)
    (grown,) = margins.follow((ZONE,), place(-21.0, 0.1))
    assert grown != ZONE


def test_relative_to_a_place_far_in_the_map_both_positions_count() -> None:
    """Certain at the start again, the robot still does not know where that place is."""
    there, start = both(0.3, 0.3), both(0.0, 0.42)
    assert growth_m(there, start) > 0.3
    assert growth_m(there, there) == 0.0  # control: beside the place itself


def test_a_passage_opens_when_the_robot_comes_back_to_where_it_is_more_certain() -> None:
    margins = margins_of(frozen=True)
    (before,) = margins.follow((ZONE,), place(0.0, 0.13))
    (after,) = margins.follow((ZONE,), place(0.0, 0.08))
    (fresh,) = margins_of(frozen=True).follow((ZONE,), place(0.0, 0.08))
    assert after.polygon == fresh.polygon
    assert Polygon(before.polygon).area > Polygon(after.polygon).area + 0.3


GATE = DEFAULT_SAFETY.keep_out
SITE = dataclasses.replace(
    ZONE,
    kind=ZoneKind.STAY_INSIDE,
    polygon=((-40.0, -20.0), (1.0, -20.0), (1.0, 20.0), (-40.0, 20.0)),
)
"""A site whose edge lies where the zone begins."""


def gap_m(zone: Zone, x_m: float) -> float:
    """Distance in metres of a point on the x axis from what a zone forbids."""
    return float(distance_m(zone, shapely.points([(x_m, 0.0)]))[0])


@pytest.mark.parametrize("zone", [ZONE, SITE], ids=["zone", "site"])
def test_a_zone_relative_to_which_the_position_is_too_uncertain_has_the_gates_clearance(
    zone: Zone,
) -> None:
    # place() is twice as uncertain along y.
    least_m = GATE.largest_growth_m / GATE.sigmas / 2
    margins = margins_of(frozen=True)
    (certain,) = margins.follow((zone,), place(-10.0, 0.98 * least_m))
    (uncertain,) = margins.follow((zone,), place(-10.0, 1.02 * least_m))
    lost_m = gap_m(certain, -10.0) - gap_m(uncertain, -10.0)
    assert GATE.uncertain_clearance_m <= lost_m < GATE.uncertain_clearance_m + 0.08
    # It is not given back at once: the path would change to and fro.
    assert margins.follow((zone,), place(-10.0, 0.98 * least_m)) == (uncertain,)
    assert gap_m(margins.follow((zone,), place(-10.0, 0.7 * least_m))[0], -10.0) > 10.5


def test_a_speed_limit_has_no_clearance() -> None:
    limit = dataclasses.replace(ZONE, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3)
    closed, open_ = (
        margins_of(frozen=True).follow((zone,), place(-10.0, 0.1))[0] for zone in (ZONE, limit)
    )
    drawn_m, growth_m = gap_m(limit, -10.0), 1.5 * GATE.sigmas * 0.1
    assert gap_m(open_, -10.0) > drawn_m - growth_m
    assert gap_m(closed, -10.0) < drawn_m - 0.9 * GATE.uncertain_clearance_m  # control


def test_a_speed_limit_grows_by_all_of_the_uncertainty_as_no_margin_is_kept_from_it() -> None:
    limit = dataclasses.replace(ZONE, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3)
    beside = {}
    for zone in (limit, ZONE):
        margins = margins_of()
        margins.follow((zone,), place(0.0, 0.0))
        (grown,) = margins.follow((zone,), place(0.0, 0.05))
        beside[zone.kind] = zone.bounds[0] - grown.bounds[0]
    assert beside[ZoneKind.SPEED_LIMIT] >= GATE.sigmas * 0.05
    assert (
        beside[ZONE.kind] < 0.5 * GATE.sigmas * 0.05
    )  # control: the planner's margin does the rest


def test_the_clearance_gives_way_to_a_robot_that_is_nearer_and_comes_back_behind_it() -> None:
    margins, reach_m = margins_of(frozen=True), []
    for x_m in (-0.1, -0.2, -0.4, -1.5, -0.6):
        here = place(x_m, 0.1)
        (grown,) = margins.follow((ZONE,), here)
        footprint = shapely.polygons(here.T_map_base.to_parent(HUSKY.footprint()))
        assert distance_m(grown, np.array([footprint]))[0] > 0.0
        reach_m.append(11.0 - gap_m(grown, -10.0))
    # How far the zone reaches beyond its edge grows as the robot drives away, and stays so.
    assert reach_m[0] < reach_m[1] < reach_m[2] == reach_m[3] == reach_m[4]


def test_the_zone_whose_growth_the_robot_is_in_is_named_until_it_is_out() -> None:
    margins = margins_of()

    def covering(x_m: float, sigma_m: float) -> list[str]:
        here = place(x_m, sigma_m)
        margins.follow((ZONE,), here)
        return [one.zone.id for one in margins.covering_robot((ZONE,), here)]

    assert covering(0.2, 0.0) == []
    assert covering(0.2, 0.3) == [ZONE.id]
    assert covering(-0.5, 0.3) == []
    assert covering(0.8, 0.3) == []  # the body is in the zone itself: to leave it takes an order


def test_a_robot_in_the_smaller_part_of_a_site_is_not_in_its_growth() -> None:
    site = dataclasses.replace(ZONE, polygon=ROOMS, kind=ZoneKind.STAY_INSIDE)
    margins, here = margins_of(), place(2.8, 0.2)
    margins.follow((site,), place(-4.0, 0.0))
    margins.follow((site,), here)
    assert margins.covering_robot((site,), here) == ()


def test_the_clearance_is_given_up_where_it_closes_the_way() -> None:
    margins = margins_of(frozen=True)
    (clear,) = margins.follow((ZONE,), place(-10.0, 0.1))
    assert margins.keeps_clearance
    margins.give_up_clearance()
    (bare,) = margins.follow((ZONE,), place(-10.0, 0.1))
    assert not margins.keeps_clearance
    assert gap_m(bare, -10.0) == pytest.approx(
        gap_m(clear, -10.0) + GATE.uncertain_clearance_m, abs=0.03
    )
    margins.restore_clearance()
    assert margins.follow((ZONE,), place(-10.0, 0.1)) == (clear,)
