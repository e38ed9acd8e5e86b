"""Classes by example in the console: clicks into the camera image, and what is made of them."""

from __future__ import annotations

import secrets
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from app.console.beware.recent_frames import RecentFrame, RecentFrames
from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.errors import Refused
from navcore.geometry.arrays import Bools, FloatImage
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareList
from navcore.mission.prototype import Prototype
from navcore.perception.labels import Labels
from navcore.perception.prototype import (
    Example,
    background_of,
    example_of,
    fitted,
    prototype_pixels,
)
from navcore.perception.region_growing import object_at
from navcore.robot.frame import Frame
from web.interface.beware import ExampleClick, RecentLook

MAX_CLICKS = 64
"""Largest number of clicks that are kept; the oldest are forgotten."""
MAX_FRAMES = 12
"""Largest number of frames that serve as background, and whose descriptors are kept (about 3 MB
each)."""
KNOWN_SHARE = 0.5
"""Share of what was clicked from which a class that already labels it is named."""
NO_NETWORK = (
    "only colour rules run here, no network whose features could be compared; make a colour rule, "
    "or start with a network"
)


class Describer(Protocol):
    """A network with features; `NetworkSegmenter` is one."""

    identity: str
    """Identity of the network in prototypes."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the labels of a frame."""

    def described(self, frame: Frame) -> FloatImage:
        """Return the (h, w, D) descriptors of a frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Click:
    """A click and what it has taken."""

    recent: RecentFrame
    pixels: Bools
    """(H, W) pixels of the thing."""


class LiveExamples:
    """Satisfies the console's port `Examples`. Safe from any thread."""

    def __init__(
        self,
        recent: RecentFrames,
        network: Callable[[], Describer | None],
        *,
        poses: Callable[[], Sequence[Pose2]],
        config: PerceptionConfig = DEFAULT_PERCEPTION,
    ) -> None:
        """`network` gives the network in use, one for this object alone; None where none runs.
        `poses` gives those of the map by pose ID."""
        self._recent, self._network = recent, network
        self._poses, self._config = poses, config
        self._clicks: OrderedDict[str, _Click] = OrderedDict()
        self._described: OrderedDict[tuple[str, int], FloatImage] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def hindrance(self) -> str | None:
        """Why no class can be made by example here; None where it can."""
        return NO_NETWORK if self._network() is None else None

    def click(
        self, right: float, down: float, beware: BewareList, *, frame: str | None = None
    ) -> ExampleClick:
        """Return what a click takes in the newest image, or in a kept one."""
        self._required()
        one = self._recent.named(frame)
        height, width = one.frame.depth_m.shape
        row, col = min(int(down * height), height - 1), min(int(right * width), width - 1)
        pixels = object_at(one.frame, row, col, self._config.prototype)
        self._check_unknown(one.frame, beware, pixels)
        key = secrets.token_hex(8)
        with self._lock:
            self._clicks[key] = _Click(recent=one, pixels=pixels)
            while len(self._clicks) > MAX_CLICKS:
                self._clicks.popitem(last=False)
        return ExampleClick(key=key, frame=one.name, mask=pixels)

    def made(self, taken: Sequence[str], away: Sequence[str] = ()) -> Prototype:
        """Return the prototype of what some clicks have taken without what others have."""
        network, config = self._required(), self._config.prototype
        clicks, without = [self._click(key) for key in taken], [self._click(key) for key in away]
        examples = []
        for click in clicks:
            pixels = click.pixels.copy()
            for other in without:
                if other.recent is click.recent:
                    pixels &= ~other.pixels
            examples.append(self._example(click, pixels))
        frames = [click.recent for click in clicks]
        frames += [one for one in self._spread() if one not in frames]
        background = [
            background_of(frame, self.described(frame), examples, config)
            for frame in map(self._placed, frames)
        ]
        apart = [self._example(click, click.pixels) for click in without]
        return fitted(network.identity, examples, np.concatenate(background), config, away=apart)

    def looks(self, prototype: Prototype, at_most: int) -> Sequence[RecentLook]:
        """Return what a prototype takes in the newest image and in older ones, evenly chosen."""
        network = self._required()
        newest = self._recent.named(None)
        if prototype.network != network.identity:
            raise Refused("the class was made with another network; click the thing again")
        older = [one for one in self._spread() if one is not newest]
        step = max(1, -(-len(older) // max(at_most - 1, 1)))
        return [
            RecentLook(
                rgb=one.frame.rgb,
                mask=self.pixels(one.frame, prototype),
                age_s=(newest.frame.stamp_ns - one.frame.stamp_ns) / 1e9,
                frame=one.name,
            )
            for one in (newest, *older[::step][: at_most - 1])
        ]

    def pixels(self, frame: Frame, prototype: Prototype) -> Bools:
        """Return the (H, W) pixels of a frame that belong to a prototype."""
        return prototype_pixels(frame, self.described(frame), prototype, self._config.prototype)[0]

    def described(self, frame: Frame) -> FloatImage:
        """Return the descriptors of a frame, computed once for each of the newest frames."""
        network = self._required()
        key = (network.identity, frame.stamp_ns)
        with self._lock:
            known = self._described.get(key)
            if known is None:
                known = self._described[key] = network.described(frame).astype(np.float16)
                while len(self._described) > 2 * MAX_FRAMES:
                    self._described.popitem(last=False)
            self._described.move_to_end(key)
        return np.asarray(known, dtype=np.float32)

    def spread(self) -> Sequence[RecentFrame]:
        """Return some of the frames of the last minutes, evenly chosen, newest first."""
        return self._spread() if self._network() is not None else []

    def _spread(self) -> list[RecentFrame]:
        # Those that are kept for long, or the descriptors of each new frame would be computed.
        kept = self._recent.kept
        return list(kept[:: max(1, -(-len(kept) // MAX_FRAMES))])

    def _required(self) -> Describer:
        network = self._network()
        if network is None:
            raise Refused(NO_NETWORK)
        return network

    def _click(self, key: str) -> _Click:
        with self._lock:
            if key not in self._clicks:
                raise Refused("a click has been forgotten meanwhile; click the thing again")
            return self._clicks[key]

    def _placed(self, one: RecentFrame) -> Frame:
        """Return a frame at the present pose of its ID; as it was taken on another map."""
        poses = self._poses()
        return one.placed(poses) if one.pose_id < len(poses) else one.frame

    def _example(self, click: _Click, pixels: Bools) -> Example:
        frame = self._placed(click.recent)
        return example_of(frame, self.described(frame), pixels, self._config.prototype)

    def _check_unknown(self, frame: Frame, beware: BewareList, pixels: Bools) -> None:
        """Raise `Refused` where a class of the list already labels half of some (H, W) pixels."""
        with self._lock:
            labels = self._required().segment(frame, beware)
        for entry in beware.classes:
            shares = [
                ((one.class_ids == entry.class_id) & (one.confidence >= entry.min_confidence))[
                    pixels
                ].mean()
                for one in labels.all_hypotheses
            ]
            if max(shares) < KNOWN_SHARE:
                continue
            if entry.class_id in beware.people_ids:
                raise Refused("that is a person; people are kept clear of anyway")
            more = "" if entry.enabled else "; it is switched off: switch it on in the list"
            raise Refused(f"that is a “{entry.title}” already{more}")
