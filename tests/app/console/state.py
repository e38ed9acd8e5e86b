"""A holder of the operator's state without a robot."""

from __future__ import annotations

from collections.abc import Callable

from app.console.beware.beware_editor import BewareEditor, BewareStore
from app.console.beware.beware_map import BewareMap
from app.console.beware.colour_rules import LiveColourRules
from app.console.beware.examples import LiveExamples
from app.console.beware.recent_frames import RecentFrames
from app.runtime.control.operator_state import OperatorState, StateHolder
from navcore.config.navigator import NavigatorConfig
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.mission import Mission
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.robot.profile import HUSKY
from tests.navcore.perception.colour_network import ColourNetwork
from tests.navcore.scene import SPEC
from web.interface.beware import BewareVersion, BewareVersionSummary


class PlainHolder:
    """Satisfies `app.runtime.control.operator_state.StateHolder`."""

    def __init__(self, intent: OperatorState | None = None) -> None:
        self.intent = intent or OperatorState(mission=Mission(), beware=default_beware_list())

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the state."""
        self.intent = edit(self.intent)
        return self.intent


class PlainMap:
    """Satisfies `app.console.map_reading.MapHolder`: an edit is done at once, or waits for
    `follow`, as for the next tick."""

    def __init__(self, point_map: PointMap, *, waits: bool = False) -> None:
        self.point_map, self.waits = point_map, waits
        self.waiting: list[Callable[[PointMap], None]] = []

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Edit the map."""
        self.waiting.append(edit)
        if not self.waits:
            self.follow()

    def follow(self) -> None:
        """Do the edits that wait, in their order."""
        waiting, self.waiting = self.waiting, []
        for edit in waiting:
            edit(self.point_map)


def beware_editor(
    store: BewareStore,
    beware: BewareList | None = None,
    *,
    holder: StateHolder | None = None,
    defaults: BewareList | None = None,
    map_holder: PlainMap | None = None,
    recent: RecentFrames | None = None,
    network: ColourNetwork | None = None,
) -> BewareEditor:
    """Return an editor of a list, by default the shipped one, by colour rules alone or with a
    network."""
    config, recent = NavigatorConfig(), recent or RecentFrames()
    segmenter = (
        ColourSegmenter() if network is None else FusedSegmenter(network, HUSKY.depth_sensor)
    )
    map_holder = map_holder or PlainMap(PointMap(SPEC, config.map))
    point_map = map_holder.point_map
    listed = OperatorState(mission=Mission(), beware=beware or default_beware_list())
    examples = LiveExamples(recent, lambda: network, poses=lambda: point_map.poses)
    follower = BewareMap(
        map_holder,
        point_map=point_map,
        recent=recent,
        segmenter=segmenter,
        config=config,
        examples=examples,
    )
    return BewareEditor(
        holder or PlainHolder(listed),
        store=store,
        segmenter=segmenter,
        colours=LiveColourRules(recent),
        follower=follower,
        examples=examples,
        defaults=defaults,
    )


def summary_of(one: BewareVersion) -> BewareVersionSummary:
    """Return what is said of a stored list."""
    return BewareVersionSummary(
        version=one.list.version,
        unix_s=one.unix_s,
        by=one.by,
        what=one.what,
        classes=len(one.list.classes),
    )
