"""The insight of the fake system: the real log, explanation and table of figures, and one sighting."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.insight.event_log import Journal
from app.insight.explanation import ExplanationQuery, alternative, explained
from app.insight.time_series import COLUMNS, Series
from navcore.errors import NotKnown
from navcore.geometry.transform import Pose2
from web.insight import Alternative, Candidates, Explanation, Kind, LabellingState, Page, Sighting
from web.pictures import camera_jpg


class FakeInsight:
    """Satisfies `web.insight.Insight`."""

    def __init__(self, case: Callable[[], ExplanationQuery], place: Callable[[], Pose2]) -> None:
        self._case, self._place = case, place
        self.log = Journal(wall_clock=lambda: 1_700_000_000.0)
        self.figures = Series()
        self.taught: list[tuple[str | None, tuple[int, int, int, int] | None]] = []
        self._sighting = Sighting(
            id=1,
            class_name="cup",
            class_id=3,
            place=(2.5, 1.0),
            confidence=0.83,
            looks=4,
            first_s=1.0,
            last_s=2.0,
        )
        for second in range(30):
            row = {
                "speed_mps": 0.5,
                "distance_m": 0.5 * second,
                "explored_m2": 2.0 * second,
                "explored_m3": 1.0 * second,
            }
            self.figures.add(float(second), {**row, "tick_ms": 20.0 + second % 5})
        assert set(self.figures.after(-1.0)) == set(COLUMNS)

    def journal(
        self, *, kinds: Collection[Kind], since: int, limit: int, before: int | None = None
    ) -> Page:
        """As the port says."""
        return self.log.page(kinds=kinds, since=since, limit=limit, before=before)

    def explain(self) -> Explanation:
        """As the port says."""
        return explained(self._case())

    def without(self, keys: Collection[str]) -> Alternative:
        """As the port says."""
        return alternative(self._case(), keys)

    def candidates(self) -> Candidates | None:
        """Three short arcs, one of them half blocked, another chosen."""
        pose = self._place()
        along = np.linspace(0.1, 1.6, 16)
        arcs = np.stack(
            [
                np.column_stack([pose.x_m + along, pose.y_m + bend * along**2])
                for bend in (-0.3, 0.0, 0.3)
            ]
        )
        return Candidates(serial=1, arcs=arcs, free=np.array([16, 8, 16]), chosen=2)

    def sightings(self) -> tuple[Sighting, ...]:
        """One cup."""
        return (self._sighting,)

    def sighting_picture(self, sighting_id: int) -> bytes:
        """A grey one."""
        self._expect(sighting_id)
        return camera_jpg(np.full((60, 80, 3), 150, dtype=np.uint8))

    def seen_counts(self) -> Mapping[int, int]:
        """As the port says."""
        return {} if self._sighting.verdict else {3: 1}

    def call_wrong(self, sighting_id: int, class_name: str | None) -> LabellingState:
        """As the port says."""
        self._expect(sighting_id)
        self._sighting = replace(self._sighting, verdict="wrong")
        self.taught.append((class_name, None))
        return self.labelling()

    def snapshot(self) -> int:
        """Always the same."""
        return 7

    def snapshot_picture(self, snapshot: int) -> bytes:
        """A picture with a bright thing in it."""
        if snapshot != 7:
            raise NotKnown("this picture is not held")
        picture = np.full((180, 320, 3), 90, dtype=np.uint8)
        picture[80:140, 130:200] = (240, 200, 40)
        return camera_jpg(picture)

    def add_example(
        self, snapshot: int, class_name: str, box: tuple[int, int, int, int]
    ) -> LabellingState:
        """As the port says."""
        self.snapshot_picture(snapshot)
        self.taught.append((class_name, box))
        return self.labelling()

    def labelling(self) -> LabellingState:
        """As the port says."""
        return LabellingState(
            folder=str(Path("data") / "labelling"),
            pictures=len(self.taught),
            bytes_used=250_000 * len(self.taught),
            max_pictures=500,
            max_bytes=500_000_000,
        )

    def series(self, since_s: float) -> Mapping[str, list[float | None]]:
        """As the port says."""
        return self.figures.after(since_s)

    def _expect(self, sighting_id: int) -> None:
        if sighting_id != 1:
            raise NotKnown("nothing was recognised under this id")
