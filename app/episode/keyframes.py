"""What is kept of an episode while it runs, to draw it afterwards: the ways that were planned, and
telling pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.episode.episode import Episode
from navcore.mission.beware_list import BewareList
from navcore.navigator import TickResult
from navcore.planning.route import Route

FRAMES = 6
"""So many pictures are shown, as in the paper."""
KEPT = 4 * FRAMES
"""So many are kept meanwhile."""
FIRST_SPAN_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """A picture, and what was seen in it."""

    t_s: float
    """When, in simulated seconds."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list where the picture binds the robot, else 0."""

    @property
    def size(self) -> int:
        """Pixels that bind the robot."""
        return int(np.count_nonzero(self.class_ids))


class Keyframes:
    """Follows one episode."""

    def __init__(self, episode: Episode) -> None:
        self._episode, self._span_s = episode, FIRST_SPAN_S
        self.planned: list[Route] = []
        """The first way that was found to each goal."""
        self._planned_for: int | None = None
        self._shots: list[Keyframe] = []
        episode.on_decision = self._note

    def shots(self) -> list[Keyframe]:
        """At most `FRAMES`, spread over the time: of each stretch the one that shows most."""
        telling = [shot for shot in self._shots if shot.size] or self._shots
        parts = np.array_split(np.arange(len(telling)), min(FRAMES, max(len(telling), 1)))
        return [
            max((telling[i] for i in part), key=lambda shot: shot.size)
            for part in parts
            if len(part)
        ]

    def _note(self, t_s: float, decision: TickResult) -> None:
        intent = self._episode.pilot.intent
        goal, route = intent.mission.goal, decision.route
        if (
            goal is not None
            and route is not None
            and len(route.points)
            and goal.id != self._planned_for
        ):
            self._planned_for = goal.id
            self.planned.append(route)
        self._keep(t_s, decision, intent.beware)

    def _keep(self, t_s: float, decision: TickResult, beware: BewareList) -> None:
        """The best picture of each stretch of time; when there are too many, stretches become twice
        as long."""
        binding = decision.labels.mask(beware)
        size, last = int(np.count_nonzero(binding)), self._shots[-1] if self._shots else None
        same = last is not None and t_s // self._span_s == last.t_s // self._span_s
        if same and last is not None and size <= last.size:
            return
        class_ids = np.where(binding, decision.labels.class_ids, np.uint8(0))
        shot = Keyframe(t_s=t_s, rgb=decision.frame.rgb, class_ids=class_ids)
        self._shots = [*(self._shots[:-1] if same else self._shots), shot]
        if len(self._shots) > KEPT:
            self._span_s *= 2
            best: dict[float, Keyframe] = {}
            for shot in self._shots:
                stretch = shot.t_s // self._span_s
                if stretch not in best or shot.size > best[stretch].size:
                    best[stretch] = shot
            self._shots = list(best.values())
