"""The console's insight port on a running robot: event log, detections, explanations, time series.

The think and the command thread hand over one reference each and go on. Everything expensive
happens in a thread of this module or of the web server: comparing paths, matching detections,
compressing images, searching for alternative paths.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Collection, Iterable
from typing import Protocol

import numpy as np

from app.insight.detections import DetectionGallery, packed
from app.insight.event_detector import EventDetector
from app.insight.event_log import EventLog, EventStore
from app.insight.explanation import ExplanationQuery, alternative, explain
from app.insight.labelling import LabellingFolder, region_in
from app.insight.place_events import PlaceEvents
from app.runtime.control.loop import PeriodicThread
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.recorder import Recorder
from app.runtime.record.time_series import TimeSeries
from navcore.config.navigator import NavigatorConfig
from navcore.control.motions.path_follower import candidates
from navcore.errors import NotKnown, Refused
from navcore.mission.beware_list import BewareClass
from navcore.navigator import TickResult
from navcore.planning.global_planner import goal_tolerance_m
from navcore.planning.path import Path
from navcore.safety.gate import GateDecision, StopReason
from web.images.camera import camera_jpg
from web.interface.insight import (
    Alternative,
    Candidates,
    Explanation,
    LabellingState,
    Sighting,
)
from web.interface.wire import Position

log = logging.getLogger(__name__)
PERIOD_S = 0.25
"""Period of the thread, seconds."""
WRITE_PERIOD_S = 1.0
"""Time between two writes of the event log to the disk, seconds: a kill loses no more of it."""
MAX_SNAPSHOTS = 8
"""Largest number of images held for corrections by operators."""
MAX_WAITING = 1024
"""Largest number of changes of the stop reason, and of the operator's state, that wait to be
logged; teleoperation changes the state 20 times a second."""


class Clock(Protocol):
    """The robot's clock; `navcore.robot.driver.Robot` is one."""

    def now_ns(self) -> int:
        """Return the time of the robot's monotonic clock in nanoseconds."""


class LiveInsight:
    """Satisfies the console's port `Diagnostics` for a running robot: `start`, feed by
    `note_decision` and `note_verdict`, `stop`."""

    def __init__(
        self,
        *,
        controller: RobotController,
        recorder: Recorder,
        labelling: LabellingFolder,
        config: NavigatorConfig,
        clock: Clock,
        store: EventStore,
    ) -> None:
        """`store`: storage of the event log, which outlives the console."""
        self._controller, self._recorder, self._config = controller, recorder, config
        self._clock = clock
        self.event_log = EventLog(store)
        """What the robot decided, and what led to it."""
        self.detections = DetectionGallery()
        """Detected objects of the beware list."""
        self.labelling = labelling
        """Images for the next training, corrected by operators."""
        self.series = TimeSeries()
        """Speed, distance, explored area and volume, tick times."""
        self._writer = PeriodicThread(
            self.event_log.write, period_s=WRITE_PERIOD_S, name="event log to disk"
        )
        self._event_detector = EventDetector(self.event_log, controller.intent)
        self._place_events = PlaceEvents()
        self._explaining, self._correcting = threading.Lock(), threading.Lock()
        self._explained: tuple[object, Explanation] | None = None
        self._decision: TickResult | None = None
        # Together, as the gallery may be cleared while its thread takes the newest tick.
        self._seen: tuple[TickResult, int] | None = None  # a tick, and `moves` of the gallery
        self._processed: TickResult | None = None
        self._causes: tuple[str, ...] = ()
        self._verdicts: deque[tuple[float, tuple[StopReason, ...]]] = deque(maxlen=MAX_WAITING)
        self._intents: deque[tuple[float, OperatorState]] = deque(maxlen=MAX_WAITING)
        controller.on_change(lambda intent: self._intents.append((self._now_s(), intent)))
        self._snapshots: deque[TickResult] = deque(maxlen=MAX_SNAPSHOTS)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="insight", daemon=True)

    def start(self) -> None:
        """Start the threads."""
        self._thread.start()
        self._writer.start()

    def stop(self) -> None:
        """End the threads and write the event log; a second call has no effect."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
            self._writer.stop()
            self.event_log.write()

    def note_decision(self, decision: TickResult) -> None:
        """Called by the think thread after each tick."""
        if decision.taken_back:
            self.detections.clear()
        elif decision.correction is not None:
            self.detections.follow(decision.correction.before, decision.correction.after)
        self._decision = decision
        self._seen = decision, self.detections.moves
        self.note_place(self._place_events.after(decision))

    def note_place(self, texts: Iterable[str]) -> None:
        """Log sentences on the robot's place and on what moved with the map."""
        for text in texts:
            self.event_log.note(self._now_s(), "place", text, self._here())

    def note_map(self, text: str, place: Position) -> None:
        """Log a sentence on an edit of the map."""
        self.event_log.note(self._now_s(), "map", text, place)

    def note_verdict(self, verdict: GateDecision) -> None:
        """Called by the command thread after each command."""
        causes = tuple(reason.cause for reason in verdict.reasons[:1])
        if causes != self._causes:
            self._causes = causes
            self._verdicts.append((self._now_s(), verdict.reasons))

    def forget_place(self) -> None:
        """Forget what was detected: the robot is at another site now."""
        self.detections.clear()

    # Requests of the console

    def explain(self) -> Explanation:
        """Explain the present path, or the one to the first waiting goal.

        Computed once for each map, goal and cell of the robot, list of classes, zones, and unseen
        floor with its price.
        """
        with self._explaining:
            query = self._query()
            cell = query.occupancy.spec.cell(query.pose.x_m, query.pose.y_m)
            unseen = None if query.unseen is None else np.packbits(query.unseen).tobytes()
            rules = (query.beware, query.zones, query.unknown_price, unseen)
            key = (query.occupancy, query.goal, query.path, cell, *rules)
            if self._explained is None or self._explained[0] != key:
                self._explained = (key, explain(query))
            return self._explained[1]

    def without(self, keys: Collection[str]) -> Alternative:
        """Plan the path without some rules; nothing is applied."""
        with self._explaining:
            return alternative(self._query(), keys)

    def candidates(self) -> Candidates | None:
        """Return the local planner's motion primitives with their free lengths; None before the
        first tick."""
        decision = self._decision
        if decision is None:
            return None
        geometric, forbidden = decision.obstacles
        arcs, free = candidates(
            geometric=geometric,
            forbidden=forbidden,
            profile=self._controller.profile,
            local=self._config.local,
            cell_m=decision.occupancy.spec.resolution_m,
            control=self._config.control,
        )
        return Candidates(
            serial=decision.frame.stamp_ns,
            arcs=decision.frame.pose.to_parent(arcs),
            free=free,
            chosen=decision.motion.arc,
        )

    def mark_wrong(self, sighting_id: int, class_name: str | None) -> LabellingState:
        """Mark a detection as wrong, and add its frame to the labelling folder, corrected."""
        entry = None if class_name is None else self._entry(class_name)
        said = None if entry is None else entry.detected_as
        with self._correcting:  # of two corrections at once one is refused
            view = self.detections.view(sighting_id)
            self.labelling.add(view, names=self._network_classes(), said=said)
            self.detections.mark(sighting_id, "wrong")
        what = "it is nothing of the list" if entry is None else f"it is “{entry.title}”"
        self.event_log.note(
            self._now_s(),
            "labelled",
            f"Sighting {sighting_id} was called wrong: {what}.",
            self._place_of(sighting_id),
        )
        return self.labelling.state()

    def snapshot(self) -> int:
        """Hold the present image and return its id; raises `Refused` before the first."""
        if self._decision is None:
            raise Refused("the camera has delivered no image yet")
        self._snapshots.append(self._decision)
        return _snapshot_id(self._decision)

    def snapshot_image(self, snapshot: int) -> bytes:
        """Return the JPEG of a held image; raises `NotKnown`."""
        return camera_jpg(self._held(snapshot).frame.rgb)

    def add_example(
        self, snapshot: int, class_name: str, box: tuple[int, int, int, int]
    ) -> LabellingState:
        """Add a held image to the labelling folder, with a missed object."""
        entry, decision = self._entry(class_name), self._held(snapshot)
        mask = region_in(decision.frame.rgb, box)
        view = packed(decision.frame, decision.labels, self._controller.intent.beware, mask)
        self.labelling.add(view, names=self._network_classes(), said=entry.detected_as)
        self.event_log.note(
            self._now_s(),
            "labelled",
            f"A “{entry.title}” that was missed was shown to the robot.",
            self._here(),
        )
        return self.labelling.state()

    # Thread

    def _run(self) -> None:
        is_last = False
        while not is_last:
            is_last = self._ending.wait(PERIOD_S)
            try:
                self._update()
            except Exception:
                log.exception("the event log missed an event")  # no driving depends on it

    def _update(self) -> None:
        now_s, decision = self._now_s(), self._decision
        while self._verdicts:
            self._event_detector.on_gate(*self._verdicts.popleft(), self._here())
        while self._intents:
            self._event_detector.on_change(*self._intents.popleft(), self._here())
        self._event_detector.on_tick(now_s, decision, self._here())
        if (seen := self._seen) is not None and seen[0] is not self._processed:
            self._processed, moves = seen
            beware, found = self._controller.intent.beware, list[Sighting]()
            if seen[0].place.is_known:
                frame, labels = seen[0].frame, seen[0].labels
                found = self.detections.update(now_s, frame, labels, beware, moves=moves)
            for new in found:
                title = beware.titles[new.class_id]
                text = f"First sight of “{title}” here, {new.confidence:.0%} sure."
                self.event_log.note(now_s, "seen", text, new.place)
        if self.series.is_due(now_s):
            self.series.add(now_s, self._recorder.measurements(decision))

    def _now_s(self) -> float:
        return self._clock.now_ns() / 1e9

    def _held(self, snapshot: int) -> TickResult:
        for decision in tuple(self._snapshots):
            if _snapshot_id(decision) == snapshot:
                return decision
        raise NotKnown(f"image {snapshot} is no longer held; take another one")

    def _here(self) -> Position:
        return self._recorder.pose.x_m, self._recorder.pose.y_m

    def _place_of(self, sighting_id: int) -> Position | None:
        return next(
            (sighting.place for sighting in self.detections.all() if sighting.id == sighting_id),
            None,
        )

    def _entry(self, class_name: str) -> BewareClass:
        for entry in self._controller.intent.beware.classes:
            if entry.name == class_name:
                return entry
        raise NotKnown(f"the beware list has no class {class_name!r:.90}; add it first")

    def _network_classes(self) -> dict[int, str]:
        """Return the class of the network for each class id of the list: a renamed entry is still
        trained as the class that detects it."""
        return {
            entry.class_id: entry.detected_as for entry in self._controller.intent.beware.classes
        }

    def _query(self) -> ExplanationQuery:
        intent, decision = self._controller.intent, self._decision
        if decision is None:
            raise Refused("there is no map yet; the camera has not delivered an image")
        if not intent.mission.queue:
            raise Refused("there is no goal, so there is no path to explain; add a goal first")
        goal = (intent.mission.queue[0].x_m, intent.mission.queue[0].y_m)
        request, route, path = decision.request, decision.route, None
        if request.goal == goal and route is not None and route.reaches_goal:
            path = route.outcome if isinstance(route.outcome, Path) else None
        price = intent.unknown_price or self._config.planning.unknown_price
        explored = self._controller.navigator.map.explored
        return ExplanationQuery(
            unseen=explored.unseen_on(decision.occupancy.spec) if price > 1 else None,
            unknown_price=price,
            occupancy=decision.occupancy,
            beware=request.beware,
            zones=(*request.zones, *decision.closed),
            pose=decision.frame.pose,
            goal=goal,
            goal_tolerance_m=goal_tolerance_m(self._config, self._controller.profile),
            path=path,
            profile=self._controller.profile,
            safety_margin_m=self._config.safety_margin_m,
            start_relief_m=self._config.start_relief_m,
        )


def _snapshot_id(decision: TickResult) -> int:
    """Return the number of a held image: its time in microseconds, since JavaScript rounds the
    nanoseconds of a clock that has run for 104 days."""
    return decision.frame.stamp_ns // 1000
