"""ESANet: RGB-D semantic segmentation (Seichter et al. 2021), compatible with the official
repository's checkpoints.

The network loads on first use, and torch with it: a program that runs it on another engine does
without the memory of torch.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from navcore.perception.esanet.network.model import EsaNet, build

__all__ = ["EsaNet", "build"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("navcore.perception.esanet.network.model"), name)
