"""Records of an episode for figures: the planned routes, and images that show detections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.episode.episode import Episode
from navcore.mission.beware_list import BewareList
from navcore.navigator import TickResult
from navcore.planning.route import Route

FRAMES = 6
"""Number of images in a figure, as in the paper."""
MAX_KEPT = 4 * FRAMES
"""Largest number of images kept during the episode."""
FIRST_SPAN_S = 1.0
"""Initial length of the interval from which one image is kept, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """A camera image and its labels."""

    t_s: float
    """Simulated time, seconds."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) colour image."""
    class_ids: npt.NDArray[np.uint8]
    """(H, W) class ids of the beware list where the confidence suffices, else 0."""

    @property
    def size(self) -> int:
        """Number of labelled pixels."""
        return int(np.count_nonzero(self.class_ids))


class Keyframes:
    """Records routes and images of one episode."""

    def __init__(self, episode: Episode) -> None:
        self._episode, self._span_s = episode, FIRST_SPAN_S
        self.routes: list[Route] = []
        """First route that was found to each goal."""
        self._planned_for: int | None = None
        self._frames: list[Keyframe] = []
        episode.on_decision = self._note

    def selected(self) -> list[Keyframe]:
        """Return at most `FRAMES` images spread over the time, each with the most labelled pixels
        of its interval."""
        labelled = [keyframe for keyframe in self._frames if keyframe.size] or self._frames
        parts = np.array_split(np.arange(len(labelled)), min(FRAMES, max(len(labelled), 1)))
        return [
            max((labelled[i] for i in part), key=lambda keyframe: keyframe.size)
            for part in parts
            if len(part)
        ]

    def _note(self, t_s: float, decision: TickResult) -> None:
        intent = self._episode.controller.intent
        goal, route = intent.mission.goal, decision.route
        if (
            goal is not None
            and route is not None
            and len(route.points)
            and goal.id != self._planned_for
        ):
            self._planned_for = goal.id
            self.routes.append(route)
        self._keep(t_s, decision, intent.beware)

    def _keep(self, t_s: float, decision: TickResult, beware: BewareList) -> None:
        """Keep the best image of each interval; when there are too many, double the interval."""
        binding = decision.labels.mask(beware)
        size, last = int(np.count_nonzero(binding)), self._frames[-1] if self._frames else None
        same = last is not None and t_s // self._span_s == last.t_s // self._span_s
        if same and last is not None and size <= last.size:
            return
        class_ids = np.where(binding, decision.labels.class_ids, np.uint8(0))
        keyframe = Keyframe(t_s=t_s, rgb=decision.frame.rgb, class_ids=class_ids)
        self._frames = [*(self._frames[:-1] if same else self._frames), keyframe]
        if len(self._frames) > MAX_KEPT:
            self._span_s *= 2
            best: dict[float, Keyframe] = {}
            for keyframe in self._frames:
                interval = keyframe.t_s // self._span_s
                if interval not in best or keyframe.size > best[interval].size:
                    best[interval] = keyframe
            self._frames = list(best.values())
