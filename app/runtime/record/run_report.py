"""Reports of the missions that a console has driven, one per run."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from app.runtime.record.time_series import TimeSeries
from app.storage import Store
from navcore.errors import StorageFailed
from navcore.mission.mission import Goal, Mission, Phase
from navcore.mission.zone import Zone

log = logging.getLogger(__name__)
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
    is idle again."""

    def __init__(self, *, store: Store, referee: Referee | None, scenario: str, robot: str) -> None:
        self._store, self._referee, self._scenario, self._robot = store, referee, scenario, robot
        self._stop_noted: str | None = None
        self._run: _Run | None = None

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
        if self._run is None and mission.phase is Phase.DRIVING:
            self._begin(_Run(stamp_ns, mission, travelled_m))
        elif self._run is not None:
            self._run.note_tick(stamp_ns, mission, travelled_m, measure)
            if mission.phase is Phase.IDLE:
                self._end(mission)

    def close(self, mission: Mission) -> None:
        """Store the report of an unfinished run; call when nothing else uses this any more."""
        if self._run is not None:
            self._end(mission)

    def _begin(self, run: _Run) -> None:
        if self._referee is not None:
            self._referee.new_run()
            self._stop_noted = None  # a new judgement has to be told again
        self._run = run

    def _end(self, mission: Mission) -> None:
        assert self._run is not None
        run, self._run = self._run, None
        report = {
            "id": uuid.uuid4().hex[:12],
            "scenario": self._scenario,
            "robot": self._robot,
            **run.report(),
            **(self._referee.referee_report() if self._referee is not None else {}),
            "goals_reached": mission.reached_count,
        }
        try:
            self._store.save_run(report)
        except StorageFailed:
            log.exception("the run is not in the history")  # a full disk must not stop the robot


class _Run:
    """The present run."""

    def __init__(self, stamp_ns: int, mission: Mission, travelled_m: float) -> None:
        self._started_ns = self._last_ns = stamp_ns
        self._started_m = self._last_m = travelled_m
        self._series = TimeSeries(max_rows=MAX_ROWS, thinning=True)
        self._goals: dict[int, Goal] = {goal.id: goal for goal in mission.queue}

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
        for goal in mission.queue:
            self._goals.setdefault(goal.id, goal)

    @property
    def _duration_s(self) -> float:
        return (self._last_ns - self._started_ns) / 1e9

    @property
    def _distance_m(self) -> float:
        return self._last_m - self._started_m

    def report(self) -> dict[str, Any]:
        """Return the run's own part of the report."""
        return {
            "goals": [[goal.x_m, goal.y_m] for goal in self._goals.values()],
            "series": self._series.after(),
            "distance_m": round(self._distance_m, 3),
            "sim_time_s": round(self._duration_s, 3),
        }
