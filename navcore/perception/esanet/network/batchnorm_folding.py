"""Batch-norm folding: a trained batch norm becomes part of the convolution before it."""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from navcore.perception.esanet.network.model import EsaNet

_PAIRS = (
    *(("conv", "bn"), ("conv1", "bn1"), ("conv2", "bn2"), ("conv3", "bn3")),
    *(("conv1x3_1", "bn1"), ("conv1x3_2", "bn2"), ("0", "1")),
)
"""Names of a convolution and its batch norm within one module (`0`, `1`: a shortcut)."""


def folded(network: EsaNet) -> EsaNet:
    """Return a copy for inference without batch norms, equal up to rounding; the original is not
    changed."""
    copied = copy.deepcopy(network).eval().requires_grad_(False)
    for module in list(copied.modules()):
        for conv_name, norm_name in _PAIRS:
            conv, norm = getattr(module, conv_name, None), getattr(module, norm_name, None)
            if isinstance(conv, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
                module.add_module(conv_name, fuse_conv_bn_eval(conv, norm))
                module.add_module(norm_name, nn.Identity())
    left = [name for name, module in copied.named_modules() if isinstance(module, nn.BatchNorm2d)]
    assert not left, f"batch norms that follow no known convolution: {left}"
    return copied


class FixedPool(nn.Module):
    """Adaptive average pooling for one map size, as two constant matrix products: ONNX has no other
    form where the cells differ in size."""

    rows: Tensor
    cols: Tensor

    def __init__(self, bins: int, height: int, width: int) -> None:
        super().__init__()
        self.register_buffer("rows", _averages(bins, height))
        self.register_buffer("cols", _averages(bins, width).T.contiguous())

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, C, height, width) to (B, C, bins, bins)."""
        return self.rows @ x @ self.cols


def with_fixed_pools(network: EsaNet, height: int, width: int) -> EsaNet:
    """Fix the pooling for maps of (height, width) at 1/32, in place; return the network."""
    for branch in network.context_module.features:
        assert isinstance(branch, nn.Sequential)
        pool = branch[0]
        if isinstance(pool, nn.AdaptiveAvgPool2d) and (
            height % int(pool.output_size) or width % int(pool.output_size)  # type: ignore[arg-type]
        ):
            branch[0] = FixedPool(int(pool.output_size), height, width)  # type: ignore[arg-type]
    return network


def _averages(bins: int, length: int) -> Tensor:
    """Return the weights (bins, length) of torch's adaptive average pooling."""
    weights = torch.zeros(bins, length)
    for k in range(bins):
        first, end = k * length // bins, -(-(k + 1) * length // bins)
        weights[k, first:end] = 1.0 / (end - first)
    return weights
