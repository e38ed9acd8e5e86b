"""Tables of what is seen: walks, light, recordings, real things, prints, and what was taught."""

from __future__ import annotations

import statistics

from app.evaluation.perception.light_figures import row_of
from app.evaluation.perception.print_figures import COLUMNS
from app.evaluation.perception.print_figures import row_of as print_row_of
from app.evaluation.suites import Suite
from app.evaluation.tables.kinds import is_before, is_of
from app.evaluation.tables.table import (
    Result,
    Row,
    Table,
    listed,
    percent,
    seeds,
    share_interval,
    single,
)


def _walks_row(result: Result) -> Row:
    low, high = result["found_in_time_ci95"]
    few, many = result["false_items_per_10_m_ci95"]
    share = f"{percent(result['found_in_time'])}, {percent(low)} to {percent(high)}"
    return (
        f"`{result['scenario']}`",
        "{} × {}".format(*result["images"]),
        seeds(result),
        f"{result['found']} of {result['things_in_view']} ({share})",
        listed(result["found_by_class"]),
        result.get("found_of_thin", "–"),
        percent(result["named_rightly"]),
        f"{result['false_items_per_10_m']:.2f} ({few:.2f} to {many:.2f})",
        listed(result["false_items_by_class"]),
        f"{result['walked_m']:.0f} m",
    )


def _light_rows(result: Result) -> list[Row]:
    size = "{} × {}".format(*result["images"])
    network = "before" if is_before(result) else "shipped"
    return [
        (network, size, seeds(result), name, *row_of(measured))
        for name, measured in result["disturbances"].items()
    ]


def _recording_row(result: Result) -> Row:
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
        f"{judged['wrong_cells']} ({percent(share, 1)})",
        listed(judged["wrong_by_class"]),
        f"{judged['held_as_own_class']} of {len(held)}",
        "; ".join(f"{name}: {classes}" for name, classes in held.items()),
    )


def _labelled_rows(result: Result) -> list[Row]:
    return [
        (
            f"`{result['scenario']}`, {name}",
            str(found["images"]),
            f"{found['labelled']} of {found['things']}",
            share_interval(found["labelled"], found["things"]),
            listed(found["by_class"]),
            percent(found["table_share"], 2),
        )
        for name, found in result["labelled_things"].items()
    ]


def _print_rows(result: Result) -> list[Row]:
    prints = result["episodes"]
    return [
        (f"`{result['scenario']}`", seeds(result), *print_row_of(name, found, prints))
        for name, found in result["printed"].items()
    ]


def _teaching_row(result: Result) -> Row:
    taught = result["taught"]
    share = share_interval(result["found"], len(taught))
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
        seeds(result),
        f"{result['found']} of {len(taught)} ({share})",
        ", ".join(f"{one['kind']} {one['iou'] or 0.0:.2f}" for one in taught),
        f"{before:.3f}, {after:.3f}",
        f"{lost} ({least:+.3f} to {most:+.3f})",
    )


WALKS = Table(
    shows=is_of(Suite.FINDING, Suite.ONE_CLICK),
    columns=(
        *("suite", "images", "seeds", "found in time", "by class", "of thin ones"),
        *("by their names", "false per 10 m", "false by class", "walked"),
    ),
    rows=single(_walks_row),
)
LIGHT = Table(
    shows=is_of(Suite.LIGHT),
    columns=(
        *("network", "images", "seeds", "light"),
        *("mIoU", "found in time", "of thin ones", "false per 10 m"),
    ),
    rows=_light_rows,
)
RECORDINGS = Table(
    shows=is_of(Suite.REPLAY),
    columns=(
        *("recording", "frames", "occupied cells", "wrongly of the list", "by class"),
        *("objects held as their class", "each held as"),
    ),
    rows=single(_recording_row),
)
REAL_THINGS = Table(
    shows=is_of(Suite.TABLE_TOPS),
    columns=("suite", "images", "things labelled", "95 % interval", "as", "of the tables"),
    rows=_labelled_rows,
)
PRINTS = Table(
    shows=is_of(Suite.PRINTS),
    columns=("suite", "seeds", *COLUMNS),
    rows=_print_rows,
)
TEACHING = Table(
    shows=is_of(Suite.TEACHING),
    columns=(
        *("suite", "seeds", "found elsewhere", "IoU of each"),
        *("mean IoU of the known classes in rendered images, before and after", "most lost"),
    ),
    rows=single(_teaching_row),
)
