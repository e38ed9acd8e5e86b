"""The mapping stage: the points of a frame enter the global map, without those of people."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Bools, FloatImage, Points
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.mapping.people_sightings import PeopleSightings
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.people_points import class_set
from navcore.mapping.views.observation import Observation, observe
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.ground import flat_ground
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.people.tracker import PeopleTracker
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile


class Mapper:
    """Updates a point map, and the floor that is known to be free because the robot drove on it."""

    def __init__(
        self,
        point_map: PointMap,
        tracker: PeopleTracker,
        profile: RobotProfile,
        config: NavigatorConfig,
        source_of: Callable[[BewareClass], LabelSource] = lambda entry: LabelSource.NETWORK,
    ) -> None:
        """Update `point_map`; `source_of` tells what finds a class of the list now."""
        self.map = point_map
        """The global map."""
        self._tracker, self._profile, self._config = tracker, profile, config
        self._source_of = source_of
        self._colourless: tuple[BewareList | None, list[BewareClass]] = None, []
        self._placed = False
        self._sightings = PeopleSightings(config.map.people_s)
        self._has_loaded_people = False
        self._edits, self._is_corrected = point_map.edits.count, False

    def update(
        self,
        frame: Frame,
        labels: Labels,
        beware: BewareList,
        ground_m: FloatImage | None = None,
        T_map_odom: Pose2 = IDENTITY,
    ) -> None:
        """Insert the frame's points under its pose ID, and remove what people left on the map.

        The frame is placed in the map; the tracker of people is in odometry's frame.
        """
        self._mark_driven(frame.pose)
        rules = self._config.points
        people = beware.people_ids
        if self._has_loaded_people and people:
            self.map.forget_people(people, frame.pose)
            self._has_loaded_people = False
        seen = observe(frame, labels, beware, self.map.spec, rules, ground_m)
        self.map.insert(seen, frame, labels, self._recognised(beware))
        if ground_m is None:
            ground_m = flat_ground(frame.intrinsics.width)
        self.map.observe_ground(frame, ground_m, rules.obstacle_height_m)
        if people:
            self._forget_unseen(seen, people, frame.stamp_ns, T_map_odom)
        self.map.forget(self._tracker.trail(self.map.spec, T_map_odom), [NOTHING, *people])
        self.map.clear_ghosts(
            seen.box,
            lambda positions: self._tracker.is_free_floor(T_map_odom.from_parent(positions)),
            people,
            frame,
        )
        self.map.explored.integrate_rays(frame, rules)

    def begin_loaded_map(self) -> None:
        """Begin with a map that was loaded, whose people are forgotten at the next frame."""
        self._has_loaded_people = True
        self._sightings.clear()

    def follow_correction(self) -> None:
        """Take it that a correction has moved the points of the map, people among them."""
        self._is_corrected = True

    def reset_pose(self) -> None:
        """Expect the robot anywhere: the next frame's pose is a new start."""
        self._placed = False

    def _forget_unseen(
        self, seen: Observation, people: list[int], stamp_ns: int, T_map_odom: Pose2
    ) -> None:
        """Forget people where none has been seen, or followed by the tracker, for a while."""
        shown = seen.points_map[class_set(people)[seen.class_ids], :2].astype(np.float64)
        self._sightings.note(shown, stamp_ns)
        if self._is_corrected or self._edits != self.map.edits.count:
            # Points have moved, or were put back, with no look at where they are now.
            self._sightings.note(self.map.positions_of(people), stamp_ns)
            self._edits, self._is_corrected = self.map.edits.count, False
        followed = T_map_odom.to_parent(self._tracker.positions)
        self._sightings.note(followed, stamp_ns, self._config.perception.people.return_m)
        cells = self._sightings.take_old(stamp_ns, self.map.spec)
        if len(cells):
            self.map.forget(cells, people)

    def _recognised(self, beware: BewareList) -> Bools:
        """Return (256,) whether the network or an example can show a class now, by its id: the
        list may be without a class that the map holds, and the network may not have loaded."""
        if self._colourless[0] is not beware:
            # Of a colour rule and another source, the rule may be named.
            entries = [dataclasses.replace(entry, colour=None) for entry in beware.classes]
            self._colourless = beware, entries
        return class_set(
            entry.class_id
            for entry in self._colourless[1]
            if self._source_of(entry) is not LabelSource.NOTHING
        )

    def _mark_driven(self, pose: Pose2) -> None:
        outlines = [self._profile.footprint()] if self._placed else self._start_area()
        self._placed = True
        for outline in outlines:
            self.map.explored.mark_driven(pose.to_parent(outline), pose)

    def _start_area(self) -> list[Points]:
        """Return convex outlines, (N, 2) metres of the base frame, of the floor that is clear where
        the robot is put down: the camera cannot see it.

        What stands at the edge of the clear circle is on no map, and a cell is marked of which half
        lies in an outline: of the circle a rim is left that keeps the middles of cells inside.
        """
        angles = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        ahead_m = self._config.start_ahead_m
        beside_m = self._profile.width_m / 2 + self._config.local.padding_m
        ahead = np.array(
            [(0.0, -beside_m), (ahead_m, -beside_m), (ahead_m, beside_m), (0.0, beside_m)]
        )
        rim_m = self.map.spec.resolution_m * math.sqrt(0.5)
        return [max(self._config.start_clear_m - rim_m, 0.0) * circle, ahead]
