"""The whole loop, once per frame: read `Navigator.tick` and know the system (the paper's Algorithms
1 and 2)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.recovery import Recovery, RecoveryAction, closed_way, trail_with
from navcore.behaviours.waiting import WaitingTimer
from navcore.config.navigator import NavigatorConfig
from navcore.control.local_planner import plan_motion
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.social import PeopleState
from navcore.control.speed_limits import allowed_speed_mps, slowed, travel_time_s
from navcore.costmap.costmap import Costmap, nearest_free
from navcore.costmap.live_costmap import LiveCostmap
from navcore.costmap.local_costmap import (
    footprint_overlaps,
    frontier,
    nearby,
    obstacle_masks,
    split_areas,
)
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.bitplane import BitPlane
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import Cell, GridSpec, OccupancyGrid, inflate_layers
from navcore.mapping.observation import observe
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.perception.ground import Image, ground_heights
from navcore.perception.labels import Labels, Segmenter
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.planning.escape import escape_path
from navcore.planning.gap_viewpoint import viewpoint_before_gap
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan_in
from navcore.planning.replanner import Replanner
from navcore.planning.route import NO_POINTS, Route, build_route, no_route
from navcore.planning.search.open_list import SearchWorkspace
from navcore.robot.frame import Frame, check_frame
from navcore.robot.profile import RobotProfile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickResult:
    """What one tick made of a frame."""

    frame: Frame
    """The frame it was made of."""
    labels: Labels
    """What its pixels show."""
    occupancy: Costmap
    """The map after the frame."""
    route: Route | None
    """The way to the goal; None without a goal."""
    motion: Motion
    """What to do until the next frame."""
    people: tuple[Track, ...] = ()
    """Who walks or stands about, and how."""
    closed: tuple[Zone, ...] = ()
    """Where the robot keeps out for a while of its own accord: a way that was found closed, or
    somebody's lane."""


class Navigator:
    """The map and the present path. It has no clock, no thread and no means to stop the robot: that
    is the gate's work."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        profile: RobotProfile,
        segmenter: Segmenter,
        config: NavigatorConfig,
    ) -> None:
        self.map = PointMap(spec, config.map)
        self._profile = profile
        self._segmenter = segmenter
        self._config = config
        self._occupancy = LiveCostmap(
            self.map, vehicle_width_m=profile.width_m, safety_margin_m=config.safety_margin_m
        )
        self._replanner = Replanner(self._occupancy.space)
        self._route: tuple[tuple[object, ...], Route] | None = None
        self._motion = IDLE
        self._placed = False
        self._tracker = PeopleTracker(non_cooperative=config.people.non_cooperative)
        self._recovery, self._trail = Recovery(), NO_POINTS
        self._lanes, self._patience = LaneKeepOut(), WaitingTimer()
        self._was_open: tuple[float, float] | None = None
        self._aim: tuple[object, ...] = ()
        self._closed: tuple[Zone, ...] = ()

    def tick(self, frame: Frame, order: NavigationRequest) -> TickResult:
        """From a frame to a motion. Raises `BadFrame`, and then has changed nothing."""
        check_frame(frame)
        labels = self.label(frame, order)
        ground_m = self.survey(frame)
        people = self.track(frame, labels, order, ground_m)
        self.remember(frame, labels, order, ground_m)
        occupancy, closed = self.occupancy(order), self.closed
        route = self.route(occupancy, frame.pose, order)
        motion = self.move(
            occupancy,
            frame.pose,
            route,
            people,
            leaving=(*order.zones, *closed) if order.leave else None,
            goal_yaw_rad=order.goal_yaw_rad,
            now=frame.twist,
        )
        self.leave_lanes(motion, frame, route, people)
        motion = self.limit(self.recover(motion, frame, route, order), frame, order)
        return TickResult(
            frame=frame,
            labels=labels,
            occupancy=occupancy,
            route=route,
            motion=motion,
            people=people,
            closed=closed,
        )

    def label(self, frame: Frame, order: NavigationRequest) -> Labels:
        """Which pixels show something on the beware list."""
        return self._segmenter.segment(frame, order.beware)

    def survey(self, frame: Frame) -> Image:
        """(H, W) how high the ground lies below what each pixel shows."""
        return ground_heights(frame, self._config.points.max_slope)

    def track(
        self, frame: Frame, labels: Labels, order: NavigationRequest, ground_m: Image | None = None
    ) -> tuple[Track, ...]:
        """Everybody who walks, and everybody whom the segmenter recognises."""
        return self._tracker.follow(frame, labels, order.beware, ground_m)

    def remember(
        self, frame: Frame, labels: Labels, order: NavigationRequest, ground_m: Image | None = None
    ) -> None:
        """Put the frame's points on the map, under its pose ID, but for those of people who walk;
        note the ground trodden."""
        self._tread(frame.pose)
        seen = observe(frame, labels, order.beware, self.map.spec, self._config.points, ground_m)
        self.map.insert(seen, frame, labels)
        people = order.beware.people_ids
        self.map.forget(self._tracker.trail(self.map.spec), [NOTHING, *people])
        self.map.clear_ghosts(seen.box, self._tracker.is_free_floor, people, frame)
        self.map.explored.look(frame, self._config.points)

    def occupancy(self, order: NavigationRequest) -> Costmap:
        """The occupied and the blocked cells; what has changed on the map, the list or the zones is
        followed."""
        aim = (order.goal, order.goal_yaw_rad, order.leave)
        if self._aim != aim:
            # What was tried on the way to another goal, and found closed there, says nothing of
            # this one.
            self._aim, self._closed, self._recovery = aim, (), Recovery()
        return self._occupancy.follow(order.beware, (*order.zones, *self.closed))

    @property
    def closed(self) -> tuple[Zone, ...]:
        """Where the robot keeps out for a while of its own accord."""
        return (*self._closed, *self._lanes.zones)

    def route(self, occupancy: Costmap, pose: Pose2, order: NavigationRequest) -> Route | None:
        """The shortest path from here, planned in full whenever the map, the goal or the robot's
        cell has changed."""
        if order.goal is None and not order.leave:
            return None
        key = (occupancy.version, order.goal, self.map.spec.cell(pose.x_m, pose.y_m))
        if self._route is None or self._route[0] != key:
            if order.goal is None:
                route = self.way_out(occupancy, pose, (*order.zones, *self.closed))
            else:
                route = self.plan(occupancy, pose, order.goal, order.beware)
            self._route = (key, route)
            if isinstance(route.outcome, Path):
                self._was_open = order.goal
        return self._route[1]

    def plan(
        self, occupancy: Costmap, pose: Pose2, goal: tuple[float, float], beware: BewareList
    ) -> Route:
        """The shortest path from a pose to a goal over the present map, which follows the list."""
        start = self._start(occupancy, pose)
        if start is None:
            return no_route(Reason.START_BLOCKED)
        space = self._occupancy.space
        outcome = self._replanner.plan(
            start, self.map.spec.cell(*goal), max_expansions=self._config.plan_budget
        )
        if outcome == NoPath(reason=Reason.UNREACHABLE):
            return self._nearer(occupancy, pose, goal, beware) or self._laid(
                outcome, goal, space.across[FREE]
            )
        if (
            outcome == NoPath(reason=Reason.GOAL_BLOCKED)
            and self._was_open == goal
            and pose.distance_to(*goal) > _LOOK_M
        ):
            return self._beside(occupancy, start, goal) or self._laid(
                outcome, goal, space.across[FREE]
            )
        return self._laid(outcome, goal, space.across[FREE])

    def _nearer(
        self, occupancy: Costmap, pose: Pose2, goal: tuple[float, float], beware: BewareList
    ) -> Route | None:
        """No path, but a way to where it may look open from nearer; None where there is none, or
        the robot is there."""
        spec = self.map.spec
        found = viewpoint_before_gap(
            occupancy,
            spec.cell(pose.x_m, pose.y_m),
            spec.cell(*goal),
            people=beware.people_ids,
            vehicle_width_m=self._profile.width_m,
            relief_cells=self._config.start_relief_m / spec.resolution_m,
        )
        if found is None:
            return None
        space = self._occupancy.space
        path = plan_in(
            space, SearchWorkspace(space), *found, max_expansions=self._config.plan_budget
        )
        if not isinstance(path, Path):
            return None
        way = self._laid(path, spec.centre(*found[1]), space.across[FREE])
        return dataclasses.replace(way, outcome=NoPath(reason=Reason.UNREACHABLE))

    def _beside(self, occupancy: Costmap, start: Cell, goal: tuple[float, float]) -> Route | None:
        """The way to beside a goal that was open, and where something was seen from afar to stand
        by now: does it still?

        None where there is none, and where an operator's zone is on the goal or near it: that does
        not go by looking.
        """
        grid, spec, (row, col) = occupancy.grid, self.map.spec, self.map.spec.cell(*goal)
        reach = math.ceil(_BESIDE_M / spec.resolution_m)
        window = np.s_[max(row - reach, 0) : row + reach + 1, max(col - reach, 0) : col + reach + 1]
        beside = nearest_free(occupancy.free, (row, col), _BESIDE_M / spec.resolution_m)
        if beside is None or any(
            layer[window].any() for layer in (grid.zones, *(zone for _, zone in grid.wide_zones))
        ):
            return None
        path = self._replanner.plan(start, beside, max_expansions=self._config.plan_budget)
        way = self._laid(path, spec.centre(*beside), self._occupancy.space.across[FREE])
        return dataclasses.replace(way, outcome=NoPath(reason=Reason.GOAL_BLOCKED))

    def way_out(self, occupancy: Costmap, pose: Pose2, zones: tuple[Zone, ...]) -> Route:
        """The shortest way to where no part of the robot is in a beware area, however it turns;
        over no area but its own.

        `zones`: those that the occupancy was made with.
        """
        found = escape_path(occupancy, pose, zones, self._profile, self._config)
        if isinstance(found.outcome, NoPath):
            return no_route(found.outcome.reason)
        goal = found.spec.centre(*found.outcome.cells[-1])
        way = build_route(found.outcome, goal, found.free, found.spec, self._profile, self._config)
        return dataclasses.replace(way, outcome=found.on_the_map)

    def preview(self, occupancy: Costmap, pose: Pose2, goal: tuple[float, float]) -> Route:
        """The shortest path over any given occupancy, from scratch; changes nothing and may be
        called from any thread."""
        start = self._start(occupancy, pose)
        if start is None:
            return no_route(Reason.START_BLOCKED)
        space = FreeSpace.of(occupancy.blocked)
        outcome = plan_in(
            space,
            SearchWorkspace(space),
            start,
            self.map.spec.cell(*goal),
            max_expansions=self._config.plan_budget,
        )
        return self._laid(outcome, goal, space.across[FREE])

    def travel_time_s(
        self, route: Route, zones: tuple[Zone, ...], *, start_yaw_rad: float | None
    ) -> float:
        """How long a route takes, about; where people will be in the way is not known beforehand."""
        return travel_time_s(
            route.points, zones, self._profile, self._config.local, start_yaw_rad=start_yaw_rad
        )

    def drafted(self, grid: OccupancyGrid) -> Costmap:
        """A given grid as the planners would see it: for previews."""
        blocked = inflate_layers(
            grid,
            vehicle_width_m=self._profile.width_m,
            safety_margin_m=self._config.safety_margin_m,
        )
        return Costmap.of(grid, blocked, version=-1)

    def _start(self, occupancy: Costmap, pose: Pose2) -> Cell | None:
        spec = self.map.spec
        return nearest_free(
            occupancy.free,
            spec.cell(pose.x_m, pose.y_m),
            self._config.start_relief_m / spec.resolution_m,
        )

    def _laid(self, outcome: Path | NoPath, goal: tuple[float, float], free: BitPlane) -> Route:
        return build_route(outcome, goal, free, self.map.spec, self._profile, self._config)

    def move(
        self,
        occupancy: Costmap,
        pose: Pose2,
        route: Route | None,
        people: tuple[Track, ...] = (),
        *,
        leaving: tuple[Zone, ...] | None = None,
        goal_yaw_rad: float | None = None,
        now: Twist = STANDSTILL,
    ) -> Motion:
        """The velocity that follows the route, touches nothing and is in nobody's way; standing
        without a route.

        At the route's end the robot turns to `goal_yaw_rad`, where one is asked for. `now` is the
        velocity that it has.

        A robot that is `leaving` may pass over the area it stands in, and over no other: all zones
        are given with it.
        """
        reach = self._config.local.reach_m + self._profile.circumscribed_radius_m
        around = occupancy.around(pose, reach)
        (hard, forbidden), rules = obstacle_masks(around), self._config.local
        if leaving is not None:
            rules = dataclasses.replace(
                rules, nearly_m=0.0
            )  # near the end of the way out is still inside
            _, forbidden = split_areas(around, leaving, self._profile, pose)
        ruled = nearby(forbidden, around, pose, reach)
        if route is None or len(route.points) == 0:
            trapped = footprint_overlaps(ruled, self._profile, around.spec.resolution_m)
            self._motion = (
                Motion(twist=STANDSTILL, outcome=ControllerState.IN_ZONE) if trapped else IDLE
            )
            return self._motion
        self._motion = plan_motion(
            geometric=nearby(hard, around, pose, reach),
            ruled=ruled,
            unseen=nearby(frontier(self.map.explored.known(around.spec)), around, pose, reach),
            path_map=route.track,
            pose=pose,
            previous=self._motion,
            profile=self._profile,
            rules=rules,
            cell_m=around.spec.resolution_m,
            people=PeopleState.of(people, pose, self._config.people),
            people_config=self._config.people,
            goal_yaw_rad=goal_yaw_rad,
            retreat_map=self._trail if self._recovery.means is RecoveryAction.BACK else None,
            look_round=self._recovery.means is RecoveryAction.LOOK,
            ignore_predictions=self._patience.is_over(self._config.people),
            now=now,
        )
        if isinstance(route.outcome, NoPath) and self._motion.outcome in (
            ControllerState.ARRIVED,
            ControllerState.ALIGN,
        ):
            self._motion = IDLE  # where the way was closed, not at the goal
        return self._motion

    def leave_lanes(
        self, motion: Motion, frame: Frame, route: Route | None, people: tuple[Track, ...]
    ) -> None:
        """Whoever keeps the robot waiting where he walks to and fro gets his lane from the next
        tick on; see `lanes.py`."""
        self._patience = self._patience.after(motion, frame.pose, frame.stamp_ns)
        way_m = None if route is None else route.length_m
        profile, people_config = self._profile, self._config.people
        self._lanes = self._lanes.after(
            motion,
            people,
            frame.pose,
            frame.stamp_ns,
            way_m=way_m,
            profile=profile,
            people_config=people_config,
        )

    def limit(self, motion: Motion, frame: Frame, order: NavigationRequest) -> Motion:
        """The same motion, as slow as the operator's speed limits want it."""
        rules = self._config.local
        return slowed(
            motion,
            allowed_speed_mps(order.zones, frame.pose, frame.twist.v_mps, self._profile, rules),
        )

    def recover(
        self, motion: Motion, frame: Frame, route: Route | None, order: NavigationRequest
    ) -> Motion:
        """The same motion, or standing while it is waited, or because nothing has helped; see
        `recovery.py`."""
        self._trail = trail_with(self._trail, frame.pose)
        looked = (
            route is not None
            and isinstance(route.outcome, NoPath)
            and motion.outcome is ControllerState.IDLE
        )
        if route is None or len(route.points) == 0 or looked:
            self._recovery, closed = Recovery(), self._closed
            if closed and order.goal is not None:
                # Only what was found closed may be in the way: rather give up where the robot is
                # than say that there is none.
                self._closed, self._recovery = (
                    (),
                    Recovery(
                        means=RecoveryAction.GIVE_UP, tried=RecoveryAction.CLOSE, at=frame.pose
                    ),
                )
            return motion
        before = self._recovery
        self._recovery = before.after(motion, frame.pose, frame.stamp_ns, self._config.recovery)
        if (
            self._recovery.means is RecoveryAction.CLOSE
            and before.means is not RecoveryAction.CLOSE
            and before.at is not None
        ):
            # Before where it stands now: it has moved a little since it was boxed in, and must not
            # stand in what it closes.
            self._closed = (*self._closed, closed_way(route.track, frame.pose, self._profile))
        if self._recovery.means is RecoveryAction.GIVE_UP:
            self._closed = ()  # should one of the ways that were found closed be open again, it goes on
            return Motion(twist=STANDSTILL, outcome=ControllerState.GIVEN_UP)
        return (
            Motion(twist=STANDSTILL, outcome=ControllerState.BOXED_IN)
            if self._recovery.means is RecoveryAction.WAIT
            else motion
        )

    def put_down(self) -> None:
        """The robot is where the next frame says, however it came there: what it did before does
        not lead on from here."""
        self._placed, self._motion, self._trail = False, IDLE, NO_POINTS
        self._recovery, self._patience = Recovery(), WaitingTimer()

    def _tread(self, pose: Pose2) -> None:
        outline = self._profile.footprint()
        if not self._placed:
            # Where it is put down it has been given room; the camera cannot see the floor at its
            # own feet.
            angles = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
            outline = self._config.start_clear_m * np.column_stack([np.cos(angles), np.sin(angles)])
            self._placed = True
        self.map.explored.mark_driven(pose.to_parent(outline))


_BESIDE_M, _LOOK_M = 1.5, 3.0
"""So far beside a goal that is taken the robot would go, and from so far away it is sure of that.
"""
