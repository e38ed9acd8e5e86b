"""The event log: its bounds, and the entries for the differences from one tick to the next."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.insight.event_detector import EventDetector
from app.insight.event_log import EventLog
from app.runtime.control.operator_state import OperatorState
from navcore.control.motion import IDLE
from navcore.costmap.costmap import Costmap
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.localisation.estimate import LocalisationEstimate
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.mission import Mission
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.mission.zone_cells import rasterise
from navcore.navigator import TickResult
from navcore.perception.labels import Labels
from navcore.planning.path import Path
from navcore.planning.planner import plan
from navcore.planning.route import Route
from navcore.robot.frame import Frame
from navcore.safety.gate import Cause, StopReason
from web.interface.insight import Kind

SPEC = GridSpec.centred(size_m=(8.0, 6.0), resolution_m=0.1)
BEWARE = BewareList(classes=(BewareClass(name="cup", class_id=3),))
ZONE = Zone(id="z", name="Wet floor", polygon=((0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)))
HERE = (-3.0, 0.0)
GOAL = (3.0, 0.0)


def box(left: float, right: float, low: float, high: float) -> BoolGrid:
    return rasterise(((left, low), (right, low), (right, high), (left, high)), SPEC)


def intent(
    *, zones: tuple[Zone, ...] = (), beware: BewareList = BEWARE, driving: bool = True
) -> OperatorState:
    mission = Mission().add(*GOAL, SPEC)
    return OperatorState(
        mission=mission.start() if driving else mission, beware=beware, zones=zones
    )


def decision(
    walls: BoolGrid, *, cups: BoolGrid | None = None, zones: tuple[Zone, ...] = ()
) -> TickResult:
    """What a tick makes of a map."""
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    drawn = np.logical_or.reduce([nothing, *(rasterise(zone.polygon, SPEC) for zone in zones)])
    grid = OccupancyGrid(
        spec=SPEC, geometric=walls, beware={3: nothing if cups is None else cups}, zones=drawn
    )
    blocked = inflate_layers(grid, vehicle_width_m=0.4, safety_margin_m=0.1)
    outcome = plan(blocked, SPEC.cell(*HERE), SPEC.cell(*GOAL))
    points = (
        np.vstack([SPEC.centres(outcome.cells[:-1]), GOAL])
        if isinstance(outcome, Path)
        else np.empty((0, 2))
    )
    lens = Intrinsics(width=4, height=3, fx=2.0, fy=2.0, cx=2.0, cy=1.5)
    frame = Frame(
        stamp_ns=1,
        rgb=np.zeros((3, 4, 3), dtype=np.uint8),
        depth_m=np.ones((3, 4), dtype=np.float32),
        intrinsics=lens,
        T_base_camera=np.eye(4),
        pose=Pose2(x_m=HERE[0], y_m=HERE[1], yaw_rad=0.0),
        twist=STANDSTILL,
    )
    return TickResult(
        place=LocalisationEstimate(),
        frame=frame,
        request=NavigationRequest(goal=GOAL, beware=BewareList(classes=()), zones=()),
        labels=Labels(
            class_ids=np.zeros((3, 4), dtype=np.uint8), confidence=np.ones((3, 4), dtype=np.float32)
        ),
        occupancy=Costmap.of(grid, blocked, version=1),
        route=Route(outcome=outcome, points=points, waypoints=points, track=points),
        motion=IDLE,
    )


EMPTY = box(-4.0, -3.95, -3.0, -2.95)


def written(event_log: EventLog) -> list[tuple[str, str]]:
    return [
        (entry.kind, entry.text) for entry in event_log.page(kinds=(), since=0, limit=1000).entries
    ]


@pytest.mark.parametrize(
    ("after", "said"),
    [
        (decision(box(-0.5, 0.5, -1.0, 1.0)), "An obstacle closes the path"),
        (decision(EMPTY, cups=box(-0.5, 0.5, -1.0, 1.0)), "“cup” closes the path"),
        (decision(EMPTY, zones=(ZONE,)), "A zone closes the path"),
        (decision(box(-0.5, 0.5, -3.0, 3.0)), "There is no path"),
    ],
)
def test_a_new_path_is_written_down_with_what_closed_the_old_one_and_where(
    after: TickResult, said: str
) -> None:
    event_log, will = EventLog(), intent()
    detector = EventDetector(event_log, will)
    detector.on_tick(0.0, decision(EMPTY), HERE)
    detector.on_tick(5.0, after, HERE)
    assert [kind for kind, _ in written(event_log)] == ["replanned", "replanned"]
    assert (
        "Planned a path of 6.0 m" in written(event_log)[0][1] and said in written(event_log)[1][1]
    )
    place = event_log.page(kinds=(), since=1, limit=9).entries[0].place
    assert place is not None and -3.1 < place[0] < 1.0


def test_the_same_path_is_no_news_and_a_shorter_one_is() -> None:
    event_log, will = EventLog(), intent()
    detector = EventDetector(event_log, will)
    wall = box(-0.5, 0.5, -1.0, 1.0)
    for second in range(4):
        detector.on_tick(2.0 * second, decision(wall), HERE)
    assert len(written(event_log)) == 1
    detector.on_tick(20.0, decision(EMPTY), HERE)
    assert "A shorter path has opened" in written(event_log)[-1][1]


@pytest.mark.parametrize(
    ("walls", "said"),
    [
        (box(-0.5, 0.5, -2.2, 3.0), "The gap is too narrow; the way round is "),
        (EMPTY, "A shorter path has opened"),
    ],
)
def test_a_look_at_a_gap_and_what_came_of_it_are_told_once(walls: BoolGrid, said: str) -> None:
    event_log, will = EventLog(), intent()
    detector = EventDetector(event_log, will)
    detector.on_tick(0.0, decision(EMPTY), HERE)
    round_about = decision(box(-0.5, 0.5, -2.2, 3.0))
    assert round_about.route is not None
    look = dataclasses.replace(
        round_about.route,
        points=np.array([HERE, (-1.0, 0.0)]),
        round_m=round_about.route.length_m,
    )
    for now_s in (2.0, 4.0, 6.0):
        detector.on_tick(now_s, dataclasses.replace(round_about, route=look), HERE)
    detector.on_tick(8.0, decision(walls), HERE)
    texts = [text for _, text in written(event_log)]
    assert len(texts) == 3
    assert "looks at it from near before it takes the way round" in texts[1]
    assert texts[2].startswith(said)


def test_a_look_for_another_goal_is_told_as_one() -> None:
    event_log, will = EventLog(), intent()
    detector = EventDetector(event_log, will)
    round_about = decision(box(-0.5, 0.5, -2.2, 3.0))
    assert round_about.route is not None
    look = dataclasses.replace(
        round_about.route, points=np.array([HERE, (-1.0, 0.0)]), round_m=20.0
    )
    looking = dataclasses.replace(round_about, route=look)
    detector.on_tick(0.0, looking, HERE)
    other = dataclasses.replace(will, mission=Mission().add(2.0, 1.0, SPEC).start())
    detector.on_change(1.0, other, HERE)
    detector.on_tick(2.0, dataclasses.replace(looking), HERE)
    detector.on_change(3.0, will, HERE)
    detector.on_tick(4.0, decision(EMPTY), HERE)
    texts = [text for kind, text in written(event_log) if kind == "replanned"]
    assert ["looks at it" in text for text in texts] == [True, True, False]
    assert texts[2].startswith("Planned a path")


def ending_at(seen: TickResult, end: tuple[float, float]) -> TickResult:
    """Return a tick whose path ends at another place."""
    assert seen.route is not None
    points = np.vstack([seen.route.points[:-1], end])
    return dataclasses.replace(seen, route=dataclasses.replace(seen.route, points=points))


def test_a_goal_that_a_correction_moves_is_the_same_goal_and_keeps_its_name() -> None:
    event_log, moved = EventLog(), (GOAL[0] + 0.12, GOAL[1])
    mission = Mission().add(*GOAL, SPEC, name="Dock").start()
    will = dataclasses.replace(intent(), mission=mission)
    (dock,) = mission.queue
    after = dataclasses.replace(
        will, mission=dataclasses.replace(mission, queue=(dataclasses.replace(dock, x_m=moved[0]),))
    )
    detector = EventDetector(event_log, will)
    # The goal has moved already where the first path to it is told.
    detector.on_change(0.0, after, HERE)
    detector.on_tick(1.0, decision(EMPTY), HERE)
    detector.on_tick(3.0, ending_at(decision(EMPTY), moved), HERE)
    assert written(event_log) == [("replanned", "Planned a path of 6.0 m to “Dock”.")]


def test_another_way_out_of_a_beware_area_is_no_new_goal() -> None:
    event_log, will = EventLog(), intent()
    leaving = dataclasses.replace(will, mission=will.mission.leave())
    detector = EventDetector(event_log, leaving)
    for second, end in enumerate([(3.0, 0.0), (3.0, 0.4), (3.0, -0.4)]):
        detector.on_tick(2.0 * second, ending_at(decision(EMPTY), end), HERE)
    said = [text for _, text in written(event_log)]
    assert sum(text.startswith("Planned a path") for text in said) == 1


def test_a_path_that_opens_while_the_mission_is_paused_is_told_when_it_goes_on() -> None:
    event_log, driving = EventLog(), intent()
    detector = EventDetector(event_log, driving)
    paused = dataclasses.replace(driving, mission=driving.mission.pause())
    closed, open_ = decision(box(-0.5, 0.5, -3.0, 3.0)), decision(EMPTY)
    for now_s, state, seen in ((0.0, driving, closed), (2.0, paused, open_), (4.0, driving, open_)):
        detector.on_change(now_s, state, HERE)
        detector.on_tick(now_s, seen, HERE)
    said = [text for kind, text in written(event_log) if kind == "replanned"]
    assert len(said) == 2 and "no path" in said[0] and said[1].startswith("A path has opened")


def test_edits_of_zones_and_list_and_reached_goals_are_written_down() -> None:
    event_log = EventLog()
    before = intent(driving=False)
    detector = EventDetector(event_log, before)
    edits: list[OperatorState] = [dataclasses.replace(before, zones=(ZONE,))]
    edits.append(dataclasses.replace(edits[-1], zones=(dataclasses.replace(ZONE, enabled=False),)))
    edits.append(dataclasses.replace(edits[-1], zones=()))
    edits.append(dataclasses.replace(edits[-1], beware=BEWARE.edited("cup", enabled=False)))
    edits.append(dataclasses.replace(edits[-1], mission=before.mission.start()))
    edits.append(dataclasses.replace(edits[-1], mission=before.mission.start().arrive()))
    for second, edit in enumerate(edits):
        detector.on_change(float(second), edit, HERE)
    assert [kind for kind, _ in written(event_log)] == [
        "zone",
        "zone",
        "zone",
        "beware",
        "mission",
        "goal",
        "mission",
    ]
    said = [text for _, text in written(event_log)]
    assert (
        said[0].endswith("was drawn.")
        and said[1].endswith("was switched off.")
        and said[2].endswith("was deleted.")
    )
    assert (
        said[3] == "Beware list: “cup” switched off." and "The goal (3.0, 0.0) is reached." in said
    )


def test_a_class_that_is_renamed_neither_leaves_nor_joins_the_list_and_each_edit_is_told() -> None:
    event_log, before = EventLog(), intent()
    detector = EventDetector(event_log, before)
    lists = [BEWARE.renamed("cup", "mug"), BEWARE.edited("cup", max_height_m=0.2)]
    for beware in lists:
        detector.on_change(1.0, dataclasses.replace(before, beware=beware), HERE)
        detector.on_change(2.0, before, HERE)
    said = [text for _, text in written(event_log)]
    assert said[::2] == [
        "Beware list: “cup” renamed to “mug”.",
        "Beware list: “cup”: largest height any → 0.2 m.",
    ]


def test_a_reason_that_comes_and_goes_within_a_second_is_one_stop() -> None:
    event_log = EventLog()
    detector = EventDetector(event_log, intent())
    yielding = (StopReason(cause=Cause.YIELDING, text="A person is in the way."),)
    for tenth in range(10):
        detector.on_gate(0.1 * tenth, yielding if tenth % 2 == 0 else (), HERE)
    detector.on_tick(3.0, None, HERE)
    assert [kind for kind, _ in written(event_log)] == ["stopped", "released"]
    assert "yielding lasted 0.9 s" in written(event_log)[1][1]


@given(
    st.lists(st.sampled_from(["zone", "goal", "seen"]), max_size=40),
    st.integers(0, 50),
    st.integers(1, 20),
)
def test_a_page_of_the_log_is_the_newest_of_what_was_asked_for(
    kinds: list[Kind], since: int, limit: int
) -> None:
    event_log = EventLog(max_entries=25)
    for number, kind in enumerate(kinds):
        event_log.note(float(number), kind, f"{number}")
    kept = [(number + 1, kind) for number, kind in enumerate(kinds)][-25:]
    asked: tuple[Kind, ...] = ("zone",)
    page = event_log.page(kinds=asked, since=since, limit=limit)
    wanted = [number for number, kind in kept if kind == "zone" and number > since][-limit:]
    assert [entry.id for entry in page.entries] == wanted
    assert page.newest == len(kinds) and page.oldest == (kept[0][0] if kept else 0)


def test_a_new_price_of_unseen_floor_is_told() -> None:
    event_log, will = EventLog(), intent()
    detector = EventDetector(event_log, will)
    for now_s, price in enumerate((None, 3.0, 3.0, None)):
        dearer = dataclasses.replace(will, unknown_price=price)
        detector.on_change(float(now_s), dearer, HERE)
    assert written(event_log) == [
        ("replanned", "A metre of unseen floor now costs as much as 3 m of seen floor."),
        ("replanned", "Unseen floor costs again what the configuration says."),
    ]


@pytest.mark.parametrize("former_name", ["hall", "attic"])
def test_another_site_is_told_as_that_and_not_as_edits_and_arrivals(former_name: str) -> None:
    """A site may have the name by which the robot entered the one before, renamed since."""
    event_log = EventLog()
    before = dataclasses.replace(
        intent(zones=(ZONE,), driving=False), site=former_name, site_id="one"
    )
    detector = EventDetector(event_log, before)
    mission = dataclasses.replace(before.mission, reached=before.mission.queue, queue=())
    there = OperatorState(
        mission=mission, beware=BewareList(classes=()), site="attic", site_id="another"
    )
    detector.on_change(1.0, there, HERE)
    assert [text for _, text in written(event_log)] == ["The robot is at the site “attic”."]
    detector.on_change(2.0, dataclasses.replace(there, zones=(ZONE,)), HERE)
    assert "Wet floor" in written(event_log)[-1][1], "edits there are told"
