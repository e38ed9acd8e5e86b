"""What is told of the robot's place."""

from __future__ import annotations

import dataclasses

import pytest

from app.insight.place_events import PlaceEvents
from navcore.geometry.transform import IDENTITY
from navcore.localisation.estimate import LocalisationEstimate, PlaceCorrection
from navcore.localisation.map_correction import AppliedCorrection
from navcore.robot.fix import FixSource
from tests.app.insight.test_event_detector import EMPTY, decision


@pytest.mark.parametrize(
    ("source", "begins"),
    [
        (FixSource.GNSS, "Satellite positions"),
        (FixSource.TAG, "A tag"),
        (FixSource.DOCK, "The dock"),
        (None, "What the camera sees"),
    ],
)
def test_a_correction_of_the_place_is_told_once_with_its_source_and_length(
    source: FixSource | None, begins: str
) -> None:
    events, tick = PlaceEvents(), decision(EMPTY)
    corrected = LocalisationEstimate(place_correction=PlaceCorrection(source=source, shift_m=1.104))
    (told,) = events.after(dataclasses.replace(tick, place=corrected))
    assert told.startswith(begins) and told.endswith("by 1.10 m.")
    assert events.after(tick) == []


def test_a_push_is_told_once_with_its_length() -> None:
    events, tick = PlaceEvents(), decision(EMPTY)
    pushed = dataclasses.replace(tick, place=LocalisationEstimate(pushed_m=0.204))
    (told,) = events.after(pushed)
    assert told.startswith("The robot was pushed") and told.endswith("by 0.20 m.")
    (told,) = events.after(dataclasses.replace(tick, taken_back=True))
    assert told == "What was seen from a wrong place is taken back from the map."
    assert events.after(tick) == []


def test_poses_that_another_program_has_corrected_are_told() -> None:
    correction = AppliedCorrection(before=(IDENTITY,), after=(IDENTITY,))
    tick = dataclasses.replace(decision(EMPTY), correction=correction)
    assert PlaceEvents().after(tick) == ["Another program has corrected poses of the map."]
