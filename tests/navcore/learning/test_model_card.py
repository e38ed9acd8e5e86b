"""The working size on a model's card: kept where it is known, absent where it is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch

from navcore.errors import BadConfiguration
from navcore.perception.esanet import build
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH, Size
from navcore.perception.esanet.weights.weights_file import WeightsCard, load, save
from navcore.toml_config import from_table


def saved(path: Path, size: Size | None) -> WeightsCard:
    torch.manual_seed(0)
    card = WeightsCard(
        variant="r18",
        num_classes=2,
        width=0.125,
        class_names=("a", "b"),
        depth=NYUV2_DEPTH,
        source_sha256="0" * 64,
        size=size,
    )
    save(build("r18", 2, width=0.125), card, path)
    return card


@pytest.mark.parametrize("size", [None, Size(height=256, width=448)])
def test_the_size_survives_the_disk(size: Size | None, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    assert saved(path, size) == load(path).card
    content = path.read_bytes()
    metadata = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])["__metadata__"]
    assert ("size" in metadata) == (size is not None), (
        "files without it are as they were before the field came"
    )


def test_a_size_that_no_network_takes_is_refused() -> None:
    with pytest.raises(BadConfiguration, match=r"card.height"):
        from_table(Size, {"height": 20, "width": 64}, "card")
