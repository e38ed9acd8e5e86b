"""What a class of the beware list looks like by a few clicks, for comparison with every frame."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged

MAX_CHANNELS = 512
"""Largest number of channels of a prototype."""
COLOUR_CHANNELS = 3
"""Number of channels of colour behind those of the network: CIE L*, a* and b*."""
LARGEST = 1e6
"""Largest magnitude of a weight or a score."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prototype:
    """A class by example: where it lies among the features of a network and the colours, a score
    that tells it from the background, and the size that its regions have.

    Channels are those of the network's features, then L*, a* and b*.
    """

    network: str
    """Identity of the network whose features these are; another one cannot use them."""
    centre: tuple[float, ...] = ranged(-LARGEST, LARGEST)
    """Mean of each channel over the clicked cells."""
    spread: tuple[float, ...] = ranged(1e-6, LARGEST)
    """Standard deviation that each channel may have about the centre."""
    radius: float = ranged(0.0, LARGEST)
    """Largest mean square of the deviations from the centre, each divided by its spread."""
    weights: tuple[float, ...] = ranged(-LARGEST, LARGEST)
    """Weight of each channel in the score."""
    threshold: float = ranged(-LARGEST, LARGEST)
    """Score from which a pixel may belong to the class; confidence 0.5."""
    typical: float = ranged(-LARGEST, LARGEST)
    """Score of a typical pixel of the class; above the threshold."""
    max_size_m: float = ranged(0.01, 10.0)
    """Largest extent of a region across the line of sight, metres."""
    min_height_m: float = ranged(0.0, 5.0)
    """Least height of the top of a region above the floor, metres."""
    max_height_m: float = ranged(0.01, 5.0)
    """Largest height of a pixel above the floor, metres."""
    clicks: int = ranged(1, 100)
    """Number of clicks that it was made of."""

    def __post_init__(self) -> None:
        lengths = {len(values) for values in (self.centre, self.spread, self.weights)}
        if len(lengths) > 1 or not COLOUR_CHANNELS < len(self.weights) <= MAX_CHANNELS:
            raise BadConfiguration(
                "centre, spread and weights: expected one number a channel in each, for "
                f"{COLOUR_CHANNELS + 1} to {MAX_CHANNELS} channels"
            )
        if self.typical <= self.threshold:
            raise BadConfiguration(
                f"typical {self.typical:g} has to be above threshold {self.threshold:g}"
            )
        if not self.network.isalnum() or len(self.network) > 64:
            raise BadConfiguration("network: expected 1 to 64 letters and digits")
