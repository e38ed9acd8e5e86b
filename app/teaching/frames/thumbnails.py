"""Near-duplicates among captured frames, by pose and image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.teaching.frames.rules import CaptureRules
from navcore.geometry.transform import Pose2, wrap_angle

SIZE = (32, 18)
"""Columns and rows of a thumbnail."""
Thumbnail = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fingerprint:
    """What is compared of a frame."""

    pose: Pose2 | None
    """Pose of the robot in the map frame; None where it is not known."""
    thumbnail: Thumbnail
    """(18, 32) grey values of the reduced image."""


def thumbnail_of(rgb: npt.NDArray[np.uint8]) -> Thumbnail:
    """Return the (18, 32) grey thumbnail of an (H, W, 3) image."""
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.resize(grey, SIZE, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def is_near_duplicate(one: Fingerprint, other: Fingerprint, rules: CaptureRules) -> bool:
    """Return whether two frames show the same: like images from poses that are near, or nearly the
    same image from anywhere."""
    difference = float(
        np.abs(one.thumbnail.astype(np.int16) - other.thumbnail.astype(np.int16)).mean()
    )
    if difference < rules.same:
        return True
    if one.pose is None or other.pose is None or difference >= rules.alike:
        return False
    return (
        one.pose.distance_to(other.pose.x_m, other.pose.y_m) < rules.step_m
        and abs(wrap_angle(one.pose.yaw_rad - other.pose.yaw_rad)) < rules.step_rad
    )


def near_duplicates(fingerprints: Mapping[str, Fingerprint], rules: CaptureRules) -> list[set[str]]:
    """Return the groups of two or more frames that show the same, by name; one that is like two
    frames joins their groups."""
    names, group_of = list(fingerprints), dict[str, set[str]]()
    grey = np.array([one.thumbnail.ravel() for one in fingerprints.values()], dtype=np.int16)
    for i, name in enumerate(names):
        group = {name}
        differences = np.abs(grey[:i] - grey[i]).mean(axis=1)
        for j in np.flatnonzero(differences < max(rules.same, rules.alike)):
            if is_near_duplicate(fingerprints[name], fingerprints[names[j]], rules):
                group |= group_of[names[j]]
        group_of.update(dict.fromkeys(group, group))
    groups = {id(group): group for group in group_of.values()}
    return [group for group in groups.values() if len(group) > 1]
