"""The network as a segmenter: labels of the frame's size, by name, with honest confidence."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
import torch
from torch.nn import functional

from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.esanet import build
from navcore.perception.esanet.inference.argmax import most_likely
from navcore.perception.esanet.inference.network_file import open_network
from navcore.perception.esanet.inference.torch_engine import TorchInference
from navcore.perception.esanet.network.preprocess import (
    NYUV2_DEPTH,
    SUNRGBD_DEPTH,
    DepthStatistics,
    Size,
    to_tensors,
)
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.esanet.weights.class_names import (
    NYUV2_CLASSES,
    SUNRGBD_CLASSES,
    aliases_for,
)
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard, load, save
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import LabelSource, Segmenter
from navcore.perception.prototype import background_of, example_of, fitted
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.perception.esanet.goldens import arrays, data_file, fresh
from tests.navcore.scene import Box, picture

NAMES = ("wall", "Red Floor", "book", "cup")
WORKING, OFFICIAL = Size(height=96, width=128), Size(height=480, width=640)
BOOK, CUP = BewareClass(name="book", class_id=7), BewareClass(name="cup", class_id=9, enabled=False)
LIST = BewareList(
    classes=(
        BewareClass(name="red floor", class_id=3),
        BOOK,
        CUP,
        BewareClass(name="cable", class_id=4),
    )
)
FRAME = picture(Box(x=(1.5, 2.0), y=(-0.5, 0.5), z=(0.0, 0.6), colour=(200, 30, 30)))


def trained(names: tuple[str, ...] = NAMES) -> TrainedNetwork:
    torch.manual_seed(3)
    network = build("r18-nbt1d", len(names), width=1 / 8).eval()
    return TrainedNetwork(network=network, card=card_of(names, NYUV2_DEPTH, "r18-nbt1d", 1 / 8))


def card_of(
    names: tuple[str, ...], depth: DepthStatistics, variant: str, width: float = 1.0
) -> WeightsCard:
    return WeightsCard(
        variant=variant,
        num_classes=len(names),
        width=width,
        class_names=names,
        depth=depth,
        source_sha256="0" * 64,
    )


class EsaNetSegmenter(NetworkSegmenter):
    """A segmenter that runs a trained network on torch."""

    def __init__(
        self, trained: TrainedNetwork, *, size: Size, aliases: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(
            TorchInference(trained.network),
            class_names=trained.card.class_names,
            depth=trained.card.depth,
            size=size,
            aliases=aliases,
        )


@functools.cache
def probabilities() -> npt.NDArray[np.float64]:
    """(C, H, W) of the slim network for `FRAME`, the long way round."""
    depth_mm = FRAME.depth_m * np.float32(1000)
    with torch.inference_mode():
        logits = trained().network(*to_tensors(FRAME.rgb, depth_mm, WORKING, NYUV2_DEPTH))
        logits = functional.interpolate(
            logits, size=FRAME.depth_m.shape, mode="bilinear", align_corners=False
        )[0].double()
    powers = np.exp(logits.numpy())
    return np.asarray(powers / powers.sum(axis=0), dtype=np.float64)


def test_what_the_network_calls_a_class_without_an_entry_is_told() -> None:
    names = ("background", *NAMES[1:])
    segmenter = EsaNetSegmenter(trained(names), size=WORKING)
    winners, without_cup = probabilities().argmax(axis=0), LIST.removed("cup")
    assert segmenter.segment(FRAME, LIST).unlisted is None
    assert (winners == 3).any()
    for segmenter_of in (segmenter, FusedSegmenter(segmenter, HUSKY.depth_sensor)):
        unlisted = segmenter_of.segment(FRAME, without_cup).unlisted
        assert unlisted is not None and np.array_equal(unlisted, winners == 3)
    # Without a class for the background, floor and wall are it.
    assert EsaNetSegmenter(trained(), size=WORKING).segment(FRAME, LIST).unlisted is None


def test_labels_are_the_likeliest_class_by_name_and_confidence_its_probability() -> None:
    segmenter: Segmenter = EsaNetSegmenter(trained(), size=WORKING)
    labels = segmenter.segment(FRAME, LIST)
    assert labels.class_ids.shape == labels.confidence.shape == FRAME.depth_m.shape
    assert (labels.class_ids.dtype, labels.confidence.dtype) == (
        np.dtype(np.uint8),
        np.dtype(np.float32),
    )
    np.testing.assert_allclose(labels.confidence, probabilities().max(axis=0), atol=1e-4)
    ranked = np.sort(probabilities(), axis=0)
    clear = ranked[-1] - ranked[-2] > 1e-3
    expected = np.array([NOTHING, 3, 7, 9])[probabilities().argmax(axis=0)]
    assert clear.mean() > 0.9
    assert len(np.unique(expected)) > 1
    np.testing.assert_array_equal(labels.class_ids[clear], expected[clear])


def test_an_unlisted_class_is_nothing_and_a_disabled_one_is_labelled_anyway() -> None:
    segmenter = EsaNetSegmenter(trained(), size=WORKING)
    assert set(np.unique(segmenter.segment(FRAME, BewareList(classes=())).class_ids)) == {NOTHING}
    everything = BewareList(
        classes=tuple(BewareClass(name=name, class_id=5 + i) for i, name in enumerate(NAMES))
    )
    switched_off = everything.replaced(
        dataclasses.replace(entry, enabled=False) for entry in everything.classes
    )
    on, off = segmenter.segment(FRAME, everything), segmenter.segment(FRAME, switched_off)
    assert on.class_ids.min() >= 5
    np.testing.assert_array_equal(on.class_ids, off.class_ids)


def test_an_alias_gives_a_class_of_the_network_the_lists_name() -> None:
    segmenter = EsaNetSegmenter(trained(), size=WORKING, aliases={"wall": "Cable", "cup": "cable"})
    without_cup = BewareList(classes=tuple(one for one in LIST.classes if one is not CUP))
    found = segmenter.segment(FRAME, without_cup).class_ids
    plain = EsaNetSegmenter(trained(), size=WORKING).segment(FRAME, LIST).class_ids
    np.testing.assert_array_equal(found == 4, (plain == NOTHING) | (plain == 9))


def test_the_own_name_of_a_class_goes_before_its_alias() -> None:
    segmenter = EsaNetSegmenter(trained(), size=WORKING, aliases={"wall": "cable"})
    wall = BewareClass(name="Wall", class_id=11)
    found = segmenter.segment(FRAME, BewareList(classes=(*LIST.classes, wall))).class_ids
    plain = EsaNetSegmenter(trained(), size=WORKING).segment(FRAME, LIST).class_ids
    np.testing.assert_array_equal(found == 11, plain == NOTHING)
    assert not (found == 4).any()
    sources = [segmenter.source_of(entry) for entry in (wall, LIST.classes[3])]
    assert sources == [LabelSource.NETWORK] * 2


def test_two_classes_of_a_network_may_stand_for_one_entry() -> None:
    aliases = aliases_for(("wall", "Books", "Book"))
    assert aliases == {"Books": "book"}
    segmenter = EsaNetSegmenter(trained(), size=WORKING, aliases={"wall": "book"})
    found = segmenter.segment(FRAME, LIST).class_ids
    plain = EsaNetSegmenter(trained(), size=WORKING).segment(FRAME, LIST).class_ids
    np.testing.assert_array_equal(found == 7, (plain == NOTHING) | (plain == 7))
    assert segmenter.source_of(BOOK) is LabelSource.NETWORK


def test_an_alias_of_no_class_is_refused() -> None:
    with pytest.raises(BadConfiguration, match=r"sofa.*wall"):
        EsaNetSegmenter(trained(), size=WORKING, aliases={"sofa": "book"})


def test_a_class_by_example_is_a_hypothesis_of_its_own_of_the_network_that_it_was_made_with() -> (
    None
):
    eyes = NetworkSegmenter(
        TorchInference(trained().network),
        class_names=NAMES,
        depth=NYUV2_DEPTH,
        size=WORKING,
        identity="abc",
    )
    described = eyes.described(FRAME)
    example = example_of(FRAME, described, FRAME.rgb[..., 0] > 190)
    prototype = fitted("abc", [example], background_of(FRAME, described, [example]))
    entry = BewareClass(name="crate", class_id=11, prototype=prototype)
    listed = BewareList(classes=(*LIST.classes, entry))
    network, by_example = eyes.segment(FRAME, listed).hypotheses
    is_crate = FRAME.rgb[..., 0] > 190
    assert (by_example.class_ids[is_crate] == 11).mean() > 0.5
    assert not (by_example.class_ids[~is_crate] == 11).any()
    np.testing.assert_array_equal(network.class_ids, eyes.segment(FRAME, LIST).class_ids)
    assert eyes.source_of(entry) is LabelSource.PROTOTYPE
    other = dataclasses.replace(entry, prototype=dataclasses.replace(prototype, network="def"))
    assert eyes.source_of(other) is LabelSource.NOTHING
    foreign = eyes.segment(FRAME, BewareList(classes=(*LIST.classes, other)))
    assert foreign.hypotheses == ()


def test_a_working_size_the_network_cannot_take_is_refused() -> None:
    with pytest.raises(BadConfiguration, match="multiple of 32"):
        EsaNetSegmenter(trained(), size=Size(height=120, width=160))


def test_the_same_frame_is_labelled_the_same_way_twice() -> None:
    segmenter = EsaNetSegmenter(trained(), size=WORKING)
    first, second = segmenter.segment(FRAME, LIST), segmenter.segment(FRAME, LIST)
    np.testing.assert_array_equal(first.class_ids, second.class_ids)
    np.testing.assert_array_equal(first.confidence, second.confidence)


def test_weights_from_the_disk_label_like_those_in_memory(tmp_path: Path) -> None:
    mine = trained()
    save(mine.network, mine.card, tmp_path / "mine.safetensors")
    again = EsaNetSegmenter(load(tmp_path / "mine.safetensors"), size=WORKING).segment(FRAME, LIST)
    np.testing.assert_array_equal(
        again.class_ids, EsaNetSegmenter(mine, size=WORKING).segment(FRAME, LIST).class_ids
    )


def test_confidence_is_a_probability_however_large_the_logits() -> None:
    logits = np.array([[[0.0, 1e4, 700.0]], [[0.0, -1e4, 700.0]]], dtype=np.float32)
    winners, confidence = most_likely(logits, height=1, width=3)
    np.testing.assert_array_equal(winners[0, 1], 0)
    np.testing.assert_allclose(confidence, [[0.5, 1.0, 0.5]])


def test_winners_and_their_probabilities_are_those_of_the_resized_logits_softmax() -> None:
    logits = np.random.default_rng(3).normal(0, 5, (7, 24, 32)).astype(np.float32)
    logits[2] += np.linspace(-40, 40, 32, dtype=np.float32)
    winners, confidence = most_likely(logits, height=15, width=53)
    resized = torch.nn.functional.interpolate(
        torch.from_numpy(logits)[None], size=(15, 53), mode="bilinear"
    )[0].softmax(0)
    np.testing.assert_array_equal(winners, resized.argmax(0).numpy())
    np.testing.assert_allclose(confidence, resized.max(0).values.numpy(), atol=2e-5)


def test_a_network_that_answers_nan_is_refused_not_believed() -> None:
    broken = trained()
    with torch.no_grad():
        assert broken.network.decoder.conv_out.bias is not None
        broken.network.decoder.conv_out.bias[0] = torch.nan
    with pytest.raises(BadConfiguration, match="not finite"):
        EsaNetSegmenter(broken, size=WORKING).segment(FRAME, LIST)


@pytest.mark.parametrize(
    ("data_set", "names", "depth", "units"),
    [
        ("nyuv2", NYUV2_CLASSES, NYUV2_DEPTH, 10_000.0),
        ("sunrgbd", SUNRGBD_CLASSES, SUNRGBD_DEPTH, 8_000.0),
    ],
)
def test_the_official_sample_is_labelled_as_the_official_network_labels_it(
    data_set: str, names: tuple[str, ...], depth: DepthStatistics, units: float
) -> None:
    golden = arrays("golden_preproc_metric.npz")[f"{data_set}/raw/e2e_argmax"]
    network = TrainedNetwork(
        network=fresh("r34-nbt1d", len(names)), card=card_of(names, depth, "r34-nbt1d")
    )
    everything = BewareList(
        classes=tuple(BewareClass(name=name, class_id=i + 1) for i, name in enumerate(names))
    )
    labels = EsaNetSegmenter(network, size=OFFICIAL).segment(sample(units), everything)
    assert (labels.class_ids != golden + 1).mean() < 1e-3


def sample(units_per_m: float) -> Frame:
    """The official sample picture as a frame."""
    bgr = cv2.imread(str(data_file("samples/sample_rgb.png")), cv2.IMREAD_COLOR)
    depth = cv2.imread(str(data_file("samples/sample_depth.png")), cv2.IMREAD_UNCHANGED)
    assert bgr is not None
    assert depth is not None
    lens = Intrinsics(width=512, height=424, fx=365.0, fy=365.0, cx=256.0, cy=212.0)
    rgb = np.ascontiguousarray(bgr[..., ::-1], dtype=np.uint8)
    return dataclasses.replace(
        FRAME, rgb=rgb, depth_m=np.asarray(depth / units_per_m, dtype=np.float32), intrinsics=lens
    )


def test_the_identity_of_a_network_is_that_of_the_file_that_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mine.safetensors"
    made = trained()
    save(made.network, made.card, path)
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()

    def replaced_meanwhile(path: Path) -> TrainedNetwork:
        read = load(path)
        path.write_bytes(b"another network")
        return read

    monkeypatch.setattr("navcore.perception.esanet.weights.weights_file.load", replaced_meanwhile)
    assert open_network(path, camera=WORKING).sha256 == sha256
