"""Kinds of results, by what they hold."""

from __future__ import annotations

from app.evaluation.tables.table import Result
from app.runtime.record.provenance import shipped_sha256
from navcore.robot.camera_stream import CameraStream


def is_paper(result: Result) -> bool:
    """Return whether a result is of one of the paper's missions, not of random ones."""
    return result.get("mission") == "given"


def is_walked(result: Result) -> bool:
    """Return whether a result is of a suite in which a camera is carried and nothing drives."""
    return "found_in_time" in result


def is_lit(result: Result) -> bool:
    """Return whether a result is of the walks under each disturbance of the light."""
    return "disturbances" in result


def is_before(result: Result) -> bool:
    """Return whether a result is of a network before the one that ships, which it shall be compared
    with."""
    return is_lit(result) and f"network sha256 {shipped_sha256()}," not in result["segmenter"]


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


def has_scanner(result: Result) -> bool:
    """Return whether a result is of a robot with a laser scanner."""
    return result.get("scanner") == "all round"


def is_recorded(result: Result) -> bool:
    """Return whether a result is of a recording of a real camera."""
    return "frames" in result


def is_labelled(result: Result) -> bool:
    """Return whether a result is of real things on tables."""
    return "labelled_things" in result


def is_printed(result: Result) -> bool:
    """Return whether a result is of prints of things and the things themselves."""
    return "printed" in result


def is_random(result: Result) -> bool:
    """Return whether a result is of random missions in a world."""
    others = (
        *(is_paper, is_walked, is_lit, is_doors, is_crossings, is_taught, is_recorded),
        *(is_localisation, is_labelled, is_printed),
    )
    return not any(is_other(result) for is_other in others)


def file_name(result: Result) -> str:
    """Return the name of the file of a result, without its suffix."""
    is_finer = is_walked(result) and tuple(result["images"]) != CameraStream().size
    kinds = (
        "paper" if is_paper(result) else "",
        "second-day" if is_second_day(result) else "",
        "scanner" if has_scanner(result) else "",
        "before" if is_before(result) else "",
        f"localisation-{result['odometry']}" if is_localisation(result) else "",
        "{}x{}".format(*result["images"]) if is_finer else "",
    )
    return "-".join(filter(None, (result["scenario"], *kinds)))
