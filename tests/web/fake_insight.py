"""Diagnostics of the fake robot: real event log, explanation and time series, and one detection."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sized
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.insight.detections import DetectionExtent
from app.insight.event_log import EventLog
from app.insight.explanation import ExplanationQuery, alternative, explain
from app.runtime.record.time_series import COLUMNS, TimeSeries
from navcore.errors import NotKnown
from navcore.geometry.transform import Pose2
from web.images.camera import camera_jpg
from web.interface.insight import (
    Alternative,
    Candidates,
    Explanation,
    LabellingState,
    Sighting,
    Verdict,
)


class FakeInsight:
    """Implementation of `web.interface.insight.Diagnostics`."""

    def __init__(self, case: Callable[[], ExplanationQuery], place: Callable[[], Pose2]) -> None:
        self._case, self._place = case, place
        self.event_log = EventLog(wall_clock=lambda: 1_700_000_000.0)
        self.series = TimeSeries()
        self.taught: list[tuple[str | None, tuple[int, int, int, int] | None]] = []
        self.labelling = FakeLabelling(self.taught)
        self.detections = FakeDetections()
        for second in range(30):
            row = {
                "speed_mps": 0.5,
                "distance_m": 0.5 * second,
                "explored_m2": 2.0 * second,
                "explored_m3": 1.0 * second,
            }
            self.series.add(float(second), {**row, "tick_ms": 20.0 + second % 5})
        assert set(self.series.after(-1.0)) == set(COLUMNS)

    def explain(self) -> Explanation:
        """Implement the port."""
        return explain(self._case())

    def without(self, keys: Collection[str]) -> Alternative:
        """Implement the port."""
        return alternative(self._case(), keys)

    def candidates(self) -> Candidates | None:
        """Return three short primitives, one half blocked, another chosen."""
        pose = self._place()
        along = np.linspace(0.1, 1.6, 16)
        arcs = np.stack(
            [
                np.column_stack([pose.x_m + along, pose.y_m + bend * along**2])
                for bend in (-0.3, 0.0, 0.3)
            ]
        )
        return Candidates(serial=1, arcs=arcs, free=np.array([16, 8, 16]), chosen=2)

    def mark_wrong(self, sighting_id: int, class_name: str | None) -> LabellingState:
        """Implement the port."""
        self.detections.crop(sighting_id)
        self.detections.mark(sighting_id, "wrong")
        self.taught.append((class_name, None))
        return self.labelling.state()

    def snapshot(self) -> int:
        """Return the same id every time."""
        return 7

    def snapshot_image(self, snapshot: int) -> bytes:
        """Return an image with a bright object."""
        if snapshot != 7:
            raise NotKnown("this picture is not held")
        picture = np.full((180, 320, 3), 90, dtype=np.uint8)
        picture[80:140, 130:200] = (240, 200, 40)
        return camera_jpg(picture)

    def add_example(
        self, snapshot: int, class_name: str, box: tuple[int, int, int, int]
    ) -> LabellingState:
        """Implement the port."""
        self.snapshot_image(snapshot)
        self.taught.append((class_name, box))
        return self.labelling.state()


class FakeDetections:
    """Gallery of one cup."""

    def __init__(self) -> None:
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

    def all(self) -> tuple[Sighting, ...]:
        """Implement the port."""
        return (self._sighting,)

    def crop(self, sighting_id: int) -> bytes:
        """Return a grey image."""
        if sighting_id != 1:
            raise NotKnown("nothing was recognised under this id")
        return camera_jpg(np.full((60, 80, 3), 150, dtype=np.uint8))

    def counts(self) -> Mapping[int, int]:
        """Implement the port."""
        return {} if self._sighting.verdict else {3: 1}

    def mark(self, sighting_id: int, verdict: Verdict | None) -> None:
        """Mark the cup."""
        self._sighting = replace(self._sighting, verdict=verdict)

    def drop_image(self) -> None:
        """Keep the whole image of the cup no longer."""
        self._sighting = replace(self._sighting, has_image=False)

    def extent(self, sighting_id: int) -> DetectionExtent:
        """Return the place of the cup."""
        self.crop(sighting_id)
        points = np.array([self._sighting.place])
        return DetectionExtent(sighting=self._sighting, points=points, confidence=0.9)


class FakeLabelling:
    """Folder that counts the corrections."""

    def __init__(self, taught: Sized) -> None:
        self._taught = taught

    def state(self) -> LabellingState:
        """Implement the port."""
        return LabellingState(
            folder=str(Path("data") / "labelling"),
            pictures=len(self._taught),
            bytes_used=250_000 * len(self._taught),
            max_pictures=500,
            max_bytes=500_000_000,
        )
