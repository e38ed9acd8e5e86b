"""Law: the map after any edits of the beware list while driving, colour rules and undo among them,
is that of the final list from the start, whatever was erased, rejected and corrected between; and a
preview shows what applying gives."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from app.console.beware.beware_editor import BewareEditor
from app.console.beware.recent_frames import RecentFrames
from app.runtime.control.operator_state import OperatorState
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.errors import BadConfiguration, NotKnown, Refused
from navcore.geometry.arrays import Indices
from navcore.geometry.transform import Pose2
from navcore.grid.grid import inflate
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mission.beware_list import (
    BewareClass,
    BewareList,
    ColourPattern,
    ColourRule,
    FloorLine,
)
from navcore.mission.mission import Mission
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from tests.app.console.state import PlainHolder, PlainMap, beware_editor, summary_of
from tests.navcore.laws import law
from tests.navcore.scene import SPEC, Box, Paint, Span, picture
from web.interface.beware import BewareDraft, BewareVersion, BewareVersionSummary

RED = ColourRule(hue_deg=(345.0, 15.0), max_height_m=0.05)
WARM = ColourRule(hue_deg=(330.0, 70.0), max_height_m=0.2)
YELLOW = ColourRule(hue_deg=(36.0, 64.0))
TAPE = dataclasses.replace(YELLOW, pattern=ColourPattern(max_gap_m=0.32, max_value=0.25))
BAY = dataclasses.replace(YELLOW, pattern=ColourPattern(max_gap_m=0.6, min_line_m=0.3))
LINE = ColourRule(
    hue_deg=(0.0, 360.0),
    min_saturation=0.0,
    max_saturation=0.2,
    min_value=0.4,
    line=FloorLine(max_width_m=0.2, min_contrast=0.3),
)
GREEN = ColourRule(hue_deg=(90.0, 150.0), max_height_m=0.05)
FIRST = BewareList(
    classes=(
        BewareClass(name="red", class_id=1, colour=RED),
        BewareClass(name="green", class_id=2, colour=GREEN, margin_m=0.1),
        BewareClass(name="tape", class_id=3, colour=TAPE),
    )
)
THINGS: tuple[Box | Paint, ...] = (
    Paint(x=(1.0, 1.6), y=(-0.4, 0.1)),
    Paint(x=(1.8, 2.2), y=(-0.3, 0.5), colour=(210, 170, 30)),
    Paint(x=(1.2, 1.5), y=(0.3, 0.6), colour=(30, 180, 40)),
    *(
        Paint(x=(1.1, 1.4), y=(0.7 + 0.1 * k, 0.8 + 0.1 * k), colour=colour)
        for k, colour in enumerate(3 * ((245, 200, 10), (22, 22, 24)))
    ),
    *(Paint(x=(x, x + 0.1), y=(-1.2, -0.5), colour=(245, 200, 10)) for x in (1.2, 1.6)),
    Paint(x=(1.9, 2.0), y=(-1.3, -0.4), colour=(245, 245, 242)),
    Box(x=(2.4, 2.6), y=(-0.8, -0.4), z=(0.0, 0.5), colour=(40, 40, 200)),
)
FRAMES = [
    picture(*THINGS, pose=Pose2(x_m=0.25 * k, y_m=0.0, yaw_rad=0.02 * k), stamp_ns=k * 100_000_000)
    for k in range(3)
]


class MemoryLists:
    """Satisfies `app.console.beware.beware_editor.BewareStore`."""

    def __init__(self) -> None:
        self.versions: list[BewareVersion] = []

    def beware(self) -> BewareList | None:
        """Return the list saved last."""
        return self.versions[-1].list if self.versions else None

    def beware_versions(self, *, limit: int = 1000) -> tuple[BewareVersion, ...]:
        """Return the newest lists, newest first."""
        return tuple(self.versions[::-1][:limit])

    def beware_summaries(self) -> tuple[BewareVersionSummary, ...]:
        """Return what is said of the lists, newest first."""
        return tuple(map(summary_of, self.versions[::-1]))

    def beware_version(self, version: int) -> BewareVersion | None:
        """Return a list."""
        return next((one for one in self.versions[::-1] if one.list.version == version), None)

    def save_beware(self, beware: BewareList, *, unix_s: float, by: str, what: str) -> None:
        """Keep a list."""
        self.versions.append(BewareVersion(list=beware, unix_s=unix_s, by=by, what=what))


@dataclass
class Drive:
    """A robot that observes the frames, and its operator."""

    recent: RecentFrames = field(default_factory=RecentFrames)
    navigator: Navigator = field(
        default_factory=lambda: Navigator(
            spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )
    )
    beware: BewareList = FIRST
    waits: bool = False
    """Whether the map follows edits of the list before the next frame only."""
    holder: PlainMap = field(init=False)
    editor: BewareEditor = field(init=False)
    occupancy: Costmap | None = None

    def __post_init__(self) -> None:
        holder = PlainHolder(OperatorState(mission=Mission(), beware=self.beware))
        self.holder = PlainMap(self.navigator.map, waits=self.waits)
        self.editor = beware_editor(
            MemoryLists(), holder=holder, map_holder=self.holder, recent=self.recent
        )

    def see(self, number: int) -> None:
        """Observe a frame as the think thread does."""
        self.holder.follow()
        request = NavigationRequest(goal=None, beware=self.editor.list, zones=())
        decision = self.navigator.tick(FRAMES[number], request)
        self.occupancy = decision.occupancy
        at = self.navigator.map.pose_ids.known(decision.frame.pose)
        assert at is not None
        point_map = self.navigator.map
        self.recent.note(decision.frame, at, point_map.pose_ids[at], point_map.edits.erasures)

    def cells(self) -> dict[str, Any]:
        """Return the occupied cells of each class by name."""
        self.holder.follow()
        grid = self.navigator._costmap.follow(self.editor.list, ()).grid
        return {
            entry.name: grid.beware[entry.class_id].copy() for entry in self.editor.list.enabled
        }


EDITS: dict[str, Callable[[BewareEditor], object]] = {
    "off": lambda editor: editor.edit("red", {"enabled": False}),
    "on": lambda editor: editor.edit("red", {"enabled": True}),
    "wide": lambda editor: editor.edit("red", {"colour": dataclasses.asdict(WARM)}),
    "narrow": lambda editor: editor.edit("red", {"colour": dataclasses.asdict(RED)}),
    "rename": lambda editor: editor.edit("red", {"name": "paint"}),
    "rename back": lambda editor: editor.edit("paint", {"name": "red"}),
    "tape": lambda editor: editor.edit("tape", {"colour": dataclasses.asdict(TAPE)}),
    "bay": lambda editor: editor.edit("tape", {"colour": dataclasses.asdict(BAY)}),
    "yellow": lambda editor: editor.edit("tape", {"colour": dataclasses.asdict(YELLOW)}),
    "line": lambda editor: editor.edit("tape", {"colour": dataclasses.asdict(LINE)}),
    "tape off": lambda editor: editor.edit("tape", {"enabled": False}),
    "remove tape": lambda editor: editor.remove("tape"),
    "add line": lambda editor: editor.add({"name": "tape", "colour": dataclasses.asdict(LINE)}),
    "remove": lambda editor: editor.remove("green"),
    "add": lambda editor: editor.add({"name": "green", "colour": dataclasses.asdict(GREEN)}),
    "order": lambda editor: editor.order([entry.name for entry in editor.list.classes][::-1]),
    "undo": lambda editor: editor.undo(),
    "redo": lambda editor: editor.redo(),
    "first": lambda editor: editor.restore(0),
}


def cells_in(x_m: Span, y_m: Span) -> Indices:
    """Return the cells of a rectangle, row · cols + col."""
    x, y = SPEC.centres(np.argwhere(np.ones((SPEC.rows, SPEC.cols)))).T
    return np.flatnonzero((x > x_m[0]) & (x < x_m[1]) & (y > y_m[0]) & (y < y_m[1]))


def moved(point_map: PointMap) -> None:
    """Correct all poses as a loop closure does, by the same motion."""
    motion = Pose2(x_m=0.13, y_m=-0.07, yaw_rad=0.04)
    point_map.correct({number: motion @ pose for number, pose in enumerate(point_map.poses)})


MAP_EDITS: dict[str, Callable[[PointMap], object]] = {
    "erase all": lambda point_map: point_map.edits.erase(
        cells_in((1.0, 1.9), (-1.0, 1.0)), Erasable.BOTH.class_ids
    ),
    "erase tape": lambda point_map: point_map.edits.erase(
        cells_in((1.0, 2.1), (0.2, 1.4)), Erasable.BEWARE.class_ids
    ),
    "erase obstacles": lambda point_map: point_map.edits.erase(
        cells_in((1.0, 3.0), (-1.0, 1.0)), Erasable.GEOMETRY.class_ids
    ),
    "reject red": lambda point_map: (
        point_map.edits.reject(1, np.array([[1.35, -0.15]]), 1.0) if point_map.poses else None
    ),
    "reject tape": lambda point_map: (
        point_map.edits.reject(3, np.array([[1.25, 0.85]]), 1.0) if point_map.poses else None
    ),
}
Steps = list[tuple[int, str]]
"""Moment and name of each edit, in their order."""
NAMES = st.one_of(st.sampled_from(sorted(EDITS)), st.sampled_from([*sorted(MAP_EDITS), "correct"]))
STEPS = st.lists(st.tuples(st.integers(0, len(FRAMES)), NAMES), max_size=8)


def driven(drive: Drive, steps: Steps, edits: Mapping[str, Callable[[Drive], object]]) -> Drive:
    """Let a robot observe the frames, with those of the steps between them that are among some
    edits."""
    for moment in range(len(FRAMES) + 1):
        for _, name in (step for step in steps if step[0] == moment and step[1] in edits):
            edits[name](drive)
        if moment < len(FRAMES):
            drive.see(moment)
    return drive


def of_list(name: str) -> Callable[[Drive], None]:
    """Return an edit of the list by name, which may be impossible now."""

    def edit(drive: Drive) -> None:
        # There may be nothing to undo, or no such class or version now.
        with contextlib.suppress(BadConfiguration, Refused, NotKnown):
            EDITS[name](drive.editor)

    return edit


def of_map(name: str) -> Callable[[Drive], None]:
    """Return an edit of the map by name, or its correction as long as nothing was erased."""

    def edit(drive: Drive) -> None:
        drive.holder.follow()
        point_map = drive.navigator.map
        if name in MAP_EDITS:
            MAP_EDITS[name](point_map)
        elif not point_map.edits.erasures:
            moved(point_map)

    return edit


@pytest.mark.long
@law(60)
@given(STEPS, st.booleans())
@example([(1, "wide"), (1, "erase all"), (2, "narrow"), (3, "wide")], False)
@example([(1, "erase tape"), (3, "bay")], False)
@example([(1, "narrow"), (2, "wide"), (2, "narrow"), (2, "erase all"), (3, "undo")], False)
@example([(2, "line"), (3, "correct"), (3, "bay"), (3, "reject tape"), (3, "tape")], False)
@example([(3, "bay"), (3, "undo")], True)
def test_the_map_after_any_edits_is_that_of_the_final_list_from_the_start(
    steps: Steps, waits: bool
) -> None:
    """Law of edits of the list with undo, between edits of the map and corrections: these are made
    at the same moments on the other map. A point of a voxel is of the first pose that shows it,
    under the rule of then, so that a correction may put it into the cell beside; and what is
    rejected strikes pixels of past frames, but points of the map."""
    on_map = {name: of_map(name) for name in (*MAP_EDITS, "correct")}
    edited = driven(Drive(waits=waits), steps, on_map | {name: of_list(name) for name in EDITS})
    fresh = driven(Drive(beware=edited.editor.list), steps, on_map)
    one, other = edited.cells(), fresh.cells()
    assert one.keys() == other.keys()
    exact = {"erase all", "erase tape", "erase obstacles", *EDITS}
    reach = 0 if {name for _, name in steps} <= exact else 2  # the cells beside, diagonally too
    for name, cells in other.items():
        for few, many in ((one[name], cells), (cells, one[name])):
            assert not (few & ~inflate(many, reach)).any(), name


def test_a_wider_rule_brings_what_was_seen_before_and_its_undo_takes_exactly_that() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    before = drive.cells()["red"]
    EDITS["wide"](drive.editor)
    assert drive.cells()["red"].sum() > before.sum() + 5  # control: no frame came since
    drive.editor.undo()
    np.testing.assert_array_equal(drive.cells()["red"], before)


def test_what_a_rule_has_found_goes_with_the_rule_and_comes_back_with_its_undo() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    before = drive.cells()["red"]
    drive.editor.edit("red", {"colour": None})
    assert before.any() and not drive.cells()["red"].any()
    drive.see(len(FRAMES) - 1)
    assert not drive.cells()["red"].any()
    drive.editor.undo()
    np.testing.assert_array_equal(drive.cells()["red"], before)


def test_what_is_undone_before_the_map_has_followed_comes_back() -> None:
    drive = Drive(waits=True)
    for number in range(len(FRAMES)):
        drive.see(number)
    before = drive.cells()["red"]
    drive.recent.forget()  # no frame shows it again
    drive.editor.edit("red", {"colour": None})
    drive.editor.undo()
    assert before.any()
    np.testing.assert_array_equal(drive.cells()["red"], before)


def test_a_preview_shows_the_cells_that_applying_gives() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    follower: Any = drive.editor._follower
    for name in ("wide", "bay", "line", "off", "remove", "order"):
        drafts: dict[str, tuple[dict[str, Any], dict[str, Any] | None]] = {
            "wide": ({"red": {"colour": dataclasses.asdict(WARM)}}, None),
            "bay": ({"tape": {"colour": dataclasses.asdict(BAY)}}, None),
            "line": ({"tape": {"colour": dataclasses.asdict(LINE)}}, None),
            "off": ({"red": {"enabled": False}}, None),
            "remove": ({"green": None}, None),
            "order": ({}, {"name": "ochre", "colour": {"hue_deg": [40.0, 60.0]}}),
        }
        changes, added = drafts[name]
        drafted = drive.editor.drafted(BewareDraft(changes=changes, add=added))
        present, then = follower.grids(lambda: drive.occupancy, drive.editor.list, drafted)
        version = drive.editor.list.version
        if added is None:
            EDITS[name](drive.editor)
        else:
            drive.editor.add(added)
        assert drive.editor.list.version == version + 1
        applied = drive.cells()
        ids = drive.editor.list.ids
        assert {ids[given] for given in applied} == then.beware.keys(), name
        for given_name, cells in applied.items():
            np.testing.assert_array_equal(then.beware[ids[given_name]], cells, err_msg=name)
        changed = (
            any(
                not np.array_equal(present.beware.get(key, cells & False), cells)
                for key, cells in then.beware.items()
            )
            or present.beware.keys() != then.beware.keys()
        )
        assert changed, name
        drive.editor.undo()


def test_what_was_erased_does_not_come_back_with_another_rule() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    assert drive.cells()["red"].any()
    everywhere = np.arange(SPEC.rows * SPEC.cols)
    drive.navigator.map.edits.erase(everywhere, Erasable.BEWARE.class_ids)
    EDITS["wide"](drive.editor)
    assert not drive.cells()["red"].any()
    drive.see(len(FRAMES) - 1)
    assert drive.cells()["red"].any()  # control: what the camera sees later comes back


def test_what_is_no_pattern_any_more_goes_where_a_near_look_shows_that() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    before = drive.cells()["tape"]
    symbol = ColourPattern(max_gap_m=0.32, max_value=0.25, max_size_m=0.1)
    rule = dataclasses.replace(TAPE, pattern=symbol)
    drive.editor.edit("tape", {"colour": dataclasses.asdict(rule)})
    assert before.any() and not drive.cells()["tape"].any()
    drive.editor.undo()
    np.testing.assert_array_equal(drive.cells()["tape"], before)
