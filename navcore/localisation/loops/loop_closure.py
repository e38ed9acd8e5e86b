"""Loop closure: keyframes that show what earlier ones showed, and the poses they lead to.

Values in, values out, for a thread beside the tick. Each match must lie within odometry's
uncertainty, several near each other must agree, and graduated non-convexity has the last word.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from navcore.config.localisation.localisation import MatchConfig
from navcore.config.localisation.pose_graph import (
    DEFAULT_LOOP_CLOSURE,
    DEFAULT_POSE_GRAPH,
    LoopClosureConfig,
    PoseGraphConfig,
)
from navcore.geometry.transform import Pose2
from navcore.localisation.graph.edges import ConstantErrors, Edge
from navcore.localisation.graph.pose_graph import AbsolutePose, OptimisedGraph, PoseGraph, optimise
from navcore.localisation.loops.loop_finder import LoopFinder
from navcore.localisation.scans.scan import Keyframe

DEFAULT_MATCH = MatchConfig()
"""The configuration unless another is given."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopCandidates:
    """Matches with which too few others agree so far, and no corrected pose."""

    edges: tuple[Edge, ...]
    """Those of the last metres: the `candidates` of the next call."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopClosures:
    """Corrected poses, and the loops that led to them."""

    poses: Mapping[int, Pose2]
    """T_map_base by pose ID, of all keyframes."""
    loops: tuple[Edge, ...]
    """All loops that are believed, earlier ones included: the `loops` of the next call."""
    new_loops: tuple[Edge, ...]
    """Those that this call found."""
    candidates: LoopCandidates
    """Matches with which too few others agree so far."""
    graph: OptimisedGraph
    """The optimised graph, for covariances."""


def close_loops(
    keyframes: Sequence[Keyframe],
    odometry: Sequence[Edge],
    *,
    tried_until: int = 0,
    loops: Sequence[Edge] = (),
    candidates: Sequence[Edge] = (),
    constant_errors: ConstantErrors | None = None,
    absolute: Sequence[AbsolutePose] = (),
    first: Pose2 | None = None,
    config: LoopClosureConfig = DEFAULT_LOOP_CLOSURE,
    graph_config: PoseGraphConfig = DEFAULT_POSE_GRAPH,
    match_config: MatchConfig = DEFAULT_MATCH,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> LoopClosures | LoopCandidates | None:
    """Return corrected poses if keyframes from index `tried_until` on close loops, with
    `candidates` of the keyframes before them; else what may close one with later keyframes.

    `keyframes` are in the order of driving, `odometry` connects them, `constant_errors` are those
    of odometry as far as known, and `absolute` are measured poses of keyframes. `first` is the
    T_map_base of the first keyframe that its covariance is of; None if it was not corrected since.
    None if cancelled, which is asked before every keyframe. Raises `BadGeometry` for edges of
    unknown keyframes.
    """
    if len(keyframes) < 2:
        return None
    graph = PoseGraph(
        poses={keyframe.pose_id: keyframe.T_map_base for keyframe in keyframes},
        odometry=odometry,
        loops=loops,
        constant_errors=constant_errors,
        absolute=absolute,
        first_covariance=keyframes[0].covariance,
        first=first or keyframes[0].T_map_base,
    )
    present = optimise(graph, graph_config)
    finder = LoopFinder(keyframes, present, config, match_config)
    found = list(candidates)
    for index in range(tried_until, len(keyframes)):
        if is_cancelled():
            return None
        found += finder.loops_of(index)
    agreed = finder.agreeing(found, loops)
    pairs = {(loop.from_id, loop.to_id) for loop in agreed}
    alone = [one for one in found if (one.from_id, one.to_id) not in pairs]
    waiting = LoopCandidates(edges=finder.recent(alone))
    if not agreed:
        return waiting
    solved = optimise(replace(graph, poses=present.poses, loops=[*loops, *agreed]), graph_config)
    believed = dict(zip([*loops, *agreed], solved.accepted_loops, strict=True))
    new = tuple(loop for loop in agreed if believed[loop])
    if not new:
        return waiting
    return LoopClosures(
        poses=solved.poses,
        loops=tuple(loop for loop, is_believed in believed.items() if is_believed),
        new_loops=new,
        candidates=waiting,
        graph=solved,
    )
