"""A recording plays as a robot, its floor is found, its map agrees with the world, and every
refusal names the file."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.main import cli
from app.replay.annotation import judge_beware, load_annotation
from app.replay.floor_plane import find_floor
from app.replay.recording import RecordingWriter, open_recording
from app.replay.reference import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Reference,
    agreement,
    load_reference,
    occupied_cells,
)
from app.replay.robot import ReplayRobot, frames_of, map_around
from app.replay.run import compare, replay
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration, BadGeometry
from navcore.geometry.transform import Twist, invert
from navcore.grid.grid import GridSpec
from navcore.learning.data.images import write_grey
from navcore.mapping.points.point_table import MapPoints
from navcore.mission.beware_list import default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.planning.path import Path as GridPath
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, load_profile
from tests.navcore.scene import LENS, picture
from tests.recorded import HAND, PLACES, RECORDING_GAP_NS, TILTED, write_recording
from tests.shared_data import beside

DATA = Path(__file__).parents[3].parent / "shared" / "data" / "rgbd"


def due(robot: ReplayRobot) -> Frame:
    frame = robot.wait_frame(None, 0.0)
    assert frame is not None
    return frame


def ahead_m(before: int, after: int) -> float:
    """Return the displacement between two places along the heading at the first."""
    return (PLACES[before].inverse() @ PLACES[after]).x_m


@pytest.fixture(scope="module")
def level(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose world is the map."""
    return write_recording(tmp_path_factory.mktemp("level") / "walk", np.eye(4))


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A recording of one's own, in a world that is not level."""
    return write_recording(tmp_path / "walk", TILTED)


def test_the_floor_of_a_tilted_recording_is_found_beneath_the_table(walk: Path) -> None:
    found = find_floor(open_recording(walk))
    assert math.degrees(math.acos(float((found @ TILTED)[2, 2]))) < 0.5
    places = np.array([[place.x_m, place.y_m, 0.0, 1.0] for place in PLACES])
    assert np.abs((found @ TILTED @ places.T)[2]).max() < 0.02


def test_frames_are_played_by_the_clock_and_the_camera_is_where_it_was(level: Path) -> None:
    recording, now_ns = open_recording(level), 1_000
    robot = ReplayRobot(recording, np.eye(4), clock=lambda: now_ns)
    assert robot.newest_frame() is None
    first = due(robot)
    robot.send(Twist(v_mps=1.0, w_radps=0.0))
    assert (first.stamp_ns, due(robot) is first, robot.newest_frame() is first) == (
        1_000,
        True,
        True,
    )
    now_ns += 3 * RECORDING_GAP_NS + 1_000_000
    fourth = due(robot)
    assert fourth.stamp_ns == 1_000 + recording.stamp_ns(3)
    np.testing.assert_allclose(fourth.T_map_camera, PLACES[3].matrix() @ HAND, atol=1e-9)
    assert fourth.twist.v_mps == pytest.approx(ahead_m(2, 3) * 6, rel=1e-3)
    assert fourth.twist.w_radps == pytest.approx(-0.04 * 6, rel=1e-3)
    assert (fourth.depth_m[0, :5] == 0).all()  # 65535 is no distance
    now_ns += 60_000_000_000
    last = due(robot)
    assert last.pose.y_m == pytest.approx(PLACES[-1].y_m)
    assert robot.wait_frame(last, 0.02) is None


def test_a_recording_that_goes_back_and_forth_never_jumps_and_its_clock_goes_on(
    level: Path,
) -> None:
    recording, now_ns = open_recording(level), 0
    robot = ReplayRobot(recording, np.eye(4), clock=lambda: now_ns, back_and_forth=True)
    frames: list[Frame] = []
    for now_ns in range(0, 22 * RECORDING_GAP_NS, RECORDING_GAP_NS // 3):  # noqa: B007 - the robot's clock
        if not frames or due(robot) is not frames[-1]:
            frames.append(due(robot))
    there, back = [place.y_m for place in PLACES], [place.y_m for place in PLACES[-2::-1]]
    assert [frame.pose.y_m for frame in frames] == pytest.approx([*there, *back, *there[1:]])
    stamps_ns = [step * RECORDING_GAP_NS for step in range(len(frames))]
    assert [frame.stamp_ns for frame in frames] == pytest.approx(stamps_ns, abs=len(frames))
    last = len(PLACES) - 1
    steps = [*zip(range(last), range(1, last + 1), strict=True)]
    steps += [(after, before) for before, after in reversed(steps)] + steps
    speeds = [ahead_m(before, after) * 6 for before, after in steps]
    assert min(speeds) < 0 < max(speeds), "backwards on the way back"
    assert [frame.twist.v_mps for frame in frames[1:]] == pytest.approx(speeds, rel=1e-3)


def test_every_frame_comes_once(level: Path) -> None:
    stamps = [frame.stamp_ns for frame in frames_of(open_recording(level), np.eye(4))]
    assert stamps == [5 * step * 1_000_000_000 // 30 for step in range(len(PLACES))]


def test_the_map_of_a_recording_has_what_stood_there_and_the_path_goes_round_it(
    level: Path,
) -> None:
    replayed = replay(
        open_recording(level),
        np.eye(4),
        profile=load_profile("jackal"),
        config=NavigatorConfig(),
        segmenter=ColourSegmenter(),
        beware=default_beware_list(),
        goal=(3.0, -0.3),
    )
    occupied, spec = replayed.decision.occupancy.grid.geometric, replayed.navigator.map.spec
    assert occupied[spec.cell(2.02, 0.0)]
    assert occupied[spec.cell(3.62, 0.6)]
    assert not occupied[spec.cell(1.5, 0.0)]
    route = replayed.decision.route
    assert route is not None
    assert isinstance(route.outcome, GridPath)
    clear = (
        (route.points[:, 0] < 1.9) | (np.abs(route.points[:, 1]) > 0.5) | (route.points[:, 0] > 2.7)
    )
    assert clear.all()


def test_a_goal_off_the_map_is_refused(level: Path) -> None:
    with pytest.raises(BadGeometry, match="outside the recording's map"):
        replay(
            open_recording(level),
            np.eye(4),
            profile=HUSKY,
            config=NavigatorConfig(),
            segmenter=ColourSegmenter(),
            beware=default_beware_list(),
            goal=(99.0, 0.0),
        )


def test_agreement_leaves_out_what_the_reference_does_not_know() -> None:
    ours, theirs, known = (np.zeros((9, 9), dtype=np.bool_) for _ in range(3))
    known[:, :8] = True
    ours[4, 1:5], theirs[4, 2:7], ours[0, 8] = True, True, True
    told = agreement(ours, theirs, known)
    assert (told.iou, told.judged, told.reference, told.not_judged) == (3 / 6, 4, 5, 1)
    assert (told.precision_near, told.recall_near) == (1.0, 4 / 5)


def test_a_reference_in_a_tilted_world_is_judged_on_the_floor_between_two_heights() -> None:
    state = np.full((10, 10, 10), FREE, dtype=np.uint8)
    state[5, 5, 2:4], state[0] = OCCUPIED, UNKNOWN
    reference = Reference(state=state, origin_m=np.zeros(3), voxel_m=0.1)
    quarter = np.array(
        [[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )  # world x is the map's y
    spec = GridSpec(resolution_m=0.1, rows=10, cols=10, origin_x_m=-1.0, origin_y_m=0.0)
    occupied, known = occupied_cells(reference, quarter, spec, heights_m=(0.1, 1.0))
    assert np.argwhere(occupied).tolist() == [[5, 4]]
    assert not known[0].any()
    assert known[1:].all()
    above, _ = occupied_cells(reference, quarter, spec, heights_m=(0.4, 1.0))
    assert not above.any()
    np.testing.assert_allclose(quarter @ invert(quarter), np.eye(4))


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("poses.txt", None, "poses.txt: no such file"),
        ("poses.txt", "0 1 2 3\n", "poses.txt: line 1: expected 17 numbers"),
        ("poses.txt", "0 " + "nan " * 16, "poses.txt: line 1: expected 17 numbers"),
        ("poses.txt", "# none\n", "has 0 poses"),
        ("poses.txt", "5 " + "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "no rotation"),
        ("poses.txt", "\n".join(["5 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"] * 2), "increasing"),
        ("poses.txt", "7 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "frame-000007.depth.png: no such file"),
        ("camera-intrinsics.txt", "-1 0 0\n0 1 0\n0 0 1\n", "positive focal lengths"),
        ("frame-000000.depth.png", "no picture", "neither PNG nor JPEG"),
    ],
)
def test_a_damaged_recording_is_refused_by_the_name_of_the_file(
    walk: Path, file: str, content: str | None, words: str
) -> None:
    (walk / file).unlink()
    if content is not None:
        (walk / file).write_text(content)
    with pytest.raises(BadConfiguration, match=words):
        open_recording(walk)


def test_a_picture_of_another_size_is_refused_by_name(walk: Path) -> None:
    write_grey(walk / "frame-000005.depth.png", np.zeros((4, 4), dtype=np.uint16))
    recording = open_recording(walk)
    with pytest.raises(BadConfiguration, match=r"frame-000005.depth.png: is \(4, 4\) pixels"):
        recording.depth_m(1)


def test_a_recording_without_a_floor_is_refused(walk: Path) -> None:
    recording = open_recording(walk)
    for number in recording.numbers:
        write_grey(
            walk / f"frame-{number:06d}.depth.png",
            np.zeros((LENS.height, LENS.width), dtype=np.uint16),
        )
    with pytest.raises(BadConfiguration, match="no floor is seen"):
        find_floor(recording)


def test_a_file_that_is_no_reference_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", state=np.zeros((2, 2, 2), dtype=np.uint8))
    with pytest.raises(BadConfiguration, match="lacks origin, voxel_size"):
        load_reference(tmp_path / "other.npz")
    (tmp_path / "text.npz").write_text("text")
    with pytest.raises(BadConfiguration, match="no reference, or a damaged one"):
        load_reference(tmp_path / "text.npz")


@pytest.mark.parametrize(
    ("origin", "voxel_size"), [(["a", "b", "c"], 0.1), ([0.0, 0.0, 0.0], 0.1j)]
)
def test_a_reference_whose_origin_or_voxel_size_is_no_number_is_refused(
    tmp_path: Path, origin: list[Any], voxel_size: complex
) -> None:
    state = np.zeros((2, 2, 2), dtype=np.uint8)
    np.savez(tmp_path / "r.npz", state=state, origin=origin, voxel_size=voxel_size)
    with pytest.raises(BadConfiguration, match="origin must be three finite numbers"):
        load_reference(tmp_path / "r.npz")


def test_pixels_whose_colour_is_not_known_are_so_in_what_is_read_of_a_recorded_drive(
    tmp_path: Path,
) -> None:
    first, second = (picture(stamp_ns=number * 1_000_000_000) for number in range(2))
    unknown = np.zeros(first.depth_m.shape, dtype=np.bool_)
    unknown[10:20, 5:9] = True
    rgb = np.where(unknown[..., None], np.uint8(0), first.rgb)
    writer = RecordingWriter(tmp_path)
    writer.add(dataclasses.replace(first, rgb=rgb, uncoloured=unknown))
    writer.add(second)
    known, all_known = frames_of(open_recording(tmp_path), np.eye(4))
    assert np.array_equal(known.rgb, rgb) and known.uncoloured is not None
    assert np.array_equal(known.uncoloured, unknown)
    assert all_known.uncoloured is None


def test_a_recording_whose_map_would_be_too_large_is_refused(walk: Path) -> None:
    recording = open_recording(walk)
    far = recording.T_world_camera.copy()
    far[-1, :2, 3] += 450.0
    with pytest.raises(BadConfiguration, match="walk: its map would be 9"):
        map_around(
            dataclasses.replace(recording, T_world_camera=far),
            np.eye(4),
            reach_m=5.0,
            resolution_m=0.05,
        )


def test_the_command_tells_maps_and_draws(walk: Path, tmp_path: Path) -> None:
    recording = open_recording(walk)
    state = np.full((80, 80, 80), FREE, dtype=np.uint8)
    np.savez(
        tmp_path / "reference.npz",
        state=state,
        origin=np.array([-2.0, -3.0, -2.0]),
        voxel_size=0.05,
    )
    out = tmp_path / "out"
    words = [
        "replay",
        walk,
        "--out",
        out,
        "--picture",
        "--segmenter",
        "colour",
        "--reference",
        tmp_path / "reference.npz",
        "--objects",
        tmp_path / "objects.toml",
    ]
    (tmp_path / "objects.toml").write_text("objects = []")
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    assert "8 frames" in result.output
    assert "IoU" in result.output
    report = json.loads((out / "replay.json").read_text())
    assert report["frames"] == len(recording)
    assert report["occupied_cells"] > 50
    assert report["reference"]["iou"] == 0.0  # the reference holds nothing for occupied
    assert report["objects"]["judged_cells"] > 50
    assert report["objects"]["held"] == {}
    assert (report["scenario"], report["segmenter"]) == ("walk", "colour rules")
    assert {"replay.png", "map.npz"} <= {path.name for path in out.iterdir()}


def test_cells_of_the_list_are_wrong_only_away_from_annotated_objects(tmp_path: Path) -> None:
    file = tmp_path / "objects.toml"
    file.write_text(
        """
        judged_below_m = 1.0
        [[objects]]
        name = "parcel"
        beware_class = "box"
        outline = [[1.0, 0.5, 0.2], [1.2, 0.5, 0.2], [1.2, 0.7, 0.2], [1.0, 0.7, 0.2]]
        [[objects]]
        name = "bin"
        outline = [[2.0, 0.5, 0.2], [2.2, 0.5, 0.2], [2.2, 0.7, 0.2]]
        """
    )
    beware, spec = default_beware_list(), GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
    box, cup = beware.ids["box"], beware.ids["cup"]
    seen = [
        ((1.1, 0.6, 0.3), box, 0.9),  # the parcel
        ((1.1, 0.8, 0.3), box, 0.9),  # its rim
        ((2.1, 0.6, 0.3), cup, 0.9),  # the bin, which may be anything
        ((3.0, 0.6, 0.7), box, 0.9),  # a table
        ((3.0, 0.6, 0.7), cup, 0.9),
        ((3.5, 0.6, 0.7), box, 0.2),  # not sure enough
        ((3.0, 1.6, 1.2), box, 0.9),  # too high to be judged
        ((0.5, 0.6, 0.3), 0, 1.0),  # a wall
    ]
    points = MapPoints(
        points_map=np.array([at for at, _, _ in seen], dtype=np.float32),
        rgb=np.zeros((len(seen), 3), dtype=np.uint8),
        class_ids=np.array([kind for _, kind, _ in seen], dtype=np.uint8),
        confidence=np.array([sure for *_, sure in seen], dtype=np.float32),
        range_m=np.ones(len(seen), dtype=np.float32),
        pose_ids=np.zeros(len(seen), dtype=np.int32),
        looks=np.zeros(len(seen), dtype=np.uint8),
    )
    told = judge_beware(points, spec, np.eye(4), load_annotation(file), beware, certain=0.95)
    assert (told.judged_cells, told.wrong_cells) == (5, 1)
    assert told.wrong_by_class == {"box": 1, "cup": 1}
    assert told.held == {"parcel": ("box",)}
    assert told.held_as_own_class == 1
    turned = np.array([[-1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    elsewhere = judge_beware(points, spec, turned, load_annotation(file), beware, certain=0.95)
    assert (elsewhere.wrong_cells, elsewhere.held_as_own_class) == (4, 0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("objects = [", "not readable as TOML"),
        ('objects = [{ name = "a", outline = [[0, 0, 0]] }]', "'a': an outline has at least 3"),
        ('objects = [{ name = "a", outline = [], kind = 1 }]', "kind"),
    ],
)
def test_a_file_that_is_no_annotation_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "objects.toml").write_text(text)
    with pytest.raises(BadConfiguration, match=words):
        load_annotation(tmp_path / "objects.toml")


def shared_data(name: str) -> Path:
    """Real data beside this checkout; skips where they are missing, unless continuous integration
    promises them."""
    return beside(DATA / name, "the recordings are")


def test_a_real_kitchen_becomes_the_map_that_its_reference_says() -> None:
    """Every fourth of the shipped frames: 35 pictures of a Kinect carried by hand."""
    recording = open_recording(shared_data("7scenes_redkitchen"), every=4)
    reference = load_reference(shared_data("7scenes_redkitchen_occupancy_5cm.npz"))
    jackal = load_profile("jackal")
    config = config_for(jackal)
    replayed = replay(
        recording,
        find_floor(recording),
        profile=jackal,
        config=config,
        segmenter=ColourSegmenter(),
        beware=default_beware_list(),
        goal=(0.2, -3.0),
    )
    judged = compare(replayed, reference, config)
    assert judged.iou >= 0.85
    assert judged.precision_near >= 0.99
    assert judged.recall_near >= 0.99
    assert judged.not_judged <= 0.05 * judged.judged
    route = replayed.decision.route
    assert route is not None
    assert isinstance(route.outcome, GridPath)
    assert not replayed.decision.occupancy.blocked[tuple(route.outcome.cells.T)].any()
