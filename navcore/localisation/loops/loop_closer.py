"""The pose graph of a session: gathers keyframes and edges, and says when loops are worth looking
for.

Only the chain since the robot was last placed takes part: no edge leads to it from before. A saved
map is followed and not corrected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from navcore.config.localisation.localisation import MatchConfig
from navcore.config.localisation.pose_graph import LoopClosureConfig, PoseGraphConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.graph.edges import ConstantErrors, Edge
from navcore.localisation.graph.pose_graph import AbsolutePose
from navcore.localisation.loops.loop_closure import LoopCandidates, LoopClosures, close_loops
from navcore.localisation.scans.scan import Keyframe


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CloseLoops:
    """Look for loops among keyframes."""

    keyframes: tuple[Keyframe, ...]
    """Keyframes in the order of driving."""
    odometry: tuple[Edge, ...]
    """Edges between consecutive ones."""
    absolute: tuple[AbsolutePose, ...]
    """Measured poses of some of them."""
    first: Pose2
    """T_map_base that the first one had when it was made, which its covariance is of."""
    tried_until: int
    """Number of keyframes that were tried before."""
    loops: tuple[Edge, ...]
    """Loops that are believed already."""
    candidates: tuple[Edge, ...]
    """Matches of the last metres with which too few others agree so far."""
    constant_errors: ConstantErrors
    """What is known of the constant errors of odometry."""
    loop_config: LoopClosureConfig
    """Which matches count."""
    graph_config: PoseGraphConfig
    """How the graph is optimised."""
    match_config: MatchConfig
    """How two scans are matched."""

    def run(self, is_cancelled: Callable[[], bool]) -> LoopClosures | LoopCandidates | None:
        """Return corrected poses, or what may close a loop later; None if it was cancelled."""
        return close_loops(
            self.keyframes,
            self.odometry,
            absolute=self.absolute,
            first=self.first,
            tried_until=self.tried_until,
            loops=self.loops,
            candidates=self.candidates,
            constant_errors=self.constant_errors,
            config=self.loop_config,
            graph_config=self.graph_config,
            match_config=self.match_config,
            is_cancelled=is_cancelled,
        )


@dataclass(slots=True)
class LoopCloser:
    """Keyframes and edges of one chain."""

    loop_config: LoopClosureConfig
    """Which matches count."""
    graph_config: PoseGraphConfig
    """How the graph is optimised."""
    match_config: MatchConfig
    """How two scans are matched."""
    _edges: list[Edge] = field(default_factory=list)
    _absolute: list[AbsolutePose] = field(default_factory=list)
    _loops: tuple[Edge, ...] = ()
    _candidates: tuple[Edge, ...] = ()
    _chain: dict[int, None] = field(default_factory=dict)
    _first: Pose2 | None = None
    _tried: int = 0
    _since: int = 0

    def note(self, edges: tuple[Edge, ...], absolute: tuple[AbsolutePose, ...] = ()) -> None:
        """Take the edges, and the measured poses of keyframes, since the last call."""
        self._absolute += absolute
        for edge in edges:
            self._edges.append(edge)
            self._chain.setdefault(edge.from_id)
            self._chain.setdefault(edge.to_id)

    def next_task(
        self, keyframe: Callable[[int], Keyframe | None], constant_errors: ConstantErrors
    ) -> CloseLoops | None:
        """Return what to compute once enough keyframes are new; `keyframe` gives those of an ID at
        its present pose, and `constant_errors` are those of odometry as far as they are known."""
        if len(self._chain) - self._tried < self.loop_config.new_keyframes:
            return None
        tried, self._tried = self._tried, len(self._chain)
        found = [keyframe(pose_id) for pose_id in self._chain]
        keyframes = tuple(one for one in found if one is not None)
        if len(keyframes) < len(found):
            return None
        if self._first is None:  # no loop has corrected it yet
            self._first = keyframes[0].T_map_base
        return CloseLoops(
            keyframes=keyframes,
            odometry=tuple(self._edges),
            absolute=tuple(one for one in self._absolute if one.pose_id in self._chain),
            first=self._first,
            tried_until=tried,
            loops=self._loops,
            candidates=self._candidates,
            constant_errors=constant_errors,
            loop_config=self.loop_config,
            graph_config=self.graph_config,
            match_config=self.match_config,
        )

    def has(self, closures: LoopClosures) -> bool:
        """Return whether closures concern this chain: the robot may have been placed while they
        were looked for."""
        return closures.poses.keys() <= self._chain.keys()

    def corrected(
        self, closures: LoopClosures, present: Sequence[Pose2]
    ) -> tuple[dict[int, Pose2], Pose2]:
        """Return the poses by ID that closures of this chain lead to, and T_new_old of the newest;
        `present` are those of all IDs.

        Keyframes that are newer than the closures, and poses without a keyframe that were first
        seen since the chain began, move rigidly with the last corrected one before them. Those of
        before stay: this chain tells nothing of them.
        """
        moved, motion, known = dict(closures.poses), IDENTITY, self._since
        for pose_id in self._chain:  # in the order of driving
            for between in range(known, pose_id):
                moved.setdefault(between, motion @ present[between])
            known = max(known, pose_id + 1)
            if pose_id in closures.poses:
                motion = closures.poses[pose_id] @ present[pose_id].inverse()
            else:
                moved[pose_id] = motion @ present[pose_id]
        for later in range(known, len(present)):
            moved[later] = motion @ present[later]
        return moved, motion

    def take(self, closures: LoopClosures) -> None:
        """Believe the loops of a task."""
        self._loops = closures.loops
        self.keep(closures.candidates)

    def keep(self, candidates: LoopCandidates) -> None:
        """Keep what may close a loop with later keyframes, if it is of this chain."""
        ids = {pose_id for edge in candidates.edges for pose_id in (edge.from_id, edge.to_id)}
        if ids <= self._chain.keys():
            self._candidates = candidates.edges

    def restart(self, known: int) -> None:
        """Begin a new chain: the robot was placed, and no edge leads there. `known`: number of pose
        IDs so far."""
        self._edges, self._absolute, self._loops, self._candidates = [], [], (), ()
        self._chain, self._first, self._tried, self._since = {}, None, 0, known
