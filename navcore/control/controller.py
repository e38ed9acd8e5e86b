"""The control stage: the velocity that follows the route and collides with nothing."""

from __future__ import annotations

import dataclasses

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.people.people_state import NOTHING_EXPECTED, PeopleExpectations, PeopleState
from navcore.control.speed_limits import allowed_speed_mps, slowed
from navcore.costmap.costmap import Costmap
from navcore.costmap.local_costmap import (
    bare_cells,
    footprint_overlaps,
    frontier,
    kept_cells,
    kept_zones,
    margins_left,
    nearby,
    obstacle_masks,
    occupied_cells,
    people_mask,
    split_areas,
)
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.localisation.cell_margins import NO_CELLS, GrownCells
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import GrownZone
from navcore.perception.people.track import Track
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile

_LIMBS_M = 0.3
"""Distance in metres beyond the disc of a person to which points are taken for arms, legs, or the
error of the prediction."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlTask:
    """The input of one control step."""

    costmap: Costmap
    """Occupied and blocked cells."""
    pose: Pose2
    """T_map_base."""
    twist: Twist
    """Velocity by odometry."""
    track: Points
    """(N, 2) smoothed path to follow, map frame; empty to stand."""
    reaches_goal: bool
    """Whether the track ends at the goal, and not at a viewpoint on the way to it."""
    people: tuple[Track, ...]
    """Tracked people."""
    expectations: PeopleExpectations = NOTHING_EXPECTED
    """What the behaviours know of them."""
    goal_yaw_rad: float | None = None
    """Heading in the map frame to take at the goal; None for any."""
    leaving: tuple[Zone, ...] | None = None
    """All zones in force while the robot leaves the one it stands in, or the growth of one; None
    otherwise. A robot that leaves may cross the area it stands in, and no other."""
    kept_cells: GrownCells = NO_CELLS
    """Beware cells near the robot, which it keeps from as the safety gate does."""
    kept_zones: tuple[GrownZone, ...] = ()
    """Zones near the robot, which it keeps from in the same way."""
    around: tuple[GrownZone, ...] = ()
    """Zones whose growth the robot is in, and drives out of before it goes on."""
    goal: tuple[float, float] | None = None
    """(x, y) of the goal in metres of the map frame; None without one."""
    retreat: Points | None = None
    """(N, 2) driven path in the map frame, newest first, to back off along; None otherwise."""
    spin: bool = False
    """Whether to turn once in place and look around."""
    people_ids: tuple[int, ...] = ()
    """Class ids of the beware list that are people."""
    newly_seen: Points | None = None
    """(N, 2) obstacle points in the map frame of an image newer than the costmap; None without
    one."""

    def after(self, frame: Frame, later_s: float, obstacles: Points) -> ControlTask:
        """Return the task at a frame that is `later_s` seconds newer, placed in the map, with the
        (N, 2) obstacle points that its image shows, base frame. People have walked on, and points
        near them are theirs."""
        people = tuple(person.after(later_s) for person in self.people)
        seen = frame.pose.to_parent(obstacles)
        for person in people:
            away_m = np.hypot(*(seen - (person.x_m, person.y_m)).T)
            seen = seen[away_m > person.radius_m + _LIMBS_M]
        return dataclasses.replace(
            self, pose=frame.pose, twist=frame.twist, people=people, newly_seen=seen
        )


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControllerMemory:
    """What a step of the controller leaves behind."""

    motion: Motion
    """Its motion."""
    in_margin: bool
    """Whether a margin reaches the body, and what has it does not."""
    obstacles: tuple[Points, Points]
    """What stands near the robot, and where it is forbidden: (N, 2) middles of cells, base
    frame."""


class Controller:
    """Runs the local planner; remembers the newest motion, since a manoeuvre is carried through."""

    def __init__(
        self, explored: VisibilityMap, profile: RobotProfile, config: NavigatorConfig
    ) -> None:
        self._explored, self._profile, self._config = explored, profile, config
        self._motion = IDLE
        self.in_margin = False
        """Whether a margin reaches the body, and what has it does not."""
        self.obstacles: tuple[Points, Points] = np.empty((0, 2)), np.empty((0, 2))
        """What stands near the robot, and where it is forbidden: (N, 2) middles of cells, base
        frame."""

    def control(self, task: ControlTask) -> Motion:
        """Compute the motion until the next frame; standing without a track."""
        costmap, pose, local = task.costmap, task.pose, self._config.local
        reach_m = local.reach_m + self._profile.circumscribed_radius_m
        around = costmap.around(pose, reach_m)
        hard, forbidden = obstacle_masks(around, people=task.people_ids)
        if task.newly_seen is not None:
            hard = hard | occupied_cells(around.spec, task.newly_seen)
        near = (pose, self._profile.circumscribed_radius_m)
        passed = near if task.expectations.passes_close else None
        people_cells = people_mask(around, task.people_ids, passed)
        people_points = nearby(people_cells, around, pose, reach_m)
        cell_m = around.spec.resolution_m
        bare = bare_cells(around, people=task.people_ids)
        in_area, in_margin = (
            footprint_overlaps(nearby(cells, around, pose, reach_m), self._profile, cell_m)
            for cells in (bare, forbidden)
        )
        self.in_margin = in_margin and not in_area and task.leaving is None
        if task.leaving is not None:
            # Near the end of the escape path is still inside.
            local = dataclasses.replace(local, nearly_m=0.0)
            within = {one.zone.id for one in task.around}
            zones = tuple(zone for zone in task.leaving if zone.id not in within)
            _, forbidden = split_areas(around, zones, self._profile, pose)
        else:
            if self.in_margin:
                forbidden = bare | margins_left(around, self._profile, pose, task.people_ids)
            besides_m = self._config.control.collision.kept_besides_m
            kept = task.kept_cells.kept_by(self._profile, pose, besides_m)
            forbidden |= kept_cells(around.spec, kept.cells, kept.growth_m)
            forbidden |= kept_zones(around.spec, task.kept_zones)
        geometric, forbidden_points = (
            nearby(cells, around, pose, reach_m) for cells in (hard, forbidden)
        )
        self.obstacles = np.vstack([geometric, people_points]), forbidden_points
        if len(task.track) == 0 and not task.around:
            trapped = footprint_overlaps(forbidden_points, self._profile, cell_m)
            in_zone = Motion(twist=STANDSTILL, outcome=ControllerState.IN_ZONE)
            self._motion = in_zone if trapped or in_area or in_margin else IDLE
            return self._motion
        unseen = frontier(self._explored.known(around.spec))
        people, control = self._config.people, self._config.control
        self._motion = compute_velocity(
            LocalPlannerInput(
                geometric=geometric,
                forbidden=forbidden_points,
                people_cells=people_points,
                unseen=nearby(unseen, around, pose, reach_m),
                cell_m=cell_m,
                path=task.track if len(task.track) else np.array([task.goal]),
                pose=pose,
                twist=task.twist,
                previous=self._motion,
                profile=self._profile,
                local=local,
                control=control,
                people=PeopleState.of(task.people, pose, people, control.social, task.expectations),
                people_config=people,
                goal_yaw_rad=task.goal_yaw_rad,
                around=task.around,
                retreat=task.retreat,
                spin=task.spin,
            )
        )
        at_end = self._motion.outcome in (ControllerState.ARRIVED, ControllerState.ALIGN)
        if at_end and not task.reaches_goal:
            self._motion = IDLE
        return self._motion

    @property
    def memory(self) -> ControllerMemory:
        """What the next step goes on from, and what the newest one was decided by."""
        return ControllerMemory(
            motion=self._motion, in_margin=self.in_margin, obstacles=self.obstacles
        )

    def recall(self, memory: ControllerMemory) -> None:
        """Go on from another step than the newest one."""
        self._motion, self.in_margin = memory.motion, memory.in_margin
        self.obstacles = memory.obstacles

    def limit(self, motion: Motion, zones: tuple[Zone, ...], pose: Pose2, twist: Twist) -> Motion:
        """Slow a motion down to the operator's speed limits; `twist` is the measured velocity."""
        local, limits = self._config.local, self._config.control.speed_limits
        allowed = allowed_speed_mps(zones, pose, twist.v_mps, self._profile, local, limits)
        return slowed(motion, allowed)

    def reset(self) -> None:
        """Forget the newest motion: the robot was moved by other means."""
        self._motion = IDLE
