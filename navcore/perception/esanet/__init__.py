"""ESANet: RGB-D semantic segmentation (Seichter et al. 2021), compatible with the official
repository's checkpoints."""

from navcore.perception.esanet.network.model import EsaNet, build

__all__ = ["EsaNet", "build"]
