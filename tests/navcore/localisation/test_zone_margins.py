"""Margins of zones follow the robot's uncertainty relative to the zone."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from navcore.config.zone_margins import ZoneMarginConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.zone_margins import ZoneMargins
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import grown_polygon, spread_of

ZONE = Zone(id="z", name="z", polygon=((1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)))


def place(x_m: float, sigma_m: float) -> LocalisationEstimate:
    return LocalisationEstimate(
        T_map_base=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
        covariance=np.diag([sigma_m**2, (2 * sigma_m) ** 2, 0.0]),
    )


def test_a_zone_contains_what_the_present_uncertainty_needs_at_every_step() -> None:
    margins, needed_before, changes = ZoneMargins(), None, 0
    for step in range(400):
        sigma_m = 0.2 * step / 400
        (grown,) = margins.follow((ZONE,), place(0.1 * step, sigma_m))
        needed = grown_polygon(
            ZONE.polygon,
            spread_of(place(0.0, sigma_m).covariance, ZoneMarginConfig().sigmas),
        )
        if 2 * ZoneMarginConfig().sigmas * sigma_m > ZoneMarginConfig().negligible_m:
            # The circumscribed arcs are polygons themselves: they differ by a millimetre.
            assert Polygon(grown.polygon).buffer(0.006).contains(Polygon(needed))
        changes += grown is not needed_before
        needed_before = grown
    assert 2 <= changes <= 40  # every change costs a costmap


def test_a_zone_drawn_beside_the_robot_is_exact_however_far_it_has_come() -> None:
    margins = ZoneMargins()
    for x_m in np.arange(-50.0, 1.0, 0.5):
        margins.follow((), place(float(x_m), 0.3))
    assert margins.follow((ZONE,), place(1.0, 0.3)) == (ZONE,)
    (later,) = margins.follow((ZONE,), place(20.0, 0.5))
    assert Polygon(later.polygon).area > Polygon(ZONE.polygon).area + 1.0


def test_zones_of_a_loaded_map_belong_to_its_frame() -> None:
    margins = ZoneMargins(frozen=True)
    margins.follow((), place(0.0, 0.2))
    (grown,) = margins.follow((ZONE,), place(1.0, 0.2))
    assert Polygon(grown.polygon).area > Polygon(ZONE.polygon).area + 1.0


def test_growth_is_given_back_when_the_robot_is_certain_again() -> None:
    margins = ZoneMargins(frozen=True)
    assert margins.follow((ZONE,), place(0.0, 0.2)) != (ZONE,)
    assert margins.follow((ZONE,), place(0.0, 0.0)) == (ZONE,)
