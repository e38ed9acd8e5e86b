"""The whole loop, once per frame: read `Navigator.tick` and know the system (Algorithms 1 and
2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from navcore.behaviours.supervisor import Behaviour
from navcore.config.navigator import NavigatorConfig
from navcore.config.perception import GroundConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import Motion
from navcore.control.speed_limits import travel_time_s
from navcore.costmap.costmap import Costmap
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.arrays import FloatImage
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec, OccupancyGrid, inflate_layers
from navcore.mapping.mapper import Mapper
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.perception.ground import ground_heights
from navcore.perception.labels import Labels, Segmenter
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.planning.global_planner import GlobalPlanner, Replan
from navcore.planning.path import Path
from navcore.planning.route import NO_POINTS, Route
from navcore.robot.frame import Frame, check_frame
from navcore.robot.profile import RobotProfile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickResult:
    """The outcome of one tick."""

    frame: Frame
    """The frame that was processed."""
    labels: Labels
    """Label of every pixel."""
    occupancy: Costmap
    """The costmap after the frame."""
    route: Route | None
    """The route to the goal; None without a goal."""
    motion: Motion
    """The motion until the next frame."""
    people: tuple[Track, ...] = ()
    """Tracked people."""
    closed: tuple[Zone, ...] = ()
    """Zones that the robot avoids of its own accord for a while: passages that it found blocked,
    lanes of people."""


def _segment(segmenter: Segmenter, frame: Frame, beware: BewareList) -> Labels:
    return segmenter.segment(frame, beware)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stages:
    """The stages of a tick, each a function of the component that holds its state.

    Timing, fault injection and ablations wrap or replace fields of this record before they hand it
    to the navigator; nothing is patched afterwards.
    """

    segment: Callable[[Segmenter, Frame, BewareList], Labels] = _segment
    """Label the pixels."""
    estimate_ground: Callable[[Frame, float, GroundConfig], FloatImage] = ground_heights
    """(H, W) height of the ground below each pixel; the number is the steepest slope of ground."""
    track: Callable[[PeopleTracker, Frame, Labels, BewareList, FloatImage], tuple[Track, ...]] = (
        PeopleTracker.follow
    )
    """Track people."""
    update_map: Callable[[Mapper, Frame, Labels, BewareList, FloatImage], None] = Mapper.update
    """Insert the frame's points into the map."""
    update_costmap: Callable[[LiveCostmap, BewareList, tuple[Zone, ...]], Costmap] = (
        LiveCostmap.follow
    )
    """Follow the changes of the map, the beware list and the zones."""
    plan: Callable[
        [GlobalPlanner, Costmap, Pose2, NavigationRequest, tuple[Zone, ...], Replan], Route | None
    ] = GlobalPlanner.route
    """Give the present route; calls `replan` when something has changed."""
    replan: Replan = GlobalPlanner.plan
    """Plan in full."""
    control: Callable[[Controller, ControlTask], Motion] = Controller.control
    """Choose the motion."""
    supervise: Callable[..., tuple[Behaviour, Motion]] = Behaviour.after
    """Run the behaviours: recovery, waiting, keep-outs of the robot's own."""


class Navigator:
    """The map, the present route and the behaviours; it has no clock, no thread and cannot stop the
    robot, which is the gate's work."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        profile: RobotProfile,
        segmenter: Segmenter,
        config: NavigatorConfig,
        stages: Stages | None = None,
    ) -> None:
        self.map = PointMap(spec, config.map)
        """The global map."""
        self.behaviour = Behaviour()
        """Recovery, waiting and keep-outs as of the newest tick."""
        self._stages = stages or Stages()
        self._profile, self._config, self._segmenter = profile, config, segmenter
        self._tracker = PeopleTracker(
            non_cooperative=config.people.non_cooperative, config=config.perception
        )
        self._mapper = Mapper(self.map, self._tracker, profile, config)
        self._costmap = LiveCostmap(
            self.map, vehicle_width_m=profile.width_m, safety_margin_m=config.safety_margin_m
        )
        self._planner = GlobalPlanner(self._costmap.space, spec, profile, config)
        self._controller = Controller(self.map.explored, profile, config)

    def tick(self, frame: Frame, request: NavigationRequest) -> TickResult:
        """Turn a frame into a motion. Raises `BadFrame`, and then has changed nothing."""
        check_frame(frame)
        stages, beware, pose = self._stages, request.beware, frame.pose
        labels = stages.segment(self._segmenter, frame, beware)
        ground_m = stages.estimate_ground(
            frame, self._config.points.max_slope, self._config.perception.ground
        )
        people = stages.track(self._tracker, frame, labels, beware, ground_m)
        stages.update_map(self._mapper, frame, labels, beware, ground_m)
        self.behaviour = self.behaviour.towards(request)
        keep_outs = self.behaviour.keep_outs
        zones = (*request.zones, *keep_outs)
        costmap = stages.update_costmap(self._costmap, beware, zones)
        route = stages.plan(self._planner, costmap, pose, request, keep_outs, stages.replan)
        task = self._control_task(costmap, frame, route, people, request)
        motion = stages.control(self._controller, task)
        self.behaviour, motion = stages.supervise(
            self.behaviour,
            motion,
            frame=frame,
            route=route,
            people=people,
            request=request,
            profile=self._profile,
            config=self._config,
        )
        return TickResult(
            frame=frame,
            labels=labels,
            occupancy=costmap,
            route=route,
            motion=self.limit(motion, request.zones, pose, frame.twist),
            people=people,
            closed=keep_outs,
        )

    def limit(self, motion: Motion, zones: tuple[Zone, ...], pose: Pose2, twist: Twist) -> Motion:
        """Slow a motion down to the operator's speed limits; `twist` is the measured velocity."""
        return self._controller.limit(motion, zones, pose, twist)

    def preview(self, costmap: Costmap, pose: Pose2, goal: tuple[float, float]) -> Route:
        """Plan from scratch over any costmap; changes nothing and may run in any thread."""
        return self._planner.preview(costmap, pose, goal)

    def inflate_draft(self, grid: OccupancyGrid) -> Costmap:
        """Make a costmap of a draft grid, for previews."""
        blocked = inflate_layers(
            grid,
            vehicle_width_m=self._profile.width_m,
            safety_margin_m=self._config.safety_margin_m,
        )
        return Costmap.of(grid, blocked, version=-1)

    def travel_time_s(
        self, route: Route, zones: tuple[Zone, ...], *, start_yaw_rad: float | None
    ) -> float:
        """Estimate the duration of a route in seconds, without people in the way."""
        points, local = route.points, self._config.local
        return travel_time_s(points, zones, self._profile, local, start_yaw_rad=start_yaw_rad)

    def reset_pose(self) -> None:
        """Expect the robot anywhere: it was moved by other means than its wheels."""
        self._mapper.reset_pose()
        self._controller.reset()
        self.behaviour = self.behaviour.after_reset()

    def _control_task(
        self,
        costmap: Costmap,
        frame: Frame,
        route: Route | None,
        people: tuple[Track, ...],
        request: NavigationRequest,
    ) -> ControlTask:
        behaviour = self.behaviour
        zones = (*request.zones, *behaviour.keep_outs)
        has_route = route is not None and len(route.points) > 0
        return ControlTask(
            costmap=costmap,
            pose=frame.pose,
            twist=frame.twist,
            track=route.track if route is not None and has_route else NO_POINTS,
            reaches_goal=route is not None and isinstance(route.outcome, Path),
            people=people,
            goal_yaw_rad=request.goal_yaw_rad,
            leaving=zones if request.leave else None,
            retreat=behaviour.retreat,
            spin=behaviour.spins,
            ignore_predictions=behaviour.waiting.is_over(self._config.people),
        )
