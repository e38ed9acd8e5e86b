"""Summaries of suites that drive: of few made-up reports, with what each suite counts."""

from __future__ import annotations

from typing import Any

from app.evaluation.driving.barn import summarise as summarise_barn
from app.evaluation.driving.crossings import summarise as summarise_crossings
from app.evaluation.suites import Suite
from app.evaluation.summary import rate_interval
from tests.app.evaluation.test_scenario import made_up


def crossed(seed: int, *, collisions: int = 0, struck: int = 0, **changes: Any) -> dict[str, Any]:
    walked = {"kind": "stops", "speed_mps": 1.2, "angle_deg": 90}
    counts = {"collisions": collisions, "struck_while_standing": struck}
    return made_up(seed, **{**walked, **counts, **changes})


def test_a_person_who_is_driven_into_is_told_from_one_who_walks_into_the_standing_robot() -> None:
    reports = [
        crossed(1, min_clearance_m=0.4, sim_time_s=10.0),
        crossed(2, struck=2, min_clearance_m=0.0, kind="walks on", sim_time_s=30.0),
        crossed(3, collisions=1, struck=1, min_clearance_m=0.0, goals_reached=0, sim_time_s=20.0),
        crossed(4, min_clearance_m=0.2, sim_time_s=20.0),
    ]
    told = summarise_crossings("bewarenav evaluate crossings", reports)
    assert (told["command"], told["suite"]) == ("bewarenav evaluate crossings", "crossings")
    assert (told["drove_into_people"], told["drove_into_people_seeds"]) == (1, [3])
    assert told["drove_into_people_ci95"] == [round(end, 4) for end in rate_interval(1, 4)]
    assert (told["struck_while_standing"], told["untouched"]) == (1, 2)
    assert told["min_clearance_untouched_m"] == 0.2
    assert (told["goals_reached"], told["sim_time_s"]) == (3, 20.0)
    assert told["kinds"] == {"stops": 3, "walks on": 1}


def test_crossings_in_which_everyone_is_touched_have_no_clearance_of_untouched() -> None:
    told = summarise_crossings("evaluate crossings", [crossed(1, struck=1)])
    assert (told["untouched"], told["min_clearance_untouched_m"]) == (0, None)


def raced(world: int, **verdict: Any) -> dict[str, Any]:
    usual = {"collision": False, "timeout": False, "score": 0.5, "time_s": 4.0}
    return made_up(0, world=world, **usual | verdict)


def test_the_scores_of_barn_are_means_and_its_rate_has_an_interval() -> None:
    reports = [
        raced(7),
        raced(3, success=False, collision=True, score=0.0, time_s=2.0, min_clearance_m=0.0),
        raced(4, success=False, timeout=True, score=0.0, time_s=100.0),
        raced(5, score=0.3, time_s=8.0, tick_ms={"p99": 9.0}),
    ]
    told = summarise_barn(Suite.DYNABARN, "bewarenav evaluate dynabarn", reports)
    assert (told["suite"], told["worlds"], told["episodes"]) == ("dynabarn", [7, 3, 4, 5], 4)
    assert (told["success_rate"], told["collisions"], told["timeouts"]) == (0.5, 1, 1)
    assert told["success_rate_ci95"] == [round(end, 4) for end in rate_interval(2, 4)]
    assert (told["score"], told["time_s"], told["tick_ms_p99"]) == (0.2, 28.5, 6.0)
    assert told["min_clearance_m"] == 0.0
