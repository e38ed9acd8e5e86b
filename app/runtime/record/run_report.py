"""Reports of the missions that a console has driven, one per run."""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from app.runtime.record.time_series import TimeSeries
from app.storage import Store
from app.storage.site_store import SiteStore
from navcore.errors import StorageFailed
from navcore.mission.mission import MAX_GOALS, Goal, Mission, Phase
from navcore.mission.zone import Zone

log = logging.getLogger(__name__)
MAX_REPORTED = MAX_GOALS
"""Largest number of goals in a report, the newest: a patrol goes on for days."""
MAX_ROWS = 7200
"""Largest number of rows of a run's time series; a longer run has a longer period."""


class Referee(Protocol):
    """An external judge of a run; only the simulated robot has one."""

    def watch_zones(self, polygons: list[list[tuple[float, float]]]) -> None:
        """Judge by these zones from now on."""

    def note_stop(self, reason: str | None) -> None:
        """Note why the robot is held; None when it is not."""

    def new_run(self) -> None:
        """Start a new judgement."""

    def referee_report(self) -> dict[str, Any]:
        """Return the judgement since the last `new_run`."""


class RunReporter:
    """Stores the report of each run: a run begins when the mission starts to drive and ends when it
    is idle again, or another mission is loaded. What happens until then is stored now and then
    (`keep`), so that a run that ends with the power is in the history, too."""

    def __init__(
        self,
        *,
        store: Store,
        referee: Referee | None,
        scenario: str,
        robot: str,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        """`now_s` gives the time in seconds since 1970."""
        self._store, self._referee, self._scenario, self._robot = store, referee, scenario, robot
        self._now_s = now_s
        self._stop_noted: str | None = None
        self._run: _Run | None = None
        self._kept: tuple[object, ...] = ()
        self._saving = threading.Lock()

    def note_stop(self, reason: str | None) -> None:
        """Tell the referee why the robot is held, whenever that changes; None when it is not."""
        if self._referee is not None and reason != self._stop_noted:
            self._stop_noted = reason
            self._referee.note_stop(reason)

    def watch_zones(self, zones: tuple[Zone, ...]) -> None:
        """Tell the referee the zones in force."""
        if self._referee is not None:
            self._referee.watch_zones(
                [list(zone.polygon) for zone in zones if zone.closed and not zone.forbids_outside]
            )

    def note_tick(
        self,
        stamp_ns: int,
        mission: Mission,
        travelled_m: float,
        measure: Callable[[], Mapping[str, float]],
    ) -> None:
        """Follow the mission after a tick; `measure` gives a row of the time series."""
        if self._run is not None and mission.runs == self._run.number:
            self._run.note_tick(stamp_ns, mission, travelled_m, measure)
        if self._run is not None and (
            mission.runs != self._run.number or mission.phase is Phase.IDLE
        ):
            # The mission of a site that is left waits there; any other one that another has taken
            # the place of is driven no more.
            is_left = self._store.site.id != self._run.site_id
            is_other = mission.runs != self._run.number
            self._end(unfinished=is_left, cancelled=not is_left and (is_other or mission.cancelled))
        if self._run is None and mission.phase is Phase.DRIVING:
            begun_s = round(self._now_s())
            self._begin(_Run(stamp_ns, mission, travelled_m, begun_s, self._store.site))

    def keep(self) -> None:
        """Store what the present run has come to; any thread may call it."""
        with self._saving:
            run = self._run
            if run is not None and run.progress != self._kept:
                self._kept = run.progress
                self._save(self._report_of(run, unfinished=True))

    def close(self, mission: Mission) -> None:
        """Store the report of an unfinished run; call when nothing else uses this any more."""
        if self._run is not None:
            if mission.runs == self._run.number:
                self._run.note_mission(mission)
            self._end(unfinished=True)

    def _begin(self, run: _Run) -> None:
        if self._referee is not None:
            self._referee.new_run()
            self._stop_noted = None  # a new judgement has to be told again
        self._run = run

    def _end(self, *, unfinished: bool = False, cancelled: bool = False) -> None:
        assert self._run is not None
        judged = self._referee.referee_report() if self._referee is not None else {}
        with self._saving:
            run, self._run = self._run, None
            report = self._report_of(run, unfinished=unfinished, cancelled=cancelled)
            self._save({**report, **judged})

    def _report_of(self, run: _Run, *, unfinished: bool, cancelled: bool = False) -> dict[str, Any]:
        return {
            "scenario": self._scenario,
            "robot": self._robot,
            "unfinished": unfinished,
            "cancelled": cancelled,
            **run.report(),
        }

    def _save(self, report: dict[str, Any]) -> None:
        try:
            self._store.save_run(report)
        except StorageFailed:
            log.exception("the run is not in the history")  # a full disk must not stop the robot


class _Run:
    """The present run."""

    def __init__(
        self,
        stamp_ns: int,
        mission: Mission,
        travelled_m: float,
        begun_unix_s: int,
        site: SiteStore,
    ) -> None:
        self.site_id, self._site_name, self._begun_unix_s = site.id, site.name, begun_unix_s
        """Site at which the run has begun."""
        self._started_ns = self._last_ns = stamp_ns
        self._started_m = self._last_m = travelled_m
        self._series = TimeSeries(max_rows=MAX_ROWS, thinning=True)
        self._id, self.number = uuid.uuid4().hex[:12], mission.runs
        """Number of the mission's run."""
        self._goals: dict[int, Goal] = {goal.id: goal for goal in mission.queue}
        self._goal_count = len(self._goals)
        self._reached_before, self._reached_count = mission.reached_count, mission.reached_count

    def note_tick(
        self,
        stamp_ns: int,
        mission: Mission,
        travelled_m: float,
        measure: Callable[[], Mapping[str, float]],
    ) -> None:
        self._last_ns, self._last_m = stamp_ns, travelled_m
        if self._series.is_due(self._duration_s):
            self._series.add(self._duration_s, {**measure(), "distance_m": self._distance_m})
        self.note_mission(mission)

    def note_mission(self, mission: Mission) -> None:
        """Follow the goals: those that are added, moved or reached."""
        present = {goal.id: goal for goal in mission.queue}
        self._goal_count += len(present.keys() - self._goals.keys())
        self._goals.update(present)
        too_many = len(self._goals) - MAX_REPORTED
        if too_many > 0:
            for oldest in [goal_id for goal_id in self._goals if goal_id not in present][:too_many]:
                del self._goals[oldest]
        self._reached_count = mission.reached_count

    @property
    def progress(self) -> tuple[object, ...]:
        """What changes as the robot gets on."""
        return self._id, round(self._distance_m, 1), self._reached_count, self._goal_count

    @property
    def _duration_s(self) -> float:
        return (self._last_ns - self._started_ns) / 1e9

    @property
    def _distance_m(self) -> float:
        return self._last_m - self._started_m

    def report(self) -> dict[str, Any]:
        """Return the run's own part of the report."""
        return {
            "id": self._id,
            "begun_unix_s": self._begun_unix_s,
            "site": self._site_name,
            "goals": [[goal.x_m, goal.y_m] for goal in tuple(self._goals.values())],
            "goal_count": self._goal_count,
            "goals_reached": self._reached_count - self._reached_before,
            "series": self._series.after(),
            "distance_m": round(self._distance_m, 3),
            "sim_time_s": round(self._duration_s, 3),
        }
