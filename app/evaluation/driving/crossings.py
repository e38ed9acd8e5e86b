"""Evaluation of people who cross the robot's path: many seeded encounters in an empty hall.

The person does not avoid the robot. Speed, angle and time are drawn so that a robot that ignores
people is hit; half of the people walk on, the others stop on the robot's path or turn back on it.
In `crossings` each is visible to the camera for a while before the collision: on a collision course
a person stays at the same bearing, and one outside the camera's field of view is seen by chance at
the most. These others are `unseen-crossings`.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.episode.episode import Episode, EpisodeSettings
from app.evaluation.campaign import HERE, Conclusion, Fleet, show_reports
from app.evaluation.driving.drawn_missions import EXAMPLES, drive_drawn
from app.evaluation.origin import origin_of_drives
from app.evaluation.suites import CROSSING_SUITES, Suite
from app.evaluation.summary import rate_interval
from app.runtime.record.provenance import command_line
from navcore.robot.profile import HUSKY
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.schema import MapExtent, Person, Scenario

HALL_M = 30.0
START_M, GOAL_M = -4.0, 4.5
"""The robot drives along the x axis from start to goal, metres."""
CRUISE_MPS, DELAY_S = 1.0, 0.4
"""Speed of the undisturbed robot, and its delay before it drives."""
SPEEDS_MPS = (0.4, 1.6)
MEETING_M = (-1.0, 2.5)
"""Range of the x coordinate at which the two paths cross, metres."""
WIDEST_RAD = math.radians(40.0)
"""Largest bearing at which the camera sees a person; its field of view reaches 43.5° each side."""
CAMERA_M, FARTHEST_M = 0.35, 4.2
"""x of the camera in the robot's frame, and its range for people, metres."""
NOTICE_S, SEEN_S = 3.0, 0.8
"""The person is visible for `SEEN_S` within the last `NOTICE_S` before the collision, seconds."""
PATIENCE_S = 60.0
"""Time limit of an episode, simulated seconds."""
BEYOND_M, REST_S = 6.0, 3600.0
"""Distance that the person walks beyond the crossing, and the time they then stay there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A person's walk across the robot's path, as drawn from a seed."""

    speed_mps: float
    """Walking speed of the person."""
    angle_deg: float
    """Angle from the robot's heading to the person's: 90 is straight across, 180 towards the robot;
    negative to the right."""
    meeting_m: float
    """x coordinate at which the paths cross."""
    late_s: float
    """Delay of the person at the crossing behind the centre of the undisturbed robot."""
    kind: str
    """Behaviour of the person: `walks on`, `stops` or `turns back`."""
    beyond_m: float
    """Distance past the crossing at which the person stops or turns back; negative before it."""
    pause_s: float
    """Time for which the person then stands."""

    def scenario(self) -> Scenario:
        """Return the empty hall with the person in it."""
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
        pauses = (0.0, REST_S) if on else (0.0, self.pause_s, REST_S)
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

    def meets_undisturbed_robot(self) -> tuple[bool, bool]:
        """Return whether the person touches a robot that drives along x at its cruising speed, and
        whether its camera shows them for a while before that."""
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
            return False, False
        before = (t_s < t_s[met[0]]) & (t_s > t_s[met[0]] - NOTICE_S)
        seen = (np.abs(np.arctan2(y, x - CAMERA_M)) < WIDEST_RAD) & (np.hypot(x, y) < FARTHEST_M)
        return True, bool((before & seen).sum() * (t_s[1] - t_s[0]) >= SEEN_S)

    def _due_s(self) -> float:
        """Return the time at which the undisturbed robot reaches the crossing."""
        return DELAY_S + (self.meeting_m - START_M) / CRUISE_MPS


def draw_crossing(seed: int, suite: Suite = Suite.CROSSINGS) -> tuple[Crossing, int]:
    """Return the crossing of a seed: the first one drawn in which an undisturbed robot is hit, and
    has seen the person, or has not, as the suite asks; and how many of the other kind came before
    it."""
    rng, left_out = np.random.default_rng((seed, 0xC0551)), 0
    shall_be_seen = suite == Suite.CROSSINGS
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
        is_met, is_seen = crossing.meets_undisturbed_robot()
        if is_met and is_seen == shall_be_seen:
            return crossing, left_out
        left_out += is_met


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
    settings: EpisodeSettings,
    *,
    seeds: Iterable[int],
    fleet: Fleet = HERE,
    out: Path,
    suite: Suite = Suite.CROSSINGS,
) -> dict[str, Any]:
    """Drive one crossing per seed, print a table, write `summary.json`; return the summary."""
    reports = drive_drawn(
        suite,
        tuple(draw_crossing(seed, suite)[0].scenario() for seed in EXAMPLES),
        partial(drive_crossing, suite=suite),
        dataclasses.replace(settings, max_time_s=PATIENCE_S),
        seeds=seeds,
        fleet=fleet,
        out=out,
    )
    return CONCLUSIONS[suite].write(command_line(), reports, out)


def drive_crossing(
    seed: int, settings: EpisodeSettings, suite: Suite = Suite.CROSSINGS
) -> dict[str, Any]:
    """Drive the crossing of a seed; return its report with the drawn values."""
    crossing, left_out = draw_crossing(seed, suite)
    episode = Episode(crossing.scenario(), settings, seed=seed)
    try:
        report = episode.run()
    finally:
        episode.close()
    drawn = {
        "kind": crossing.kind,
        "speed_mps": round(crossing.speed_mps, 2),
        "angle_deg": round(crossing.angle_deg),
        "left_out": left_out,
    }
    return {**report, **drawn}


def summarise(
    command: str, reports: Sequence[dict[str, Any]], suite: Suite = Suite.CROSSINGS
) -> dict[str, Any]:
    """Return the summary of a campaign as a JSON object, with Wilson's interval.

    A robot that drives into a person is at fault; one that a person walks into while it stands or
    makes way is not.
    """
    left_out = [report["left_out"] for report in reports if "left_out" in report]
    hit = [report for report in reports if report["collisions"]]
    untouched = [
        report
        for report in reports
        if not report["collisions"] and not report["struck_while_standing"]
    ]
    return {
        **origin_of_drives(suite, command, reports),
        "drove_into_people": len(hit),
        "drove_into_people_ci95": [round(end, 4) for end in rate_interval(len(hit), len(reports))],
        "drove_into_people_seeds": [report["seed"] for report in hit],
        "struck_while_standing": sum(
            not report["collisions"] and report["struck_while_standing"] > 0 for report in reports
        ),
        "untouched": len(untouched),
        "goals_reached": sum(report["goals_reached"] for report in reports),
        "kinds": dict(Counter(report["kind"] for report in reports)),
        # Reports of earlier versions do not tell it.
        "left_out": sum(left_out) if len(left_out) == len(reports) else None,
        "min_clearance_untouched_m": min(
            (report["min_clearance_m"] for report in untouched), default=None
        ),
        "sim_time_s": round(float(np.mean([report["sim_time_s"] for report in reports])), 2),
    }


CONCLUSIONS: Mapping[str, Conclusion] = {
    suite: Conclusion(
        summarise=partial(summarise, suite=suite),
        show=partial(show_reports, columns=COLUMNS, title=suite),
    )
    for suite in CROSSING_SUITES
}
"""What is made of a campaign of each suite."""
