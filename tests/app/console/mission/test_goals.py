"""A goal is refused in a zone that no tick has seen yet."""

from __future__ import annotations

import dataclasses

import pytest

from app.console.mission.goals import Goals, MapView
from app.console.mission.saved_missions import SavedMissions
from app.runtime.control.operator_state import OperatorState
from navcore.costmap.costmap import Costmap
from navcore.errors import BlockedGoal, Refused
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.mission.zone import Zone, ZoneKind
from tests.app.console.state import PlainHolder
from tests.navcore.scene import SPEC
from tests.web.fake_operations import FakeOperations
from tests.web.fake_world import inflated
from tests.web.memory_store import MemoryStore

SQUARE = ((1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5))


class NoTick:
    """Satisfies `MapView`: nothing was seen yet."""

    picture = None


def goals_of(holder: PlainHolder, view: MapView | None = None) -> Goals:
    return Goals(
        holder,
        view=view or NoTick(),
        spec=lambda: SPEC,
        inflate=lambda grid: Costmap.of(grid, inflated(grid), version=0),
        saved=SavedMissions(MemoryStore()),
    )


def holder_of(*zones: Zone) -> PlainHolder:
    return PlainHolder(OperatorState(mission=Mission(), beware=default_beware_list(), zones=zones))


KEEP_OUT = Zone(id="a", name="wet floor", polygon=SQUARE)
WIDE = Zone(id="a", name="wet floor", polygon=SQUARE, margin_m=0.4)
BOUNDARY = Zone(id="a", name="the hall", polygon=SQUARE, kind=ZoneKind.STAY_INSIDE)
HALL = Zone(
    id="a",
    name="the hall",
    polygon=((-4.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-4.0, 2.0)),
    kind=ZoneKind.STAY_INSIDE,
)
OFF = Zone(id="a", name="wet floor", polygon=SQUARE, enabled=False)
SLOW = Zone(id="a", name="the ramp", polygon=SQUARE, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3)


@pytest.mark.parametrize(("zone", "x_m"), [(KEEP_OUT, 1.5), (WIDE, 2.35), (BOUNDARY, 2.1)])
def test_a_goal_where_a_new_zone_forbids_to_stand_is_refused(zone: Zone, x_m: float) -> None:
    holder = holder_of()
    goals = goals_of(holder)
    moved = goals.add(-3.0, 0.0)
    holder.change(lambda state: dataclasses.replace(state, zones=(zone,)))
    with pytest.raises(BlockedGoal, match="inside a beware zone"):
        goals.add(x_m, 0.0)
    with pytest.raises(BlockedGoal, match="inside a beware zone"):
        goals.change(moved.id, {"x_m": x_m})
    assert holder.intent.mission.queue == (moved,)


def test_a_goal_that_was_meant_for_the_site_of_before_is_refused() -> None:
    holder = holder_of()
    goals = goals_of(holder)
    goals.add(-3.0, 0.0)
    holder.change(lambda state: dataclasses.replace(state, site_id="another", mission=Mission()))
    with pytest.raises(Refused, match="another site now"):
        goals.add(-2.0, 0.0)
    with pytest.raises(Refused, match="another site now"):
        goals.save("night")
    assert holder.intent.mission == Mission() and not goals.missions()


@pytest.mark.parametrize(
    ("zone", "x_m"), [(KEEP_OUT, 2.1), (WIDE, 2.45), (BOUNDARY, 1.5), (OFF, 1.5), (SLOW, 1.5)]
)
def test_a_goal_elsewhere_is_queued(zone: Zone, x_m: float) -> None:
    goal = goals_of(holder_of(zone)).add(x_m, 0.0)
    assert (goal.x_m, goal.y_m) == (x_m, 0.0)


@pytest.mark.parametrize(("zone", "x_m"), [(KEEP_OUT, 1.5), (WIDE, 2.35), (HALL, 2.1)])
def test_the_refusal_names_a_position_beside_the_new_zone(zone: Zone, x_m: float) -> None:
    goals = goals_of(holder_of(zone), FakeOperations().view)
    with pytest.raises(BlockedGoal) as refused:
        goals.add(x_m, 0.0)
    assert refused.value.nearest is not None
    assert goals.add(*refused.value.nearest).id > 0
