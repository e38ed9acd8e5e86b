"""Quantisation to eight bits: convolutions with non-negative inputs run on bytes, where an engine
has kernels for them.

The value range of a byte is measured on images beforehand (`weights quantise`) and stored in the
card of the weights; kernels have one scale per output channel (Jacob et al., CVPR 2018). Inputs
that may be negative (the images, the decoder's sums) keep their precision: they take little of the
time and cause most of the error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.errors import BadConfiguration
from navcore.perception.esanet.network.batchnorm_folding import folded
from navcore.perception.esanet.network.model import EsaNet

KEPT = 0.9999
"""Share of a convolution's inputs in one image that its range covers; larger ones are clipped."""
_BYTE, _SIGNED_LOW, _SIGNED_HIGH = 255, -128, 127


class ByteConvolution(nn.Module):
    """A convolution whose inputs and kernels are rounded to bytes; exported to ONNX, engines
    compute it on bytes."""

    kernel_scales: Tensor
    kernel_zeros: Tensor

    def __init__(self, convolution: nn.Conv2d, most: float) -> None:
        """Quantise a convolution for inputs from 0 to `most`."""
        super().__init__()
        self.convolution, self.scale = convolution, most / _BYTE
        largest = convolution.weight.detach().abs().amax(dim=(1, 2, 3)).clamp(min=1e-9)
        self.register_buffer("kernel_scales", largest / _SIGNED_HIGH)
        self.register_buffer("kernel_zeros", torch.zeros(len(largest), dtype=torch.int32))

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, Cin, H, W) to (B, Cout, H, W)."""
        convolution = self.convolution
        inputs = torch.fake_quantize_per_tensor_affine(x, self.scale, 0, 0, _BYTE)
        kernel = torch.fake_quantize_per_channel_affine(
            convolution.weight, self.kernel_scales, self.kernel_zeros, 0, _SIGNED_LOW, _SIGNED_HIGH
        )
        # All paddings of an ESANet are zeros, equal on both sides.
        padding = tuple(int(side) for side in convolution.padding)
        return functional.conv2d(inputs, kernel, convolution.bias, convolution.stride, padding)


def measured_ranges(network: EsaNet, images: Iterable[tuple[Tensor, Tensor]]) -> tuple[float, ...]:
    """Return the largest input of each convolution (in module order) on the images, up to `KEPT`.

    0 for convolutions that are not quantised: with a negative input somewhere, with means of the
    whole image as input, or that did not run. `images` are normalised rgb (1, 3, h, w) and depth
    (1, 1, h, w).
    """
    copied = folded(network)
    found = convolutions(copied)
    least, most = [0.0] * len(found), [0.0] * len(found)

    def measure(index: int, x: Tensor) -> None:
        if x.shape[2:] == (1, 1):
            return
        least[index] = min(least[index], float(x.min()))
        beyond = max(1, round(x.numel() * (1 - KEPT)))
        most[index] = max(most[index], float(torch.topk(x.flatten(), beyond).values[-1]))

    for index, (_, convolution) in enumerate(found):
        convolution.register_forward_pre_hook(lambda _, inputs, at=index: measure(at, inputs[0]))
    with torch.inference_mode():
        for rgb, depth in images:
            copied(rgb, depth)
    return tuple(0.0 if low < 0 else high for low, high in zip(least, most, strict=True))


def quantised(network: EsaNet, ranges: Sequence[float]) -> EsaNet:
    """Return a copy for inference, batch norms folded, with byte convolutions where there is a
    range for them.

    Raises `BadConfiguration` if the ranges belong to another network.
    """
    copied = folded(network)
    found = convolutions(copied)
    if len(ranges) != len(found):
        raise BadConfiguration(
            f"weights: {len(ranges)} ranges for {len(found)} convolutions; quantise them again"
        )
    for (name, convolution), most in zip(found, ranges, strict=True):
        if most > 0:
            parent, _, leaf = name.rpartition(".")
            copied.get_submodule(parent).add_module(leaf, ByteConvolution(convolution, most))
    return copied


def convolutions(network: EsaNet) -> list[tuple[str, nn.Conv2d]]:
    """Return the names and modules of the convolutions that mix channels."""
    return [
        (name, module)
        for name, module in network.named_modules()
        if isinstance(module, nn.Conv2d) and module.groups == 1
    ]
