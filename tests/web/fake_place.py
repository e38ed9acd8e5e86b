"""Where the small robot behind the console is, as its operator checks and sets it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationState
from navcore.mission.mission import Phase
from web.interface.localisation import PlaceCheck, PlaceOut


class FakePlace:
    """Implementation of `web.interface.localisation.PlaceEdits`: every pose left of x = 0 fits."""

    def __init__(self, move_to: Callable[[Pose2], None], phase: Callable[[], Phase]) -> None:
        self._move_to, self._phase = move_to, phase
        self.now = PlaceOut(state=LocalisationState.LOCATED, text="Located.", match_share=0.9)

    def status(self) -> PlaceOut:
        """Implement the port."""
        return self.now

    def check(self, pose: Pose2) -> PlaceCheck:
        """Implement the port."""
        fits = pose.x_m < 0
        return PlaceCheck(
            pose=pose,
            match_share=0.9 if fits else 0.2,
            fits=fits,
            text="fits" if fits else "does not fit",
            scan=np.array([[pose.x_m + 1.0, pose.y_m]]),
        )

    def place(self, pose: Pose2, *, force: bool) -> PlaceCheck:
        """Implement the port."""
        if self._phase() is Phase.DRIVING:
            raise Refused("the robot drives; pause the mission first")
        found = self.check(pose)
        if not found.fits and not force:
            raise Refused(found.text)
        self._move_to(found.pose)
        return found

    def search(self) -> None:
        """Implement the port."""
        self.now = dataclasses.replace(self.now, searching=True)
