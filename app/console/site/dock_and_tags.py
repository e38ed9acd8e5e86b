"""Dock and tags of a site: stored, told to the robot, and found in what it sees."""

from __future__ import annotations

import dataclasses

import numpy as np

from app.console.site.site_archive import FURNISHINGS, furnishings_of
from app.storage.site_store import SiteStore
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.localisation.fixes import MappedTag, TagMap, tag_map, tag_seen
from navcore.navigator import TickResult
from navcore.perception.tags import detect_tags
from web.interface.sites import SeenTag, Tag

Dock = Pose2 | None
"""Pose of the robot in its dock, map frame; None without a dock."""
Tags = tuple[Tag, ...]
"""Tags of a site."""


def furnish(site: SiteStore, dock: Dock, tags: Tags) -> None:
    """Set dock and tags of a site, unchecked: what is stored already may be beyond the limits of
    what is new."""
    record = {
        "dock": None if dock is None else dataclasses.asdict(dock),
        "tags": [dataclasses.asdict(tag) for tag in tags],
    }
    site.save_document(*FURNISHINGS, record)


def stored_tags(site: SiteStore) -> tuple[Tag, ...]:
    """Return the tags of a site as they are stored."""
    return tuple(Tag(**tag) for tag in furnishings_of(site)["tags"])


def with_tag(tags: Tags, tag: Tag) -> Tags:
    """Return tags with one more, in the place of that of its number, by number."""
    return tuple(sorted((*without_tag(tags, tag.id), tag), key=lambda one: one.id))


def without_tag(tags: Tags, number: int) -> Tags:
    """Return tags without the one of a number."""
    return tuple(tag for tag in tags if tag.id != number)


def tags_of(site: SiteStore) -> TagMap:
    """Return the tags of a site as the robot is told of them."""
    return tag_map(
        MappedTag(
            id=tag.id,
            pose=Pose2(x_m=tag.x_m, y_m=tag.y_m, yaw_rad=tag.yaw_rad),
            size_m=tag.size_m,
            covariance=np.diag([tag.sigma_m, tag.sigma_m, tag.sigma_rad]) ** 2,
        )
        for tag in stored_tags(site)
    )


def dock_of(site: SiteStore) -> Pose2 | None:
    """Return T_map_base of the robot in the dock of a site; None without a dock."""
    dock = furnishings_of(site)["dock"]
    return None if dock is None else Pose2(**dock)


def seen_tags(decision: TickResult | None, size_m: float, known: TagMap) -> tuple[SeenTag, ...]:
    """Return the tags in the image of a tick, with squares of one size, by number.

    Raises `Refused` while the robot does not know where it is.
    """
    if decision is None or not decision.place.is_known:
        raise Refused("the robot does not know where it is; show it its place first")
    place = decision.place
    return tuple(
        SeenTag(
            tag=_tag_of(tag_seen(one, size_m, place.T_map_base, place.covariance), one.z_m),
            known=one.id in known.tags,
        )
        for one in detect_tags(decision.frame, lambda number: size_m)
    )


def _tag_of(tag: MappedTag, z_m: float) -> Tag:
    """Return a tag that was seen, its uncertainty within the bounds of what is stored."""
    along = float(np.sqrt(np.linalg.eigvalsh(tag.covariance[:2, :2])[-1]))
    return Tag(
        id=tag.id,
        x_m=round(tag.pose.x_m, 3),
        y_m=round(tag.pose.y_m, 3),
        z_m=round(z_m, 3),
        yaw_rad=round(tag.pose.yaw_rad, 4),
        size_m=tag.size_m,
        sigma_m=round(min(max(along, 0.001), 10.0), 4),
        sigma_rad=round(min(max(float(np.sqrt(tag.covariance[2, 2])), 0.001), 3.2), 4),
    )
