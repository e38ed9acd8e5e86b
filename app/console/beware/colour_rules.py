"""Colour rules from clicks into the camera image, tried on the frames of the last minutes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from app.console.beware.recent_frames import RecentFrames
from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools
from navcore.mission.beware_list import BewareClass, ColourRule
from navcore.perception.colour_rule import rule_at
from navcore.perception.colour_segmenter import colour_masks, matches_colour
from navcore.perception.depth_filter import heights_above_floor
from navcore.robot.frame import Frame
from web.interface.beware import RecentLook


class LiveColourRules:
    """Satisfies the console's port `ColourRules`."""

    def __init__(self, recent: RecentFrames, config: PerceptionConfig = DEFAULT_PERCEPTION) -> None:
        self._recent, self._config = recent, config

    def proposed(self, right: float, down: float, *, frame: str | None = None) -> ColourRule:
        """Return the rule for what is at a position in the newest image, or in a named one."""
        picture = self._recent.named(frame).frame
        height, width = picture.depth_m.shape
        return rule_at(
            min(int(down * height), height - 1),
            min(int(right * width), width - 1),
            rgb=picture.rgb,
            heights_m=heights_above_floor(picture),
            config=self._config.colour_picking,
        )

    def looks(self, rule: ColourRule, at_most: int) -> Sequence[RecentLook]:
        """Return what a rule takes in the newest image and in older ones, evenly chosen."""
        recent = self._recent.all
        step = max((len(recent) - 1) / max(at_most - 1, 1), 1.0)
        chosen = [recent[round(step * i)] for i in range(at_most) if round(step * i) < len(recent)]
        return [
            RecentLook(
                rgb=one.frame.rgb,
                mask=self._taken(one.frame, rule),
                age_s=(recent[0].frame.stamp_ns - one.frame.stamp_ns) / 1e9,
                frame=one.name,
            )
            for one in chosen
        ]

    def check(self, entries: Iterable[BewareClass]) -> None:
        """Raise `BadConfiguration` for an entry whose colour rule takes half of all pixels of the
        last minutes: it would mark the whole floor."""
        frames = [one.frame for one in self._recent.all]
        most = self._config.colour_picking.max_share
        for entry in entries:
            if entry.colour is None or not frames:
                continue
            # Most rules are told apart by their colour alone, without heights.
            colour = sum(matches_colour(frame.rgb, entry.colour).mean() for frame in frames)
            if colour / len(frames) < most:
                continue
            share = sum(self._taken(frame, entry.colour).mean() for frame in frames) / len(frames)
            if share >= most:
                raise BadConfiguration(
                    f"the colour rule of “{entry.title}” takes {share:.0%} of all pixels of the "
                    "last images; narrow its ranges of hue, saturation or brightness"
                )

    def _taken(self, frame: Frame, rule: ColourRule) -> Bools:
        """Return the (H, W) pixels that a rule takes, whatever their region's size."""
        entry = BewareClass(name="rule", class_id=1, colour=rule)
        masks = colour_masks(frame, heights_above_floor(frame), [entry], self._config)
        return masks[0][1] if masks else np.zeros(frame.depth_m.shape, dtype=np.bool_)
