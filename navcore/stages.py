"""The stages of a tick as a record of functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from navcore.behaviours.supervisor import Behaviour
from navcore.config.perception.perception import GroundConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import Motion
from navcore.costmap.costmap import Costmap
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.arrays import FloatImage, Floats
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.localisation import Localisation
from navcore.mapping.mapper import Mapper
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.perception.ground_memory import GroundMemory
from navcore.perception.labels import Labels, Segmenter, only_coloured
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.planning.global_planner import GlobalPlanner, Replan
from navcore.planning.route import Route
from navcore.robot.frame import Frame


def _segment(segmenter: Segmenter, frame: Frame, beware: BewareList) -> Labels:
    return only_coloured(segmenter.segment(frame, beware), frame)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stages:
    """The stages of a tick, each a function of the component that holds its state.

    Timing, fault injection and ablations wrap or replace fields of this record before they hand it
    to the navigator; nothing is patched afterwards.
    """

    segment: Callable[[Segmenter, Frame, BewareList], Labels] = _segment
    """Label the pixels."""
    estimate_ground: Callable[
        [GroundMemory, Frame, float, GroundConfig, Floats | None], FloatImage
    ] = GroundMemory.estimate
    """Height of the ground below each pixel, as of `ground_heights`; the number is the steepest
    slope of ground, the last argument the slopes that were seen earlier."""
    track: Callable[[PeopleTracker, Frame, Labels, BewareList, FloatImage], tuple[Track, ...]] = (
        PeopleTracker.follow
    )
    """Track people, in odometry's frame."""
    localise: Callable[
        [Localisation, Frame, Labels, tuple[Track, ...], FloatImage], LocalisationEstimate
    ] = Localisation.update
    """Estimate where odometry's frame lies in the map; everything after it is in the map frame."""
    update_map: Callable[[Mapper, Frame, Labels, BewareList, FloatImage, Pose2], None] = (
        Mapper.update
    )
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
