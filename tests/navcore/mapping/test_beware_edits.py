"""Edits of the beware list while driving: the map equals that of the final list from the start."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import PERSON, BewareClass, BewareList, ColourRule
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from tests.navcore.scene import RED_FLOOR, SPEC, Box, Paint, picture

BLUE = BewareClass(
    name="blue",
    class_id=7,
    margin_m=0.1,
    colour=ColourRule(hue_deg=(200.0, 260.0), max_height_m=0.2),
)
GREEN = (30, 160, 60)
THINGS = (
    Paint(x=(1.0, 1.8), y=(-0.4, 0.1)),
    Box(x=(1.5, 1.7), y=(0.2, 0.5), z=(0.0, 0.15), colour=(20, 40, 220)),
    Box(x=(2.2, 2.5), y=(-1.1, -0.7), z=(0.0, 0.1), colour=(220, 20, 20)),  # a person in red shoes
    Box(x=(2.2, 2.5), y=(-1.1, -0.7), z=(0.1, 1.7), colour=GREEN),
)
FRAMES = [
    picture(
        *THINGS, pose=Pose2(x_m=0.1 * k, y_m=0.05 * k, yaw_rad=0.02 * k), stamp_ns=k * 100_000_000
    )
    for k in range(4)
]
WARM = BewareClass(
    name="warm", class_id=8, colour=ColourRule(hue_deg=(300.0, 60.0), max_height_m=0.2)
)
BOOK = BewareClass(name="book", class_id=2, margin_m=0.05)
CUP = BewareClass(name="cup", class_id=3, min_height_m=0.05)
PERSON_CLASS = BewareClass(name=PERSON, class_id=11, min_height_m=0.5)
CLAIMED_TWICE = BewareList(classes=(WARM, RED_FLOOR, BOOK, BLUE, CUP, PERSON_CLASS))
NAMES = st.sampled_from(["red floor", "blue", "warm", "book", "cup", PERSON])
EDITS = st.lists(
    st.tuples(
        st.integers(0, 3),
        NAMES,
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


class Reader:
    """Network that detects a book in red paint, more confidently from image to image, a cup in what
    is blue, and a person in what is green and the red below it."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label pixels by colour."""
        red, green = frame.rgb[..., 0] > 150, (frame.rgb == GREEN).all(axis=2)
        right = np.arange(frame.rgb.shape[1]) > np.flatnonzero(green.any(axis=0)).min() - 2
        said = np.select(
            [green | (red & right), red & (frame.rgb[..., 1] < 60), frame.rgb[..., 2] > 200],
            [PERSON_CLASS.class_id, BOOK.class_id, CUP.class_id],
        )
        sure = np.full(red.shape, 0.4 + 0.15 * frame.stamp_ns / 1e8, dtype=np.float32)
        return Labels(
            class_ids=said.astype(np.uint8), confidence=np.where(green, np.float32(0.7), sure)
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return books, cups and people."""
        known = {BOOK.class_id, CUP.class_id, PERSON_CLASS.class_id}
        return LabelSource.NETWORK if entry.class_id in known else LabelSource.NOTHING


def seen(lists: list[BewareList], segmenter: Segmenter) -> Costmap:
    """Return the final map of a robot that observed each frame with the list of that moment."""
    navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=segmenter, config=NavigatorConfig())
    for frame, beware in zip(FRAMES, lists, strict=True):
        decision = navigator.tick(frame, NavigationRequest(goal=None, beware=beware, zones=()))
    return decision.occupancy


def claims_of(
    segmenter: Segmenter, edits: list[tuple[int, str, dict[str, object]]]
) -> tuple[Costmap, Costmap]:
    """Return the maps after edits while driving, and with the final list from the start."""
    lists, beware = [], CLAIMED_TWICE
    for moment in range(len(FRAMES)):
        for _, name, changes in (edit for edit in edits if edit[0] == moment):
            beware = beware.edited(name, **changes)
        lists.append(beware)
    return seen(lists, segmenter), seen([beware] * len(FRAMES), segmenter)


@law(15)
@given(EDITS, st.sampled_from([ColourSegmenter(), FusedSegmenter(Reader(), HUSKY.depth_sensor)]))
def test_the_map_after_any_edits_is_that_of_the_final_list_from_the_start(
    edits: list[tuple[int, str, dict[str, object]]], segmenter: Segmenter
) -> None:
    edited, fresh = claims_of(segmenter, edits)
    assert edited.grid.beware.keys() == fresh.grid.beware.keys()
    for class_id, layer in fresh.grid.beware.items():
        np.testing.assert_array_equal(edited.grid.beware[class_id], layer)
    np.testing.assert_array_equal(edited.grid.geometric, fresh.grid.geometric)
    np.testing.assert_array_equal(edited.blocked, fresh.blocked)


def test_a_point_of_two_classes_is_there_for_either_that_is_enabled_later() -> None:
    off: dict[str, object] = {"enabled": False}
    for entry in (BOOK, RED_FLOOR, WARM):
        all_off = [(0, other.name, off) for other in CLAIMED_TWICE.classes]
        edited, _ = claims_of(
            FusedSegmenter(Reader(), HUSKY.depth_sensor),
            [*all_off, (3, entry.name, {"enabled": True})],
        )
        assert edited.grid.beware.keys() == {entry.class_id}
        assert edited.grid.beware[entry.class_id].any()
        assert edited.blocked.any()
