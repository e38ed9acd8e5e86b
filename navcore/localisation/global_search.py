"""The search of the place in the whole map beside the ticks: what is asked for, and which answers
count."""

from __future__ import annotations

from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.relocalisation import (
    PlaceProposal,
    Relocaliser,
    SearchResult,
    SearchTask,
)
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tasks import PrepareSearch, SearchPlaces


class GlobalSearch:
    """Gathers scans while it is followed, and compares them with the map.

    An answer comes some frames after it was asked for. Where the robot has been placed elsewhere
    meanwhile, or its scans were forgotten, it tells nothing.
    """

    def __init__(self, config: RelocalisationConfig) -> None:
        """Begin without a map and without any scan."""
        self._config = config
        self._place_map: PlaceMap | None = None
        self._relocaliser: Relocaliser | None = None
        self._asked: SearchTask | None = None
        """The newest search under way; None where its answer does not count."""
        self._outdated: SearchTask | None = None
        """The search under way whose answer does not count."""
        self._put_off_m = 0.0
        self.has_asked = False
        """Whether anything was asked for in this map."""

    @property
    def proposal(self) -> PlaceProposal | None:
        """What is known of the place; None while no scan is gathered."""
        return None if self._relocaliser is None else self._relocaliser.proposal

    @property
    def is_put_off(self) -> bool:
        """Whether the last search has failed, and the robot has not moved enough since."""
        return self._put_off_m > 0.0

    def follow(self, scan: Scan | None, T_odom_base: Pose2, seen_s: float) -> None:
        """Take one more scan with the odometry of its moment. `seen_s`: time in seconds before it
        that it may tell of."""
        if self._relocaliser is None and self._place_map is not None:
            self._relocaliser = Relocaliser(self._place_map, self._config)
        if self._relocaliser is not None and scan is not None:
            self._relocaliser.observe(scan, T_odom_base, seen_s)

    def next_task(
        self, searched: ScanMap, *, given: Pose2 | None, last: Pose2 | None
    ) -> PrepareSearch | SearchPlaces | None:
        """Return what to compute in a map; None for nothing. `given` and `last`: T_map_odom of a
        place to be checked beside, and of the one that was believed last."""
        if self.is_put_off:
            return None
        self.has_asked = True
        if self._place_map is None:
            return PrepareSearch.of(searched, self._config)
        task = None if self._relocaliser is None else self._relocaliser.next_task(given, last)
        if task is None:
            return None
        self._asked = task
        return SearchPlaces(task=task, place_map=self._place_map, config=self._config)

    def take_map(self, place_map: PlaceMap) -> None:
        """Receive the search tables of the map."""
        self._place_map = place_map

    def take(self, result: SearchResult) -> bool:
        """Receive the answer to a search; return whether it counts."""
        if result.task is self._outdated:
            return False
        if self._relocaliser is not None:
            self._relocaliser.take(result)
        return True

    def is_newest(self, result: SearchResult) -> bool:
        """Whether a result answers the newest search."""
        return result.task is self._asked

    def put_off(self) -> None:
        """Ask for nothing until the robot has moved: the last search has failed."""
        self._put_off_m = self._config.search_m

    def move(self, distance_m: float) -> None:
        """Note how far the robot has moved; a turn by 1 rad counts as 0.5 m."""
        self._put_off_m -= distance_m

    def retry(self) -> None:
        """Search also where the last search has failed."""
        self._put_off_m = 0.0

    def reconsider(self) -> None:
        """Believe nothing yet of what was found, and go on with the same scans."""
        if self._relocaliser is not None:
            self._relocaliser = self._relocaliser.reconsidered()

    def forget_scans(self) -> None:
        """Gather scans from here on alone."""
        self._relocaliser = None

    def forget_answer(self) -> None:
        """Take no answer to the search under way: it is about another place, or other scans."""
        self._outdated, self._asked = self._asked or self._outdated, None

    def restart(self) -> None:
        """Search afresh: what was seen and asked before tells nothing of where the robot is."""
        self.forget_scans()
        self.forget_answer()

    def forget_map(self) -> None:
        """Make the tables again before the next search: the map has changed."""
        self._place_map = None

    def begin_map(self) -> None:
        """Begin in another map."""
        self.restart()
        self.forget_map()
        self.retry()
        self.has_asked = False
