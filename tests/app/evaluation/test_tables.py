"""The tables of results in the pages are those of the kept files, and these of what ships."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from app.evaluation.perception.detection_counts import DetectionCounts, summary
from app.evaluation.suites import CROSSING_SUITES, Suite
from app.evaluation.tables.kinds import file_name, is_before, is_of, is_second_day
from app.evaluation.tables.pages import (
    BEGIN,
    END,
    PAGES,
    RESULTS,
    ROOT,
    full_table,
    kept_results,
    with_table,
)
from app.evaluation.tables.table import Result
from app.runtime.record.provenance import shipped_sha256
from navcore.errors import BadConfiguration
from navcore.learning.data.class_names import BEWARE_CLASSES

short_table = PAGES["README.md"]
FILES = sorted(RESULTS.glob("*.json"))
KEPT = dict(zip((path.stem for path in FILES), kept_results(), strict=True))
BY_COLOUR = (Suite.DOORS, *CROSSING_SUITES, Suite.LOCALISATION)
"""Suites that no network sees."""
is_random = is_of(Suite.RANDOM)
every_result = pytest.mark.parametrize("result", KEPT.values(), ids=KEPT)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_what_the_files_say(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert with_table(text, PAGES[page](kept_results())) == text


@every_result
def test_a_result_is_of_the_network_that_ships_and_names_its_origin(result: Result) -> None:
    of_place = is_second_day(result)  # which is what is judged
    if not (result["suite"] in BY_COLOUR or is_before(result) or of_place):
        assert f"network sha256 {shipped_sha256()}," in result["segmenter"]
    if result["suite"] == Suite.REPLAY:
        assert result["frames"] > 0
        assert result["command"].startswith(f"bewarenav replay {result['scenario']} ")
    elif result["suite"] == Suite.TABLE_TOPS:
        assert result["command"].startswith("bewarenav evaluate table-tops ")
        assert all(one["images"] > 0 for one in result["labelled_things"].values())
    else:
        assert result["episodes"] == len(result["seeds"]) == len(set(result["seeds"])) > 0
        assert result["command"].startswith("bewarenav evaluate ")
    assert result["versions"] and "unknown" not in result["versions"]
    assert result["machines"] and "unknown" not in result["machines"]


def test_kept_files_are_small_and_named_after_their_world() -> None:
    assert KEPT
    for name, result in KEPT.items():
        assert name == file_name(result)
        assert (RESULTS / f"{name}.json").stat().st_size < 20_000


def test_only_the_light_is_shown_for_the_network_before_it_was_trained_with() -> None:
    assert [name for name, result in KEPT.items() if is_before(result)] == ["light-before"]
    of_networks = [
        one["disturbances"].keys() for one in KEPT.values() if one["suite"] == Suite.LIGHT
    ]
    assert of_networks == [of_networks[0]] * 2
    assert "| before |" in full_table(list(KEPT.values()))


def test_another_figure_makes_another_table() -> None:
    """Control: the tables depend on what they show."""
    first = next(filter(is_random, KEPT.values()))
    for table_of in (short_table, full_table):
        for key, value in (("spl", 0.123), ("goals_rate", 0.0)):
            assert table_of([{**first, key: value}]) != table_of([first])


def test_a_mission_of_the_paper_shows_how_far_from_each_goal_the_robot_stood() -> None:
    paper = KEPT["indoor-paper"]
    shown = full_table([paper])
    assert (
        f"{paper['goal_errors_m']['3'][0]:.2f} m" in shown and short_table([paper]).count("\n") == 2
    )
    assert full_table([{**paper, "goal_errors_m": {"1": [0.5]}}]) != shown


def test_a_suite_of_walks_has_a_table_of_its_own_on_the_page_about_evaluation() -> None:
    result = {
        "command": "bewarenav evaluate finding",
        "suite": "finding",
        "scenario": "finding",
        "images": [424, 240],
        "segmenter": "network sha256 abc",
        "versions": ["1"],
        "machines": ["one"],
        "episodes": 3,
        "seeds": [2000, 2001, 2002],
    } | summary(
        [
            DetectionCounts(seen=Counter(cable=2), found=Counter(cable=1), walked_m=5.0),
            DetectionCounts(seen=Counter(box=1), found=Counter(box=1), walked_m=5.0),
            DetectionCounts(false=Counter(cup=2), walked_m=10.0),
        ],
        BEWARE_CLASSES[1:],
    )
    shown = full_table([result])
    assert "| `finding` | 424 × 240 | 2000 to 2002 | 2 of 3 (67 %, 21 % to 94 %) |" in shown
    assert "cable 1/2" in shown and "| 1/2 | 0 % | 1.00 (0.00 to 2.00) | cup 2 | 20 m |" in shown
    assert short_table([result]).count("\n") == 2
    assert full_table([{**result, "false_items_per_10_m": 3.0}]) != shown
    assert file_name(result) == "finding"
    assert file_name({**result, "images": [848, 480]}) == "finding-848x480"


def test_doors_have_a_table_of_their_own_on_the_page_about_evaluation() -> None:
    result = {
        "command": "bewarenav evaluate doors",
        "suite": "doors",
        "scenario": "doors",
        "segmenter": "colour rules",
        "versions": ["1"],
        "machines": ["one"],
        "episodes": 3,
        "seeds": [2000, 2001, 2002],
        "first_try": 0.6667,
        "not_at_first_try_seeds": [2001],
        "collisions": 0,
        "min_clearance_m": 0.071,
    }
    shown = full_table([result])
    assert "| `doors` | 2000 to 2002 | 2 of 3 (21 % to 94 %) | 0 | 0.07 m | 2001 |" in shown
    assert short_table([result]).count("\n") == 2
    assert full_table([{**result, "first_try": 1.0}]) != shown


def test_crossings_have_a_table_of_their_own_on_the_page_about_evaluation() -> None:
    result = {
        "command": "bewarenav evaluate crossings",
        "suite": "crossings",
        "scenario": "crossings",
        "segmenter": "colour rules",
        "versions": ["1"],
        "machines": ["one"],
        "episodes": 3,
        "seeds": [2000, 2001, 2002],
        "drove_into_people": 1,
        "drove_into_people_ci95": [0.0615, 0.7923],
        "drove_into_people_seeds": [2001],
        "struck_while_standing": 2,
        "goals_reached": 3,
        "sim_time_s": 21.04,
    }
    shown = full_table([result])
    row = "| `crossings` | 2000 to 2002 | 1 of 3 (6 % to 79 %) | 2001 | 2 of 3 | 3 of 3 | 21.0 s |"
    assert row in shown
    assert short_table([result]).count("\n") == 2
    assert full_table([{**result, "drove_into_people": 0}]) != shown
    many = {**result, "drove_into_people_seeds": list(range(2000, 2072)), "left_out": 5}
    assert "2008, 2009 and 62 more | 2 of 3 | 3 of 3 | 21.0 s | 5 |" in full_table([many])


def test_teaching_has_a_table_of_its_own_with_the_things_and_what_was_lost() -> None:
    kept = {"old": 0.5, "new": 0.5, "change": [-0.01, 0.01]}
    lost = {"old": 0.6, "new": 0.5, "change": [-0.12, -0.08]}
    result = {
        "command": "bewarenav evaluate teaching",
        "suite": "teaching",
        "scenario": "teaching",
        "segmenter": "network sha256 abc",
        "versions": ["1"],
        "machines": ["one"],
        "episodes": 2,
        "seeds": [2000, 2001],
        "taught": [{"kind": "lamp", "iou": 0.712}, {"kind": "vase", "iou": None}],
        "found": 1,
        "known": {"cup": {"rendered": kept}, "book": {"rendered": lost}},
    }
    shown = full_table([result])
    row = "| 1 of 2 (9 % to 91 %) | lamp 0.71, vase 0.00 | 0.550, 0.500 | book (-0.120 to -0.080) |"
    assert row in shown
    assert short_table([result]).count("\n") == 2
    assert full_table([{**result, "found": 2}]) != shown


def located(wrong: int) -> dict[str, Any]:
    """Return a result of the suite of localisation."""
    figures = {"odometry_rms_m": 0.25, "rms_m": 0.015, "p95_m": 0.03, "yaw_p95_deg": 0.1}
    figures |= {"nees": 0.7, "p99_ms": 3.9}
    loops = {"loops_right": [1.0, 2.0], "loops_wrong": [0.0, 0.0]}
    run = {"runs": 2, "median": figures, "worst": figures, "by_run": loops}
    search: dict[str, Any] = {"starts": 10, "right": 8, "refused": 2 - wrong, "wrong": wrong}
    search |= {"misled": 1, "misled_m": 0.9, "median_m": 2.5}
    carried = {"carried": 9, "noticed": 8, "in_time": 7, "right_again": 1}
    carried |= {"false_alarms": 0, "not_carried": 3}
    return {
        "suite": "localisation",
        "scenario": "office",
        "odometry": "typical",
        "segmenter": "colour rules",
        "command": "bewarenav evaluate localisation",
        "versions": ["1"],
        "machines": ["one"],
        "new_map": run,
        "saved_map": run,
        "switched_on": search,
        "looked_round": {"the saved map": {**search, "median_m": None}},
        "wrong_map": {},
        "started_in": {"mirrored": search},
        "carried_away": {"saved_map": carried},
        "disturbed": {"jump": {"right": 1, "wrong": 0, "runs": 2}},
    }


def test_localisation_has_tables_of_tracking_and_of_searches() -> None:
    result = located(wrong=0)
    shown, row = (
        full_table([result]),
        "| `office` | typical | by odometry | mirrored | 8 of 10 | 2.5 m | ",
    )
    assert "| 1.5 (1.5) cm | 3 (3) cm |" in shown and "| 3 right, 0 wrong |" in shown
    assert f"{row}2 | 0 (0 % to 28 %) | 1, 0.9 m at most |" in shown
    assert f"{row}1 | 1 (2 % to 40 %) |" in full_table([located(wrong=1)])
    assert "| no place, one turn | the saved map | 8 of 10 | – | 2 |" in shown
    assert file_name(result) == "office-localisation-typical"
    assert short_table([result]).count("\n") == 2


def test_the_second_day_has_rows_of_its_own() -> None:
    kept = next(filter(is_random, KEPT.values()))
    first = {key: value for key, value in kept.items() if key != "planned"}  # all are driven
    second = {**first, "map": "kept"}
    world = f"`{first['scenario']}`"
    assert file_name(second) == f"{first['scenario']}-second-day"
    for table_of in (short_table, full_table):
        assert f"| {world}, second day |" in table_of([second])
        assert f"| {world} |" in table_of([first])


def test_what_both_days_put_on_the_map_is_divided_by_the_way_of_both() -> None:
    items = {"box": {"there": 4, "seen": 4, "not_passed": 0, "missed": 1, "false": 6}}
    second = {**KEPT["office"], "episodes": 2, "distance_m": 10.0, "items": items, "map": "kept"}
    of_both = full_table([{**second, "first_days": {"distance_m": 40.0}}])
    assert "| 3 of 4; 1.00 (box 6) |" in of_both
    assert "| 3 of 4; – (box 6) |" in full_table([{**second, "first_days": {"came_back": 2}}])
    assert "| 3 of 4; – (box 6) |" in full_table([second])


@pytest.mark.parametrize(
    ("departs", "name", "words"),
    [
        ({"ablation": "no-semantics"}, "office-ablation-no-semantics", "ablation no-semantics"),
        ({"odometry": "poor"}, "office-odometry-poor", "odometry poor"),
        ({"latency": "120 ms"}, "office-latency-120-ms", "latency 120 ms"),
        ({"robot": "jackal"}, "office-robot-jackal", "robot jackal"),
        ({"people": "some yield"}, "office-people-some-yield", "people some yield"),
        ({"camera": "848x480@10"}, "office-camera-848x480@10", "camera 848x480@10"),
        ({"scanner": "all round"}, "office-scanner", "with a scanner"),
        ({"gnss": "plain"}, "office-gnss-plain", "gnss plain"),
        ({"scenario": "forest", "gnss": "none"}, "forest-gnss-none", "gnss none"),
        (
            {"map": "kept", "robot": "jackal", "odometry": "poor"},
            "office-second-day-robot-jackal-odometry-poor",
            "second day, robot jackal, odometry poor",
        ),
    ],
)
def test_a_campaign_of_another_robot_or_other_people_has_a_name_and_a_row_of_its_own(
    departs: dict[str, Any], name: str, words: str
) -> None:
    other = {**KEPT["office"], **departs}
    assert file_name(other) == name
    assert f"| `{other['scenario']}`, {words} " in full_table([other])


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [
        ("--zones 4", "office-zones-4", "zones 4"),
        ("--max-time=90.5", "office-max-time-90.5", "max-time 90.5"),
        ("--navigation my/slow.toml", "office-navigation-slow", "navigation slow"),
        ("--beware outdoor", "office-beware-outdoor", "beware outdoor"),
    ],
)
def test_an_option_that_only_the_command_tells_is_part_of_the_name(
    option: str, name: str, words: str
) -> None:
    other = {**KEPT["office"], "command": f"bewarenav evaluate office --random {option} --seed 3"}
    assert file_name(other) == name
    assert f"| `office`, {words} " in full_table([other])
    assert short_table([KEPT["office"], other]) == short_table([KEPT["office"]])


def test_missions_without_a_network_are_not_those_of_the_plain_name() -> None:
    blind = {**KEPT["office"], "segmenter": "colour rules"}
    assert file_name(blind) == "office-segmenter-colour-rules"
    assert [file_name(KEPT[suite]) for suite in ("doors", "crossings")] == ["doors", "crossings"]


def test_only_a_mission_of_the_paper_is_called_so() -> None:
    paper = KEPT["indoor-paper"]
    own = {**paper, "scenario": "office", "command": "bewarenav evaluate office --seed 3000"}
    assert file_name(own) == "office-given"
    assert "the paper's" in full_table([paper]) and "the paper's" not in full_table([own])


def test_the_first_page_has_the_robot_of_the_paper_alone() -> None:
    usual, own = KEPT["office"], {**KEPT["office"], "ablation": "no-semantics"}
    assert short_table([usual, own]) == short_table([usual])
    # What a world gives its robot, and a world without people, are no departures.
    assert file_name(KEPT["forest"]) == "forest" and file_name(KEPT["clutter"]) == "clutter"


def test_localisation_with_other_odometry_names_it_once() -> None:
    assert file_name({**located(0), "odometry": "poor"}) == "office-localisation-poor"


def test_a_table_stands_between_its_two_lines() -> None:
    assert with_table(f"a\n{BEGIN}old\n{END}b\n", "new\n") == f"a\n{BEGIN}new\n{END}b\n"
    for page in ("a\n", f"a\n{BEGIN}b\n", f"a\n{END}b\n{BEGIN}"):
        with pytest.raises(BadConfiguration, match="no lines"):
            with_table(page, "new\n")


def test_walks_under_each_light_have_a_row_for_each_on_the_page_about_evaluation() -> None:
    counts = [DetectionCounts(seen=Counter(cable=2), found=Counter(cable=1), walked_m=5.0)]
    measured = summary(counts, BEWARE_CLASSES[1:]) | {"mean_iou": 0.7149}
    lit = {
        "suite": "light",
        "scenario": "light",
        "segmenter": "network",
        "images": [848, 480],
        "seeds": [7],
        "versions": ["1"],
        "machines": ["m"],
        "command": "c",
        "disturbances": {"none": measured, "dark": measured},
    }
    page = full_table([*KEPT.values(), lit])
    for name in ("none", "dark"):
        assert f"| 848 × 480 | 7 to 7 | {name} | 0.715 | 1 of 2 | 1/2 |" in page
    assert "| none |" not in short_table([*KEPT.values(), lit])
