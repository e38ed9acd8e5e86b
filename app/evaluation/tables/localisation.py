"""Tables of localisation: tracking, and searches for the place."""

from __future__ import annotations

from app.evaluation.suites import Suite
from app.evaluation.tables.kinds import is_of
from app.evaluation.tables.table import Result, Row, Table, share_interval, single


def _tracking_row(result: Result) -> Row:
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


def _search_rows(result: Result) -> list[Row]:
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
            f"{one['wrong']} ({share_interval(one['wrong'], one['starts'])})",
            f"{one['misled']}, {one['misled_m']:.1f} m at most",
        )
        for start, name, one in found
    ]


TRACKING = Table(
    shows=is_of(Suite.LOCALISATION),
    columns=(
        *("world", "odometry", "runs", "odometry alone, rms", "new map, rms"),
        *("saved map, rms", "its p95", "its yaw, p95", "NEES", "loops", "carried away"),
        *("disturbed", "p99 a frame"),
    ),
    rows=single(_tracking_row),
)
SEARCHES = Table(
    shows=is_of(Suite.LOCALISATION),
    columns=(
        *("world", "odometry", "start", "map", "right", "after", "refused", "wrong"),
        "misled on the way",
    ),
    rows=_search_rows,
)
