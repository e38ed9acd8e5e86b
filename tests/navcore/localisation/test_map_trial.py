"""What is seen from a place on trial can be taken back from the map until metres have proved it."""

from __future__ import annotations

import dataclasses
import math
from typing import cast

import numpy as np
import pytest

from navcore.config.localisation.localisation import StartConfig
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState, PlaceCorrection
from navcore.localisation.localisation import Localisation
from navcore.localisation.map_trial import MapTrial
from navcore.localisation.scans.scan import Keyframe
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.coloured import PastView
from navcore.mission.beware_list import NOTHING

RULES = StartConfig()
LOCATED = LocalisationEstimate(state=LocalisationState.LOCATED)
LOST = LocalisationEstimate(state=LocalisationState.LOST)
CORRECTED = dataclasses.replace(LOCATED, place_correction=PlaceCorrection(source=None, shift_m=1.2))


@dataclasses.dataclass(slots=True)
class Driving:
    """Localisation of a robot at a place on trial."""

    is_on_trial: bool = True
    is_in_new: bool = False
    waits_for_standstill: bool = False
    has_saved_map: bool = True
    forgotten: int = 0

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        return ()

    def return_to(self, keyframes: tuple[Keyframe, ...]) -> None:
        assert keyframes == ()
        self.forgotten += 1


def trial(driving: Driving | None = None) -> tuple[MapTrial, PointMap, Driving]:
    spec = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.1)
    point_map, driving = PointMap(spec, NavigatorConfig().map), driving or Driving()
    begun = MapTrial(point_map, cast(Localisation, driving), RULES)
    begun.begin()
    return begun, point_map, driving


def metres_until_closed(begun: MapTrial, most_m: float = 10 * RULES.trial_m) -> float | None:
    """Metres straight on that end a trial; None if that many do not."""
    for count in range(round(most_m / 0.3)):
        at = Pose2(x_m=0.3 * count, y_m=0.0, yaw_rad=0.0)
        begun.follow(dataclasses.replace(LOCATED, T_driven_base=at))
        if not begun.is_open:
            return 0.3 * count
    return None


def frames_until_closed(
    *, corrected_at: int | None = None, lane_m: float = math.inf, step_m: float = 0.3
) -> int | None:
    """Frames of a drive to and fro on a lane, turning about at its ends, that end the trial; None
    if many times `trial_m` do not."""
    begun, _, _ = trial()
    return frames_of(begun, corrected_at=corrected_at, lane_m=lane_m, step_m=step_m)


def frames_of(
    begun: MapTrial, *, corrected_at: int | None = None, lane_m: float, step_m: float
) -> int | None:
    """The same of a trial."""
    for count in range(1, round(10 * RULES.trial_m / step_m)):
        driven_m = step_m * count
        lanes, x_m = divmod(driven_m, lane_m)
        is_back = lanes % 2 == 1
        place = CORRECTED if count == corrected_at else LOCATED
        at = Pose2(x_m=lane_m - x_m if is_back else x_m, y_m=0.0, yaw_rad=math.pi * is_back)
        begun.follow(dataclasses.replace(place, T_driven_base=at))
        if not begun.is_open:
            return count
    return None


@pytest.mark.parametrize("step_m", [0.02, 0.3, 0.45])
def test_the_metres_before_a_correction_prove_nothing(step_m: float) -> None:
    for before_m in (0.0, 9.0):
        corrected_at = round(before_m / step_m) or None
        frames = frames_until_closed(corrected_at=corrected_at, step_m=step_m)
        assert frames is not None
        # Floor is new in steps of up to two frames.
        assert frames * step_m - before_m == pytest.approx(RULES.trial_m, abs=1.3)


def test_a_way_that_is_driven_again_proves_nothing_more() -> None:
    """Between two walls that are alike a robot goes to and fro: a wrong map must not be written."""
    assert frames_until_closed(lane_m=RULES.trial_m / 2) is None
    assert frames_until_closed(lane_m=RULES.trial_m + 1.0) is not None


def test_an_edit_by_hand_ends_the_trial_at_once() -> None:
    for edits in (0, 1):
        begun, point_map, driving = trial()
        begun.follow(LOCATED)
        point_map.edits.by_operator += edits
        assert (begun.held is None) is (edits == 1), "what was edited is to be stored"
        assert begun.take_back() is (edits == 0)
        assert driving.forgotten == 1 - edits and begun.is_open is (edits == 0)


def test_what_was_seen_before_a_correction_is_taken_back_once_it_is_applied() -> None:
    begun, point_map, driving = trial()
    begun.follow(LOCATED)
    point_map.load_prior(np.ones((point_map.spec.rows, point_map.spec.cols), dtype=np.bool_))
    driving.waits_for_standstill = True
    assert not begun.follow(CORRECTED)
    assert not begun.follow(LOCATED)
    driving.waits_for_standstill = False
    assert begun.follow(LOCATED)
    assert driving.forgotten == 1
    assert not point_map.layers.bools(0).any()


def test_what_an_operator_vouches_for_is_proved_also_where_the_map_shows_nothing() -> None:
    begun, _, _ = trial(Driving(is_in_new=True))
    assert metres_until_closed(begun) is None
    begun.hold(is_vouched=True)
    assert metres_until_closed(begun) == pytest.approx(RULES.trial_m, abs=1.3)


def test_what_an_operator_vouches_for_in_a_new_map_is_on_trial_for_some_metres() -> None:
    begun, point_map, driving = trial(Driving(is_on_trial=False, has_saved_map=False))
    point_map.pose_ids.extend([Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)])
    begun.hold(is_vouched=True)
    begun.follow(LOCATED)
    assert begun.is_open and begun.held is None, "a new map is stored as it is"
    assert point_map.pose_ids.frozen == 0, "loops may move it"
    assert begun.follow(LOST) and driving.forgotten == 1
    for lane_m in (math.inf, 3.0):  # a room of some metres is driven to and fro
        begun.hold(is_vouched=True)
        frames = frames_of(begun, lane_m=lane_m, step_m=0.3)
        assert frames is not None and frames * 0.3 == pytest.approx(RULES.trial_m, abs=1.0)


def test_a_trial_does_not_end_while_a_correction_waits_and_what_was_seen_is_taken_back() -> None:
    begun, point_map, driving = trial()
    begun.follow(LOCATED)
    occupied = np.ones((point_map.spec.rows, point_map.spec.cols), dtype=np.bool_)
    point_map.load_prior(occupied)
    driving.is_on_trial, driving.waits_for_standstill = False, True
    assert not begun.follow(LOCATED)
    assert begun.is_open and point_map.layers.bools(0).any(), "it is driven by"
    driving.waits_for_standstill = False
    assert begun.follow(LOCATED)
    assert not begun.is_open and not point_map.layers.bools(0).any()


@pytest.mark.parametrize("has_saved_map", [True, False])
def test_a_place_that_a_search_has_found_later_is_on_trial_in_a_saved_map(
    has_saved_map: bool,
) -> None:
    begun, point_map, driving = trial(Driving(is_on_trial=False, has_saved_map=has_saved_map))
    begun.follow(LOCATED)
    assert not begun.is_open
    begun.follow(LOST)
    driving.is_on_trial = True
    assert not begun.follow(LOCATED)
    assert begun.is_open is has_saved_map
    occupied = np.ones((point_map.spec.rows, point_map.spec.cols), dtype=np.bool_)
    point_map.load_prior(occupied)
    assert begun.follow(LOST) is has_saved_map
    assert bool(point_map.layers.bools(0).all()) is not has_saved_map


def test_another_colour_rule_is_no_edit_by_which_the_map_is_found_right() -> None:
    begun, point_map, _ = trial()
    begun.follow(LOCATED)
    past = PastView(frames=(), points=point_map.edits.beware_points)
    point_map.edits.forget_coloured(1, None, None, past)
    assert begun.take_back()
    begun.follow(LOCATED)
    point_map.edits.erase(np.array([0]), [NOTHING])
    assert not begun.take_back()
