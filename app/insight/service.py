"""The console's insight port, satisfied: a thread of its own looks at what the others leave behind,
and explains on request.

The think and the command thread hand over one reference each and go on. All that costs anything
happens here, or in the web server's threads: comparing paths, telling sightings apart, packing
pictures, searching for other paths.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping

import numpy as np

from app.insight.detections import DetectionGallery, packed
from app.insight.event_detector import EventDetector
from app.insight.event_log import Journal, Shelf
from app.insight.explanation import ExplanationQuery, alternative, explained
from app.insight.labelling import LabellingFolder, region_in
from app.insight.time_series import Series
from app.runtime.loop import PeriodicThread
from app.runtime.recorder import Recorder
from app.runtime.robot_controller import RobotController
from navcore.config.navigator import NavigatorConfig
from navcore.control.collision_checker import candidates
from navcore.costmap.local_costmap import nearby, obstacle_masks
from navcore.errors import NotKnown, Refused
from navcore.navigator import TickResult
from navcore.planning.path import Path
from navcore.safety.gate import GateDecision, StopReason
from web.insight import (
    Alternative,
    Candidates,
    Explanation,
    Kind,
    LabellingState,
    Page,
    Place,
    Sighting,
)
from web.pictures import camera_jpg

log = logging.getLogger(__name__)
PERIOD_S = 0.25
"""So often the thread looks."""
WRITE_PERIOD_S = 1.0
"""So often the log goes to the disk: a kill loses no more of it."""
CANDIDATE_REACH_M = 2.6
"""Nothing that is farther off can be hit along an arc."""
MAX_SNAPSHOTS = 8
"""Pictures held for the operators' corrections."""
MOST_WAITING = 256
"""Changes of the gate's reasons that wait to be written down."""


class LiveInsight:
    """Satisfies `web.insight.Insight` for a running robot: `start`, feed by `note_decision` and
    `note_verdict`, `stop`."""

    def __init__(
        self,
        *,
        pilot: RobotController,
        recorder: Recorder,
        labelling: LabellingFolder,
        config: NavigatorConfig,
        now_s: Callable[[], float],
        tick_ms: Callable[[], float],
        log_shelf: Shelf,
    ) -> None:
        """`log_shelf`: where the log of decisions outlives the console."""
        self._pilot, self._recorder, self._labelling, self._config = (
            pilot,
            recorder,
            labelling,
            config,
        )
        self._now_s, self._tick_ms = now_s, tick_ms
        self._journal = Journal(log_shelf)
        self._writer = PeriodicThread(
            self._journal.write, period_s=WRITE_PERIOD_S, name="log to disk"
        )
        self._chronicle = EventDetector(self._journal, pilot.intent)
        self._sighted, self._series = DetectionGallery(), Series()
        self._explaining = threading.Lock()
        self._explained: tuple[object, Explanation] | None = None
        self._decision: TickResult | None = None
        self._looked_at: TickResult | None = None
        self._causes: tuple[str, ...] = ()
        self._verdicts: deque[tuple[float, tuple[StopReason, ...]]] = deque(maxlen=MOST_WAITING)
        self._snapshots: deque[TickResult] = deque(maxlen=MAX_SNAPSHOTS)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="insight", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()
        self._writer.start()

    def stop(self) -> None:
        """Look no more; a second call does nothing new."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
            self._writer.stop()
            self._journal.write()

    def note_decision(self, decision: TickResult) -> None:
        """Called by the think thread after each tick."""
        self._decision = decision

    def note_verdict(self, verdict: GateDecision) -> None:
        """Called by the command thread each time it has sent."""
        causes = tuple(reason.cause for reason in verdict.reasons[:1])
        if causes != self._causes:
            self._causes = causes
            self._verdicts.append((self._now_s(), verdict.reasons))

    # What the console asks

    def journal(
        self, *, kinds: Collection[Kind], since: int, limit: int, before: int | None = None
    ) -> Page:
        """The newest entries after an id, and before another."""
        return self._journal.page(kinds=kinds, since=since, limit=limit, before=before)

    def explain(self) -> Explanation:
        """Why the present path, or the one to the first goal that waits; made once for each map,
        goal and place."""
        with self._explaining:
            case = self._case()
            key = (
                case.occupancy,
                case.goal,
                case.path,
                case.occupancy.spec.cell(case.pose.x_m, case.pose.y_m),
            )
            if self._explained is None or self._explained[0] != key:
                self._explained = (key, explained(case))
            return self._explained[1]

    def without(self, keys: Collection[str]) -> Alternative:
        """The path if these rules did not stand."""
        with self._explaining:
            return alternative(self._case(), keys)

    def candidates(self) -> Candidates | None:
        """What the local planner chooses from, judged by what stands near."""
        decision = self._decision
        if decision is None:
            return None
        pose, profile, local = decision.frame.pose, self._pilot.profile, self._config.local
        around = decision.occupancy.around(pose, CANDIDATE_REACH_M)
        hard, ruled = (
            nearby(mask, around, pose, CANDIDATE_REACH_M) for mask in obstacle_masks(around)
        )
        cell_m, among = around.spec.resolution_m, decision.motion.among
        arcs, free = candidates(
            geometric=hard, ruled=ruled, profile=profile, rules=local, cell_m=cell_m, among=among
        )
        return Candidates(
            serial=decision.frame.stamp_ns,
            arcs=pose.to_parent(arcs),
            free=free,
            chosen=decision.motion.arc,
        )

    def sightings(self) -> tuple[Sighting, ...]:
        """Everything recognised, newest first."""
        return self._sighted.all()

    def sighting_picture(self, sighting_id: int) -> bytes:
        """JPEG of its best view."""
        return self._sighted.crop(sighting_id)

    def seen_counts(self) -> Mapping[int, int]:
        """How many things of each class were recognised."""
        return Counter(
            sighting.class_id for sighting in self._sighted.all() if sighting.verdict is None
        )

    def call_wrong(self, sighting_id: int, class_name: str | None) -> LabellingState:
        """Put its frame into the labelling folder, corrected."""
        view = self._sighted.view(sighting_id)
        self._labelling.add(view, names=self._names(class_name), said=class_name)
        self._sighted.call_wrong(sighting_id)
        what = f"it is “{class_name}”" if class_name else "it is nothing of the list"
        self._journal.note(
            self._now_s(),
            "labelled",
            f"Sighting {sighting_id} was called wrong: {what}.",
            self._place_of(sighting_id),
        )
        return self._labelling.state()

    def snapshot(self) -> int:
        """Hold the present picture."""
        if self._decision is None:
            raise Refused("the camera has delivered no picture yet")
        self._snapshots.append(self._decision)
        return self._decision.frame.stamp_ns

    def snapshot_picture(self, snapshot: int) -> bytes:
        """JPEG of a picture that is held."""
        return camera_jpg(self._held(snapshot).frame.rgb)

    def add_example(
        self, snapshot: int, class_name: str, box: tuple[int, int, int, int]
    ) -> LabellingState:
        """Put a held picture into the labelling folder, with something that was missed."""
        names, decision = self._names(class_name), self._held(snapshot)
        mask = region_in(decision.frame.rgb, box)
        view = packed(decision.frame, decision.labels, self._pilot.intent.beware, mask)
        self._labelling.add(view, names=names, said=class_name)
        self._journal.note(
            self._now_s(),
            "labelled",
            f"A “{class_name}” that was missed was shown to the robot.",
            self._here(),
        )
        return self._labelling.state()

    def labelling(self) -> LabellingState:
        """The labelling folder as it is."""
        return self._labelling.state()

    def series(self, since_s: float) -> Mapping[str, list[float | None]]:
        """Figures over time."""
        return self._series.after(since_s)

    # The thread

    def _run(self) -> None:
        while not self._ending.wait(PERIOD_S):
            try:
                self._look()
            except Exception:
                log.exception(
                    "the log of decisions missed something"
                )  # nothing that drives depends on it

    def _look(self) -> None:
        now_s, decision = self._now_s(), self._decision
        while self._verdicts:
            self._chronicle.on_gate(*self._verdicts.popleft(), self._here())
        self._chronicle.look(now_s, self._pilot.intent, decision, self._here())
        if decision is not None and decision is not self._looked_at:
            self._looked_at = decision
            for new in self._sighted.look(
                now_s, decision.frame, decision.labels, self._pilot.intent.beware
            ):
                text = f"First sight of “{new.class_name}” here, {new.confidence:.0%} sure."
                self._journal.note(now_s, "seen", text, new.place)
        if self._series.is_due(now_s):
            self._series.add(now_s, self._figures(decision))

    def _figures(self, decision: TickResult | None) -> dict[str, float]:
        return {
            "speed_mps": decision.frame.twist.v_mps if decision is not None else 0.0,
            "distance_m": self._recorder.travelled_m,
            "explored_m2": self._recorder.explored_m2,
            "explored_m3": self._pilot.navigator.map.explored.volume_m3,
            "tick_ms": self._tick_ms(),
        }

    def _held(self, snapshot: int) -> TickResult:
        for decision in tuple(self._snapshots):
            if decision.frame.stamp_ns == snapshot:
                return decision
        raise NotKnown(f"picture {snapshot} is not held any more; take another one")

    def _here(self) -> Place:
        return self._recorder.pose.x_m, self._recorder.pose.y_m

    def _place_of(self, sighting_id: int) -> Place | None:
        return next(
            (sighting.place for sighting in self._sighted.all() if sighting.id == sighting_id), None
        )

    def _names(self, class_name: str | None) -> dict[int, str]:
        names = {entry.class_id: entry.name for entry in self._pilot.intent.beware.classes}
        if class_name is not None and class_name not in names.values():
            raise NotKnown(f"the beware list has no class {class_name!r:.90}; add it first")
        return names

    def _case(self) -> ExplanationQuery:
        intent, decision = self._pilot.intent, self._decision
        if decision is None:
            raise Refused("there is no map yet; the camera has not delivered a picture")
        if not intent.mission.queue:
            raise Refused("there is no goal, so there is no path to explain; add a goal first")
        goal = (intent.mission.queue[0].x_m, intent.mission.queue[0].y_m)
        route, path = decision.route, None
        if (
            route is not None
            and isinstance(route.outcome, Path)
            and np.array_equal(route.points[-1], goal)
        ):
            path = route.outcome
        return ExplanationQuery(
            occupancy=decision.occupancy,
            beware=intent.beware,
            zones=(*intent.zones, *decision.closed),
            pose=decision.frame.pose,
            goal=goal,
            path=path,
            profile=self._pilot.profile,
            safety_margin_m=self._config.safety_margin_m,
            start_relief_m=self._config.start_relief_m,
        )
