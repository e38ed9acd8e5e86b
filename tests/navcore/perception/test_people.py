"""People are tracked as they walk; nothing that stands still is a person, however the robot moves;
a person who left is not on the map."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.config.perception.perception import PeopleTrackerConfig, PerceptionConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.camera import pixel_rays
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import PERSON, BewareClass, BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.people.detector import Cluster, PersonDetector
from navcore.perception.people.track import KalmanTrack, Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from tests.navcore.scene import MOUNT, ORIGIN, Box, picture

TENTH_NS = 100_000_000
NO_LIST = BewareList(classes=())
WITH_PEOPLE = BewareList(classes=(BewareClass(name=PERSON, class_id=11),))
FURNITURE = (
    Box(x=(4.0, 4.1), y=(-6.0, 6.0), z=(0.0, 2.5)),
    Box(x=(2.6, 3.1), y=(1.2, 1.7), z=(0.0, 0.9)),
    Box(x=(1.9, 2.3), y=(-1.6, -1.2), z=(0.0, 1.4)),
)
SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)


def person_at(x_m: float, y_m: float) -> Box:
    """Return a box as broad as a person, with the middle at a position."""
    return Box(x=(x_m - 0.12, x_m + 0.12), y=(y_m - 0.2, y_m + 0.2), z=(0.0, 1.75))


def unlabelled(frame: Frame) -> Labels:
    return Labels(
        class_ids=np.zeros(frame.depth_m.shape, np.uint8),
        confidence=np.ones(frame.depth_m.shape, np.float32),
    )


class SeesPeople:
    """A network that labels everything up to 3 m ahead, except a board, as a person."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        camera, lens = frame.T_map_camera, frame.intrinsics
        rows, cols = np.mgrid[0 : lens.height, 0 : lens.width]
        optical = pixel_rays(rows, cols, lens)
        points = optical * frame.depth_m[..., None] @ camera[:3, :3].T + camera[:3, 3]
        theirs = (
            (frame.depth_m > 0)
            & (points[..., 0] < 3.0)
            & (points[..., 1] < 0.4)
            & (points[..., 2] > 0.03)
        )
        return Labels(
            class_ids=np.where(theirs, np.uint8(11), np.uint8(0)),
            confidence=np.full(theirs.shape, 0.95, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


def follow(tracker: PeopleTracker, frame: Frame) -> tuple[Track, ...]:
    return tracker.follow(frame, unlabelled(frame), NO_LIST)


def walk(
    tracker: PeopleTracker,
    start: tuple[float, float],
    velocity: tuple[float, float],
    frames: int,
    *objects: Box,
) -> list[tuple[Track, ...]]:
    """Return the tracks while a person walks before a standing robot, at ten images a second."""
    (x, y), (vx, vy) = start, velocity
    return [
        follow(
            tracker,
            picture(*objects, person_at(x + vx * k / 10, y + vy * k / 10), stamp_ns=k * TENTH_NS),
        )
        for k in range(frames)
    ]


@pytest.mark.parametrize(
    "velocity", [(0.0, 0.5), (0.0, -0.8), (-0.6, 0.6), (-0.8, 0.0), (0.0, 1.6), (0.3, -1.0)]
)
def test_position_and_velocity_of_a_person_who_walks_straight_are_estimated(
    velocity: tuple[float, float],
) -> None:
    frames = 14
    start = (2.6 - 0.7 * velocity[0], -0.65 * velocity[1])
    (track,) = walk(PeopleTracker(), start, velocity, frames)[-1]
    speed = math.hypot(*velocity)
    assert math.hypot(track.vx_mps - velocity[0], track.vy_mps - velocity[1]) < 0.15 * speed + 0.05
    end = (start[0] + velocity[0] * (frames - 1) / 10, start[1] + velocity[1] * (frames - 1) / 10)
    assert math.dist((track.x_m, track.y_m), end) < 0.15


def test_a_walking_person_is_noticed_within_half_a_second_and_keeps_the_number() -> None:
    seen = walk(PeopleTracker(), (2.4, -0.8), (0.0, 0.8), 20, *FURNITURE[:2])
    first = next(k for k, tracks in enumerate(seen) if tracks)
    assert first <= 6
    assert {track.id for tracks in seen[first:] for track in tracks} == {seen[first][0].id}


def test_nothing_that_stands_still_is_a_person_while_the_robot_stands_turns_or_drives() -> None:
    for vx, w in ((0.0, 0.0), (0.0, 0.9), (0.0, -0.9), (0.8, 0.0), (0.5, 0.6)):
        tracker, pose = PeopleTracker(), Pose2(x_m=-1.0, y_m=0.0, yaw_rad=-8 * w / 10)
        for k in range(20):
            assert follow(tracker, picture(*FURNITURE, pose=pose, stamp_ns=k * TENTH_NS)) == ()
            pose = pose @ Pose2(x_m=vx / 10, y_m=0.0, yaw_rad=w / 10)


def test_the_same_images_give_the_same_tracks() -> None:
    runs = [walk(PeopleTracker(), (2.4, -0.8), (0.0, 0.8), 12, *FURNITURE) for _ in range(2)]
    assert runs[0] == runs[1]


def test_a_labelled_person_is_tracked_while_standing() -> None:
    tracker, tracks = PeopleTracker(), tuple[Track, ...]()
    for k in range(3):
        frame = picture(person_at(2.0, 0.3), stamp_ns=k * TENTH_NS)
        shown = (frame.depth_m > 1.2) & (frame.depth_m < 2.2)
        labels = Labels(
            class_ids=np.where(shown, 11, 0).astype(np.uint8),
            confidence=np.ones(shown.shape, np.float32),
        )
        tracks = tracker.follow(frame, labels, WITH_PEOPLE)
    assert len(tracks) == 1
    assert math.dist((tracks[0].x_m, tracks[0].y_m), (2.0, 0.3)) < 0.15
    assert tracks[0].speed_mps == 0.0


def test_a_person_who_stops_has_no_velocity_later_and_walks_on_with_the_same_number() -> None:
    tracker = PeopleTracker()
    number = walk(tracker, (2.4, -0.8), (0.0, 0.8), 10)[-1][0].id
    for k in range(10, 30):
        (standing,) = follow(tracker, picture(person_at(2.4, -0.08), stamp_ns=k * TENTH_NS))
    assert (standing.id, standing.speed_mps) == (number, 0.0)
    for k in range(30, 40):
        (walking,) = follow(
            tracker, picture(person_at(2.4, -0.08 + (k - 29) * 0.08), stamp_ns=k * TENTH_NS)
        )
    assert walking.id == number
    assert walking.vy_mps == pytest.approx(0.8, abs=0.15)


def test_an_object_wider_than_a_person_is_tracked_with_its_width_and_middle() -> None:
    """A disc of half a metre's radius, in four slices."""
    tracker, tracks = PeopleTracker(), tuple[Track, ...]()
    for k in range(14):
        y = -0.6 + 0.08 * k
        disc = [
            Box(x=(2.5 - a, 2.5 + a), y=(y - b, y + b), z=(0.0, 1.2))
            for a, b in ((0.5, 0.15), (0.4, 0.3), (0.25, 0.43), (0.1, 0.5))
        ]
        tracks = follow(tracker, picture(*disc, stamp_ns=k * TENTH_NS))
    (track,) = tracks
    assert track.radius_m == pytest.approx(0.5, abs=0.1)
    assert math.dist((track.x_m, track.y_m), (2.5, -0.6 + 0.08 * 13)) < 0.2


def test_the_walking_speed_of_a_person_who_stops_is_kept_and_the_standing_time_counted() -> None:
    tracker = PeopleTracker()
    walking = walk(tracker, (2.4, -0.8), (0.0, 0.8), 12)[-1][0]
    assert walking.walking_speed_mps == pytest.approx(0.8, abs=0.2)
    for k in range(12, 42):
        (standing,) = follow(tracker, picture(person_at(2.4, 0.08), stamp_ns=k * TENTH_NS))
    assert standing.walking_speed_mps == pytest.approx(walking.walking_speed_mps, abs=0.1)
    assert 2.5 < standing.stood_s < 3.5


def test_a_person_far_away_stands_though_the_position_is_noisy() -> None:
    rng = np.random.default_rng(0)
    one = KalmanTrack(id=1, first=at_range(3.8, 0.0), now_ns=0)
    for k in range(1, 130):
        one.predict(0.1, lost=False)
        along = min(0.08 * k, 2.0)
        one.update(at_range(3.8 + rng.normal(0, 0.06), along + rng.normal(0, 0.06)), k * TENTH_NS)
    assert one.is_person
    assert one.track(129 * TENTH_NS).stood_s > 8.0


def at_range(x_m: float, y_m: float) -> Cluster:
    """Return a cluster that may be a person, where floor was seen before."""
    cells = np.array([[round(y_m / 0.1), round(x_m / 0.1)]])
    return Cluster(
        x_m=x_m, y_m=y_m, range_m=x_m, radius_m=0.3, on_new_floor=1.0, labelled=0.0, cells=cells
    )


def test_a_person_who_starts_slowly_again_walks() -> None:
    """The speed is hardly above the noise of the estimate: the distance covered decides."""
    tracker = PeopleTracker()
    walk(tracker, (2.0, -0.4), (0.0, 0.42), 12)
    for k in range(12, 40):
        follow(tracker, picture(person_at(2.0, 0.06), stamp_ns=k * TENTH_NS))
    for k in range(40, 52):
        (track,) = follow(
            tracker, picture(person_at(2.0, 0.06 - 0.042 * (k - 39)), stamp_ns=k * TENTH_NS)
        )
    assert track.vy_mps == pytest.approx(-0.42, abs=0.12)


@pytest.mark.parametrize("comes_back", [True, False])
def test_who_was_seen_only_to_walk_away_is_a_person_soon_after_they_turn_back(
    comes_back: bool,
) -> None:
    """The robot has just turned to them: that there was floor before it has not seen."""

    def cluster(x_m: float, on_new_floor: float) -> Cluster:
        return Cluster(
            x_m=x_m,
            y_m=0.0,
            range_m=x_m,
            on_new_floor=on_new_floor,
            labelled=0.0,
            radius_m=0.3,
            cells=np.zeros((1, 2), dtype=np.int64),
        )

    track = KalmanTrack(id=1, first=cluster(3.0, 0.0), now_ns=0)
    told_s: list[float] = []
    for k in range(1, 45):
        away_m = min(0.05 * k, 1.0)
        back_m = max(0.05 * (k - 20), 0.0) if comes_back else 0.0
        track.predict(0.1, lost=False)
        track.update(cluster(3.0 + away_m - back_m, 0.2 if k < 25 else 0.9), k * TENTH_NS)
        if track.walks:
            told_s.append((k - 20) / 10)
    if comes_back:
        assert 0.5 < told_s[0] < 1.5, "before they are as near as when they were seen first"
    else:
        assert not told_s, "what stands and comes into view bit by bit is no person"


def test_a_person_cut_by_the_border_of_the_image_is_not_given_up_for_the_floor_beside() -> None:
    """The camera turns away from a standing person: it sees the side of the body last, and then the
    floor beside it."""
    tracker = PeopleTracker()
    walk(tracker, (1.6, -0.6), (0.0, 0.6), 12)
    position = (1.6, 0.06)
    for k in range(12, 30):
        follow(tracker, picture(person_at(*position), stamp_ns=k * TENTH_NS))
    for k in range(30, 60):
        away = Pose2(x_m=0.0, y_m=0.0, yaw_rad=-min(0.05 * (k - 30), 0.95))
        tracks = follow(tracker, picture(person_at(*position), pose=away, stamp_ns=k * TENTH_NS))
    (track,) = tracks
    assert math.dist((track.x_m, track.y_m), position) < 0.25


def test_a_person_who_enters_at_the_border_of_the_image_is_noticed_soon() -> None:
    """First half of the body is in view, and its middle is uncertain; the distance covered counts
    from where all of it was."""
    for start_y, most_ticks in ((1.9, 7), (1.0, 5)):  # at the border at 2 m, and well within
        seen = walk(PeopleTracker(), (2.0, start_y), (0.0, -0.9), 20)
        whole = next(k for k in range(20) if start_y - 0.09 * k + 0.2 < 1.75)
        assert next(k for k, tracks in enumerate(seen) if tracks) - whole <= most_ticks


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_middle_of_a_person_cut_by_the_border_is_behind_the_edge_in_view(side: float) -> None:
    cut = 0
    for y_m in np.arange(1.2, 2.2, 0.05):
        frame = picture(person_at(2.0, side * y_m), stamp_ns=TENTH_NS)
        found = PersonDetector().detect(frame, np.zeros(frame.depth_m.shape, np.bool_))
        for cluster in found:
            cut += cluster.is_cut
            assert cluster.x_m == pytest.approx(2.0, abs=0.1)
            # A person of the detector is 0.1 m broader to each side, of arms and feet.
            assert -0.06 < side * cluster.y_m - y_m < 0.13
    assert cut >= 3


@pytest.mark.parametrize(("start_y", "velocity"), [(1.75, (0.3, -0.55)), (1.7, (0.1, -0.5))])
def test_a_person_who_is_cut_by_the_border_all_the_way_is_noticed(
    start_y: float, velocity: tuple[float, float]
) -> None:
    """The robot drives on, and they walk towards its path: they stay at the border."""
    tracker, told = PeopleTracker(), list[int]()
    for k in range(20):
        at = Pose2(x_m=0.09 * k, y_m=0.0, yaw_rad=0.0)
        person = person_at(2.2 + velocity[0] * k / 10, start_y + velocity[1] * k / 10)
        frame = picture(*FURNITURE[2:], person, pose=at, stamp_ns=k * TENTH_NS)
        if follow(tracker, frame):
            told.append(k)
    assert told and told[0] <= 12


@pytest.mark.parametrize("turn_radps", [0.0, 0.3, -0.3])
def test_furniture_that_the_border_cuts_is_no_person(turn_radps: float) -> None:
    """Table tops stand over floor that was seen before; what comes into view bit by bit moves."""
    things = tuple(
        Box(x=(x, x + width_m), y=(y, y + 0.5), z=(bottom_m, 1.0))
        for x, y, width_m, bottom_m in (
            (2.0, 1.2, 0.3, 0.0),
            (2.6, -1.9, 0.8, 0.6),
            (3.4, 1.6, 1.0, 0.65),
            (3.9, -2.2, 0.4, 0.0),
        )
    )
    tracker = PeopleTracker()
    for k in range(30):
        at = Pose2(x_m=0.09 * k, y_m=0.0, yaw_rad=turn_radps * math.sin(k / 5))
        assert not follow(tracker, picture(*things, pose=at, stamp_ns=k * TENTH_NS))


def test_the_disc_of_a_standing_person_out_of_sight_does_not_grow() -> None:
    tracker = PeopleTracker()
    walk(tracker, (2.0, -0.4), (0.0, 0.6), 12)
    for k in range(12, 60):
        (last,) = follow(tracker, picture(person_at(2.0, 0.26), stamp_ns=k * TENTH_NS))
    away = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
    (later,) = [
        follow(tracker, picture(pose=away, stamp_ns=(60 + k) * TENTH_NS)) for k in range(30)
    ][-1]
    assert later.radius_m == last.radius_m


def test_a_walking_person_out_of_sight_is_predicted_with_a_growing_disc_until_given_up() -> None:
    tracker = PeopleTracker()
    (last,) = walk(tracker, (2.0, -0.8), (0.0, 1.0), 12)[-1]
    away = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
    (later,) = [
        follow(tracker, picture(pose=away, stamp_ns=(12 + k) * TENTH_NS)) for k in range(10)
    ][-1]
    assert later.y_m == pytest.approx(last.y_m + 1.0 * last.vy_mps, abs=0.05)
    assert later.radius_m > last.radius_m
    assert later.last_seen_ns == last.last_seen_ns
    for k in range(22, 100):
        tracks = follow(tracker, picture(pose=away, stamp_ns=k * TENTH_NS))
    assert tracks == ()


@pytest.mark.parametrize("w_radps", [0.0, 0.9])
def test_no_person_out_of_sight_is_given_up_while_the_robot_turns_to_look_for_them(
    w_radps: float,
) -> None:
    tracker, away = PeopleTracker(), Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
    walk(tracker, (2.0, -0.8), (0.0, 1.0), 12)
    for k in range(12, 100):
        turns = Twist(v_mps=0.0, w_radps=w_radps if k > 85 else 0.0)
        tracks = follow(tracker, picture(pose=away, stamp_ns=k * TENTH_NS, twist=turns))
    assert (tracks != ()) is (w_radps > 0.0)
    assert follow(tracker, picture(pose=away, stamp_ns=100 * TENTH_NS)) == ()


def out_of_sight(
    tracker: PeopleTracker, start: tuple[float, float], velocity: tuple[float, float], seconds: int
) -> Track:
    """Return the track of a person who walked before the robot until the camera lost them: so near
    it measures nothing where they are."""
    walk(tracker, start, velocity, 12)
    there = picture(person_at(start[0] + 1.2 * velocity[0], start[1] + 1.2 * velocity[1]))
    for k in range(12, 12 + 10 * seconds):
        frame = picture(stamp_ns=k * TENTH_NS)
        blind = np.where(there.depth_m == frame.depth_m, frame.depth_m, np.float32(0.0))
        (track,) = follow(tracker, dataclasses.replace(frame, depth_m=blind))
    return track


def test_no_person_walks_through_the_robot() -> None:
    """A person who came up to it is too near to be seen as a whole, and stands there."""
    track = out_of_sight(PeopleTracker(), (1.9, 0.1), (-0.8, 0.0), 4)
    assert 0.2 < track.x_m - HUSKY.length_m / 2 < 0.5
    assert (track.vx_mps, track.vy_mps) == (0.0, 0.0)
    assert track.walking_speed_mps > 0.6
    # The control: one whose way leads by it walks on.
    beside = out_of_sight(PeopleTracker(), (1.9, -1.2), (-0.8, 0.0), 1)
    assert beside.vx_mps == pytest.approx(-0.8, abs=0.25)


def found_again(tracker: PeopleTracker, labels: Labels | None = None) -> bool:
    """Whether something of a person's size that comes into view where a person who walked out of
    sight is expected is taken for the person at once."""
    (last,) = walk(tracker, (2.0, -0.8), (0.0, 1.0), 12)[-1]
    away = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
    for k in range(12, 34):
        (expected,) = follow(tracker, picture(pose=away, stamp_ns=k * TENTH_NS))
    there = person_at(expected.x_m, expected.y_m + 0.1)
    back = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.radians(50))
    frame = picture(there, pose=back, stamp_ns=34 * TENTH_NS)
    tracks = tracker.follow(frame, labels or unlabelled(frame), WITH_PEOPLE)
    return any(one.id == last.id and one.unseen_s == 0 for one in tracks)


def test_a_chair_where_a_person_is_expected_is_not_the_person_and_one_labelled_so_is() -> None:
    assert not found_again(PeopleTracker())
    shape = picture().depth_m.shape
    people = Labels(
        class_ids=np.full(shape, np.uint8(11)), confidence=np.full(shape, 0.95, np.float32)
    )
    assert found_again(PeopleTracker(), people)
    # The control: a track that anything continues takes the chair.
    anything = PeopleTrackerConfig(doubtful_s=60.0)
    assert found_again(PeopleTracker(config=PerceptionConfig(people=anything)))


def test_a_person_is_given_up_after_a_second_of_floor_where_they_may_be() -> None:
    """Not before: they may be elsewhere in view, and not yet told from other things."""
    tracker = PeopleTracker()
    walk(tracker, (2.0, -0.8), (0.0, 0.6), 12)
    tracks = [follow(tracker, picture(stamp_ns=(12 + k) * TENTH_NS)) for k in range(12)]
    assert tracks[8] != ()
    assert tracks[-1] == ()


def test_a_jump_of_the_clock_gives_up_all_tracks() -> None:
    tracker = PeopleTracker()
    assert walk(tracker, (2.0, -0.8), (0.0, 0.8), 12)[-1]
    assert follow(tracker, picture(person_at(2.0, 0.1), stamp_ns=100 * TENTH_NS)) == ()


def occupied_after_the_person_left(*, tracked: bool, at_the_end: tuple[Box, ...] = ()) -> int:
    """Return the number of occupied cells where a person walked, a second after the camera turned
    away from the person."""
    navigator = Navigator(
        spec=SPEC,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=Stages() if tracked else Stages(track=lambda *_: ()),
    )
    order = NavigationRequest(goal=None, beware=NO_LIST, zones=())
    for k in range(12):
        navigator.tick(picture(person_at(2.2, -0.6 + 0.08 * k), stamp_ns=k * TENTH_NS), order)
    if at_the_end:
        navigator.tick(picture(*at_the_end, stamp_ns=15 * TENTH_NS), order)
    away = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
    for k in range(16, 26):
        decision = navigator.tick(picture(pose=away, stamp_ns=k * TENTH_NS), order)
    (row, left), (_, right) = SPEC.cell(1.8, -1.1), SPEC.cell(2.6, -1.1)
    return int(decision.occupancy.grid.geometric[row : row + 52, left:right].sum())


def test_a_person_who_walked_leaves_no_ghost_on_the_map_though_the_camera_looked_away() -> None:
    assert occupied_after_the_person_left(tracked=True) == 0
    assert (
        occupied_after_the_person_left(tracked=False) > 5
    )  # the control: without the tracker the person would stay there for ever


def test_nor_does_a_leg_that_is_all_an_image_shows_of_the_person() -> None:
    leg = Box(x=(2.1, 2.2), y=(0.66, 0.74), z=(0.0, 0.4))
    assert occupied_after_the_person_left(tracked=True, at_the_end=(leg,)) == 0
    beside = Box(x=(2.1, 2.2), y=(-0.84, -0.76), z=(0.0, 0.4))
    assert occupied_after_the_person_left(tracked=True, at_the_end=(beside,)) > 0, (
        "what is too far from the person stays"
    )


@pytest.mark.parametrize("x_m", [2.3, 2.65])
def test_a_person_who_stays_is_an_obstacle_and_a_wall_beside_one_stays_on_the_map(
    x_m: float,
) -> None:
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
    )
    order = NavigationRequest(goal=None, beware=NO_LIST, zones=())
    wall = Box(x=(2.9, 3.0), y=(-4.0, 4.0), z=(0.0, 2.0))
    for k in range(25):
        navigator.tick(picture(wall, stamp_ns=k * TENTH_NS), order)
    held = int(layer_grid(navigator.map, NO_LIST, ()).geometric.sum())
    for k in range(25, 37):
        decision = navigator.tick(
            picture(wall, person_at(x_m, -0.8 + 0.08 * (k - 25)), stamp_ns=k * TENTH_NS), order
        )
    assert len(decision.people) == 1
    assert int(decision.occupancy.grid.geometric.sum()) > 0.9 * held
    for k in range(37, 60):
        decision = navigator.tick(picture(wall, person_at(x_m, 0.08), stamp_ns=k * TENTH_NS), order)
    (row, col) = SPEC.cell(x_m - 0.1, 0.08)
    assert decision.occupancy.grid.geometric[row - 4 : row + 4, col - 2 : col + 3].any()


def test_before_the_first_image_no_floor_is_free() -> None:
    assert not PeopleTracker().is_free_floor(np.array([[0.0, 0.0], [1.5, -0.3]])).any()


def test_people_do_not_float_but_a_board_may() -> None:
    """A person who has gone is off the map when the floor there is seen, though nothing is measured
    behind; another object is not."""
    board = Box(x=(2.6, 2.7), y=(0.5, 1.2), z=(0.7, 0.8))
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=SeesPeople(), config=NavigatorConfig()
    )
    order = NavigationRequest(goal=None, beware=WITH_PEOPLE, zones=())
    for k in range(20):
        decision = navigator.tick(
            picture(board, person_at(2.6, -0.2), stamp_ns=k * TENTH_NS), order
        )
    (row, left), (_, right) = SPEC.cell(2.4, -0.5), SPEC.cell(2.8, -0.5)
    there, floats = np.s_[row : row + 12, left:right], np.s_[row + 20 : row + 34, left:right]
    held = int(decision.occupancy.grid.geometric[floats].sum())
    assert decision.occupancy.grid.beware[11][there].sum() > 4 and held > 4
    for k in range(20, 24):
        empty = picture(stamp_ns=k * TENTH_NS)
        decision = navigator.tick(empty, order)
    assert (empty.depth_m[:20] == 0).all(), "no depth where the head was"
    assert (
        decision.occupancy.grid.geometric[there].sum()
        == decision.occupancy.grid.beware[11][there].sum()
        == 0
    )
    # The part that the image shows to be gone goes; the rest of the board, before which there is no
    # depth, stays.
    assert 0 < decision.occupancy.grid.geometric[floats].sum() <= held


def test_a_near_person_stays_on_the_map_though_the_image_shows_no_head_but_floor() -> None:
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=SeesPeople(), config=NavigatorConfig()
    )
    order = NavigationRequest(goal=None, beware=WITH_PEOPLE, zones=())
    legs = [Box(x=(1.95, 2.05), y=y, z=(0.0, 1.0)) for y in ((-0.14, -0.06), (0.06, 0.14))]
    body = Box(x=(1.88, 2.12), y=(-0.44, 0.36), z=(1.0, 1.75))
    for k, x_m in enumerate((0.0, 0.0, 0.0, 0.0, 0.3, 0.6, 0.9)):
        frame = picture(
            *legs, body, pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0), stamp_ns=k * TENTH_NS
        )
        decision = navigator.tick(frame, order)
    (row, left), (_, right) = SPEC.cell(1.8, -0.5), SPEC.cell(2.2, -0.5)
    rows = np.flatnonzero(
        decision.occupancy.grid.beware[11][row : row + 20, left:right].any(axis=1)
    )
    assert rows.max() - rows.min() >= 14, "with the arms"


def test_the_camera_of_these_images_sees_enough_of_a_person() -> None:
    """Control of the scene: a person before the robot covers many pixels."""
    assert MOUNT[2, 3] == pytest.approx(0.6)
    empty, there = picture(pose=ORIGIN), picture(person_at(2.0, 0.0), pose=ORIGIN)
    assert int((empty.depth_m != there.depth_m).sum()) > 1000


def test_a_post_is_a_person_only_while_several_images_label_it_as_one() -> None:
    post, tracker, seen = (
        Box(x=(2.0, 2.2), y=(-0.11, 0.11), z=(0.0, 1.6)),
        PeopleTracker(),
        list[int](),
    )
    said = [False, True, False, False, True, True, True, True] + [False] * 10
    for k, named in enumerate(said):
        frame = picture(post, stamp_ns=k * TENTH_NS)
        labels = unlabelled(frame)
        labels.class_ids[...] = np.where((frame.depth_m < 2.5) & named, 11, 0)
        seen.append(len(tracker.follow(frame, labels, WITH_PEOPLE)))
    assert seen[:5] == [0] * 5
    assert seen[7] == 1
    assert seen[-1] == 0
