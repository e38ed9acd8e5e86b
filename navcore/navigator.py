"""The whole loop, once per frame: read `Navigator.tick` and know the system (Algorithms 1 and
2)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

from navcore.behaviours.supervisor import Behaviour
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.control.controller import Controller, ControllerMemory, ControlTask
from navcore.control.motion import ControllerState, Motion
from navcore.control.motions.beside_people import no_faster
from navcore.control.speed_limits import travel_time_s
from navcore.costmap.costmap import Costmap
from navcore.costmap.live_costmap import LiveCostmap
from navcore.costmap.local_costmap import beware_cells, outside
from navcore.geometry.arrays import FloatImage, Points
from navcore.geometry.transform import STANDSTILL, Matrix, Pose2, Twist
from navcore.grid.grid import Box, GridSpec, OccupancyGrid, inflate_layers
from navcore.grid.growth import growth_to
from navcore.localisation.cell_margins import CellMargins, GrownCells
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation, Outcome, Task
from navcore.localisation.map_correction import (
    AppliedCorrection,
    MapCorrection,
    PrepareCorrection,
    is_large,
)
from navcore.localisation.map_trial import MapTrial
from navcore.localisation.scans.keyframe_store import restored, stored
from navcore.localisation.tasks import TaskFailed
from navcore.localisation.zone_margins import ZoneMargins
from navcore.mapping.correction import PreparedCorrection
from navcore.mapping.mapper import Mapper
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.views.extent import needed_part, permitted_part
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import GrownZone
from navcore.perception.ground import cell_centres
from navcore.perception.ground_memory import GroundMemory
from navcore.perception.labels import Labels, Segmenter
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.planning.global_planner import GlobalPlanner
from navcore.planning.path import NoPath
from navcore.planning.route import NO_POINTS, Route
from navcore.robot.frame import Frame, check_frame
from navcore.robot.profile import RobotProfile
from navcore.stages import Stages

_ENDS = (
    ControllerState.BLOCKED,
    ControllerState.BACK,
    ControllerState.MANOEUVRE,
    ControllerState.IDLE,
)
"""States in which the robot does not get on along the path, for what stands near it."""
_CREEP_MPS = 0.1
"""Speed in metres per second of the fastest point of the body towards what ends the way and is not
on the map, until the safety gate stops the robot before it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickResult:
    """The outcome of one tick."""

    frame: Frame
    """The frame that was processed, placed in the map."""
    request: NavigationRequest
    """What was asked for, with the zones as the robot keeps out of them: grown by the uncertainty
    of its position."""
    place: LocalisationEstimate
    """Where the robot is in the map, and how sure that is."""
    correction: AppliedCorrection | None = None
    """Correction of the map since the frame of the result before; None without one."""
    labels: Labels
    """Label of every pixel."""
    occupancy: Costmap
    """The costmap after the frame."""
    grown_cells: GrownCells = field(default_factory=GrownCells)
    """Beware cells near the robot, as the safety gate keeps them."""
    route: Route | None
    """The route to the goal; None without a goal."""
    motion: Motion
    """The motion until the next frame."""
    obstacles: tuple[Points, Points] = NO_POINTS, NO_POINTS
    """What stands near the robot, and where it is forbidden, as the local planner keeps from it:
    (N, 2) middles of cells, base frame."""
    people: tuple[Track, ...] = ()
    """Tracked people in the map frame."""
    closed: tuple[Zone, ...] = ()
    """Zones that the robot avoids of its own accord for a while: passages that it found blocked,
    lanes of people."""
    in_margin: bool = False
    """Whether the margin of a zone or of a class reaches the body, and what has it does not."""
    in_growth: bool = False
    """Whether the robot drives out of the growth of a zone before it goes on to the goal."""
    taken_back: bool = False
    """Whether what was seen from a wrong place was taken back from the saved map before this
    frame."""


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
        self.first_grid = spec
        """Grid of a map in which nothing is known yet."""
        self.map = PointMap(spec, config.map, profile)
        """The global map."""
        self.behaviour = Behaviour()
        """Recovery, waiting and keep-outs as of the newest tick."""
        self._stages = stages or Stages()
        self.config = self._config = config
        """The configuration."""
        self._profile, self._segmenter = profile, segmenter
        self._ground = GroundMemory()
        self._tracker = PeopleTracker(
            profile, non_cooperative=config.people.non_cooperative, config=config.perception
        )
        self._mapper = Mapper(self.map, self._tracker, profile, config, segmenter.source_of)
        self.localisation = Localisation(
            self.map.pose_ids, config.localisation, profile.depth_sensor
        )
        """Estimates the pose in the map."""
        self.map.scans = lambda: stored(self.localisation.keyframes)
        self.place = LocalisationEstimate()
        """Estimate of the newest frame."""
        self.zone_margins = self._zone_margins()
        """Growth of the zones with the uncertainty of the pose."""
        self._cell_margins = CellMargins(
            keep_out=DEFAULT_SAFETY.keep_out, odometry=config.localisation.odometry
        )
        self._correction = MapCorrection(self.map, self.localisation, config.localisation.tracking)
        self._trial = MapTrial(self.map, self.localisation, config.localisation.start)
        # The newest tick, where the local planner has decided, and its newest decision since.
        self._steering: tuple[TickResult, ControlTask] | None = None
        self._steered: ControllerMemory | None = None
        # What has become of the map, until the result of a tick tells it: a tick may fail after it.
        self._corrected: AppliedCorrection | None = None
        self._taken_back = False
        self._costmap = LiveCostmap(
            self.map, vehicle_width_m=profile.width_m, safety_margin_m=config.safety_margin_m
        )
        self._planner = GlobalPlanner(self._costmap.space, self.map.explored, profile, config)
        self._controller = Controller(self.map.explored, profile, config)

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label a frame, and change nothing, so that it may run beside a tick; one call at a time,
        as engines are not thread-safe. Raises `BadFrame`."""
        check_frame(frame)
        return self._stages.segment(self._segmenter, frame, beware)

    def tick(
        self,
        frame: Frame,
        request: NavigationRequest,
        labels: Labels | None = None,
        *,
        held: bool = False,
    ) -> TickResult:
        """Turn a frame into a motion; `labels`: those by `segment`, if they are known already.
        `held`: whether the safety gate has kept the robot from the motions of the last ticks for
        the sake of a zone or the beware list. Raises `BadFrame`, and then has changed nothing."""
        check_frame(frame)
        stages, beware = self._stages, request.beware
        if labels is None:
            labels = stages.segment(self._segmenter, frame, beware)
        ground_m = self._estimate_ground(frame)
        people = stages.track(self._tracker, frame, labels, beware, ground_m)
        place = self._localise(frame, labels, people, ground_m)
        frame = frame.placed(place.T_map_odom)
        people = tuple(person.placed(place.T_map_odom) for person in people)
        before, self.behaviour = self.behaviour, self.behaviour.towards(request)
        if self.behaviour is not before:
            self.zone_margins.restore_clearance()
        drawn = request.zones
        request = dataclasses.replace(request, zones=self.zone_margins.follow(drawn, place))
        around = self.zone_margins.covering_robot(drawn, place) if request.goal else ()
        keep_outs = self.behaviour.keep_outs
        if place.is_known:
            self.grow_to(self._needed_part(frame, request, (*request.zones, *keep_outs)))
            labels = self.map.rejections.without(frame, labels)
            stages.update_map(self._mapper, frame, labels, beware, ground_m, place.T_map_odom)
        grown_cells = self._update_costmap(frame, request, keep_outs)
        costmap, route = self._plan(frame, request, keep_outs, grown_cells)
        task = dataclasses.replace(
            self._control_task(costmap, frame, route, people, request, around),
            kept_cells=grown_cells,
            kept_zones=self._zones_near(drawn),
        )
        decided = stages.control(self._controller, task)
        motion = self._supervise(decided, frame, route, people, held=held)
        result = TickResult(
            frame=frame,
            request=request,
            place=place,
            correction=self._corrected,
            taken_back=self._taken_back,
            labels=labels,
            occupancy=costmap,
            grown_cells=grown_cells,
            route=route,
            motion=self.limit(motion, request.zones, frame.pose, frame.twist),
            obstacles=self._controller.obstacles,
            people=people,
            closed=keep_outs,
            in_margin=self._controller.in_margin,
            in_growth=len(around) > 0,
        )
        self._corrected, self._taken_back = None, False
        self._steering, self._steered = (result, task) if motion is decided else None, None
        return result

    def steer(self, newest: Frame, obstacles: Points) -> TickResult | None:
        """Return the result of the newest tick with the motion chosen again, by a newer frame whose
        labels are not made yet: by its pose, its velocity and (N, 2) obstacle points of its base
        frame, with all else as that tick has left it. None where that has had the robot do
        something else than follow the local planner."""
        if self._steering is None:
            return None
        last, of_tick = self._steering
        frame = newest.placed(self.place.T_map_odom)
        pose, later_s = frame.pose, (frame.stamp_ns - last.frame.stamp_ns) / 1e9
        seen = obstacles[outside(obstacles, self._profile, 0.0)]  # what is inside is noise
        task = dataclasses.replace(
            of_tick.after(frame, later_s, seen),
            expectations=self.behaviour.expectations(pose, self._profile, self._config),
        )
        memory = self._controller.memory
        before = self._steered or memory
        try:
            motion = self._decide(task, before)
            if len(seen) and motion.outcome in _ENDS:
                # What the map does not have may bend or slow the way, not end it: the safety gate
                # stops the robot before it, and so the recovery begins.
                kept = self._controller.memory
                onward = self._decide(dataclasses.replace(task, newly_seen=None), before)
                if onward.outcome is motion.outcome:
                    self._controller.recall(kept)
                else:
                    motion = no_faster(onward, _CREEP_MPS, self._profile)
        finally:  # the next tick, of an older frame perhaps, goes on from the last one
            self._steered = self._controller.memory
            self._controller.recall(memory)
        if last.people:  # who may have stopped meanwhile
            limit_mps = self._profile.fastest_mps(last.motion.twist)
            asked, motion = motion.twist, no_faster(motion, limit_mps, self._profile)
            if motion.twist == STANDSTILL != asked:  # for what the tick has it stand
                motion = dataclasses.replace(motion, outcome=last.motion.outcome)
        return dataclasses.replace(
            last,
            motion=self.limit(motion, last.request.zones, pose, frame.twist),
            obstacles=self._steered.obstacles,
            in_margin=self._steered.in_margin,
        )

    def _decide(self, task: ControlTask, before: ControllerMemory) -> Motion:
        """Choose a motion that goes on from a step `before`."""
        self._controller.recall(before)
        return self._stages.control(self._controller, task)

    def _estimate_ground(self, frame: Frame) -> FloatImage:
        """Return the height of the ground below each pixel. Localisation needs it: the slopes that
        were seen earlier are looked up by the place of the frame before."""
        rules = self._config.perception.ground
        slopes = self.map.terrain.slopes_around(
            frame.placed(self.place.T_map_odom), cell_centres(rules)
        )
        return self._stages.estimate_ground(
            self._ground, frame, self._config.points.max_slope, rules, slopes
        )

    def _localise(
        self, frame: Frame, labels: Labels, people: tuple[Track, ...], ground_m: FloatImage
    ) -> LocalisationEstimate:
        """Return the place at a frame, whose pose is odometry's. Before it a correction of the map
        that waits is applied, and after it the map is freed of what was seen from a wrong place."""
        correction = self._correction.apply(self.place.T_map_base, frame.twist)
        if correction is not None:
            self._note(correction)
        last = self.place
        self.place = self._stages.localise(self.localisation, frame, labels, people, ground_m)
        if self.place.T_map_odom != last.T_map_odom:
            self._follow_place(last, frame)
        if self._trial.follow(self.place):
            self._plan_anew()
            self._taken_back = True
        return self.place

    def _update_costmap(
        self, frame: Frame, request: NavigationRequest, keep_outs: tuple[Zone, ...]
    ) -> GrownCells:
        """Follow map, list and zones; return the beware cells near the robot as the safety gate
        keeps them."""
        zones = (*request.zones, *keep_outs)
        costmap = self._stages.update_costmap(self._costmap, request.beware, zones)
        around = costmap.around(frame.pose, DEFAULT_SAFETY.keep_out.seen_within_m)
        cells, objects = beware_cells(around)
        return self._cell_margins.follow(cells, frame, self.place, objects)

    def _plan(
        self,
        frame: Frame,
        request: NavigationRequest,
        keep_outs: tuple[Zone, ...],
        grown_cells: GrownCells,
    ) -> tuple[Costmap, Route | None]:
        """Return the costmap, and the route over it; the grid grows where the way leads out."""
        stages, zones = self._stages, (*request.zones, *keep_outs)
        while True:
            costmap = self._kept_from(grown_cells, frame.pose, request.beware)
            route = stages.plan(
                self._planner, costmap, frame.pose, request, keep_outs, stages.replan
            )
            lacking = self._planner.lacking
            if not lacking or not self.grow_to(permitted_part(lacking, self.map.spec, zones)):
                break
            stages.update_costmap(self._costmap, request.beware, zones)
        if self.zone_margins.keeps_clearance and route and isinstance(route.outcome, NoPath):
            self.zone_margins.give_up_clearance()
        return costmap, route

    def _zones_near(self, drawn: tuple[Zone, ...]) -> tuple[GrownZone, ...]:
        """Return the zones near the robot, which it keeps from as the safety gate does."""
        local, collision = self._config.local, self._config.control.collision
        reach_m = local.reach_m + self._profile.circumscribed_radius_m
        return self.zone_margins.near(drawn, self.place, reach_m, collision.kept_besides_m)

    def _supervise(
        self,
        motion: Motion,
        frame: Frame,
        route: Route | None,
        people: tuple[Track, ...],
        *,
        held: bool,
    ) -> Motion:
        """Run the behaviours; return the motion to carry out."""
        self.behaviour, motion = self._stages.supervise(
            self.behaviour,
            motion,
            held=held,
            frame=frame,
            route=route,
            people=people,
            profile=self._profile,
            config=self._config,
        )
        idle = motion.outcome is ControllerState.IDLE
        if route is not None and route.is_look and (idle or self.behaviour.has_failed):
            self._planner.end_look()
            self.behaviour = self.behaviour.on_another_way()
        return motion

    def grow_to(self, part: Box) -> bool:
        """Grow the grid by whole tiles to contain a part of the map frame, in cells of the present
        grid; return whether it has grown.

        It does not where it contains the part already, and where it would become too large
        (`navcore.grid.growth`): then the part stays outside the map.
        """
        growth = growth_to(self.map.spec, part)
        if growth is None:
            return False
        self.map.grow(growth)
        self._costmap.grow(growth)
        self._planner.grow(self._costmap.space, growth)
        return True

    def limit(self, motion: Motion, zones: tuple[Zone, ...], pose: Pose2, twist: Twist) -> Motion:
        """Slow a motion down to the operator's speed limits; `twist` is the measured velocity."""
        return self._controller.limit(motion, zones, pose, twist)

    def preview(
        self,
        costmap: Costmap,
        pose: Pose2,
        goal: tuple[float, float],
        *,
        unknown_price: float | None = None,
    ) -> Route:
        """Plan from scratch over any costmap; changes nothing and may run in any thread.

        `unknown_price`: as in `NavigationRequest`.
        """
        return self._planner.preview(costmap, pose, goal, unknown_price=unknown_price)

    def inflate_draft(self, grid: OccupancyGrid) -> Costmap:
        """Make a costmap of a draft grid, for previews."""
        blocked = inflate_layers(
            grid,
            vehicle_width_m=self._profile.width_m,
            safety_margin_m=self._config.safety_margin_m,
        )
        return Costmap.of(grid, blocked, version=-1)

    def travel_time_s(self, points: Points, zones: tuple[Zone, ...]) -> float:
        """Estimate the duration in seconds of the drive along (N, 2) points, without people in the
        way."""
        return travel_time_s(points, zones, self._profile)

    def next_task(self) -> Task | PrepareCorrection | None:
        """Return what is to be computed beside the tick: loop closures, relocalisation; None for
        nothing."""
        return self._correction.next_task()

    @property
    def waits_for_standstill(self) -> bool:
        """Whether the robot has to stand for a correction of its place on the map."""
        return self._correction.waits_for_standstill

    @property
    def map_is_on_trial(self) -> bool:
        """Whether what is put on the saved map now may be taken back, since the place may be
        wrong."""
        return self._trial.is_open

    @property
    def held_map(self) -> MapState | None:
        """The saved map without what may be taken back, to be stored; None where nothing may, and
        for a new map, which is stored as it is."""
        return self._trial.held

    def take(self, outcome: Outcome | PreparedCorrection | TaskFailed) -> None:
        """Receive the outcome of a task before the next tick."""
        self._correction.take(outcome)

    def adopt_map(
        self, last: Pose2 | None = None, *, kept: LocalisationEstimate | None = None
    ) -> None:
        """Localise in the map that was loaded, whose poses are constants, from the next frame on,
        and plan on its grid. `last`: T_map_base at the end of the session before, which is tried
        where the scans contradict odometry's pose. `kept`: the estimate in this map when another
        one was loaded, if the robot has hardly moved since."""
        self._plan_anew()
        if self.localisation.scan is not None:
            # The present estimate is of another map; of this one the next frame tells.
            self.place = kept or LocalisationEstimate(state=LocalisationState.CHECKING)
        keyframes = restored(self.map.scans(), self.map.poses)
        self.localisation.load(keyframes, last, kept=kept)
        self.map.scans = lambda: stored(self.localisation.keyframes)
        self.zone_margins = self._zone_margins(frozen=len(self.map.poses) > 0)
        self._trial.begin()
        self._corrected, self._taken_back, self._steering = None, False, None

    def _plan_anew(self) -> None:
        """Plan on a map that was replaced, and on its grid."""
        self._mapper.begin_loaded_map()
        self._costmap.restart()
        self._cell_margins.forget()
        self._planner = GlobalPlanner(
            self._costmap.space, self.map.explored, self._profile, self._config
        )

    def place_robot(
        self, T_map_base: Pose2, covariance: Matrix, frame: Frame, *, is_sure: bool = True
    ) -> None:
        """Set the pose of the robot at a frame, which is odometry's, with its (3, 3) covariance.
        What it saw from a place on trial that is another one is taken back, and so is what it sees
        from this one if that turns out to be wrong, unless it `is_sure`."""
        here = self.place.T_map_odom @ frame.pose
        agrees = self.place.is_known and not is_large(
            here, T_map_base @ here.inverse(), self._config.localisation.tracking
        )
        if not agrees and self._trial.take_back():
            self._plan_anew()
            self._taken_back = True
        if is_sure and (self.localisation.has_saved_map or not agrees):
            self._trial.end()  # in a new map all fits what was seen from the place itself
        if not is_sure:
            self._trial.hold(is_vouched=True)
        self.localisation.place(T_map_base, covariance, frame, is_sure=is_sure)
        self.reset_pose()

    def accept_jump(self, frame: Frame) -> None:
        """Accept the pose of a frame by odometry, which has jumped: the place is as uncertain."""
        self.localisation.accept_jump(self.place, frame)
        self.reset_pose()

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Move what was seen from past poses, T_map_base by pose ID, to corrected ones; the next
        result has the correction. The robot stays. Raises `BadConfiguration`, and changes nothing,
        for a pose ID that is unknown or belongs to a loaded map."""
        before = self.map.poses
        self.map.correct(poses)
        self.localisation.move_keyframes(poses)
        self._trial.end()  # what is held lies elsewhere now
        self._note(AppliedCorrection(before=before, after=self.map.poses))

    def _note(self, correction: AppliedCorrection) -> None:
        """Note that the map was corrected, once more since the last result perhaps."""
        earlier = self._corrected
        self._corrected = correction.following(earlier) if earlier else correction
        self._mapper.follow_correction()

    def reset_pose(self) -> None:
        """Expect the robot anywhere: it was moved by other means than its wheels."""
        self._mapper.reset_pose()
        self._ground.forget()
        self._cell_margins.forget()
        self._controller.reset()
        self._steering = None
        self.behaviour = self.behaviour.after_reset()

    def _follow_place(self, last: LocalisationEstimate, frame: Frame) -> None:
        """Take what belongs to the robot's `last` place along with a correction of it. Where the
        robot was pushed what it has driven lies where it did, and of one whose place was not known
        nothing is left."""
        place = self.place
        motion = place.T_map_odom @ last.T_map_odom.inverse()
        jumps = is_large(last.T_map_odom @ frame.pose, motion, self._config.localisation.tracking)
        if not last.is_known:
            self.behaviour = self.behaviour.after_reset()
        elif place.pushed_m == 0.0:
            self.behaviour = self.behaviour.corrected(motion, jumps=jumps)
        if jumps:
            self._controller.reset()

    def _kept_from(self, grown: GrownCells, pose: Pose2, beware: BewareList) -> Costmap:
        """Return the costmap that keeps the robot from beware cells as the safety gate does, which
        lets it stay as near as it is, and a little more, so that the local planner, which is the
        stricter one, follows the path."""
        besides_m = self._config.control.collision.kept_besides_m
        kept = grown.kept_by(self._profile, pose, 2 * besides_m)
        return self._costmap.widen(kept.cells, kept.growth_m, beware)

    def _zone_margins(self, *, frozen: bool = False) -> ZoneMargins:
        config = self._config
        return ZoneMargins(
            self._profile,
            config.zone_margins,
            safety_margin_m=config.safety_margin_m,
            frozen=frozen,
        )

    def _needed_part(
        self, frame: Frame, request: NavigationRequest, zones: tuple[Zone, ...]
    ) -> Box:
        config, around_m = self._config, self._profile.circumscribed_radius_m
        return needed_part(
            self.map.spec,
            frame,
            body_m=max(around_m, config.start_clear_m, config.start_ahead_m),
            reach_m=config.local.reach_m + around_m,
            max_range_m=config.points.max_range_m,
            goal=request.goal,
            zones=zones,
        )

    def _control_task(
        self,
        costmap: Costmap,
        frame: Frame,
        route: Route | None,
        people: tuple[Track, ...],
        request: NavigationRequest,
        around: tuple[GrownZone, ...],
    ) -> ControlTask:
        behaviour = self.behaviour
        zones = (*request.zones, *behaviour.keep_outs)
        has_route = route is not None and len(route.points) > 0
        return ControlTask(
            costmap=costmap,
            pose=frame.pose,
            twist=frame.twist,
            track=route.track if route is not None and has_route else NO_POINTS,
            reaches_goal=route is not None and route.reaches_goal,
            people=people,
            expectations=behaviour.expectations(frame.pose, self._profile, self._config),
            goal_yaw_rad=request.goal_yaw_rad,
            leaving=zones if request.leave or around else None,
            retreat=behaviour.retreat,
            spin=behaviour.spins,
            around=around,
            goal=request.goal,
            people_ids=tuple(request.beware.people_ids),
        )
