"""Somebody walks across the robot's way and does not look out for it: many seeded encounters in an
empty hall.

Speed, angle and moment are drawn so that a robot that drives on without care is met by him; half of
them walk on, the others stop in the robot's way or turn back in it. They are drawn so that the
camera can see them for a while before they meet: on a course to meet, somebody stays at the same
bearing, and who comes from beyond the camera's field of view is seen by nobody.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.episode.episode import Episode
from app.evaluation.campaign import Campaign, conclude
from navcore.config.navigator import NavigatorConfig
from navcore.mission.beware_list import BewareList
from navcore.robot.profile import HUSKY
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.schema import MapExtent, Person, Scenario

HALL_M = 30.0
START_M, GOAL_M = -4.0, 4.5
"""The robot drives along x, from the one to the other."""
CRUISE_MPS, DELAY_S = 1.0, 0.4
"""As it does when nobody is there: so fast, after so long."""
SPEEDS_MPS = (0.4, 1.6)
MEETING_M = (-1.0, 2.5)
"""Where on the robot's way they would meet."""
WIDEST_RAD = math.radians(40.0)
"""He is seen at a smaller bearing from the camera than this; it sees 43.5° to either side …"""
CAMERA_M, FARTHEST_M = 0.35, 4.2
"""… from so far ahead of the robot's middle, and people up to so far …"""
NOTICE_S, SEEN_S = 3.0, 0.8
"""… for so long within so long before they meet."""
PATIENCE_S = 60.0
"""A robot that has not reached its goal by then has not reached it."""
BEYOND_M, FOR_GOOD_S = 6.0, 3600.0
"""So far he walks on after the meeting, and there he stays."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """Somebody's way across the robot's, as drawn."""

    speed_mps: float
    """Of walking."""
    angle_deg: float
    """Between his heading and the robot's: 90 is straight across, 180 towards the robot; negative
    to the right."""
    meeting_m: float
    """x at which his way crosses the robot's."""
    late_s: float
    """By how much he is there after the robot's middle would be."""
    kind: str
    """`walks on`, `stops` or `turns back`."""
    beyond_m: float
    """How far past the crossing of their ways he stops or turns back; negative for before it."""
    pause_s: float
    """How long he then stands."""

    def scenario(self) -> Scenario:
        """The empty hall with him in it."""
        angle = math.radians(self.angle_deg)
        ahead = np.array([math.cos(angle), math.sin(angle)])
        meeting = np.array([self.meeting_m, 0.0])
        walked_m = self.speed_mps * (self._due_s() + self.late_s)
        on = self.kind == "walks on"
        stations = (
            [-walked_m, BEYOND_M]
            if on
            else [-walked_m, max(self.beyond_m, 0.3 - walked_m), -walked_m]
        )
        points = tuple(
            (float(x), float(y)) for x, y in (meeting + along * ahead for along in stations)
        )
        pauses = (0.0, FOR_GOOD_S) if on else (0.0, self.pause_s, FOR_GOOD_S)
        person = Person(
            points=points, speed_mps=self.speed_mps, yields=False, begins_at=0.0, pauses_s=pauses
        )
        return Scenario(
            name="crossing",
            size_m=(HALL_M, HALL_M),
            map=MapExtent(size_m=(HALL_M, HALL_M)),
            start=(START_M, 0.0, 0.0),
            goals=((GOAL_M, 0.0),),
            people=(person,),
        )

    def meets_the_careless(self) -> bool:
        """Whether a robot that just drives along x at its cruising speed is touched by him, who
        comes into its sight first."""
        angle = math.radians(self.angle_deg)
        t_s = np.linspace(0.0, 12.0, 481)
        robot_m = START_M + CRUISE_MPS * np.maximum(t_s - DELAY_S, 0.0)
        along_m = self.speed_mps * (t_s - self._due_s() - self.late_s)
        if self.kind != "walks on":
            turned_s = np.maximum((along_m - self.beyond_m) / self.speed_mps - self.pause_s, 0.0)
            along_m = np.minimum(along_m, self.beyond_m) - self.speed_mps * turned_s
        x, y = self.meeting_m + along_m * math.cos(angle) - robot_m, along_m * math.sin(angle)
        gap_m = np.hypot(
            np.maximum(np.abs(x) - HUSKY.length_m / 2, 0),
            np.maximum(np.abs(y) - HUSKY.width_m / 2, 0),
        )
        met = np.flatnonzero(gap_m < BODY_DIAMETER_M / 2)
        if not len(met):
            return False
        before = (t_s < t_s[met[0]]) & (t_s > t_s[met[0]] - NOTICE_S)
        seen = (np.abs(np.arctan2(y, x - CAMERA_M)) < WIDEST_RAD) & (np.hypot(x, y) < FARTHEST_M)
        return bool((before & seen).sum() * (t_s[1] - t_s[0]) >= SEEN_S)

    def _due_s(self) -> float:
        return DELAY_S + (self.meeting_m - START_M) / CRUISE_MPS


def draw_crossing(seed: int) -> Crossing:
    """The crossing of a seed: the first drawn that meets a robot without care."""
    rng = np.random.default_rng((seed, 0xC0551))
    while True:
        kind = str(rng.choice(["walks on", "walks on", "stops", "turns back"]))
        crossing = Crossing(
            speed_mps=float(rng.uniform(*SPEEDS_MPS)),
            angle_deg=float(rng.uniform(45.0, 160.0) * rng.choice([-1, 1])),
            meeting_m=float(rng.uniform(*MEETING_M)),
            late_s=float(rng.uniform(-0.6, 0.6)),
            kind=kind,
            beyond_m=float(rng.uniform(-0.6, 1.2)),
            pause_s=float(rng.uniform(1.0, 6.0)) if kind == "stops" else 0.0,
        )
        if crossing.meets_the_careless():
            return crossing


COLUMNS = (
    *(
        "seed",
        "kind",
        "speed_mps",
        "angle_deg",
        "goals_reached",
        "collisions",
        "struck_while_standing",
        "min_clearance_m",
    ),
    *("sim_time_s", "wall_time_s"),
)


def evaluate_crossings(
    *,
    seeds: Iterable[int],
    workers: int,
    out: Path,
    beware: BewareList,
    max_time_s: float = PATIENCE_S,
    config: NavigatorConfig | None = None,
) -> dict[str, Any]:
    """Drive one crossing a seed, keep each as it ends, print a table, write `summary.json`; returns
    the summary."""
    config = config or NavigatorConfig()
    drive = partial(drive_crossing, beware=beware, max_time_s=max_time_s, config=config)
    campaign = Campaign(
        key="seed",
        rules=("crossings", draw_crossing(0), beware.classes, max_time_s, config),
        holds="another campaign, beware list or time limit",
        drive=drive,
        drive_alone=drive,
    )
    reports = campaign.run(list(seeds), workers=workers, out=out)
    summary = summarise(reports)
    conclude(reports, summary, columns=COLUMNS, title="crossings", out=out)
    return summary


def drive_crossing(
    seed: int, *, beware: BewareList, max_time_s: float, config: NavigatorConfig | None = None
) -> dict[str, Any]:
    """The report of the crossing of a seed, and what was drawn."""
    crossing = draw_crossing(seed)
    episode = Episode(
        crossing.scenario(), seed=seed, beware=beware, max_time_s=max_time_s, config=config
    )
    try:
        report = episode.run()
    finally:
        episode.close()
    drawn = {
        "kind": crossing.kind,
        "speed_mps": round(crossing.speed_mps, 2),
        "angle_deg": round(crossing.angle_deg),
    }
    return {**report, **drawn}


def summarise(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of a campaign. One that drives into somebody is at fault, one into which he walks
    while it stands is not."""
    met = [report for report in reports if report["collisions"]]
    untouched = [
        report
        for report in reports
        if not report["collisions"] and not report["struck_while_standing"]
    ]
    return {
        "episodes": len(reports),
        "drove_into_somebody": len(met),
        "drove_into_somebody_seeds": [report["seed"] for report in met],
        "struck_while_standing": sum(
            not report["collisions"] and report["struck_while_standing"] > 0 for report in reports
        ),
        "untouched": len(untouched),
        "goals_reached": sum(report["goals_reached"] for report in reports),
        "kinds": dict(Counter(report["kind"] for report in reports)),
        "min_clearance_untouched_m": min(
            (report["min_clearance_m"] for report in untouched), default=None
        ),
        "sim_time_s": round(float(np.mean([report["sim_time_s"] for report in reports])), 2),
    }
