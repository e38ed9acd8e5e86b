"""Eight bits: convolutions of what a ReLU lets through work on bytes, where an engine has kernels
for them.

A byte stands for a range of values that was measured on pictures beforehand (`weights quantise`)
and is kept on the card of the weights; kernels get one scale per channel out (Jacob et al., CVPR
2018). What may be negative (the pictures, the decoder's sums) stays as it is: it takes little of
the time and most of the harm.
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
"""Share of a convolution's inputs in one picture that its range holds; the few beyond it are cut
off."""
_BYTE, _SIGNED_LOW, _SIGNED_HIGH = 255, -128, 127


class ByteConvolution(nn.Module):
    """A convolution whose inputs and kernels are rounded to bytes; exported to ONNX, engines
    compute it on bytes."""

    kernel_scales: Tensor
    kernel_zeros: Tensor

    def __init__(self, convolution: nn.Conv2d, most: float) -> None:
        """Inputs from 0 to `most`."""
        super().__init__()
        self.convolution, self.scale = convolution, most / _BYTE
        largest = convolution.weight.detach().abs().amax(dim=(1, 2, 3)).clamp(min=1e-9)
        self.register_buffer("kernel_scales", largest / _SIGNED_HIGH)
        self.register_buffer("kernel_zeros", torch.zeros(len(largest), dtype=torch.int32))

    def forward(self, x: Tensor) -> Tensor:
        """(B, Cin, H, W) → (B, Cout, H, W)."""
        convolution = self.convolution
        inputs = torch.fake_quantize_per_tensor_affine(x, self.scale, 0, 0, _BYTE)
        kernel = torch.fake_quantize_per_channel_affine(
            convolution.weight, self.kernel_scales, self.kernel_zeros, 0, _SIGNED_LOW, _SIGNED_HIGH
        )
        # Every padding of an ESANet is one of zeros, and the same on both sides.
        padding = tuple(int(side) for side in convolution.padding)
        return functional.conv2d(inputs, kernel, convolution.bias, convolution.stride, padding)


def measured_ranges(
    network: EsaNet, pictures: Iterable[tuple[Tensor, Tensor]]
) -> tuple[float, ...]:
    """The largest input of each convolution (in the order of the modules) on these pictures, as far
    as `KEPT` goes.

    0 for those that stay as they are: whose inputs were negative somewhere, or are means of the
    whole picture, or that did not run. `pictures` are normalised (rgb (1, 3, h, w), depth (1, 1, h,
    w)).
    """
    fresh = folded(network)
    found = convolutions(fresh)
    least, most = [0.0] * len(found), [0.0] * len(found)

    def look(index: int, x: Tensor) -> None:
        if x.shape[2:] == (1, 1):
            return
        least[index] = min(least[index], float(x.min()))
        beyond = max(1, round(x.numel() * (1 - KEPT)))
        most[index] = max(most[index], float(torch.topk(x.flatten(), beyond).values[-1]))

    for index, (_, convolution) in enumerate(found):
        convolution.register_forward_pre_hook(lambda _, inputs, at=index: look(at, inputs[0]))
    with torch.inference_mode():
        for rgb, depth in pictures:
            fresh(rgb, depth)
    return tuple(0.0 if low < 0 else high for low, high in zip(least, most, strict=True))


def quantised(network: EsaNet, ranges: Sequence[float]) -> EsaNet:
    """A copy for inference, batch norms folded, its convolutions on bytes where there is a range
    for them.

    Raises `BadConfiguration` where the ranges are not this network's.
    """
    fresh = folded(network)
    found = convolutions(fresh)
    if len(ranges) != len(found):
        raise BadConfiguration(
            f"weights: {len(ranges)} ranges for {len(found)} convolutions; quantise them again"
        )
    for (name, convolution), most in zip(found, ranges, strict=True):
        if most > 0:
            parent, _, leaf = name.rpartition(".")
            fresh.get_submodule(parent).add_module(leaf, ByteConvolution(convolution, most))
    return fresh


def convolutions(network: EsaNet) -> list[tuple[str, nn.Conv2d]]:
    """Those that mix channels."""
    return [
        (name, module)
        for name, module in network.named_modules()
        if isinstance(module, nn.Conv2d) and module.groups == 1
    ]
