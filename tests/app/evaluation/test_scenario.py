"""Evaluation of scenarios: episodes, summary, figures, comparison, and each ablation."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from app.cli.evaluate.command import _scenario
from app.cli.evaluate.settings import EvaluateSettings
from app.episode import episode as episode_module
from app.episode.ablation import Oracle, SeesNothing
from app.episode.ablations import Ablation
from app.episode.episode import Episode, EpisodeSettings
from app.episode.failure_causes import causes_of, count_causes
from app.episode.task import Task, episode_of
from app.evaluation import plots
from app.evaluation.driving import scenario as scenario_module
from app.evaluation.driving.scenario import (
    Evaluation,
    _draw,
    _drive_alone,
    evaluate_scenario,
)
from app.evaluation.summary import RATES, compare, mean_interval, rate_interval, summarise
from app.evaluation.tables.pages import RESULTS
from app.evaluation.tables.table import count
from app.runtime.start import preparation
from app.runtime.start.segmentation import Perception, colour_perception
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.config.perception.perception import PerceptionConfig
from navcore.errors import BadConfiguration, BewareNavError
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.robot.profile import HUSKY, load_profile
from sim.scenario.load import load_scenario
from sim.scenario.schema import Furniture, Person
from tests.sim.worlds import open_floor

ROOM = load_scenario("empty_room")


def task(**changes: Any) -> Task:
    return Task(**{"scenario": ROOM, "max_time_s": 120.0, **changes})


def driven(about: Task, *, seed: int = 0, beware: BewareList | None = None) -> dict[str, Any]:
    episode = episode_of(
        about, seed, robot=HUSKY, beware=beware or default_beware_list(), perception=None
    )
    try:
        return episode.run()
    finally:
        episode.close()


@pytest.mark.long
def test_an_evaluation_is_resumed_where_it_was_cut_and_draws_its_figures(
    tmp_path: Path, capsys: Any
) -> None:
    beware, drives = default_beware_list(), task(random=True, max_time_s=4.0)
    first = evaluate_scenario(drives, seeds=range(1), out=tmp_path, beware=beware)
    kept = (tmp_path / "episodes.jsonl").read_text()
    (tmp_path / "episodes.jsonl").write_text(
        kept + '{"scenario": "empty_ro'
    )  # as a kill would leave it
    both = evaluate_scenario(drives, seeds=range(2), out=tmp_path, beware=beware)
    assert (first["episodes"], both["episodes"], both["seeds"]) == (1, 2, [0, 1])
    assert (tmp_path / "episodes.jsonl").read_text().startswith(kept)
    assert json.loads((tmp_path / "summary.json").read_text()) == json.loads(json.dumps(both))
    words = capsys.readouterr().out
    assert all(word in words for word in ("success", "95 % interval", "SPL", "red floor"))
    drawn = {
        f"{name}.{suffix}"
        for name in ("top_view", "progress", "frames")
        for suffix in ("png", "svg")
    }
    assert {path.name for path in (tmp_path / "figures" / "seed-0000").iterdir()} == drawn
    assert {path.name for path in (tmp_path / "figures").glob("*.*")} == {
        *("drives.png", "drives.svg", "progress.png", "progress.svg")
    }
    assert compare_text([tmp_path, tmp_path]).count("empty_room") == 2
    with pytest.raises(BadConfiguration, match="ablation"):
        evaluate_scenario(task(), seeds=range(1), out=tmp_path, beware=beware)


def no_plot(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_an_episode_whose_figures_cannot_be_drawn_is_recorded_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plots, "plot_episode", no_plot)
    short, beware = task(max_time_s=1.0), default_beware_list()
    with pytest.raises(BewareNavError, match=r"figures of seed 3 cannot be drawn: OSError.*No s"):
        evaluate_scenario(short, seeds=[3], out=tmp_path, beware=beware)
    assert json.loads((tmp_path / "episodes.jsonl").read_text())["seed"] == 3
    (tmp_path / "figures").touch()  # where a folder is to be made
    with pytest.raises(BadConfiguration, match=r"cannot be written: .*figures"):
        evaluate_scenario(short, seeds=[3], out=tmp_path, beware=beware, draw_first=0)
    assert json.loads((tmp_path / "summary.json").read_text())["seeds"] == [3]


def test_figures_of_a_campaign_say_which_world_is_drawn_and_what_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(plots, "save", lambda figure, path: drawn.update({path.name: figure}))
    way = {"t_s": [0.0, 1.0], "distance_m": [0.0, 1.0], "explored_m3": [0.0, 1.0]}
    way |= {"x_m": [0.0, 1.0], "y_m": [0.0, 0.0]}
    kept = {name: values[-1:] for name, values in way.items()}
    reports = [made_up(4, series=kept), made_up(5, series=way), made_up(6, series=way)]
    _draw(reports, ROOM, tmp_path / "figures")
    (axes,) = drawn["drives"].axes
    title = "empty_room, 2 episodes, 1 more without series; obstacles of seed 5\n2 of 2 succeeded"
    assert axes.get_title() == title
    above, _ = drawn["progress"].axes
    assert len(above.lines) == 2 and above.get_title() == title.partition(";")[0]
    drawn.clear()
    _draw(reports[:1], ROOM, tmp_path / "figures")
    assert drawn == {}


def test_the_segmenter_has_the_perception_of_the_configuration_wherever_it_is_composed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tuned = dataclasses.replace(
        NavigatorConfig(), perception=PerceptionConfig(min_person_confidence=0.6)
    )
    asked = list[PerceptionConfig]()

    def composed(*_: object, config: PerceptionConfig, **__: object) -> Perception:
        asked.append(config)
        return colour_perception(config=config)

    monkeypatch.setattr(preparation, "prepared_perception", composed)
    monkeypatch.setattr(scenario_module, "evaluate_scenario", lambda *_, **__: {"success_rate": 1})
    assert _scenario(EvaluateSettings(suite="empty_room"), tuned)
    monkeypatch.setattr(scenario_module, "compose", composed)
    monkeypatch.setattr(scenario_module, "_drive", lambda *_, **__: None)
    common = Evaluation(task=task(), robot=HUSKY, beware=default_beware_list(), config=tuned)
    _drive_alone(0, common=common, choice=SegmenterChoice(kind="colour"))
    monkeypatch.setattr(episode_module, "colour_perception", composed)
    settings = EpisodeSettings(beware=default_beware_list(), config=tuned)
    Episode(ROOM, settings, seed=0).close()
    assert asked == [tuned.perception] * 3


def test_an_episode_without_a_configuration_has_that_of_its_robot() -> None:
    jackal = load_profile("jackal")
    settings = EpisodeSettings(beware=default_beware_list(), robot=jackal)
    episode = Episode(ROOM, settings, seed=0)
    episode.close()
    assert episode.controller.navigator.config == config_for(jackal)


def compare_text(folders: list[Path]) -> str:
    table = compare(folders)
    return "\n".join(str(cell) for column in table.columns for cell in column.cells)


def test_without_semantics_the_robot_drives_over_the_red_floor_and_misses_it() -> None:
    report = driven(task(ablation=Ablation.NO_SEMANTICS))
    assert report["intruded"] == {"red floor": 1} and report["beware_intrusion_m2s"] > 0
    assert report["items"]["red floor"] == {
        "there": 1,
        "seen": 1,
        "not_passed": 0,
        "missed": 1,
        "false": 0,
    }
    assert (report["success"], report["causes"]) == (False, ["over red floor"])
    assert report["segmenter"] == "no-semantics"


def test_with_the_simulators_labels_the_robot_keeps_off_and_misses_nothing() -> None:
    nothing_by_colour = BewareList(
        classes=tuple(
            dataclasses.replace(entry, colour=None) for entry in default_beware_list().classes
        )
    )
    report = driven(task(ablation=Ablation.ORACLE), beware=nothing_by_colour)
    assert report["success"] and report["causes"] == []
    assert report["items"]["red floor"] == {
        "there": 1,
        "seen": 1,
        "not_passed": 0,
        "missed": 0,
        "false": 0,
    }


def test_zones_keep_the_robot_out_unless_left_out_and_the_referee_judges_by_them_anyway() -> None:
    open_space = dataclasses.replace(open_floor(start=(-3.0, 0.0, 0.0)), goals=((3.0, 0.0),))
    obeyed = driven(task(scenario=open_space, zones=1))
    assert len(obeyed["zones"]) == 1 and obeyed["zone_intrusions"] == 0 and obeyed["success"]
    ignored = driven(task(scenario=open_space, zones=1, ablation=Ablation.NO_ZONES))
    assert (
        ignored["zones"] == obeyed["zones"]
        and ignored["zone_intrusions"] == 1
        and ignored["zone_intrusion_m2s"] > 0.1
    )
    assert ignored["causes"] == ["over a zone"]
    assert ignored["goals_reached"] == 1 and ignored["spl"] == 0.0 < obeyed["spl"]


def test_without_the_local_planner_the_robot_follows_the_path_and_hits_nothing() -> None:
    open_space = dataclasses.replace(open_floor(), goals=((3.0, 1.0), (0.0, 0.0)))
    report = driven(task(scenario=open_space, ablation=Ablation.NO_LOCAL_PLANNER))
    assert report["success"] and report["goals_reached"] == 2
    assert report["spl"] > 0.8


def test_a_person_who_walks_into_the_robot_from_behind_is_no_fault_of_its() -> None:
    """Outside the camera's view; a robot that drives into a person is in `test_crossings`."""
    behind = Person(points=((-3.0, 0.0), (8.0, 0.0)), speed_mps=1.5, yields=False, begins_at=0.0)
    world = dataclasses.replace(open_floor(people=(behind,)), goals=((6.0, 0.0),))
    report = driven(task(scenario=world))
    assert {contact["what"] for contact in report["contacts"]} == {"person"}
    assert report["struck_while_standing"] > report["collisions"] == 0
    assert report["success"] and report["causes"] == []


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"random": True, "goals": ((1.0, 1.0),)}, "--goal"),
        ({"ablation": Ablation.NO_ZONES}, "--zones"),
        (
            {"scenario": open_floor(furniture=(Furniture(kind="box", at=(3.0, 3.0)),))},
            "no goals of its own",
        ),
    ],
)
def test_tasks_that_make_no_sense_are_refused_by_option(about: dict[str, Any], words: str) -> None:
    with pytest.raises(BadConfiguration, match=words):
        task(**about)


def made_up(seed: int, **changes: Any) -> dict[str, Any]:
    report: dict[str, Any] = {
        "scenario": "w",
        "zones": [],
        "robot": "husky",
        "segmenter": "colour",
        "version": "1",
        "machine": "one",
        "ablation": "none",
        "odometry": "typical",
        "gnss": "none",
        "scanner": "none",
        "latency": "none",
        "people": "none",
        "camera": "424x240@10",
        "map": "new",
        "seed": seed,
        "success": True,
        "goals": [[0.0, 0.0]],
        "goals_reached": 1,
        "collisions": 0,
        "struck_while_standing": 0,
        "beware_intrusions": 0,
        "zone_intrusions": 0,
        "spl": 0.9,
        "shortest_m": 9.0,
        "ideal_m": 12.0,
        "distance_m": 10.0,
        "sim_time_s": 20.0,
        "wall_time_s": 10.0,
        "contacts": [],
        "beware_intrusion_m2s": 0.0,
        "zone_intrusion_m2s": 0.0,
        "explored_share": 0.5,
        "min_clearance_m": 0.2,
        "series": {"explored_m3": [1.0]},
        "tick_ms": {"p99": 5.0},
        "intruded": {},
        "intrusions": [],
        "ended": "all goals",
        "goal_errors_m": {"1": 0.1},
        "goal_errors_by_estimate_m": {"1": 0.1},
        "stops": [],
        "items": {"cup": {"there": 1, "seen": 1, "not_passed": 0, "missed": 0, "false": 0}},
        **changes,
    }
    return {**report, "causes": causes_of(report)}


def over_zone(gap_by_odometry_m: float) -> dict[str, Any]:
    return {"t_s": 1.0, "what": "zone 1", "duration_s": 0.5, "gap_by_odometry_m": gap_by_odometry_m}


def over_ground(kind: str) -> dict[str, Any]:
    intrusion = {**over_zone(0.0), "what": kind}
    return {
        "ground_intrusions": 1,
        "ground_intruded": {kind: 1},
        "fell": False,
        "intrusions": [intrusion],
    }


def test_failures_are_sorted_by_their_most_severe_cause() -> None:
    hit = {"t_s": 1.0, "what": "chair", "collided": True}
    held = {"t_s": 12.0, "duration_s": 8.0, "reason": "boxed_in", "until_s": 20.0}
    reports = [
        made_up(0),
        made_up(1, collisions=1, contacts=[hit], intruded={"cup": 1}),
        made_up(2, goals_reached=0, ended="time", stops=[held]),
        made_up(3, goals_reached=0, ended="time"),
        made_up(10, goals_reached=0, ended="position lost"),
        made_up(4, goals_reached=0, goal_errors_m={"1": 0.5}, goal_errors_by_estimate_m={"1": 0.4}),
        made_up(5, collisions=1, contacts=[hit]),
        made_up(7, goals_reached=0, goal_errors_m={"1": 0.5}, goal_errors_by_estimate_m={"1": 0.1}),
        made_up(8, zone_intrusions=1, intrusions=[over_zone(0.02)]),
        made_up(9, zone_intrusions=2, intrusions=[over_zone(0.02), over_zone(0.0)]),
        made_up(11, **over_ground("edge")),
        made_up(12, **{**over_ground("edge"), "fell": True}),
        made_up(13, **over_ground("steep slope")),
        made_up(
            6, contacts=[{**hit, "what": "person", "collided": False}], struck_while_standing=1
        ),
    ]
    assert reports[1]["causes"] == ["drove into chair", "over cup"] and reports[-1]["causes"] == []
    assert count_causes(reports) == {
        "drove into chair": [1, 5],
        "goal not reached: boxed_in": [2],
        "goal not reached: out of time": [3],
        "goal not reached: the position was lost": [10],
        "goal missed: it stopped beside it": [4],
        "goal missed: the estimated position had drifted": [7],
        "over a zone: odometry had drifted": [8],
        "over a zone": [9],
        "over edge": [11],
        "fell": [12],
        "over steep slope": [13],
    }


def test_a_summary_has_rates_and_means_with_their_intervals() -> None:
    summary = summarise(
        [made_up(seed, success=seed > 0, spl=0.8 + 0.02 * seed) for seed in range(10)]
    )
    # Anderson et al. 2018: a path counts if the episode is a success, whatever it reached.
    assert summary["success_rate"] == 0.9 and summary["goals_rate"] == 1.0
    assert summary["spl"] == pytest.approx(0.81)
    assert summary["success_rate_ci95"] == pytest.approx(
        [0.596, 0.982], abs=1e-3
    )  # Wilson's, from the literature
    low, high = summary["spl_ci95"]
    assert 0.55 < low < 0.81 < high < 0.94
    assert summary["ideal_spl"] == 0.75
    assert summary["items"]["cup"] == {
        "there": 10,
        "seen": 10,
        "not_passed": 0,
        "missed": 0,
        "false": 0,
    }


def test_the_rate_of_zones_is_one_of_the_episodes_that_have_one() -> None:
    zone = [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]
    over = made_up(0, zones=zone, zone_intrusions=1, intrusions=[over_zone(0.0)])
    summary = summarise([over, made_up(1, zones=2 * zone), *(made_up(n, zones=[]) for n in (2, 3))])
    assert (summary["zones"], summary["zone_episodes"], summary["zone_rate"]) == (3, 2, 0.5)
    assert count(summary | {"episodes": 4}, "zone_rate") == "1 of 2"
    none = summarise([made_up(2, zones=[])])
    assert (none["zone_rate"], none["zone_rate_ci95"]) == (None, None)
    assert count(none | {"episodes": 1}, "zone_rate") == "0 of 0"


def test_ground_beyond_the_limits_and_falls_are_a_rate_and_earlier_reports_have_none() -> None:
    judged = [made_up(0, **over_ground("edge")), made_up(1, fell=True), made_up(2, fell=False)]
    summary = summarise([*judged, made_up(3)])
    assert summary["ground_rate"] == 0.5 and summary["ground_intrusions"] == 1


def test_the_summary_of_second_days_says_how_the_maps_came_about() -> None:
    day = {"goals_reached": 2, "goals": 2, "map_error_m": 0.2, "place_shown": False}
    day |= {"distance_m": 20.51}
    lost = {**day, "goals_reached": 1, "distance_m": 7.0, "map_error_m": 0.4, "place_shown": True}
    summary = summarise(
        [made_up(1, map="kept", first_day=day), made_up(2, map="kept", first_day=lost)]
    )
    assert summary["first_days"] == {
        "came_back": 1,
        "map_error_m": [0.2, 0.4],
        "distance_m": 27.5,
        "place_shown_seeds": [2],
    }
    assert "first_days" not in summarise([made_up(1)])


def test_intervals_are_right_at_the_ends_and_the_same_every_time() -> None:
    assert rate_interval(0, 100) == pytest.approx((0.0, 0.037), abs=1e-3)
    assert rate_interval(100, 100) == pytest.approx((0.963, 1.0), abs=1e-3)
    assert mean_interval([1.0]) is None
    assert mean_interval([1.0, 2.0, 4.0]) == mean_interval([1.0, 2.0, 4.0]) == (1.0, 4.0)


def test_a_summary_from_before_the_ground_was_judged_is_compared(tmp_path: Path) -> None:
    kept = json.loads((RESULTS / "office.json").read_text(encoding="utf-8"))
    before = {key: value for key, value in kept.items() if not key.startswith("ground_")}
    (tmp_path / "summary.json").write_text(json.dumps(before), encoding="utf-8")
    table = compare([tmp_path])
    title, _ = RATES["ground_rate"]
    rows = dict(zip(*(column.cells for column in table.columns), strict=True))
    assert str(rows[title]).strip() == "–"


def test_folders_of_other_suites_are_not_compared(tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match=r"no summary\.json"):
        compare([tmp_path])
    (tmp_path / "summary.json").write_text('{"suite": "barn"}')
    with pytest.raises(BadConfiguration, match="another suite"):
        compare([tmp_path])


def test_blind_and_omniscient_segmenters_say_what_they_find() -> None:
    entry = default_beware_list().classes[0]
    assert SeesNothing().source_of(entry) == "nothing"
    assert Oracle.source_of(None, entry) == "network"  # type: ignore[arg-type]
