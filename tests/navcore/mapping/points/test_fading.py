"""Fading: what a colour rule has found goes as surely as it came, and never while it is there."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import FadingConfig, MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.point_table import POINT
from navcore.mapping.storage.map_file import load, save
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import assert_same, layers, rebuilt
from tests.navcore.scene import GREY, RED_ID, RED_LIST, SPEC, Box, Paint, picture

SPILL = Paint(x=(1.2, 1.7), y=(-0.3, 0.3))
FIRST, MOST = FadingConfig().first, FadingConfig().most
NOTHING_THERE = picture()


def look(point_map: PointMap, frame: Frame, labels: Labels | None = None) -> int:
    """Return the number of cells of red floor after one more image."""
    labels = labels or ColourSegmenter().segment(frame, RED_LIST)
    point_map.insert(observe(frame, labels, RED_LIST, SPEC, ObservationConfig()), frame, labels)
    return int(layer_grid(point_map, RED_LIST, ()).beware[RED_ID].sum())


def seen(times: int, frame: Frame | None = None) -> tuple[PointMap, int]:
    """Return a map with a spill that was seen some times, and its cells."""
    point_map, spill = PointMap(SPEC, MappingConfig()), frame or picture(SPILL)
    cells = [look(point_map, spill) for _ in range(times)]
    assert cells[0] == cells[-1] > 10
    return point_map, cells[-1]


def unlabelled(frame: Frame) -> Labels:
    shape = frame.depth_m.shape
    return Labels(class_ids=np.zeros(shape, np.uint8), confidence=np.ones(shape, np.float32))


@pytest.mark.parametrize(("times", "most_looks"), [(1, FIRST), (11, FIRST + 10), (60, MOST)])
def test_a_mopped_spill_fades_after_as_many_looks_as_spoke_for_it(
    times: int, most_looks: int
) -> None:
    point_map, cells = seen(times)
    left = [look(point_map, NOTHING_THERE) for _ in range(most_looks)]
    assert left[-2] == cells
    assert left[-1] == 0


def test_a_single_look_removes_nothing_and_looks_in_between_count_for_it() -> None:
    point_map, cells = seen(1)
    for _ in range(40):
        assert look(point_map, NOTHING_THERE) == cells
        assert look(point_map, picture(SPILL)) == cells


def test_what_comes_back_after_it_has_faded_counts_at_once() -> None:
    point_map, cells = seen(1)
    for _ in range(FIRST):
        look(point_map, NOTHING_THERE)
    assert look(point_map, picture(SPILL)) == cells


@pytest.mark.parametrize(
    "frame",
    [
        picture(Box(x=(0.9, 1.0), y=(-2.0, 2.0), z=(0.0, 0.6))),
        picture(Box(x=(1.1, 1.8), y=(-0.4, 0.4), z=(0.0, 0.08))),
        picture(pose=Pose2(x_m=-2.0, y_m=0.0, yaw_rad=0.0)),
        picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=2.0)),
        dataclasses.replace(NOTHING_THERE, rgb=NOTHING_THERE.rgb // 8),
        dataclasses.replace(NOTHING_THERE, depth_m=np.zeros_like(NOTHING_THERE.depth_m)),
    ],
    ids=["behind a wall", "below a low box", "far", "out of view", "in the dark", "no depth"],
)
def test_a_look_that_cannot_tell_says_nothing(frame: Frame) -> None:
    point_map, cells = seen(1)
    assert [look(point_map, frame) for _ in range(3 * MOST)] == [cells] * (3 * MOST)
    # Control: near looks at the open floor do.
    assert [look(point_map, NOTHING_THERE) for _ in range(FIRST)][-1] == 0


@pytest.mark.parametrize("share", [1.0, 0.6, 0.3])
def test_a_thing_that_is_there_does_not_fade_when_its_label_is_lost(share: float) -> None:
    """In a shadow, at a grazing angle, or after the class has left the list."""
    point_map, cells = seen(1)
    shaded = picture(SPILL)
    shaded = dataclasses.replace(shaded, rgb=(share * shaded.rgb).astype(np.uint8))
    for _ in range(2 * MOST):
        assert look(point_map, shaded, unlabelled(shaded)) == cells


def test_a_marking_that_is_there_stays_while_the_robot_turns_pitches_and_is_misplaced() -> None:
    rng, point_map = np.random.default_rng(1), PointMap(SPEC, MappingConfig())
    cells = []
    for _ in range(60):
        true = picture(
            SPILL, pose=Pose2(x_m=0.1 * rng.random(), y_m=0.0, yaw_rad=rng.normal(0, 0.1))
        )
        pose = dataclasses.replace(true.pose, x_m=true.pose.x_m + rng.normal(0, 0.02))
        cells.append(look(point_map, dataclasses.replace(true, pose=pose)))
    assert min(cells) > 0.9 * cells[0]


def test_only_the_part_that_was_mopped_fades() -> None:
    point_map, cells = seen(5)
    half = picture(dataclasses.replace(SPILL, y=(0.0, 0.3)))
    for _ in range(2 * MOST):
        left = look(point_map, half)
    assert 0.3 * cells < left < 0.75 * cells


YELLOW, BLACK, BLUE = (240, 200, 0), (15, 15, 15), (20, 60, 220)
SHIPPED = default_beware_list()


def tape(y_m: tuple[float, float], x_m: float = 1.3) -> list[Paint]:
    """Return stripes of yellow and black, 10 cm each."""
    edges = np.arange(y_m[0], y_m[1] + 0.01, 0.1)
    return [
        Paint(x=(x_m, x_m + 0.2), y=(low, high), colour=(YELLOW, BLACK)[k % 2])
        for k, (low, high) in enumerate(pairwise(edges.tolist()))
    ]


BAY = [
    Paint(x=(1.0, 1.9), y=(-0.5, 0.5), colour=BLUE),
    Paint(x=(1.1, 1.8), y=(-0.4, 0.4), colour=GREY),
]


class TestPatterns:
    """The second colour of a pattern goes with the first."""

    def look(self, point_map: PointMap, name: str, *paint: Paint) -> int:
        """Return the number of cells of an entry of the shipped list after one more image."""
        entry = dataclasses.replace(SHIPPED.named(name), enabled=True)
        beware, frame = BewareList(classes=(entry,)), picture(*paint)
        labels = ColourSegmenter().segment(frame, beware)
        point_map.insert(observe(frame, labels, beware, SPEC, ObservationConfig()), frame, labels)
        cells = layer_grid(point_map, beware, ()).beware[entry.class_id].sum()
        return int(cells)

    @pytest.mark.parametrize(
        ("name", "paint", "least"),
        [("yellow-black tape", tape((-0.6, 0.6)), 20), ("reserved bay", BAY, 60)],
        ids=["tape", "bay"],
    )
    def test_a_marking_that_is_gone_fades_whole(
        self, name: str, paint: list[Paint], least: int
    ) -> None:
        point_map = PointMap(SPEC, MappingConfig())
        cells = self.look(point_map, name, *paint)
        assert cells > least
        left = [self.look(point_map, name) for _ in range(FIRST)]
        assert left[-2] == cells and left[-1] == 0
        assert self.look(point_map, name, *paint) == cells  # and counts at once when it is back

    def test_a_part_that_is_left_keeps_both_colours(self) -> None:
        point_map, name = PointMap(SPEC, MappingConfig()), "yellow-black tape"
        whole = self.look(point_map, name, *tape((-0.6, 0.6)))
        for _ in range(2 * MOST):
            left = self.look(point_map, name, *tape((-0.6, 0.0)))
        assert 0.4 * whole < left < 0.75 * whole

    @pytest.mark.parametrize("share", [1.0, 0.5])
    def test_a_marking_that_is_there_stays_when_its_label_is_lost(self, share: float) -> None:
        point_map, name = PointMap(SPEC, MappingConfig()), "yellow-black tape"
        cells = self.look(point_map, name, *tape((-0.6, 0.6)))
        shaded = picture(*tape((-0.6, 0.6)))
        shaded = dataclasses.replace(shaded, rgb=(share * shaded.rgb).astype(np.uint8))
        for _ in range(2 * MOST):
            look(point_map, shaded, unlabelled(shaded))
        assert self.look(point_map, name, *tape((-0.6, 0.6))) == cells


WHITE = (225, 225, 220)
LINES = [
    [Paint(x=(1.4, 1.5), y=(-1.5, 1.5), colour=WHITE)],
    [Paint(x=(0.6, 2.6), y=(-0.05, 0.05), colour=WHITE)],
]


class TestLines:
    """A white line has the colour of a grey floor in brighter light."""

    beware = BewareList(classes=(dataclasses.replace(SHIPPED.named("white line"), enabled=True),))

    def look(self, point_map: PointMap, frame: Frame, labels: Labels | None = None) -> int:
        """Return the number of cells of the line after one more image."""
        self.insert(point_map, frame, labels or ColourSegmenter().segment(frame, self.beware))
        (entry,) = self.beware.classes
        return int(layer_grid(point_map, self.beware, ()).beware[entry.class_id].sum())

    def insert(self, point_map: PointMap, frame: Frame, labels: Labels) -> None:
        """Give the map one more image."""
        seen = observe(frame, labels, self.beware, SPEC, ObservationConfig())
        point_map.insert(seen, frame, labels)

    def new_map(self) -> PointMap:
        """Return a map that knows the list."""
        point_map = PointMap(SPEC, MappingConfig())
        point_map.use(self.beware)
        return point_map

    @pytest.mark.parametrize("paint", LINES, ids=["across", "along"])
    def test_a_line_that_is_gone_fades_where_the_floor_around_is_in_view(
        self, paint: list[Paint]
    ) -> None:
        point_map = self.new_map()
        cells = self.look(point_map, picture(*paint))
        assert cells > 20
        left = [self.look(point_map, NOTHING_THERE) for _ in range(FIRST)]
        assert left[-2] == cells and left[-1] < 0.4 * cells
        for k in range(4 * FIRST):  # from elsewhere the rest is in the middle of the image
            pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.5 * (-1) ** k)
            left.append(self.look(point_map, picture(pose=pose)))
        assert left[-1] < 0.2 * cells

    @pytest.mark.parametrize("paint", LINES, ids=["across", "along"])
    @pytest.mark.parametrize("share", [1.0, 0.6, 0.3])
    def test_a_line_that_is_there_stays_when_its_label_is_lost(
        self, share: float, paint: list[Paint]
    ) -> None:
        point_map = self.new_map()
        cells = self.look(point_map, picture(*paint))
        shaded = picture(*paint)
        shaded = dataclasses.replace(shaded, rgb=(share * shaded.rgb).astype(np.uint8))
        for _ in range(2 * MOST):
            left = self.look(point_map, shaded, unlabelled(shaded))
        assert left > 0.9 * cells

    def test_of_a_class_that_is_switched_off_nothing_fades(self) -> None:
        point_map = self.new_map()
        cells = self.look(point_map, picture(*LINES[0]))
        point_map.use(self.beware.edited("white line", enabled=False))
        for _ in range(2 * MOST):
            self.insert(point_map, NOTHING_THERE, unlabelled(NOTHING_THERE))
        assert self.look(point_map, NOTHING_THERE, unlabelled(NOTHING_THERE)) == cells


def test_the_evidence_is_kept_with_the_map_and_a_point_is_as_large_as_before(
    tmp_path: Path,
) -> None:
    point_map, cells = seen(1)
    for _ in range(FIRST - 1):
        look(point_map, NOTHING_THERE)
    save(tmp_path / "map", point_map.state(), {})
    again = PointMap(SPEC, MappingConfig())
    again.restore(load(tmp_path / "map").state)
    assert int(layer_grid(again, RED_LIST, ()).beware[RED_ID].sum()) == cells
    assert look(again, NOTHING_THERE) == 0
    assert POINT.itemsize == 48


@law(15)
@given(st.integers(0, 2**32 - 1))
def test_the_map_after_looks_list_edits_erasures_and_rejections_equals_that_of_its_points(
    seed: int,
) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SPEC, MappingConfig())
    beware, erased = RED_LIST, []
    for _ in range(25):
        step, points = rng.integers(8), cloud.points
        red = points.points_map[points.class_ids == RED_ID, :2].astype(np.float64)
        if step == 0:
            cells = np.flatnonzero(rng.random(SPEC.rows * SPEC.cols) < 0.3)
            erased.append(cloud.edits.erase(cells, [int(rng.integers(2)) * RED_ID]))
        elif step == 1 and erased:
            cloud.edits.put_back(erased.pop())
        elif step == 2 and len(red):
            erased.append(cloud.edits.reject(RED_ID, red[:5], 1.0)[1])
        elif step == 3 and cloud.rejections.all:
            cloud.edits.take_back(cloud.rejections.all[0].id)
        elif step == 4:
            beware = beware.edited("red floor", enabled=bool(rng.integers(2)))
            cloud.use(beware)
        elif step == 5 and len(cloud.poses):
            cloud.correct({0: Pose2(x_m=rng.normal(0, 0.2), y_m=0.0, yaw_rad=rng.normal(0, 0.1))})
        else:
            shown = [SPILL] if rng.random() < 0.4 else []
            frame = picture(*shown, pose=Pose2(x_m=0.3 * rng.random(), y_m=0.0, yaw_rad=0.0))
            labels = ColourSegmenter().segment(frame, RED_LIST)
            labels = cloud.rejections.without(frame, labels)
            cloud.insert(observe(frame, labels, RED_LIST, SPEC, ObservationConfig()), frame, labels)
        assert_same(layers(cloud, beware), rebuilt(cloud, beware))
    again = PointMap(SPEC, MappingConfig())
    again.restore(cloud.state())
    again.use(beware)
    assert_same(layers(again, beware), layers(cloud, beware))
