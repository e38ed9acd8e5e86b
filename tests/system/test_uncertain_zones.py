"""A robot that is too uncertain to drive near a zone passes it at a distance, or slowly."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import shapely

from app.episode.episode import Episode, EpisodeSettings
from navcore.config.safety import DEFAULT_SAFETY, KeepOutMonitorConfig
from navcore.geometry.transform import Pose2
from navcore.localisation import zone_margins
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.localisation import Localisation
from navcore.mission.beware_list import default_beware_list
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from tests.reliability.fault_runs import CAMERA, OPEN_FLOOR

Corners = tuple[tuple[float, float], ...]
WORLD = dataclasses.replace(OPEN_FLOOR, start=(-8.0, 0.0, 0.0), goals=((2.5, -0.5),))
BESIDE = ((-1.0, 0.2), (1.0, 0.2), (1.0, 5.0), (-1.0, 5.0))
"""A zone that the shortest path passes closely."""
SIGMA_M, GROWS_OVER_M = 0.2, 8.0
KEPT_M = (
    DEFAULT_SAFETY.keep_out.sigmas * SIGMA_M
    + DEFAULT_SAFETY.keep_out.uncertain_clearance_m
    + HUSKY.width_m / 2
)
"""Distance of the robot's middle from the zone with its whole clearance."""


def driven(
    *,
    from_m: float,
    until_s: float = 25.0,
    over_m: float = GROWS_OVER_M,
    sigma_m: float = SIGMA_M,
    zone: Corners = BESIDE,
    others: tuple[Corners, ...] = (),
) -> tuple[dict[str, Any], float]:
    """The report of a drive past a zone, on which the position becomes uncertain from a place on,
    over a distance, and the least distance of the robot's middle from the zone."""

    def localise(localisation: Localisation, *inputs: Any) -> LocalisationEstimate:
        place = Localisation.update(localisation, *inputs)
        poses.append(place.T_map_base)
        driven_m = max(pose.x_m for pose in poses) - from_m
        now_m = sigma_m * float(np.clip(driven_m / over_m, 0.0, 1.0))
        covariance = np.diag([now_m**2, now_m**2, 1e-4])
        return dataclasses.replace(place, covariance=covariance, covariance_by_motion=None)

    poses: list[Pose2] = []
    episode = Episode(
        WORLD,
        EpisodeSettings(
            beware=default_beware_list(),
            max_time_s=until_s,
            camera=CAMERA,
            zones=(zone, *others),
            stages=Stages(localise=localise),
        ),
        seed=0,
    )
    try:
        report = episode.run()
    finally:
        episode.close()
    places = shapely.points([(pose.x_m, pose.y_m) for pose in poses])
    return report, float(shapely.distance(shapely.Polygon(zone), places).min())


def test_the_path_keeps_the_clearance_of_a_zone_far_ahead() -> None:
    report, nearest_m = driven(from_m=-12.0)
    assert report["goals_reached"] == 1
    assert nearest_m > KEPT_M
    assert report["stops"] == []


def test_a_robot_beside_the_zone_when_its_position_becomes_uncertain_drives_on() -> None:
    report, nearest_m = driven(from_m=-7.0)
    assert report["goals_reached"] == 1
    assert nearest_m > DEFAULT_SAFETY.keep_out.largest_growth_m + HUSKY.width_m / 2
    assert report["stops"] == []


def test_without_the_clearance_the_path_passes_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    without = dataclasses.replace(KeepOutMonitorConfig(), uncertain_clearance_m=0.0)
    make = zone_margins.ZoneMargins.__init__
    monkeypatch.setattr(
        zone_margins.ZoneMargins,
        "__init__",
        lambda self, *inputs, **options: make(self, *inputs, gate=without, **options),
    )
    assert driven(from_m=-12.0, until_s=9.0)[1] < KEPT_M


AHEAD = ((-4.0, -1.0), (-2.5, -1.0), (-2.5, 3.0), (-4.0, 3.0))
"""A zone before which the robot stands, facing it, when its growth comes over it."""


@pytest.mark.long
def test_a_robot_that_the_growth_of_a_zone_comes_over_drives_out_and_on_to_the_goal() -> None:
    report, _ = driven(from_m=-6.0, over_m=0.05, sigma_m=0.6, zone=AHEAD, until_s=60.0)
    assert report["goals_reached"] == 1
    assert report["zone_intrusions"] == 0


def test_without_driving_out_it_backs_off_as_from_what_touches_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(zone_margins.ZoneMargins, "covering_robot", lambda *_: ())
    report, _ = driven(from_m=-6.0, over_m=0.05, sigma_m=0.6, zone=AHEAD, until_s=9.0)
    assert report["stops"] == [] and report["distance_m"] > 2.0
    assert report["zone_intrusions"] == 0


def bar(left_m: float, bottom_m: float, right_m: float, top_m: float) -> Corners:
    return ((left_m, bottom_m), (right_m, bottom_m), (right_m, top_m), (left_m, top_m))


LEFT = bar(-1.0, 1.0, 1.0, 4.0)
OTHERS = (
    bar(-1.0, -4.0, 1.0, -1.0),
    bar(-12.0, 4.0, 6.5, 5.0),
    bar(-12.0, -5.0, 6.5, -4.0),
    bar(-12.0, -4.0, -11.0, 4.0),
    bar(5.5, -4.0, 6.5, 4.0),
)
"""With `LEFT`, zones around two halves of the floor with a passage of 2 m between them, where no
path keeps the clearance."""


@pytest.mark.long
def test_where_no_path_keeps_the_clearance_the_robot_passes_slowly() -> None:
    report, nearest_m = driven(from_m=-12.0, zone=LEFT, others=OTHERS, until_s=50.0)
    assert report["goals_reached"] == 1
    assert nearest_m > DEFAULT_SAFETY.keep_out.sigmas * SIGMA_M + HUSKY.width_m / 2


def test_with_the_clearance_it_finds_no_path_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zone_margins.ZoneMargins, "give_up_clearance", lambda _: None)
    report, _ = driven(from_m=-12.0, zone=LEFT, others=OTHERS, until_s=12.0)
    assert report["stops"][-1]["reason"] == "no_path"
