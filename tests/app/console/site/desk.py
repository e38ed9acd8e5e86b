"""A robot that is ticked by hand, with its store, its editors and its sites."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from app.console.mission.zone_editor import ZoneEditor
from app.console.site.sites import LiveSites
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.map_keeper import MapKeeper
from app.storage import Store
from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.mapping.storage import map_file
from navcore.mission.mission import Mission
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from tests.app.console.state import beware_editor
from tests.app.runtime.control.controlled import forget_frames
from tests.navcore.scene import RED_LIST, SPEC, Paint, picture
from web.interface.drafts import ZoneDraft
from web.interface.snapshots import TickSnapshot

SECOND = 1_000_000_000
FRAMES = [picture(Paint(x=(1.5, 2.0), y=(-0.3, 0.3)), stamp_ns=n * SECOND) for n in (1, 2)]
SQUARE = ZoneDraft(name="wet", polygon=((0.0, 4.0), (1.0, 4.0), (1.0, 5.0)))


class Desk:
    """A robot that is ticked by hand, with its store, its editors and its sites."""

    picture: TickSnapshot | None = None
    pose = FRAMES[0].pose
    """T_odom_base of the next tick."""

    def __init__(self, folder: Path) -> None:
        self.store = Store(folder)
        self.store.site.save_beware(RED_LIST)
        navigator = Navigator(
            spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )
        intent = OperatorState(mission=Mission(), beware=RED_LIST)
        self.controller = RobotController(navigator=navigator, profile=HUSKY, intent=intent)
        self.keeper = MapKeeper(self.store.site.map_file, {})
        self.enter_site(self.store.site)
        self.sites = LiveSites(
            self.store,
            controller=self.controller,
            view=self,
            keeper=self.keeper,
            user=self,
            config=MappingConfig(),
            world="hall",
        )
        self._ticks = 0

    @contextmanager
    def leaving_site(self, keep_map: Callable[[], None]) -> Iterator[None]:
        """Hold the edits, those of the zones once the map is kept."""
        with self.beware.retired():
            keep_map()
            with self.zones.retired():
                yield

    def enter_site(self, site: SiteStore) -> None:
        """Edit another site."""
        self.zones = ZoneEditor(self.controller, store=site)
        self.beware = beware_editor(site, holder=self.controller)

    def tick(self) -> None:
        """Run one tick as the think thread does."""
        self._ticks += 1
        frame = dataclasses.replace(FRAMES[0], pose=self.pose, stamp_ns=self._ticks * SECOND)
        forget_frames(self.controller)
        self.controller.think(frame, clock=lambda: frame.stamp_ns)
        self.keeper.note_tick(self.controller.navigator.map, RED_LIST.names, frame.stamp_ns)

    @contextmanager
    def ticking(self) -> Iterator[None]:
        """Tick in a thread during the block."""
        ended = threading.Event()

        def run() -> None:
            while not ended.is_set():
                self.tick()

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def choose(self, name: str) -> None:
        """Enter a site, while ticks go on, and run one more."""
        with self.ticking():
            self.sites.choose(name)
        self.tick()

    @property
    def points(self) -> int:
        """Number of points of the live map."""
        return len(self.controller.navigator.map.points.class_ids)


def points_in(site: SiteStore) -> int:
    return len(map_file.load(site.map_file).state.points.class_ids)
