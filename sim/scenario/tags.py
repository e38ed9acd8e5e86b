"""Fiducial markers of a world: printed AprilTags on plates that stand upright."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from navcore.config.localisation.tags import LARGEST_TAG
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.localisation.fixes import MappedTag, TagMap, tag_map
from navcore.toml_config import ranged
from sim.models.solids import FARTHEST_M, facing_quaternion

SURVEY_M, SURVEY_RAD = 0.01, math.radians(1.0)
"""Standard errors with which the pose of a tag is told: as a person measures it with a tape."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """An AprilTag on a white plate without thickness, upright: on a wall half the thickness of the
    wall and a centimetre off its line."""

    id: int = ranged(0, LARGEST_TAG)
    """Number of the tag in its family."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Position of the middle, x and y in metres."""
    yaw_deg: float = ranged(-360.0, 360.0)
    """Direction that the tag faces, counter-clockwise from x of the map."""
    height_m: float = ranged(0.0, 5.0, default=0.6)
    """Height of the middle above the ground."""
    size_m: float = ranged(0.05, 2.0, default=0.3)
    """Side of the black square; the plate is a quarter wider."""
    family: Literal["36h11"] = "36h11"
    """Family of the tag."""

    def turn(self) -> list[float]:
        """Return the quaternion x, y, z, w of the plate in the map frame: its x to the right of the
        observer, y upwards, z towards the observer."""
        return facing_quaternion(math.radians(self.yaw_deg))


def check_tags(tags: Sequence[Tag], where: str) -> None:
    """Raise `BadConfiguration`, which names the key, for two tags of one number."""
    seen: dict[int, int] = {}
    for i, tag in enumerate(tags):
        if tag.id in seen:
            raise BadConfiguration(
                f"{where}.tags[{i}].id: {tag.id} is that of tags[{seen[tag.id]}] too; "
                "a robot could not tell them apart"
            )
        seen[tag.id] = i


def given_tags(tags: Sequence[Tag]) -> TagMap:
    """Return the tags of a world as a robot is told of them: where they are in the map, to 1 cm and
    1°."""
    return tag_map(
        MappedTag(
            id=tag.id,
            pose=Pose2(x_m=tag.at[0], y_m=tag.at[1], yaw_rad=math.radians(tag.yaw_deg)),
            size_m=tag.size_m,
            covariance=np.diag([SURVEY_M, SURVEY_M, SURVEY_RAD]) ** 2,
        )
        for tag in tags
    )
