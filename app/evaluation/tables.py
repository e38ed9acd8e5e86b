"""The tables of results in the pages, made from the kept files in `results/`.

A file is the `summary.json` of a campaign, named after its world or suite (`file_name`) and images
of another size than the camera's usual one, or the
`replay.json` of a recording with annotated objects, named after its folder.
`python -m app.evaluation.tables` rewrites the tables; a test compares them.
"""

from __future__ import annotations

import json
import re
import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.evaluation.perception.light_figures import row_of
from app.evaluation.summary import RATES, rate_interval
from navcore.errors import BadConfiguration
from navcore.robot.camera_stream import CameraStream

ROOT = Path(__file__).parents[2]
RESULTS = Path(__file__).with_name("results")
BEGIN, END = "<!-- results -->\n", "<!-- /results -->\n"
"""Lines of a page between which its table stands."""
HASH = re.compile(r"([0-9a-f]{12})[0-9a-f]{52}")
"""A SHA-256, of which a table shows the beginning."""
Result = Mapping[str, Any]


def kept_results(folder: Path = RESULTS) -> list[Result]:
    """Return the kept summaries in the order of their worlds' names."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def is_paper(result: Result) -> bool:
    """Return whether a result is of one of the paper's missions, not of random ones."""
    return result.get("mission") == "given"


def is_walked(result: Result) -> bool:
    """Return whether a result is of a suite in which a camera is carried and nothing drives."""
    return "found_in_time" in result


def is_lit(result: Result) -> bool:
    """Return whether a result is of the walks under each disturbance of the light."""
    return "disturbances" in result


def is_doors(result: Result) -> bool:
    """Return whether a result is of the suite of doors."""
    return "first_try" in result


def is_crossings(result: Result) -> bool:
    """Return whether a result is of the suite of people who cross the robot's path."""
    return "drove_into_people" in result


def is_taught(result: Result) -> bool:
    """Return whether a result is of the suite of teaching."""
    return "taught" in result


def is_localisation(result: Result) -> bool:
    """Return whether a result is of the suite of localisation."""
    return "saved_map" in result


def is_second_day(result: Result) -> bool:
    """Return whether a result is of missions in a kept map."""
    return result.get("map") == "kept"


def file_name(result: Result) -> str:
    """Return the name of the file of a result, without its suffix."""
    is_finer = is_walked(result) and tuple(result["images"]) != CameraStream().size
    kinds = (
        "paper" if is_paper(result) else "",
        "second-day" if is_second_day(result) else "",
        f"localisation-{result['odometry']}" if is_localisation(result) else "",
        "{}x{}".format(*result["images"]) if is_finer else "",
    )
    return "-".join(filter(None, (result["scenario"], *kinds)))


def is_recorded(result: Result) -> bool:
    """Return whether a result is of a recording of a real camera."""
    return "frames" in result


def is_labelled(result: Result) -> bool:
    """Return whether a result is of real things on tables."""
    return "labelled_things" in result


def is_random(result: Result) -> bool:
    """Return whether a result is of random missions in a world."""
    others = (
        *(is_paper, is_walked, is_lit, is_doors, is_crossings, is_taught, is_recorded),
        *(is_localisation, is_labelled),
    )
    return not any(is_other(result) for is_other in others)


def short_table(results: Sequence[Result]) -> str:
    """Return the table of the first page."""
    return _table(
        ("world", "all goals reached", "95 % interval", "success", "SPL", "SPL of the baseline"),
        [
            (
                _world(result),
                _count(result, "goals_rate"),
                _interval(result, "goals_rate"),
                _count(result, "success_rate"),
                f"{result['spl']:.2f}",
                f"{result['ideal_spl']:.2f}",
            )
            for result in results
            if is_random(result)
        ],
    )


def full_table(results: Sequence[Result]) -> str:
    """Return the tables of the page about evaluation: figures, failures and origin."""
    rates = [key for key in RATES if key != "struck_rate"]
    figures = _table(
        ("world", *(RATES[key][0] for key in rates), "SPL", "baseline", "failures by seed"),
        [
            (
                _world(result),
                *(f"{_count(result, key)} ({_interval(result, key)})" for key in rates),
                f"{result['spl']:.2f}",
                f"{result['ideal_spl']:.2f}",
                _failures(result),
            )
            for result in results
            if is_random(result)
        ],
    )
    missions = _table(
        (
            *("the paper's mission", "goals reached", "true distance at G1, G2, G3"),
            *("drove into something", "over an item, a marking or a zone", "least clearance"),
            *("driven", "time", "explored", "failures by seed"),
        ),
        [_mission_row(result) for result in results if is_paper(result)],
    )
    walked = [_walks_row(result) for result in results if is_walked(result)]
    walks = _table(
        (
            *("suite", "images", "seeds", "found in time", "by class", "of thin ones"),
            *("by their names", "false per 10 m", "false by class", "walked"),
        ),
        walked,
    )
    light = _table(
        ("images", "seeds", "light", "mIoU", "found in time", "of thin ones", "false per 10 m"),
        [row for result in results if is_lit(result) for row in _light_rows(result)],
    )
    recorded = _table(
        (
            *("recording", "frames", "occupied cells", "wrongly of the list", "by class"),
            *("objects held as their class", "each held as"),
        ),
        [_recording_row(result) for result in results if is_recorded(result)],
    )
    labelled = _table(
        ("suite", "images", "things labelled", "95 % interval", "as", "of the tables"),
        [row for result in results if is_labelled(result) for row in _labelled_rows(result)],
    )
    doors = _table(
        (
            "suite",
            "seeds",
            "passed at the first try",
            "collisions",
            "least clearance",
            "not passed",
        ),
        [_doors_row(result) for result in results if is_doors(result)],
    )
    crossings = _table(
        (
            *("suite", "seeds", "drove into a person", "seeds of these"),
            *("a person walked into the standing robot", "goal reached", "mean time"),
        ),
        [_crossings_row(result) for result in results if is_crossings(result)],
    )
    taught = _table(
        (
            *("suite", "seeds", "found elsewhere", "IoU of each"),
            *("mean IoU of the known classes in rendered images, before and after", "most lost"),
        ),
        [_teaching_row(result) for result in results if is_taught(result)],
    )
    located = _table(
        (
            *("world", "odometry", "runs", "odometry alone, rms", "new map, rms"),
            *("saved map, rms", "its p95", "its yaw, p95", "NEES", "loops", "carried away"),
            *("disturbed", "p99 a frame"),
        ),
        [_tracking_row(result) for result in results if is_localisation(result)],
    )
    searched = _table(
        (
            *("world", "odometry", "start", "map", "right", "after", "refused", "wrong"),
            "misled on the way",
        ),
        [row for result in results if is_localisation(result) for row in _search_rows(result)],
    )
    origins = _table(
        (
            "world",
            "latency",
            "people",
            "odometry",
            "GNSS",
            "segmenter",
            "version",
            "machine",
            "command",
        ),
        [
            (
                _world(result)
                + ", the paper's" * is_paper(result)
                + ", localisation" * is_localisation(result),
                result.get("latency", "–"),
                result.get("people", "–"),
                result.get("odometry", "–"),
                result.get("gnss", "–"),
                HASH.sub(r"\1…", result["segmenter"]),
                "; ".join(result["versions"]),
                "; ".join(result["machines"]),
                f"`{result['command']}`",
            )
            for result in results
        ],
    )
    lit = [light] if any(map(is_lit, results)) else []
    real = [recorded] if any(map(is_recorded, results)) else []
    real += [labelled] if any(map(is_labelled, results)) else []
    passed = [doors] if any(map(is_doors, results)) else []
    met = [crossings] if any(map(is_crossings, results)) else []
    learned = [taught] if any(map(is_taught, results)) else []
    walking = [walks] if walked else []
    placed = [located, searched] if any(map(is_localisation, results)) else []
    tables = [figures, missions, *walking, *lit, *real, *passed, *met, *learned, *placed, origins]
    return "\n".join(tables)


PAGES: Mapping[str, Callable[[Sequence[Result]], str]] = {
    "README.md": short_table,
    "app/evaluation/README.md": full_table,
}
"""Pages with results, and what makes their tables."""


def with_table(page: str, table: str) -> str:
    """Return a page with the table between its two lines; raises `BadConfiguration` without
    them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise BadConfiguration(f"the page has no lines {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}{table}{END}{after}"


def main() -> None:
    """Rewrite the tables of all pages."""
    results = kept_results()
    for name, table_of in PAGES.items():
        path = ROOT / name
        page = path.read_text(encoding="utf-8")
        path.write_text(with_table(page, table_of(results)), encoding="utf-8")


def _mission_row(result: Result) -> Sequence[str]:
    errors_m = (
        " / ".join(f"{error_m:.2f}" for error_m in errors)
        for _, errors in sorted(result["goal_errors_m"].items())
    )
    clearance_m = result["min_clearance_m"]
    return (
        f"`{result['scenario']}`, seed {', '.join(map(str, result['seeds']))}",
        f"{result['goals_reached']} of {result['goals']}",
        f"{', '.join(errors_m)} m",
        str(result["collisions"]),
        str(result["beware_intrusions"] + result["zone_intrusions"]),
        "–" if clearance_m is None else f"{clearance_m:.2f} m",
        f"{result['distance_m']:.0f} m",
        f"{result['sim_time_s']:.0f} s",
        f"{result['explored_m3']:.0f} m³",
        _failures(result),
    )


def _walks_row(result: Result) -> Sequence[str]:
    low, high = result["found_in_time_ci95"]
    few, many = result["false_items_per_10_m_ci95"]
    share = f"{result['found_in_time']:.0%}, {low:.0%} to {high:.0%}".replace("%", " %")
    return (
        f"`{result['scenario']}`",
        "{} × {}".format(*result["images"]),
        f"{min(result['seeds'])} to {max(result['seeds'])}",
        f"{result['found']} of {result['things_in_view']} ({share})",
        _listed(result["found_by_class"]),
        result.get("found_of_thin", "–"),
        f"{result['named_rightly']:.0%}".replace("%", " %"),
        f"{result['false_items_per_10_m']:.2f} ({few:.2f} to {many:.2f})",
        _listed(result["false_items_by_class"]),
        f"{result['walked_m']:.0f} m",
    )


def _light_rows(result: Result) -> list[Sequence[str]]:
    size = "{} × {}".format(*result["images"])
    seeds = f"{min(result['seeds'])} to {max(result['seeds'])}"
    return [
        (size, seeds, name, *row_of(measured)) for name, measured in result["disturbances"].items()
    ]


def _recording_row(result: Result) -> Sequence[str]:
    judged = result["objects"]
    share = judged["wrong_cells"] / judged["judged_cells"]
    held = {
        name: "as " + " and ".join(classes) if classes else "no"
        for name, classes in judged["held"].items()
    }
    return (
        f"`{result['scenario']}`",
        str(result["frames"]),
        str(judged["judged_cells"]),
        f"{judged['wrong_cells']} ({share:.1%})".replace("%", " %"),
        _listed(judged["wrong_by_class"]),
        f"{judged['held_as_own_class']} of {len(held)}",
        "; ".join(f"{name}: {classes}" for name, classes in held.items()),
    )


def _labelled_rows(result: Result) -> list[Sequence[str]]:
    return [
        (
            f"`{result['scenario']}`, {name}",
            str(found["images"]),
            f"{found['labelled']} of {found['things']}",
            _share_interval(found["labelled"], found["things"]),
            _listed(found["by_class"]),
            f"{found['table_share']:.2%}".replace("%", " %"),
        )
        for name, found in result["labelled_things"].items()
    ]


def _doors_row(result: Result) -> Sequence[str]:
    seeds = ", ".join(map(str, result["not_at_first_try_seeds"]))
    return (
        f"`{result['scenario']}`",
        f"{min(result['seeds'])} to {max(result['seeds'])}",
        f"{_count(result, 'first_try')} ({_interval(result, 'first_try')})",
        str(result["collisions"]),
        f"{result['min_clearance_m']:.2f} m",
        seeds or "none",
    )


def _crossings_row(result: Result) -> Sequence[str]:
    episodes, (low, high) = result["episodes"], result["drove_into_people_ci95"]
    interval = f"{low:.0%} to {high:.0%}".replace("%", " %")
    return (
        f"`{result['scenario']}`",
        f"{min(result['seeds'])} to {max(result['seeds'])}",
        f"{result['drove_into_people']} of {episodes} ({interval})",
        ", ".join(map(str, result["drove_into_people_seeds"])) or "none",
        f"{result['struck_while_standing']} of {episodes}",
        f"{result['goals_reached']} of {episodes}",
        f"{result['sim_time_s']:.1f} s",
    )


def _tracking_row(result: Result) -> Sequence[str]:
    new, saved = result["new_map"], result["saved_map"]

    def shown(which: Result, name: str, scale: float = 1.0, unit: str = "m") -> str:
        middle, worst = (scale * which[kind][name] for kind in ("median", "worst"))
        return f"{middle:.3g} ({worst:.3g}) {unit}".rstrip()

    loops = {kind: int(sum(new["by_run"][f"loops_{kind}"])) for kind in ("right", "wrong")}
    carried = result["carried_away"]["saved_map"]
    ends = result["disturbed"].values()
    return (
        f"`{result['scenario']}`",
        result["odometry"],
        str(new["runs"]),
        shown(new, "odometry_rms_m"),
        shown(new, "rms_m"),
        shown(saved, "rms_m", 100.0, "cm"),
        shown(saved, "p95_m", 100.0, "cm"),
        shown(saved, "yaw_p95_deg", unit="°"),
        shown(saved, "nees", unit=""),
        f"{loops['right']} right, {loops['wrong']} wrong",
        f"{carried['noticed']} of {carried['carried']} noticed, {carried['in_time']} in time, "
        f"{carried['right_again']} more corrected; "
        f"{carried['false_alarms']} false alarms in {carried['not_carried']}",
        f"{sum(end['right'] for end in ends)} right, {sum(end['wrong'] for end in ends)} wrong of "
        f"{sum(end['runs'] for end in ends)}",
        shown(saved, "p99_ms", unit="ms"),
    )


def _search_rows(result: Result) -> list[Sequence[str]]:
    """Return a row for each map, in which the robot is switched on without a place, and turns round
    first or drives on at once, or at the place that odometry gives."""
    found = [
        *(("no place, one turn", name, one) for name, one in result["looked_round"].items()),
        ("no place", "the saved map", result["switched_on"]),
        *(("no place", name, one) for name, one in result["wrong_map"].items()),
        *(("by odometry", name, one) for name, one in result["started_in"].items()),
    ]
    return [
        (
            f"`{result['scenario']}`",
            result["odometry"],
            start,
            name,
            f"{one['right']} of {one['starts']}",
            "–" if one["median_m"] is None else f"{one['median_m']:.1f} m",
            str(one["refused"]),
            f"{one['wrong']} ({_share_interval(one['wrong'], one['starts'])})",
            f"{one['misled']}, {one['misled_m']:.1f} m at most",
        )
        for start, name, one in found
    ]


def _teaching_row(result: Result) -> Sequence[str]:
    taught = result["taught"]
    low, high = rate_interval(result["found"], len(taught))
    share = f"{low:.0%} to {high:.0%}".replace("%", " %")
    known = {
        name: figures["rendered"]
        for name, figures in result["known"].items()
        if figures["rendered"]["change"] is not None
    }
    before, after = (
        statistics.fmean(figure[key] for figure in known.values()) for key in ("old", "new")
    )
    lost = min(known, key=lambda name: known[name]["new"] - known[name]["old"])
    least, most = known[lost]["change"]
    return (
        f"`{result['scenario']}`",
        f"{min(result['seeds'])} to {max(result['seeds'])}",
        f"{result['found']} of {len(taught)} ({share})",
        ", ".join(f"{one['kind']} {one['iou'] or 0.0:.2f}" for one in taught),
        f"{before:.3f}, {after:.3f}",
        f"{lost} ({least:+.3f} to {most:+.3f})",
    )


def _listed(by_name: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {count}" for name, count in by_name.items()) or "none"


def _failures(result: Result) -> str:
    causes = result["failures"].items()
    return "; ".join(f"{cause}: {', '.join(map(str, seeds))}" for cause, seeds in causes) or "none"


def _count(result: Result, key: str) -> str:
    return f"{round(result[key] * result['episodes'])} of {result['episodes']}"


def _world(result: Result) -> str:
    return f"`{result['scenario']}`" + ", second day" * is_second_day(result)


def _interval(result: Result, key: str) -> str:
    episodes = result["episodes"]
    return _share_interval(round(result[key] * episodes), episodes)


def _share_interval(number: int, trials: int) -> str:
    low, high = rate_interval(number, trials)
    return f"{low:.0%} to {high:.0%}".replace("%", " %")


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


if __name__ == "__main__":
    main()
