"""The operator's goals: every transition, and every refusal that leaves the mission as it was."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection

import pytest

from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.grid.grid import GridSpec
from navcore.grid.growth import reaching
from navcore.mission.mission import MAX_GOALS, MAX_REACHED, Goal, Mission, Phase, checked_together

SPEC = GridSpec.centred(size_m=(10, 10), resolution_m=0.1)
EMPTY = Mission()
TWO = EMPTY.add(1.0, 2.0, SPEC).add(3.0, 4.0, SPEC)
DRIVING = TWO.start()
PAUSED = DRIVING.pause()


def test_goals_are_queued_in_the_order_they_were_added_with_ids_of_their_own() -> None:
    assert TWO.queue == (Goal(id=1, x_m=1.0, y_m=2.0), Goal(id=2, x_m=3.0, y_m=4.0))
    assert EMPTY.queue == ()


@pytest.mark.parametrize(("x", "y"), [(5.0, 0.0), (0.0, -5.1), (2000.0, 0.0), (-300.0, 300.0)])
def test_a_goal_off_the_map_is_queued_as_the_map_grows_to_it(x: float, y: float) -> None:
    assert EMPTY.add(x, y, SPEC).queue[0] == Goal(id=1, x_m=x, y_m=y)


@pytest.mark.parametrize(
    ("x", "y", "word"),
    [
        (math.nan, 0.0, "not finite"),
        (0.0, math.inf, "not finite"),
        (7000.0, 0.0, "too far away: the map would grow to 100 × 70244 cells"),
        (-2000.0, 2000.0, "too far away"),
        (0.0, -1e308, "out of range"),
    ],
)
def test_a_goal_to_which_the_map_cannot_grow_is_refused(x: float, y: float, word: str) -> None:
    with pytest.raises(BadGeometry, match=word):
        EMPTY.add(x, y, SPEC)


def test_goals_that_only_together_are_too_far_apart_are_refused() -> None:
    far = EMPTY.add(2000.0, 0.0, SPEC)
    EMPTY.add(0.0, 2000.0, SPEC)
    with pytest.raises(BadGeometry, match="too far away"):
        far.add(0.0, 2000.0, SPEC)


def test_the_goals_of_a_saved_mission_are_checked_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Added one after the other, all goals before it would be checked with each."""
    checked_goals = 0

    def counted(spec: GridSpec, points: Collection[tuple[float, float]]) -> GridSpec:
        nonlocal checked_goals
        checked_goals += len(points)
        return reaching(spec, points)

    monkeypatch.setattr("navcore.mission.mission.reaching", counted)
    many = tuple(Goal(id=7, x_m=0.01 * k, y_m=0.0) for k in range(MAX_GOALS))
    loaded = EMPTY.refill(checked_together(many, SPEC), loop=False)
    assert checked_goals == 2 * MAX_GOALS
    assert [goal.id for goal in loaded.queue] == list(range(1, MAX_GOALS + 1))
    with pytest.raises(Refused, match="full"):
        checked_together((*many, many[0]), SPEC)
    apart = (Goal(id=1, x_m=2000.0, y_m=0.0), Goal(id=1, x_m=0.0, y_m=2000.0))
    with pytest.raises(BadGeometry, match=r"goal \(0, 2000\) is too far away"):
        checked_together(apart, SPEC)
    with pytest.raises(BadGeometry, match="not finite"):
        checked_together((Goal(id=1, x_m=math.nan, y_m=0.0),), SPEC)


def test_a_full_queue_is_refused() -> None:
    mission = EMPTY
    for _ in range(MAX_GOALS):
        mission = mission.add(0.0, 0.0, SPEC)
    with pytest.raises(Refused, match="full"):
        mission.add(0.0, 0.0, SPEC)


def test_a_robot_that_leaves_an_area_goes_on_when_its_last_goal_is_removed() -> None:
    leaving = EMPTY.add(1.0, 0.0, SPEC).leave().remove(1)
    assert (leaving.phase, leaving.queue) == (Phase.LEAVING, ())
    assert DRIVING.remove(1).remove(2).phase is Phase.IDLE


def test_a_mission_that_has_begun_is_cancelled_by_removing_its_last_goal() -> None:
    assert DRIVING.remove(1).remove(2).cancelled and PAUSED.remove(1).remove(2).cancelled
    assert not EMPTY.add(1.0, 0.0, SPEC).remove(1).cancelled
    assert not DRIVING.stored().remove(1).remove(2).restored


def test_goals_from_before_are_no_longer_those_once_another_waits_with_them() -> None:
    kept = EMPTY.add(1.0, 0.0, SPEC).stored()
    assert kept.restored and not kept.add(2.0, 0.0, SPEC).restored
    # Control: that the robot is where the map shows it is still to be checked.
    assert DRIVING.stored().add(2.0, 0.0, SPEC).restored


def test_a_patrol_keeps_the_last_goals_and_counts_all() -> None:
    patrol = dataclasses.replace(TWO, loop=True).start()
    for _ in range(50):
        patrol = patrol.arrive()
    assert (len(patrol.reached), patrol.reached_count) == (MAX_REACHED, 50)
    assert patrol.reached[-1].id == 50 and [goal.id for goal in patrol.queue] == [51, 52]
    again = patrol.cancel().add(1.0, 0.0, SPEC).start()
    assert (again.reached, again.reached_count) == ((), 0)


def test_there_is_a_goal_to_drive_to_only_while_driving() -> None:
    assert [mission.goal for mission in (EMPTY, TWO, PAUSED, DRIVING.cancel())] == [None] * 4
    assert DRIVING.goal == PAUSED.resume().goal == TWO.queue[0]
    assert PAUSED.queue == TWO.queue


@pytest.mark.parametrize(
    ("action", "word"),
    [
        (EMPTY.start, "no goal"),
        (PAUSED.start, "paused"),
        (EMPTY.pause, "only a driving"),
        (TWO.pause, "only a driving"),
        (PAUSED.pause, "only a driving"),
        (EMPTY.resume, "only a paused"),
        (TWO.resume, "only a paused"),
        (DRIVING.resume, "only a paused"),
    ],
)
def test_an_action_that_does_not_fit_the_phase_is_refused(
    action: Callable[[], Mission], word: str
) -> None:
    with pytest.raises(Refused, match=word):
        action()


@pytest.mark.parametrize("mission", [EMPTY, TWO, DRIVING, PAUSED])
def test_cancelling_is_always_possible_and_empties_the_queue(mission: Mission) -> None:
    assert mission.cancel() == Mission(
        reached=mission.reached, cancelled=True, next_id=mission.next_id, runs=mission.runs
    )


def test_arriving_advances_to_the_next_goal_and_at_the_last_ends_the_mission() -> None:
    first = DRIVING.arrive()
    assert (first.phase, first.queue, first.reached) == (
        Phase.DRIVING,
        TWO.queue[1:],
        TWO.queue[:1],
    )
    last = first.arrive()
    assert (last.phase, last.queue, last.reached) == (Phase.IDLE, (), TWO.queue)


def test_removing_the_present_goal_drives_to_the_next_and_removing_the_last_ends() -> None:
    assert DRIVING.remove(1).goal == TWO.queue[1]
    assert DRIVING.remove(2).goal == TWO.queue[0]
    assert DRIVING.remove(1).remove(2).phase is Phase.IDLE
    assert PAUSED.remove(1).phase is Phase.PAUSED
    with pytest.raises(NotKnown, match="id 9"):
        DRIVING.remove(9)


def test_an_id_is_never_used_twice() -> None:
    mission = TWO.cancel().add(0.0, 0.0, SPEC)
    assert mission.queue[0].id == 3
    assert TWO.remove(2).add(0.0, 0.0, SPEC).queue[-1].id == 3


def test_leaving_an_area_keeps_the_goals_and_ends_paused_with_some_and_idle_without() -> None:
    assert Mission().leave().phase is Phase.LEAVING
    assert Mission().leave().left().phase is Phase.IDLE
    waiting = Mission().add(1.0, 1.0, SPEC).start().leave()
    assert waiting.goal is None
    assert waiting.left().phase is Phase.PAUSED
    assert waiting.pause() == waiting.left()
    assert waiting.left().queue == waiting.queue
    with pytest.raises(Refused, match="leaving"):
        waiting.start()


def test_queued_goals_are_named_turned_moved_and_ordered() -> None:
    named = EMPTY.add(1.0, 2.0, SPEC, yaw_rad=3 * math.pi, name="dock").add(0.0, 0.0, SPEC)
    assert named.queue[0].name == "dock" and named.queue[0].yaw_rad == pytest.approx(math.pi)
    moved = named.change(Goal(id=1, x_m=-1.0, y_m=0.0, name="gate"), SPEC)
    assert moved.queue[0] == Goal(id=1, x_m=-1.0, y_m=0.0, name="gate")
    assert [goal.id for goal in moved.reorder([2, 1]).queue] == [2, 1]
    for wrong in ([1], [1, 1], [1, 2, 3]):
        with pytest.raises(Refused, match="every queued goal once"):
            moved.reorder(wrong)
    with pytest.raises(BadGeometry, match="too far away"):
        moved.change(Goal(id=1, x_m=9900.0, y_m=0.0), SPEC)
    with pytest.raises(BadGeometry, match="heading"):
        moved.change(Goal(id=1, x_m=0.0, y_m=0.0, yaw_rad=math.inf), SPEC)
    with pytest.raises(NotKnown, match="id 9"):
        moved.change(Goal(id=9, x_m=0.0, y_m=0.0), SPEC)


def test_a_loop_repeats_the_same_goals_until_it_is_switched_off() -> None:
    mission = DRIVING.repeat(True)
    for _ in range(5):
        mission = mission.arrive()
    assert mission.phase is Phase.DRIVING
    assert [(goal.x_m, goal.y_m) for goal in mission.queue] == [(3.0, 4.0), (1.0, 2.0)]
    assert len({goal.id for goal in (*mission.queue, *mission.reached)}) == 7
    assert mission.repeat(False).arrive().arrive().phase is Phase.IDLE


def test_a_saved_mission_replaces_the_queued_goals_but_not_while_driving() -> None:
    kept = (Goal(id=0, x_m=1.0, y_m=1.0, yaw_rad=0.5, name="a"), Goal(id=0, x_m=2.0, y_m=2.0))
    loaded = PAUSED.refill(kept, loop=True)
    assert (loaded.phase, loaded.loop, [goal.id for goal in loaded.queue]) == (
        Phase.IDLE,
        True,
        [3, 4],
    )
    assert (loaded.queue[0].name, loaded.queue[0].yaw_rad) == ("a", 0.5)
    with pytest.raises(Refused, match="driving"):
        DRIVING.refill(kept, loop=False)


def test_only_a_paused_mission_goes_on_by_itself() -> None:
    """Whatever is done to it meanwhile: a pause must not leave a driving one."""
    interrupted = DRIVING.interrupt()
    assert interrupted.phase is Phase.PAUSED and interrupted.goes_on
    emptied = interrupted
    for goal in interrupted.queue:
        emptied = emptied.remove(goal.id)
    changed = (
        interrupted.resume(),
        interrupted.pause(),
        interrupted.cancel(),
        interrupted.leave(),
        interrupted.stored(),
        interrupted.refill(interrupted.queue, loop=False),
        emptied,
        emptied.add(1.0, 1.0, SPEC).start(),
    )
    assert not any(mission.goes_on for mission in changed)
    assert interrupted.pause().phase is Phase.PAUSED
    with pytest.raises(Refused):
        interrupted.pause().pause()


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("goes_on", [False, True])
def test_a_halt_is_refused_in_no_state_and_leaves_nothing_that_drives(
    phase: Phase, goes_on: bool
) -> None:
    halted = dataclasses.replace(TWO, phase=phase, goes_on=goes_on).halt()
    assert halted.queue == TWO.queue and not halted.goes_on
    assert halted.phase is (Phase.IDLE if phase is Phase.IDLE else Phase.PAUSED)
