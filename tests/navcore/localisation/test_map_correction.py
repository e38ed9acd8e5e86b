"""Loop closures on their way to the map."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

from navcore.config.localisation.localisation import TrackingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.grid.grid import GridSpec
from navcore.localisation.localisation import Localisation
from navcore.localisation.map_correction import MapCorrection, PrepareCorrection
from navcore.localisation.tasks import TaskFailed
from navcore.mapping.point_map import PointMap


def test_a_correction_that_fails_is_given_up_and_other_work_goes_on() -> None:
    localisation = SimpleNamespace(
        closures=object(), corrected=lambda _: ({}, None), next_task=lambda: "the next search"
    )
    point_map = PointMap(
        GridSpec.centred(size_m=(4.0, 4.0), resolution_m=0.1), NavigatorConfig().map
    )
    correction = MapCorrection(point_map, cast(Localisation, localisation), TrackingConfig())
    task = correction.next_task()
    assert isinstance(task, PrepareCorrection)
    assert correction.next_task() is None  # it waits for the outcome
    correction.take(TaskFailed(task=task))
    following: object = correction.next_task()
    assert following == "the next search"
