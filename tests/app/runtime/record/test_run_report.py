"""Each run has a report of its own, also one that ends with the power."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import pytest

from app.runtime.record import run_report
from app.runtime.record.run_report import RunReporter
from app.runtime.record.time_series import COLUMNS
from navcore.grid.grid import GridSpec
from navcore.mission.mission import Mission

SPEC = GridSpec.centred(size_m=(20.0, 20.0), resolution_m=0.1)


class Runs:
    """A store of reports, and the reporter that fills it."""

    def __init__(self) -> None:
        self.stored = dict[str, dict[str, Any]]()
        self.reporter = RunReporter(
            store=self,  # type: ignore[arg-type]
            referee=None,
            scenario="hall",
            robot="husky",
            now_s=lambda: 1_700_000_000.4,
        )
        self.site = SimpleNamespace(name="ward", id="1")
        self.ticks = 0

    def save_run(self, report: dict[str, Any]) -> None:
        self.stored[report["id"]] = report

    def tick(self, mission: Mission) -> Mission:
        self.ticks += 1
        measured = dict.fromkeys(COLUMNS[1:], 0.0)
        self.reporter.note_tick(self.ticks * 10**9, mission, 0.5 * self.ticks, lambda: measured)
        return mission

    @property
    def unfinished(self) -> list[bool]:
        """Whether each run was cut off, or goes on."""
        return [run["unfinished"] for run in self.stored.values()]

    @property
    def figures(self) -> list[tuple[int, list[list[float]]]]:
        """Number of reached goals, and the goals, of each run."""
        return [(run["goals_reached"], run["goals"]) for run in self.stored.values()]


def to(*goals_m: float) -> Mission:
    mission = Mission()
    for x_m in goals_m:
        mission = mission.add(x_m, 0.0, SPEC)
    return mission


@pytest.fixture
def runs() -> Runs:
    return Runs()


def test_another_mission_that_is_loaded_ends_the_run(runs: Runs) -> None:
    mission = runs.tick(to(1.0, 2.0, 3.0).start())
    mission = runs.tick(mission.arrive().arrive())
    mission = runs.tick(mission.pause())
    runs.tick(mission.refill(to(8.0).queue, loop=False))
    assert runs.figures == [(2, [[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])]


def test_a_mission_that_goes_on_after_a_restart_counts_what_it_reaches_now(runs: Runs) -> None:
    before = to(1.0, 2.0, 3.0).start().arrive().arrive().stored()
    runs.tick(before.resume())
    runs.tick(before.resume().arrive())
    assert runs.figures == [(1, [[3.0, 0.0]])]


def test_two_missions_between_two_ticks_are_two_runs(runs: Runs) -> None:
    mission = runs.tick(to(1.0).start())
    mission = runs.tick(mission.cancel().add(5.0, 0.0, SPEC).start())
    runs.tick(mission.arrive())
    assert runs.figures == [(0, [[1.0, 0.0]]), (1, [[5.0, 0.0]])]


def test_a_goal_that_was_moved_is_reported_where_it_was_reached(runs: Runs) -> None:
    mission = runs.tick(to(1.0).start())
    (goal,) = to(4.0).queue
    mission = runs.tick(mission.change(goal, SPEC))
    runs.tick(mission.arrive())
    assert runs.figures == [(1, [[4.0, 0.0]])]


def test_a_run_is_kept_while_it_goes_on_and_replaced_by_its_end(runs: Runs) -> None:
    runs.reporter.keep()
    assert runs.figures == []
    mission = runs.tick(to(1.0, 2.0).start())
    mission = runs.tick(mission.arrive())
    runs.reporter.keep()
    assert [reached for reached, _ in runs.figures] == [1]
    assert runs.unfinished == [True]
    runs.tick(mission.arrive())
    assert [reached for reached, _ in runs.figures] == [2]
    assert runs.unfinished == [False]
    runs.reporter.keep()
    assert [reached for reached, _ in runs.figures] == [2], "nothing goes on any more"


def test_the_console_ends_an_unfinished_run(runs: Runs) -> None:
    mission = runs.tick(to(1.0, 2.0).start())
    runs.reporter.close(mission.arrive())
    assert [reached for reached, _ in runs.figures] == [1]
    assert runs.unfinished == [True]


def test_a_long_patrol_reports_its_newest_goals_and_the_number_of_all(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_report, "MAX_REPORTED", 4)
    mission = runs.tick(dataclasses.replace(to(1.0, 2.0, 3.0), loop=True).start())
    for _ in range(7):
        mission = runs.tick(mission.arrive())
    runs.reporter.close(mission)
    (report,) = runs.stored.values()
    assert report["goals"] == [[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [1.0, 0.0]]
    assert (report["goal_count"], report["goals_reached"]) == (10, 7)


def test_a_report_says_when_and_at_which_site_the_run_has_begun(runs: Runs) -> None:
    mission = runs.tick(to(1.0).start())
    runs.site.name = "another"  # renamed meanwhile
    runs.tick(mission.arrive())
    (report,) = runs.stored.values()
    assert (report["begun_unix_s"], report["site"]) == (1_700_000_000, "ward")


def test_a_report_says_whether_the_mission_was_cancelled(runs: Runs) -> None:
    mission = runs.tick(to(1.0, 2.0).start())
    mission = runs.tick(mission.arrive().cancel())
    mission = runs.tick(mission.add(5.0, 0.0, SPEC).start())
    mission = runs.tick(mission.arrive())
    mission = runs.tick(mission.add(5.0, 0.0, SPEC).start())
    mission = runs.tick(mission.pause())
    runs.tick(mission.refill(to(8.0).queue, loop=False))
    assert [report["cancelled"] for report in runs.stored.values()] == [True, False, True]


def test_a_mission_that_waits_at_a_site_that_is_left_is_not_cancelled(runs: Runs) -> None:
    mission = runs.tick(to(1.0, 2.0).start())
    mission = runs.tick(mission.arrive())
    runs.site = SimpleNamespace(name="hall", id="2")
    runs.tick(dataclasses.replace(Mission(), runs=mission.runs + 1))
    (report,) = runs.stored.values()
    assert (report["site"], report["unfinished"], report["cancelled"]) == ("ward", True, False)
