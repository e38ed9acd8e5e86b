"""Weights on the disk: official checkpoints are understood, hostile and damaged files are refused
by name."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.torch
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from navcore.errors import BadConfiguration, StorageFailed
from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH
from navcore.perception.esanet.network.variants import VARIANTS
from navcore.perception.esanet.weights import official_checkpoint as checkpoint
from navcore.perception.esanet.weights import weights_file as weights
from navcore.perception.esanet.weights.architecture import Architecture, infer_architecture
from navcore.perception.esanet.weights.official_checkpoint import read_checkpoint
from navcore.perception.esanet.weights.weights_file import WeightsCard, convert, load, save
from tests.navcore.laws import law

SLIM = 1 / 8
NAMES = ("wall", "floor", "book", "cup")
State = dict[str, Tensor]


@functools.cache
def slim(num_classes: int = 4) -> EsaNet:
    torch.manual_seed(0)
    return build("r18-nbt1d", num_classes, width=SLIM)


def card(**changes: Any) -> WeightsCard:
    told = {
        "variant": "r18-nbt1d",
        "num_classes": 4,
        "width": SLIM,
        "class_names": NAMES,
        "depth": NYUV2_DEPTH,
    }
    return WeightsCard(**{**told, "source_sha256": "0" * 64, **changes})


def pickled(content: object, path: Path, *, legacy: bool = False) -> Path:
    torch.save(content, path, _use_new_zipfile_serialization=not legacy)
    return path


def bare(state: State) -> object:
    return state


def of_training(state: State) -> object:
    return {
        "epoch": 7,
        "state_dict": state,
        "optimizer": {"state": {0: torch.zeros(3)}, "param_groups": [{"lr": 0.01}]},
    }


def under_model(state: State) -> object:
    return {"model": state}


def data_parallel(state: State) -> object:
    return {"state_dict": {f"module.{key}": value for key, value in state.items()}}


def lightning(state: State) -> object:
    return {"state_dict": {f"model.module.{key}": value for key, value in state.items()}}


@pytest.mark.long
@pytest.mark.parametrize("wrapped", [bare, of_training, under_model, data_parallel, lightning])
@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("num_classes", [37, 40])
def test_a_checkpoint_survives_conversion(
    wrapped: Callable[[State], object], legacy: bool, num_classes: int, tmp_path: Path
) -> None:
    state = slim(num_classes).state_dict()
    source = pickled(wrapped(dict(state)), tmp_path / "official.pth", legacy=legacy)
    told = convert(source, tmp_path / "mine.safetensors")
    assert (told.variant, told.num_classes, told.width) == ("r18-nbt1d", num_classes, SLIM)
    loaded = load(tmp_path / "mine.safetensors")
    assert loaded.card == told
    assert not loaded.network.training
    found = loaded.network.state_dict()
    assert list(found) == list(state)
    assert all(torch.equal(found[key], state[key]) for key in state)


@pytest.mark.parametrize("variant", [variant.name for variant in VARIANTS])
@pytest.mark.parametrize(("num_classes", "width"), [(37, 1.0), (40, 1.0), (5, 0.5)])
def test_the_architecture_is_read_from_keys_and_shapes(
    variant: str, num_classes: int, width: float
) -> None:
    architecture = Architecture(variant=variant, num_classes=num_classes, width=width)
    assert infer_architecture(architecture.skeleton().state_dict(), "here") == architecture


class Bomb:
    """Unpickled by the letter, it makes a directory."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("legacy", [False, True])
def test_a_checkpoint_that_carries_code_is_refused_and_the_code_not_run(
    legacy: bool, tmp_path: Path
) -> None:
    crater = tmp_path / "crater"
    source = pickled(
        {"state_dict": dict(slim().state_dict()), "extra": Bomb(crater)},
        tmp_path / "evil.pth",
        legacy=legacy,
    )
    with pytest.raises(BadConfiguration, match=r"evil\.pth.*nothing of it was executed"):
        convert(source, tmp_path / "mine.safetensors")
    assert not crater.exists()
    assert not (tmp_path / "mine.safetensors").exists()
    torch.load(source, weights_only=False)  # the control: read carelessly, it goes off
    assert crater.exists()


def test_a_plain_pickle_that_carries_code_is_refused_and_the_code_not_run(tmp_path: Path) -> None:
    crater = tmp_path / "crater"
    (tmp_path / "evil.pth").write_bytes(pickle.dumps(Bomb(crater)))
    with pytest.raises(BadConfiguration, match=r"evil\.pth"):
        read_checkpoint(tmp_path / "evil.pth")
    assert not crater.exists()


@pytest.mark.parametrize(
    "content",
    [
        {},
        [],
        [torch.zeros(2)],
        torch.zeros(2),
        {"state_dict": {}},
        {"state_dict": {"a": 1}},
        {1: torch.zeros(2)},
        {"a": torch.zeros(2)},
        {
            "state_dict": {
                "encoder_rgb.conv1.weight": torch.zeros(2),
                "decoder.conv_out.bias": torch.zeros(()),
            }
        },
        {"a": torch.zeros(2, 2).to_sparse()},
        {"miou": np.float64(0.5)},
    ],
    ids=lambda content: f"{content!s:.40}",
)
def test_a_pickle_that_is_no_esanet_is_refused_by_name(content: object, tmp_path: Path) -> None:
    source = pickled(content, tmp_path / "odd.pth")
    with pytest.raises(BadConfiguration, match=r"odd\.pth"):
        convert(source, tmp_path / "mine.safetensors")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda state: state.pop("se_layer2.se_rgb.fc.0.bias"),
            "se_layer2.se_rgb.fc.0.bias is missing",
        ),
        (lambda state: state.update(surplus=torch.zeros(1)), "surplus is unknown"),
        (
            lambda state: state.update({"encoder_rgb.bn1.bias": torch.zeros(9)}),
            r"encoder_rgb.bn1.bias is torch.float32 \(9,\)",
        ),
        (
            lambda state: state.update({"encoder_rgb.bn1.bias": torch.zeros(8).half()}),
            "torch.float16",
        ),
        (
            lambda state: state.update({"encoder_rgb.bn1.bias": torch.full((8,), torch.nan)}),
            "non-finite",
        ),
        (
            lambda state: state.update({"encoder_rgb.layer1.7.x": torch.zeros(1)}),
            "no known encoder",
        ),
        (
            lambda state: state.update({"context_module.features.0.conv.weight": torch.zeros(1)}),
            "appm",
        ),
        (
            lambda state: state.update(
                {"encoder_rgb.conv1.weight": torch.zeros(1).expand(10**12, 3, 7, 7)}
            ),
            "width",
        ),
        (
            lambda state: state.update({"decoder.conv_out.bias": torch.zeros(1).expand(10**12)}),
            "num_classes",
        ),
        (
            lambda state: state.update({"encoder_depth.bn1.bias": torch.zeros(1).expand(10**12)}),
            "expected torch.float32",
        ),
        (lambda state: [state.pop(key) for key in list(state) if "depth" in key], "is missing"),
    ],
)
def test_a_state_dict_that_does_not_fit_is_refused_naming_what_is_wrong(
    change: Callable[[State], object], says: str, tmp_path: Path
) -> None:
    state = dict(slim(40).state_dict())
    change(state)
    source = pickled(state, tmp_path / "odd.pth")
    with pytest.raises(BadConfiguration, match=rf"odd\.pth.*{says}"):
        convert(source, tmp_path / "mine.safetensors")


def test_classes_of_no_public_data_set_must_be_named(tmp_path: Path) -> None:
    source = pickled(slim().state_dict(), tmp_path / "own.pth")
    with pytest.raises(BadConfiguration, match="class_names"):
        convert(source, tmp_path / "mine.safetensors")
    convert(source, tmp_path / "mine.safetensors", class_names=NAMES, depth=NYUV2_DEPTH)
    assert load(tmp_path / "mine.safetensors").card.class_names == NAMES


@pytest.mark.parametrize(
    "content",
    [b"", b"PK\x03\x04", b"PK\x03\x04" + bytes(100), b"not a pickle", bytes(1000), b"\x80\x02"],
)
def test_a_file_that_is_no_checkpoint_is_refused_by_name(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "noise.pth").write_bytes(content)
    with pytest.raises(BadConfiguration, match=r"noise\.pth"):
        read_checkpoint(tmp_path / "noise.pth")


@pytest.mark.parametrize("name", ["missing.pth", "."])
def test_a_checkpoint_that_cannot_be_opened_is_refused_by_name(name: str, tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="cannot be read"):
        read_checkpoint(tmp_path / name)


@law(25)
@given(st.floats(0.0, 0.999), st.booleans())
def test_a_checkpoint_cut_off_anywhere_is_refused(share: float, legacy: bool) -> None:
    whole = checkpoint_bytes(legacy)
    path = SCRATCH / "cut.pth"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(BadConfiguration, match=r"cut\.pth"):
        read_checkpoint(path)


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint, "MAX_CHECKPOINT_BYTES", 1_000_000)
    with zipfile.ZipFile(tmp_path / "bomb.pth", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", bytes(5_000_000))
    assert (tmp_path / "bomb.pth").stat().st_size < 10_000
    with pytest.raises(BadConfiguration, match=r"bomb\.pth: 5000000 bytes are too many"):
        read_checkpoint(tmp_path / "bomb.pth")
    (tmp_path / "big.pth").write_bytes(bytes(1_000_001))
    with pytest.raises(BadConfiguration, match="too many"):
        read_checkpoint(tmp_path / "big.pth")


SCRATCH = Path()


@pytest.fixture(autouse=True, scope="module")
def _scratch(tmp_path_factory: pytest.TempPathFactory) -> None:
    global SCRATCH  # hypothesis and function-scoped fixtures do not mix
    SCRATCH = tmp_path_factory.mktemp("weights")


@functools.cache
def checkpoint_bytes(legacy: bool) -> bytes:
    return pickled(slim().state_dict(), SCRATCH / "whole.pth", legacy=legacy).read_bytes()


@functools.cache
def weights_bytes() -> bytes:
    save(slim(), card(), SCRATCH / "whole.safetensors")
    return (SCRATCH / "whole.safetensors").read_bytes()


@law(60)
@given(st.floats(0.0, 0.9999), st.integers(0, 7), st.booleans())
def test_one_flipped_bit_anywhere_is_noticed(share: float, bit: int, in_header: bool) -> None:
    damaged = bytearray(weights_bytes())
    span = int.from_bytes(damaged[:8], "little") + 8 if in_header else len(damaged)
    damaged[int(share * span)] ^= 1 << bit
    path = SCRATCH / "damaged.safetensors"
    path.write_bytes(damaged)
    with pytest.raises(BadConfiguration, match=r"damaged\.safetensors"):
        load(path)


@law(25)
@given(st.floats(0.0, 0.9999))
def test_weights_cut_off_anywhere_are_refused(share: float) -> None:
    path = SCRATCH / "cut.safetensors"
    path.write_bytes(weights_bytes()[: int(share * len(weights_bytes()))])
    with pytest.raises(BadConfiguration, match=r"cut\.safetensors"):
        load(path)


def test_weights_that_were_appended_to_are_refused(tmp_path: Path) -> None:
    (tmp_path / "more.safetensors").write_bytes(weights_bytes() + b"\0")
    with pytest.raises(BadConfiguration, match=r"more\.safetensors"):
        load(tmp_path / "more.safetensors")


def forged(path: Path, tensors: State, **fields: object) -> Path:
    """A file whose digest is right and whose content is not."""
    metadata = weights._as_metadata(card()) | {
        key: json.dumps(value) for key, value in fields.items()
    }
    content = safetensors.torch.save(
        tensors, {**metadata, "sha256": weights.digest(tensors, metadata)}
    )
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"variant": "r18"}, "does not fit"),
        ({"variant": "r99"}, "known variants"),
        ({"variant": 5}, "variant"),
        ({"num_classes": 5}, "class names"),
        ({"num_classes": 10**9}, "out of range"),
        ({"width": 1.0}, "does not fit"),
        ({"width": 0.3}, "width"),
        ({"class_names": ["wall", "wall ", "book", "cup"]}, "unique"),
        ({"depth": {"mean": 1.0, "std": 0.0, "units_per_m": 1.0}}, "std"),
        ({"source_sha256": "x"}, "hexadecimal"),
        ({"surprise": 1}, "unknown key"),
    ],
)
def test_a_card_that_lies_is_refused_by_name(
    fields: dict[str, object], says: str, tmp_path: Path
) -> None:
    path = forged(tmp_path / "forged.safetensors", dict(slim().state_dict()), **fields)
    with pytest.raises(BadConfiguration, match=rf"(?s)forged\.safetensors.*{says}"):
        load(path)


def test_weights_of_other_types_or_not_finite_are_refused(tmp_path: Path) -> None:
    state = dict(slim().state_dict())
    assert load(forged(tmp_path / "fine.safetensors", state)).card == card()  # the control
    for value, says in (
        (torch.zeros(8, dtype=torch.bfloat16), "bfloat16"),
        (torch.full((8,), torch.inf), "non-finite"),
    ):
        path = forged(tmp_path / "odd.safetensors", {**state, "encoder_rgb.bn1.bias": value})
        with pytest.raises(BadConfiguration, match=rf"odd\.safetensors.*{says}"):
            load(path)


def test_a_safetensors_file_of_somebody_else_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    for content in (
        safetensors.torch.save({"a": torch.zeros(2)}),
        b"",
        bytes(8),
        b"\xff" * 64,
        (1 << 62).to_bytes(8, "little"),
    ):
        path.write_bytes(content)
        with pytest.raises(BadConfiguration, match=r"other\.safetensors"):
            load(path)


def test_weights_that_are_missing_or_too_large_are_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BadConfiguration, match=r"missing\.safetensors: no such file"):
        load(tmp_path / "missing.safetensors")
    (tmp_path / "large.safetensors").write_bytes(weights_bytes())
    monkeypatch.setattr(weights, "MAX_WEIGHTS_BYTES", 1_000)
    with pytest.raises(
        BadConfiguration, match=r"large\.safetensors: larger than the allowed 1000 bytes"
    ):
        load(tmp_path / "large.safetensors")


def test_a_card_and_a_network_that_do_not_belong_together_are_not_saved(tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="does not fit"):
        save(slim(), card(num_classes=3, class_names=NAMES[:3]), tmp_path / "mine.safetensors")
    with pytest.raises(BadConfiguration, match="ending in"):
        save(slim(), card(), tmp_path / "official.pth")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fails_leaves_the_old_weights_intact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "mine.safetensors"
    save(slim(), card(), target)
    before = target.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageFailed, match=r"mine\.safetensors.*No space left"):
        save(slim(), dataclasses.replace(card(), source_sha256="1" * 64), target)
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["mine.safetensors"]


def test_loaded_weights_can_be_trained_further(tmp_path: Path) -> None:
    save(slim(), card(), tmp_path / "mine.safetensors")
    network = load(tmp_path / "mine.safetensors").network.train()
    outputs = network(torch.randn(2, 3, 64, 64), torch.randn(2, 1, 64, 64))
    torch.autograd.backward([output.mean() for output in outputs])
    torch.optim.SGD(network.parameters(), lr=0.1).step()


def test_kernels_in_half_precision_take_half_the_room_and_come_back_as_the_nearest_numbers(
    tmp_path: Path,
) -> None:
    network = slim()
    save(network, card(), tmp_path / "whole.safetensors")
    save(network, card(), tmp_path / "half.safetensors", half=True)
    sizes = [(tmp_path / f"{name}.safetensors").stat().st_size for name in ("whole", "half")]
    assert sizes[1] < 0.6 * sizes[0]
    back = load(tmp_path / "half.safetensors").network.state_dict()
    for key, value in network.state_dict().items():
        assert back[key].dtype == value.dtype
        assert torch.equal(back[key], value.half().float() if value.ndim == 4 else value)
