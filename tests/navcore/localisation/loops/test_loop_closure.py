"""Loops are found where the robot comes back, they correct its poses, and nothing that is alike
elsewhere counts as one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from navcore.config.localisation.localisation import MatchConfig
from navcore.config.localisation.pose_graph import LoopClosureConfig, PoseGraphConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.graph.edges import ConstantErrors, Edge
from navcore.localisation.graph.pose_graph import AbsolutePose, OptimisedGraph
from navcore.localisation.loops.loop_closer import LoopCloser
from navcore.localisation.loops.loop_closure import LoopCandidates, LoopClosures, close_loops
from navcore.localisation.scans.scan import Keyframe
from tests.navcore.localisation.plan_worlds import (
    Drive,
    PlanWorld,
    drive,
    odometry_of,
    turn_on_spot,
)

Session = tuple[list[Keyframe], list[Edge], Drive]


def ring() -> PlanWorld:
    """A corridor around a block, with niches that differ."""
    world = PlanWorld()
    for low, high in ((0.0, 14.0), (2.5, 11.5)):
        for start, end in (
            ((low, low), (high, low)),
            ((high, low), (high, high)),
            ((low, high), (high, high)),
            ((low, low), (low, high)),
        ):
            world.wall(start, end)
    rng = np.random.default_rng(4)
    for side in range(4):
        for at in (3.0, 6.2, 9.0):
            along = at + float(rng.uniform(-1.0, 1.0))
            width, depth = map(float, rng.uniform(0.3, 0.9, 2))
            corners = [
                (along, 0.06, along + width, 0.06 + depth),
                (13.94 - depth, along, 13.94, along + width),
                (along, 13.94 - depth, along + width, 13.94),
                (0.06, along, 0.06 + depth, along + width),
            ]
            world.box(*corners[side])
    return world


@cache
def session() -> Session:
    """Keyframes of a lap and a half around the block, by drifting odometry."""
    corners = [(1.6, 1.6), (12.4, 1.6), (12.4, 12.4), (1.6, 12.4), (1.6, 1.6)]
    return keyframes_of(drive([*corners, *corners[1:3]])[::3], ring())


@cache
def there_and_back() -> Session:
    """Keyframes of a drive through a hall of crates, far from its walls, and back."""
    rng, world = np.random.default_rng(5), PlanWorld()
    for x in range(24):
        for side in (-1.0, 1.0):
            y, size = side * float(rng.uniform(1.4, 3.0)), float(rng.uniform(0.3, 0.8))
            world.box(x, y - size / 2, x + size, y + size / 2)
    ends = [(1.0, 0.0), (20.0, 0.0)]
    out = drive(ends)
    turn = turn_on_spot(ends[-1], out[-1].yaw_rad, math.pi)
    return keyframes_of([*out, *turn, *drive(ends[::-1])][::3], world)


def keyframes_of(true: Drive, world: PlanWorld) -> Session:
    """Keyframes of a drive by drifting odometry, and the edges between them."""
    rng = np.random.default_rng(8)
    odometry = odometry_of(true, rng, grade="poor")
    keyframes = [
        Keyframe(pose_id=10 + i, T_map_base=guess, scan=world.scan(where, rng))
        for i, (guess, where) in enumerate(zip(odometry, true, strict=True))
    ]
    edges = [
        Edge(
            from_id=10 + i,
            to_id=11 + i,
            T_from_to=odometry[i].inverse() @ odometry[i + 1],
            covariance=np.diag(np.square([0.03, 0.02, 0.012])),
        )
        for i in range(len(true) - 1)
    ]
    return keyframes, edges, true


def error_on_return(poses: Mapping[int, Pose2], true: Drive) -> float:
    """Error in metres of the last pose relative to where the first lap passed it."""
    last = len(true) - 1
    first = min(range(last // 2), key=lambda i: true[i].distance_to(true[last].x_m, true[last].y_m))
    gap = (true[first].inverse() @ true[last]).inverse() @ (
        poses[10 + first].inverse() @ poses[10 + last]
    )
    return math.hypot(gap.x_m, gap.y_m)


def gap_of(edge: Edge, true: Drive) -> Pose2:
    return (true[edge.from_id - 10].inverse() @ true[edge.to_id - 10]).inverse() @ edge.T_from_to


def test_a_lap_is_closed_and_the_drift_of_odometry_is_removed() -> None:
    keyframes, edges, true = session()
    closed = close_loops(keyframes, edges, tried_until=len(keyframes) - 24)
    assert isinstance(closed, LoopClosures)
    before = {k.pose_id: k.T_map_base for k in keyframes}
    assert len(closed.new_loops) >= 5
    for loop in closed.new_loops:
        gap = gap_of(loop, true)
        error = np.array([gap.x_m, gap.y_m, gap.yaw_rad])
        # Along a corridor a loop tells little, and says so.
        assert error @ np.linalg.solve(loop.covariance, error) < 1.0
        assert math.hypot(gap.x_m, gap.y_m) < 0.25
        assert abs(gap.yaw_rad) < math.radians(2.5)
    assert error_on_return(before, true) > 0.3
    assert error_on_return(closed.poses, true) < 0.15


def test_a_robot_that_comes_back_the_other_way_closes_loops_too() -> None:
    """It sees the other sides of the crates."""
    keyframes, edges, true = there_and_back()
    closed, control = (
        close_loops(
            keyframes,
            edges,
            tried_until=len(keyframes) // 2,
            config=LoopClosureConfig(least_fit_share=least),
        )
        for least in (LoopClosureConfig().least_fit_share, 0.6)
    )
    before = {k.pose_id: k.T_map_base for k in keyframes}
    true_m = math.dist(_xy(true[0]), _xy(true[-1]))

    def error_m(poses: Mapping[int, Pose2]) -> float:
        ends = (poses[keyframe.pose_id] for keyframe in (keyframes[0], keyframes[-1]))
        return abs(math.dist(*map(_xy, ends)) - true_m)

    assert isinstance(closed, LoopClosures) and error_m(closed.poses) < 0.3 < 0.8 < error_m(before)
    assert isinstance(control, LoopCandidates)  # one way as much fits


def _xy(pose: Pose2) -> tuple[float, float]:
    return pose.x_m, pose.y_m


@pytest.mark.long
def test_measured_poses_of_keyframes_are_kept_to_when_loops_are_closed() -> None:
    keyframes, edges, true = session()
    ids = [keyframe.pose_id for keyframe in keyframes]
    known = dict(zip(ids, true, strict=True))
    absolute = tuple(
        AbsolutePose(
            pose_id=pose_id,
            T_map_base=known[pose_id],
            information=np.diag([2500.0, 2500.0, 0.0]),
        )
        for pose_id in ids[::5]
    )
    errors = ConstantErrors(mean=np.zeros(3), covariance=1e-8 * np.eye(3))
    placed = {k.pose_id: replace(k, covariance=np.diag([9.0, 9.0, 0.01])) for k in keyframes}
    farthest, last = [], []
    for fixes in ((), absolute):
        closer = LoopCloser(LoopClosureConfig(), PoseGraphConfig(), MatchConfig())
        closer.note(tuple(edges[:-24]), fixes)
        closer.next_task(placed.get, errors)
        closer.note(tuple(edges[-24:]))
        task = closer.next_task(placed.get, errors)
        assert task is not None
        closed = task.run(lambda: False)
        assert isinstance(closed, LoopClosures)
        last.append(closed.graph.covariances(ids[-1:])[ids[-1]][0, 0])
        farthest.append(max(closed.poses[i].distance_to(known[i].x_m, known[i].y_m) for i in ids))
    assert farthest[0] > 0.3 and farthest[1] < 0.1
    # A loop tells nothing of where the first keyframe lies in the map.
    assert last[0] > 9.0 and last[1] < 0.02**2


def test_the_first_keyframe_is_held_to_where_it_was_made_after_loops_have_moved_it() -> None:
    keyframes, edges, _ = session()
    errors = ConstantErrors(mean=np.zeros(3), covariance=1e-8 * np.eye(3))
    made = {k.pose_id: replace(k, covariance=np.diag([0.01, 0.01, 0.001])) for k in keyframes}
    closer = LoopCloser(LoopClosureConfig(), PoseGraphConfig(), MatchConfig())
    closer.note(tuple(edges[:-24]))
    closer.next_task(made.get, errors)
    closer.note(tuple(edges[-24:]))
    shift = Pose2(x_m=0.0, y_m=0.4, yaw_rad=0.0)
    moved = {i: replace(k, T_map_base=shift @ k.T_map_base) for i, k in made.items()}
    task = closer.next_task(moved.get, errors)
    assert task is not None and task.first == keyframes[0].T_map_base
    closer.restart(known=len(keyframes))
    closer.note(tuple(edges))
    task = closer.next_task(moved.get, errors)
    assert task is not None and task.first == moved[keyframes[0].pose_id].T_map_base


def test_loops_move_what_was_seen_on_their_chain_and_nothing_of_the_chain_before() -> None:
    """Passing by, the newer chain has made the keyframe of ID 3. IDs 10, 12 and 14 have none, and
    13 was made while the loops were looked for."""
    closer = LoopCloser(LoopClosureConfig(), PoseGraphConfig(), MatchConfig())
    closer.restart(known=8)
    closer.note(
        tuple(
            Edge(from_id=i, to_id=j, T_from_to=IDENTITY, covariance=np.eye(3))
            for i, j in itertools.pairwise((8, 9, 3, 11, 13))
        )
    )
    shifts_m = {8: 0.1, 9: 0.2, 3: 0.3, 11: 0.4}
    closures = LoopClosures(
        poses={i: Pose2(x_m=i + shift_m, y_m=0.0, yaw_rad=0.0) for i, shift_m in shifts_m.items()},
        loops=(),
        new_loops=(),
        candidates=LoopCandidates(edges=()),
        graph=OptimisedGraph.__new__(OptimisedGraph),
    )
    present = [Pose2(x_m=float(i), y_m=0.0, yaw_rad=0.0) for i in range(15)]

    moved, motion = closer.corrected(closures, present)

    by = {i: pose.x_m - i for i, pose in moved.items()}
    assert by == pytest.approx({**shifts_m, 10: 0.3, 12: 0.4, 13: 0.4, 14: 0.4})
    assert motion.x_m == pytest.approx(0.4)


def test_the_same_keyframes_give_the_same_loops_and_poses() -> None:
    keyframes, edges, _ = session()
    one, two = (close_loops(keyframes, edges, tried_until=len(keyframes) - 12) for _ in range(2))
    assert isinstance(one, LoopClosures)
    assert isinstance(two, LoopClosures)
    assert one.poses == two.poses
    assert [e.T_from_to for e in one.loops] == [e.T_from_to for e in two.loops]


def test_a_match_that_no_other_agrees_with_is_no_loop() -> None:
    keyframes, edges, _ = session()
    many = LoopClosureConfig(agreeing=20)
    alone = close_loops(keyframes, edges, tried_until=len(keyframes) - 12, config=many)
    assert isinstance(alone, LoopCandidates)


def test_matches_of_consecutive_batches_confirm_each_other() -> None:
    """A batch of two keyframes alone is too few."""
    keyframes, edges, _ = session()
    known = {keyframe.pose_id: keyframe for keyframe in keyframes}
    errors = ConstantErrors(mean=np.zeros(3), covariance=1e-8 * np.eye(3))
    closer = LoopCloser(LoopClosureConfig(new_keyframes=2), PoseGraphConfig(), MatchConfig())
    closer.note(tuple(edges[:-12]))
    closer.next_task(known.get, errors)
    closed = []
    for k in range(len(edges) - 12, len(edges), 2):
        closer.note(tuple(edges[k : k + 2]))
        task = closer.next_task(known.get, errors)
        assert task is not None
        outcome = task.run(lambda: False)
        if isinstance(outcome, LoopClosures):
            closed.append(outcome)
            closer.take(outcome)
        elif outcome is not None:
            closer.keep(outcome)
    assert closed


def test_one_match_more_agrees_with_the_loops_that_are_believed() -> None:
    keyframes, edges, _ = session()
    closed = close_loops(keyframes, edges, tried_until=len(keyframes) - 24)
    assert isinstance(closed, LoopClosures)
    *believed, last = closed.loops
    for loops, is_closed in ((believed, True), ([], False)):
        again = close_loops(
            keyframes, edges, tried_until=len(keyframes), loops=loops, candidates=[last]
        )
        assert isinstance(again, LoopClosures) is is_closed


def test_a_cancelled_search_changes_nothing() -> None:
    keyframes, edges, _ = session()
    assert close_loops(keyframes, edges, is_cancelled=lambda: True) is None


def test_too_few_keyframes_and_a_way_without_a_return_close_no_loop() -> None:
    keyframes, edges, _ = session()
    assert close_loops(keyframes[:1], []) is None
    found = close_loops(keyframes[:30], edges[:29])
    assert isinstance(found, LoopCandidates) and not found.edges


def test_a_place_that_looks_alike_outside_of_odometrys_uncertainty_is_no_loop() -> None:
    """Two equal niches, 20 m apart: certain odometry knows that they are two."""
    rng = np.random.default_rng(1)
    world = PlanWorld()
    world.wall((0.0, 1.2), (40.0, 1.2))
    world.wall((0.0, -1.2), (40.0, -1.2))
    for x in (6.0, 26.0):
        world.box(x, 1.1, x + 0.7, 0.5)
        world.box(x + 1.5, -1.1, x + 1.9, -0.6)
    true = drive([(2.0, 0.0), (30.0, 0.0)])[::3]
    keyframes = [
        Keyframe(pose_id=i, T_map_base=p, scan=world.scan(p, rng)) for i, p in enumerate(true)
    ]
    certain = np.diag(np.square([0.005, 0.003, 0.001]))
    edges = [
        Edge(from_id=i, to_id=i + 1, T_from_to=true[i].inverse() @ true[i + 1], covariance=certain)
        for i in range(len(true) - 1)
    ]
    assert isinstance(close_loops(keyframes, edges), LoopCandidates)
