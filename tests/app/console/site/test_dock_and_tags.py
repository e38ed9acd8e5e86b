"""Dock and tags of a site: what the camera sees of tags, and where the robot is expected."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from app.console.site.dock_and_tags import dock_of, furnish, seen_tags, tags_of
from app.console.site.sites import LAST_PLACE, expected_place
from app.storage import Store
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.fixes import TagMap
from navcore.navigator import TickResult
from sim.scenario import tags as scenario_tags
from sim.simulator import Simulator
from tests.sim.worlds import open_floor
from web.interface.sites import Tag

HERE = Pose2(x_m=0.5, y_m=-0.25, yaw_rad=0.3)
TRUE = HERE @ Pose2(x_m=2.2, y_m=0.3, yaw_rad=0.0)
"""Position of the tag."""
DOCK = Pose2(x_m=-2.0, y_m=1.0, yaw_rad=0.5)


def decision(place: LocalisationEstimate) -> TickResult:
    """A tick in a world with the tag 12, 2 m ahead and a little to the left."""
    tag = scenario_tags.Tag(id=12, at=(TRUE.x_m, TRUE.y_m), yaw_deg=200.0)
    world = dataclasses.replace(open_floor(), tags=(tag,))
    with Simulator(world, seed=0, camera_rate_hz=0.001) as simulator:
        simulator.teleport(HERE)
        frame = simulator.capture()
    return cast(TickResult, SimpleNamespace(frame=frame, place=place))


def located() -> LocalisationEstimate:
    return LocalisationEstimate(
        T_map_base=HERE,
        covariance=np.diag([0.02, 0.02, 0.01]) ** 2,
        state=LocalisationState.LOCATED,
    )


def test_a_tag_in_view_is_where_it_is_and_less_surely_than_the_robot_knows_its_place() -> None:
    (seen,) = seen_tags(decision(located()), 0.3, TagMap())
    assert (seen.tag.id, seen.tag.size_m, seen.known) == (12, 0.3, False)
    assert math.hypot(seen.tag.x_m - TRUE.x_m, seen.tag.y_m - TRUE.y_m) < 0.1
    assert seen.tag.z_m == pytest.approx(0.6, abs=0.05)
    assert math.degrees(seen.tag.yaw_rad) % 360 == pytest.approx(200.0, abs=6.0)
    assert 0.02 < seen.tag.sigma_m < 0.2


def test_what_was_seen_is_stored_with_its_uncertainty_and_known_from_then_on(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path)
    (seen,) = seen_tags(decision(located()), 0.3, TagMap())
    furnish(store.site, None, (seen.tag,))
    told = tags_of(store.site)
    assert np.sqrt(np.diag(told.tags[12].covariance)) == pytest.approx(
        [seen.tag.sigma_m, seen.tag.sigma_m, seen.tag.sigma_rad]
    )
    (again,) = seen_tags(decision(located()), 0.3, told)
    assert again.known
    store.close()


def test_a_robot_that_does_not_know_where_it_is_cannot_place_a_tag() -> None:
    lost = dataclasses.replace(located(), state=LocalisationState.LOST)
    for unknown in (None, decision(lost)):
        with pytest.raises(Refused, match="does not know where it is"):
            seen_tags(unknown, 0.3, TagMap())


def test_the_robot_is_expected_in_its_dock_until_it_was_known_to_be_elsewhere(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path)
    assert expected_place(store.site) is None
    furnish(store.site, DOCK, (Tag(id=1, x_m=0, y_m=0, z_m=0, yaw_rad=0, size_m=0.2),))
    assert dock_of(store.site) == expected_place(store.site) == DOCK
    store.site.save_document(*LAST_PLACE, dataclasses.asdict(HERE))
    assert expected_place(store.site) == HERE
    store.close()
