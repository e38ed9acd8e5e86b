"""Edits of the beware list while driving: the map is the one that the final list would have made from the start."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.beware import BewareClass, BewareList, ColourRule
from navcore.config import NavigatorConfig
from navcore.navigator import Navigator, Order
from navcore.occupancy import Occupancy
from navcore.robot import HUSKY
from navcore.segment import ColourSegmenter
from navcore.transform import Pose2
from tests.navcore.laws import law
from tests.navcore.scene import RED_FLOOR, SPEC, Box, Paint, picture

BLUE = BewareClass(name="blue", class_id=7, margin_m=0.1, colour=ColourRule(hue_deg=(200.0, 260.0), max_height_m=0.2))
LIST = BewareList(classes=(RED_FLOOR, BLUE))
THINGS = (Paint(x=(1.0, 1.8), y=(-0.4, 0.1)), Box(x=(1.5, 1.7), y=(0.2, 0.5), z=(0.0, 0.15), colour=(20, 40, 220)))
FRAMES = [picture(*THINGS, pose=Pose2(x_m=0.1 * k, y_m=0.05 * k, yaw_rad=0.02 * k), stamp_ns=k) for k in range(4)]
EDITS = st.lists(
    st.tuples(
        st.integers(0, 3),
        st.sampled_from(["red floor", "blue"]),
        st.fixed_dictionaries(
            {},
            optional={
                "enabled": st.booleans(),
                "margin_m": st.sampled_from([0.0, 0.2]),
                "min_confidence": st.sampled_from([0.0, 0.5, 1.0]),
            },
        ),
    ),
    max_size=6,
)


def seen(lists: list[BewareList]) -> Occupancy:
    """What a robot holds that looked at each frame under the list of that moment, in the end."""
    navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig())
    for frame, beware in zip(FRAMES, lists, strict=True):
        decision = navigator.tick(frame, Order(goal=None, beware=beware, zones=()))
    return decision.occupancy


@law(15)
@given(EDITS)
def test_the_map_after_any_edits_is_that_of_the_final_list_from_the_start(
    edits: list[tuple[int, str, dict[str, object]]],
) -> None:
    lists, beware = [], LIST
    for moment in range(len(FRAMES)):
        for _, name, changes in (edit for edit in edits if edit[0] == moment):
            beware = beware.edited(name, **changes)
        lists.append(beware)
    edited, fresh = seen(lists), seen([beware] * len(FRAMES))
    assert edited.grid.beware.keys() == fresh.grid.beware.keys() == {entry.class_id for entry in beware.enabled}
    for class_id, layer in fresh.grid.beware.items():
        assert layer.any()
        np.testing.assert_array_equal(edited.grid.beware[class_id], layer)
    np.testing.assert_array_equal(edited.grid.geometric, fresh.grid.geometric)
    np.testing.assert_array_equal(edited.blocked, fresh.blocked)
