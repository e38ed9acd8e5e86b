"""Tables of robots that drive: random missions, given ones as the paper's, doors and crossings."""

from __future__ import annotations

from collections.abc import Sequence

from app.evaluation.suites import CROSSING_SUITES, Suite
from app.evaluation.summary import RATES
from app.evaluation.tables.kinds import departures, is_of, is_paper, is_second_day
from app.evaluation.tables.table import (
    Result,
    Row,
    Table,
    count,
    failures,
    interval,
    listed,
    percent,
    seeds,
    single,
)

MOST_SEEDS = 10
"""Largest number of seeds that a cell lists."""
# No kept result is of a world with ground beyond the robot's limits, and all lack that rate.
_SHOWN_RATES = tuple(key for key in RATES if key not in ("struck_rate", "ground_rate"))


def world(result: Result) -> str:
    """Return the world of a result, what sets it apart from others in that world, and how many
    episodes were planned if there were more than it has."""
    apart = ["the paper's"] if is_paper(result) else []
    apart += ["second day"] if is_second_day(result) else []
    apart += [
        "with a scanner" if key == "scanner" else f"{key} {value}"
        for key, value in departures(result).items()
    ]
    planned = f" ({result['planned']} planned)" if "planned" in result else ""
    return ", ".join((f"`{result['scenario']}`", *apart)) + planned


def _short_row(result: Result) -> Row:
    return (
        world(result),
        count(result, "goals_rate"),
        interval(result, "goals_rate"),
        count(result, "success_rate"),
        _spl(result),
        f"{result['ideal_spl']:.2f}",
    )


def _random_row(result: Result) -> Row:
    return (
        world(result),
        *(f"{count(result, key)} ({interval(result, key)})" for key in _SHOWN_RATES),
        _spl(result),
        f"{result['ideal_spl']:.2f}",
        _items(result),
        failures(result),
    )


def _spl(result: Result) -> str:
    """Return the SPL; a dash for kept figures of before it was weighted by success, of episodes
    that were not kept."""
    return "–" if result["spl"] is None else f"{result['spl']:.2f}"


def _items(result: Result) -> str:
    """Return how many of the items that came into view the maps hold, and how many they hold that
    are none, by 10 m of driving and by class."""
    items = result["items"]
    seen, missed, false = (
        sum(counts[key] for counts in items.values()) for key in ("seen", "missed", "false")
    )
    wrong = {name: counts["false"] for name, counts in items.items() if counts["false"]}
    driven_m = _driven_m(result)
    rate = "–" if driven_m is None else f"{10 * false / driven_m:.2f}"
    return f"{seen - missed} of {seen}; {rate} ({listed(wrong)})"


def _driven_m(result: Result) -> float | None:
    """Return the way in metres on which the maps were made, on both days if there are two; None
    where that of the first days was not kept."""
    driven_m: float = result["distance_m"] * result["episodes"]
    if not is_second_day(result):
        return driven_m
    first_m: float | None = result.get("first_days", {}).get("distance_m")
    return None if first_m is None else first_m + driven_m


def _mission_row(result: Result) -> Row:
    errors_m = (
        " / ".join(f"{error_m:.2f}" for error_m in errors)
        for _, errors in sorted(result["goal_errors_m"].items())
    )
    clearance_m = result["min_clearance_m"]
    return (
        f"{world(result)}, seed {', '.join(map(str, result['seeds']))}",
        f"{result['goals_reached']} of {result['goals']}",
        f"{', '.join(errors_m)} m",
        str(result["collisions"]),
        str(result["beware_intrusions"] + result["zone_intrusions"]),
        "–" if clearance_m is None else f"{clearance_m:.2f} m",
        f"{result['distance_m']:.0f} m",
        f"{result['sim_time_s']:.0f} s",
        f"{result['explored_m3']:.0f} m³",
        failures(result),
    )


def _doors_row(result: Result) -> Row:
    missed = ", ".join(map(str, result["not_at_first_try_seeds"]))
    return (
        world(result),
        seeds(result),
        f"{count(result, 'first_try')} ({interval(result, 'first_try')})",
        str(result["collisions"]),
        f"{result['min_clearance_m']:.2f} m",
        missed or "none",
    )


def _listed_seeds(seeds: Sequence[int]) -> str:
    """Return the seeds, the first ones of many."""
    more = f" and {len(seeds) - MOST_SEEDS} more" if len(seeds) > MOST_SEEDS else ""
    return (", ".join(map(str, seeds[:MOST_SEEDS])) or "none") + more


def _crossings_row(result: Result) -> Row:
    episodes, (low, high) = result["episodes"], result["drove_into_people_ci95"]
    return (
        world(result),
        seeds(result),
        f"{result['drove_into_people']} of {episodes} ({percent(low)} to {percent(high)})",
        _listed_seeds(result["drove_into_people_seeds"]),
        f"{result['struck_while_standing']} of {episodes}",
        f"{result['goals_reached']} of {episodes}",
        f"{result['sim_time_s']:.1f} s",
        "–" if result.get("left_out") is None else str(result["left_out"]),
    )


SHORT = Table(
    shows=lambda result: result["suite"] == Suite.RANDOM and not departures(result),
    columns=(
        "world",
        "all goals reached",
        "95 % interval",
        "success",
        "SPL",
        "SPL of the baseline",
    ),
    rows=single(_short_row),
    always=True,
)
"""The table of the first page."""
RANDOM = Table(
    shows=is_of(Suite.RANDOM),
    columns=(
        *("world", *(RATES[key][0] for key in _SHOWN_RATES)),
        *("SPL", "baseline"),
        "items held of those in view; false ones per 10 m, with a second day of both days' ways "
        "(– where that of the first was not kept)",
        "failures by seed",
    ),
    rows=single(_random_row),
    always=True,
)
MISSIONS = Table(
    shows=is_of(Suite.GIVEN),
    columns=(
        *("given mission", "goals reached", "true distance at each goal"),
        *("drove into something", "over an item, a marking or a zone", "least clearance"),
        *("driven", "time", "explored", "failures by seed"),
    ),
    rows=single(_mission_row),
    always=True,
)
DOORS = Table(
    shows=is_of(Suite.DOORS),
    columns=(
        *("suite", "seeds", "passed at the first try", "collisions"),
        *("least clearance", "not at the first try"),
    ),
    rows=single(_doors_row),
)
CROSSINGS = Table(
    shows=is_of(*CROSSING_SUITES),
    columns=(
        *("suite", "seeds", "drove into a person", "seeds of these"),
        *("a person walked into the robot as it stood or made way", "goal reached", "mean time"),
        "left out, as the camera shows the person too late, or in time",
    ),
    rows=single(_crossings_row),
)
