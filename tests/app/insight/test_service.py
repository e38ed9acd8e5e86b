"""The explanation of a real navigator's decision."""

from __future__ import annotations

from pathlib import Path

from app.storage import Store
from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.supervisor import Behaviour
from navcore.mission.zone import OWN_COLOUR, Zone
from tests.app.insight.test_event_log import insight_of
from tests.reliability.fault_runs import first_frame, standing_controller


def test_a_keep_out_of_the_robot_itself_is_among_the_reasons_for_its_path(
    tmp_path: Path,
) -> None:
    controller, store = standing_controller(), Store(tmp_path)
    insight = insight_of(store, tmp_path, controller)
    frame = first_frame()
    x, y = frame.pose.x_m, frame.pose.y_m
    controller.change_mission(
        lambda mission: mission.add(x + 5.0, y, controller.navigator.map.spec).start()
    )
    across = ((x + 2.0, y - 0.5), (x + 2.4, y - 0.5), (x + 2.4, y + 0.5), (x + 2.0, y + 0.5))
    lane = Zone(
        id="lane 0", name="where a person walks to and fro", polygon=across, colour=OWN_COLOUR
    )
    controller.navigator.behaviour = Behaviour(lanes=LaneKeepOut(zones=(lane,)))
    decision = controller.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None and decision.closed == (lane,)
    insight.note_decision(decision)
    [rule] = [rule for rule in insight.explain().rules if rule.name == lane.name]
    assert rule.along_m > 0 and rule.saves_m is not None and rule.saves_m > 0.05
    assert insight.without([rule.key]).difference_m == -rule.saves_m
    store.close()
