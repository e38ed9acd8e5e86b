"""A class by a few clicks in the console: made, shown, in force on what was seen, and undone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from app.console.beware.beware_editor import BewareEditor
from app.console.beware.recent_frames import RecentFrames
from navcore.config.navigator import NavigatorConfig
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareClass, BewareList, as_table, as_toml
from navcore.robot.frame import Frame
from tests.app.console.beware.test_beware_map import MemoryLists
from tests.app.console.state import PlainMap, beware_editor
from tests.navcore.perception.colour_network import ColourNetwork
from tests.navcore.scene import SPEC, Box, Colour, picture

TOY: Colour = (200, 120, 40)
THING = Box(x=(1.7, 2.0), y=(-0.15, 0.15), z=(0.0, 0.3), colour=TOY)
OTHER = Box(x=(2.4, 2.7), y=(-1.0, -0.7), z=(0.0, 0.3), colour=TOY)
BLUE = Box(x=(1.7, 2.0), y=(0.4, 0.7), z=(0.0, 0.3), colour=(30, 60, 220))
WALL = Box(x=(4.0, 4.2), y=(-3.0, 3.0), z=(0.0, 2.0), colour=(190, 185, 170))
LIST = BewareList(
    classes=(BewareClass(name="blue", class_id=3), BewareClass(name="person", class_id=4))
)
MIDDLE = (0.497, 0.52)
"""Right and down of the middle of the thing."""


def frames(*things: Box) -> list[Frame]:
    return [
        picture(
            *things, WALL, pose=Pose2(x_m=-0.25 * k, y_m=0.0, yaw_rad=0.0), stamp_ns=(9 - k) * 10**9
        )
        for k in (2, 1, 0)
    ]


def console(*things: Box, blue: int = 0, network: bool = True) -> tuple[BewareEditor, PointMap]:
    """Return an editor that has seen some things, and the map, on which nothing was put yet."""
    recent, point_map = RecentFrames(), PointMap(SPEC, NavigatorConfig().map)
    for frame in frames(*things):
        pose_id = point_map.pose_ids.id_of(frame.pose)
        recent.note(frame, pose_id, frame.pose)
    editor = beware_editor(
        MemoryLists(),
        LIST,
        map_holder=PlainMap(point_map),
        recent=recent,
        network=ColourNetwork(blue) if network else None,
    )
    return editor, point_map


def cells(point_map: PointMap, class_id: int) -> int:
    points = point_map.edits.beware_points
    return len(np.unique(points["cell"][points["class_id"] == class_id]))


def test_a_click_becomes_a_class_that_holds_on_what_was_seen_as_one_edit() -> None:
    editor, point_map = console(THING, OTHER)
    click = editor.examples.click(*MIDDLE, editor.list)
    assert 100 < click.mask.sum() < 1000
    prototype = editor.examples.made([click.key])
    newest, *older = editor.examples.looks(prototype, 3)
    is_toy = (newest.rgb == TOY).all(axis=2)
    assert newest.mask[is_toy].mean() > 0.7
    assert (newest.mask & ~is_toy).sum() < 0.1 * is_toy.sum()
    assert all(look.mask.any() for look in older)

    added = editor.add({"name": "toy", "prototype": as_table(_entry(prototype))["prototype"]})
    (toy,) = (entry for entry in added.classes if entry.name == "toy")
    assert toy.prototype == prototype
    assert str(editor.finder(toy)) == "example"
    assert "toy" in editor.versions()[0].what
    assert "prototype" in as_toml(added)
    found = cells(point_map, toy.class_id)
    assert found >= 6
    editor.undo()
    assert "toy" not in {entry.name for entry in editor.list.classes}
    editor.redo()
    assert editor.list.named("toy").prototype == prototype
    assert cells(point_map, toy.class_id) == found


def _entry(prototype: object) -> BewareClass:
    return BewareClass(name="toy", class_id=9, prototype=prototype)  # type: ignore[arg-type]


def test_what_is_taken_away_is_no_longer_part_of_it() -> None:
    editor, _ = console(THING, OTHER)
    toy = editor.examples.click(*MIDDLE, editor.list)
    (look,) = editor.examples.looks(editor.examples.made([toy.key]), 1)
    row, col = np.argwhere((look.rgb == TOY).all(axis=2) & ~toy.mask)[40]
    height, width = look.mask.shape
    other = editor.examples.click((col + 0.5) / width, (row + 0.5) / height, editor.list)
    assert look.mask[other.mask].mean() > 0.5
    with pytest.raises(Refused, match="too much like"):
        editor.examples.made([toy.key], [other.key])
    with pytest.raises(Refused, match="too small"):
        editor.examples.made([toy.key], [toy.key])


def test_what_the_list_knows_is_refused_by_its_name_and_a_person_as_one() -> None:
    thing = dataclasses.replace(BLUE, y=(-0.15, 0.15))
    for blue, reason in ((3, "a “blue” already"), (4, "that is a person")):
        editor, _ = console(thing, blue=blue)
        with pytest.raises(Refused, match=reason):
            editor.examples.click(*MIDDLE, editor.list)
    editor, _ = console(thing, blue=3)
    with pytest.raises(Refused, match="a “Teppich” already"):
        editor.examples.click(*MIDDLE, editor.list.edited("blue", label="Teppich"))
    off = editor.list.edited("blue", enabled=False)
    with pytest.raises(Refused, match="switch it on in the list"):
        editor.examples.click(*MIDDLE, off)


def test_without_a_network_the_page_is_told_so_and_clicks_are_refused() -> None:
    editor, _ = console(THING, network=False)
    assert "only colour rules run here" in (editor.examples.hindrance or "")
    with pytest.raises(Refused, match="only colour rules run here"):
        editor.examples.click(*MIDDLE, editor.list)


def test_a_click_goes_into_an_older_image_by_its_name_and_not_into_one_that_is_gone() -> None:
    editor, _ = console(THING)
    click = editor.examples.click(*MIDDLE, editor.list)
    prototype = editor.examples.made([click.key])
    *_, oldest = editor.examples.looks(prototype, 3)
    again = editor.examples.click(0.497, 0.45, editor.list, frame=oldest.frame)
    assert again.frame == oldest.frame
    assert editor.examples.made([click.key, again.key]).clicks == 2
    with pytest.raises(Refused, match="no longer kept"):
        editor.examples.click(*MIDDLE, editor.list, frame="17")
    with pytest.raises(Refused, match="click the thing again"):
        editor.examples.made(["unknown"])
