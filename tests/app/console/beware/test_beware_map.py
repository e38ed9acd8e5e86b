"""Law: the map after any edits of the beware list while driving, colour rules and undo among them,
is that of the final list from the start; and a preview shows what applying gives."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.console.beware.beware_editor import BewareEditor
from app.console.beware.recent_frames import RecentFrames
from app.runtime.control.operator_state import OperatorState
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.errors import BadConfiguration, Refused
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.mission.mission import Mission
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from tests.app.console.state import PlainHolder, beware_editor
from tests.navcore.laws import law
from tests.navcore.scene import SPEC, Box, Paint, picture
from web.interface.beware import BewareDraft, BewareVersion

RED = ColourRule(hue_deg=(345.0, 15.0), max_height_m=0.05)
WARM = ColourRule(hue_deg=(330.0, 70.0), max_height_m=0.2)
GREEN = ColourRule(hue_deg=(90.0, 150.0), max_height_m=0.05)
FIRST = BewareList(
    classes=(
        BewareClass(name="red", class_id=1, colour=RED),
        BewareClass(name="green", class_id=2, colour=GREEN, margin_m=0.1),
    )
)
THINGS = (
    Paint(x=(1.0, 1.6), y=(-0.4, 0.1)),
    Paint(x=(1.8, 2.2), y=(-0.3, 0.5), colour=(210, 170, 30)),
    Paint(x=(1.2, 1.5), y=(0.3, 0.6), colour=(30, 180, 40)),
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

    def beware_versions(self) -> tuple[BewareVersion, ...]:
        """Return all lists, newest first."""
        return tuple(self.versions[::-1])

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
    editor: BewareEditor = field(init=False)
    occupancy: Costmap | None = None

    def __post_init__(self) -> None:
        holder = PlainHolder(OperatorState(mission=Mission(), beware=self.beware))
        self.editor = beware_editor(
            MemoryLists(), holder=holder, point_map=self.navigator.map, recent=self.recent
        )

    def see(self, number: int) -> None:
        """Observe a frame as the think thread does."""
        request = NavigationRequest(goal=None, beware=self.editor.list, zones=())
        decision = self.navigator.tick(FRAMES[number], request)
        self.occupancy = decision.occupancy
        at = self.navigator.map.pose_ids.known(decision.frame.pose)
        assert at is not None
        self.recent.note(decision.frame, at, self.navigator.map.pose_ids[at])

    def cells(self) -> dict[str, Any]:
        """Return the occupied cells of each class by name."""
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
    "remove": lambda editor: editor.remove("green"),
    "add": lambda editor: editor.add({"name": "green", "colour": dataclasses.asdict(GREEN)}),
    "order": lambda editor: editor.order([entry.name for entry in editor.list.classes][::-1]),
    "undo": lambda editor: editor.undo(),
    "redo": lambda editor: editor.redo(),
    "first": lambda editor: editor.restore(0),
}


@pytest.mark.long
@law(20)
@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from(sorted(EDITS))), max_size=8))
def test_the_map_after_any_edits_with_undo_is_that_of_the_final_list_from_the_start(
    edits: list[tuple[int, str]],
) -> None:
    edited = Drive()
    for moment in range(len(FRAMES) + 1):
        for _, name in (edit for edit in edits if edit[0] == moment):
            try:
                EDITS[name](edited.editor)
            except (BadConfiguration, Refused, LookupError):
                pass  # there is nothing to undo, or no such class now
            except Exception as error:
                assert "no version" in str(error)
        if moment < len(FRAMES):
            edited.see(moment)
    fresh = Drive(beware=edited.editor.list)
    for number in range(len(FRAMES)):
        fresh.see(number)
    one, other = edited.cells(), fresh.cells()
    assert one.keys() == other.keys()
    for name, cells in other.items():
        np.testing.assert_array_equal(one[name], cells, err_msg=name)


def test_a_wider_rule_brings_what_was_seen_before_and_its_undo_takes_exactly_that() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    before = drive.cells()["red"]
    EDITS["wide"](drive.editor)
    assert drive.cells()["red"].sum() > before.sum() + 5  # control: no frame came since
    drive.editor.undo()
    np.testing.assert_array_equal(drive.cells()["red"], before)


def test_a_preview_shows_the_cells_that_applying_gives() -> None:
    drive = Drive()
    for number in range(len(FRAMES)):
        drive.see(number)
    follower: Any = drive.editor._follower
    for name in ("wide", "off", "remove", "order"):
        drafts: dict[str, tuple[dict[str, Any], dict[str, Any] | None]] = {
            "wide": ({"red": {"colour": dataclasses.asdict(WARM)}}, None),
            "off": ({"red": {"enabled": False}}, None),
            "remove": ({"green": None}, None),
            "order": ({}, {"name": "yellow", "colour": {"hue_deg": [40.0, 60.0]}}),
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
