"""The numbers of the official repository, and the rule by which its network and inputs were filled
to get them.

The data are not part of this repository (`../shared/data/esanet`); tests of them are skipped where
they are missing, unless continuous integration promises them.
"""

from __future__ import annotations

import copy
import functools
import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from navcore.perception.esanet import EsaNet, build
from tests.shared_data import beside

DATA = Path(__file__).parents[5] / "shared" / "data" / "esanet"
SEED = 20261120
OFFICIAL = {"r18": "r18_basic", "r18-nbt1d": "r18_nbt1d", "r34-nbt1d": "r34_nbt1d"}
"""What the golden files call our variants."""
Array = npt.NDArray[Any]


def data_file(name: str) -> Path:
    return beside(DATA / name, "the official network's numbers are")


def arrays(name: str) -> dict[str, Array]:
    """All arrays of an .npz file."""
    with np.load(data_file(name)) as opened:
        return {key: opened[key] for key in opened.files}


def table(name: str) -> Any:
    """A JSON file."""
    return json.loads(data_file(name).read_text())


def uniform(key: str, count: int, *, seed: int = SEED) -> npt.NDArray[np.float64]:
    """(count,) numbers in [0, 1) that depend on nothing but seed and key."""
    bits = np.random.PCG64(np.random.SeedSequence([seed, zlib.crc32(key.encode())]))
    return (bits.random_raw(count) >> np.uint64(11)).astype(np.float64) * 2.0**-53


def fill(key: str, shape: tuple[int, ...]) -> Tensor:
    """The filled tensor of that key of the state dict."""
    if key.endswith("num_batches_tracked"):
        return torch.tensor(1000)
    u = uniform(key, math.prod(shape))
    if key.endswith(("running_mean", "bias")):
        u = 0.4 * (u - 0.5)
    elif key.endswith("running_var"):
        u = 0.4 + 1.2 * u
    elif len(shape) == 1:
        u = 0.3 + 0.2 * u if key.endswith("bn2.weight") else 0.8 + 0.4 * u
    else:
        u = (2.0 * u - 1.0) * math.sqrt(6.0 / math.prod(shape[1:]))
    return torch.from_numpy(u.reshape(shape).astype(np.float32))


@functools.lru_cache(maxsize=3)
def filled(variant: str, num_classes: int) -> EsaNet:
    """The filled network in eval mode; shared between tests, so leave it as it is."""
    network = build(variant, num_classes)
    network.load_state_dict(
        {key: fill(key, tuple(value.shape)) for key, value in network.state_dict().items()}
    )
    return network.eval()


def fresh(variant: str, num_classes: int) -> EsaNet:
    """A filled network in eval mode, to be changed at will."""
    return copy.deepcopy(filled(variant, num_classes))


@functools.cache
def inputs(size: str) -> tuple[Tensor, Tensor]:
    """Normalised rgb and depth for a batch such as `1x256x320`, with a tenth of the depth exactly
    0."""
    rgb, depth = (_picture(name, channels, size) for name, channels in (("rgb", 3), ("depth", 1)))
    depth[uniform(f"input.depth.hole.{size}", depth.size).reshape(depth.shape) < 0.1] = 0.0
    return torch.from_numpy(rgb.astype(np.float32)), torch.from_numpy(depth.astype(np.float32))


def _picture(name: str, channels: int, size: str) -> npt.NDArray[np.float64]:
    count, height, width = (int(part) for part in size.split("x"))
    blocks = (count, channels, height // 32, width // 32)
    coarse = uniform(f"input.{name}.coarse.{size}", math.prod(blocks)).reshape(blocks)
    coarse = coarse.repeat(32, axis=2).repeat(32, axis=3)
    fine = uniform(f"input.{name}.fine.{size}", coarse.size).reshape(coarse.shape)
    return 3.0 * (coarse - 0.5) + (fine - 0.5)


def labels(
    count: int, height: int, width: int, num_classes: int, *, seed: int = SEED
) -> npt.NDArray[np.uint8]:
    """(count, height, width) labels, 0 = void, in blocks of 16 pixels."""
    blocks = (count, height // 16, width // 16)
    u = uniform(
        f"labels.{count}x{height}x{width}.{num_classes}", math.prod(blocks), seed=seed
    ).reshape(blocks)
    return np.floor(u * (num_classes + 1)).astype(np.uint8).repeat(16, axis=1).repeat(16, axis=2)


def class_weights(num_classes: int) -> Tensor:
    return torch.from_numpy(
        (0.25 + 2.0 * uniform(f"class_weights.{num_classes}", num_classes)).astype(np.float32)
    )


def run(network: EsaNet, size: str) -> npt.NDArray[np.float32]:
    """Logits of the filled inputs."""
    rgb, depth = inputs(size)
    with torch.inference_mode():
        return np.asarray(network(rgb, depth).numpy(), dtype=np.float32)
