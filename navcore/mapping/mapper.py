"""The mapping stage: the points of a frame enter the global map, without those of people."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import FloatImage
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import Observation, observe
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.ground import flat_ground
from navcore.perception.labels import Labels
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
    ) -> None:
        self.map = point_map
        """The global map."""
        self._tracker, self._profile, self._config = tracker, profile, config
        self._placed = False
        self._people_seen_ns = dict[int, int]()
        self._adopted = False

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
        seen = observe(frame, labels, beware, self.map.spec, rules, ground_m)
        self.map.insert(seen, frame, labels)
        if ground_m is None:
            ground_m = flat_ground(frame.intrinsics.width)
        self.map.version += self.map.terrain.observe(frame, ground_m, rules.obstacle_height_m)
        people = beware.people_ids
        self._forget_people(frame, seen, people, T_map_odom)
        self.map.forget(self._tracker.trail(self.map.spec, T_map_odom), [NOTHING, *people])
        self.map.clear_ghosts(
            seen.box,
            lambda positions: self._tracker.is_free_floor(T_map_odom.from_parent(positions)),
            people,
            frame,
        )
        self.map.explored.integrate_rays(frame, rules)

    def adopt_map(self) -> None:
        """Forget the people of the map, which was loaded, at the next frame."""
        self._adopted, self._people_seen_ns = True, {}

    def reset_pose(self) -> None:
        """Expect the robot anywhere: the next frame's pose is a new start."""
        self._placed = False

    def _forget_people(
        self, frame: Frame, seen: Observation, people: list[int], T_map_odom: Pose2
    ) -> None:
        """Forget who was there when the map was kept, and whom an image has shown that the tracker
        has not believed in since."""
        if self._adopted:
            self.map.forget_people(people)
            self._adopted = False
        if any((seen.class_ids == class_id).any() for class_id in people):
            self._people_seen_ns[self.map.pose_ids.id_of(frame.pose)] = frame.stamp_ns
        before_ns = frame.stamp_ns - round(1e9 * self._config.map.people_s)
        old = {pose_id for pose_id, at in self._people_seen_ns.items() if at <= before_ns}
        if not old:
            return
        left = self.map.forget_not_followed(
            old,
            people,
            lambda positions: self._tracker.is_followed(T_map_odom.from_parent(positions)),
        )
        for pose_id in old:
            del self._people_seen_ns[pose_id]
        self._people_seen_ns |= dict.fromkeys(left, frame.stamp_ns)

    def _mark_driven(self, pose: Pose2) -> None:
        outline = self._profile.footprint()
        if not self._placed:
            # The robot is put down with clearance around it; the camera cannot see that floor.
            angles = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
            circle = np.column_stack([np.cos(angles), np.sin(angles)])
            outline = self._config.start_clear_m * circle
            self._placed = True
        self.map.explored.mark_driven(pose.to_parent(outline), pose)
