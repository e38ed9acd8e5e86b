"""What the console says of why, asked of a real navigator's decision."""

from __future__ import annotations

from pathlib import Path

from app.storage import Store
from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.supervisor import Behaviour
from navcore.mission.zone import OWN_COLOUR, Zone
from tests.app.insight.test_event_log import insight_of
from tests.reliability.drills import first_picture, standing_pilot


def test_what_the_robot_keeps_out_of_by_itself_is_among_the_reasons_for_its_way(
    tmp_path: Path,
) -> None:
    pilot, store = standing_pilot(), Store(tmp_path)
    insight = insight_of(store, tmp_path, pilot)
    frame = first_picture()
    x, y = frame.pose.x_m, frame.pose.y_m
    pilot.change_mission(lambda mission: mission.add(x + 5.0, y, pilot.navigator.map.spec).start())
    across = ((x + 2.0, y - 0.5), (x + 2.4, y - 0.5), (x + 2.4, y + 0.5), (x + 2.0, y + 0.5))
    lane = Zone(
        id="lane 0", name="where somebody walks to and fro", polygon=across, colour=OWN_COLOUR
    )
    pilot.navigator.behaviour = Behaviour(lanes=LaneKeepOut(zones=(lane,)))
    decision = pilot.think(frame, clock=lambda: frame.stamp_ns)
    assert decision is not None and decision.closed == (lane,)
    insight.note_decision(decision)
    [rule] = [rule for rule in insight.explain().rules if rule.name == lane.name]
    assert rule.along_m > 0 and rule.saves_m is not None and rule.saves_m > 0.05
    assert insight.without([rule.key]).difference_m == -rule.saves_m
    store.close()
