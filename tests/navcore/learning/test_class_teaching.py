"""Teaching of classes: what is learned, what is left as it was, and that no seed decides."""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn import functional

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.teaching.class_teaching import ClassTeacher, grown_network, memory_needed
from navcore.learning.teaching.taught_rows import TaughtRows
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.network.preprocess import Size
from navcore.perception.esanet.weights.weights_file import (
    TrainedNetwork,
    digest_of_features,
    load,
    save,
)

SIZE = Size(height=64, width=96)
KNOWN = 12
"""Number of classes of the shipped network."""
CUP, SHOE, BAG = 3, 13, 14
"""Labels of a class that it knows, and of the new ones."""


@pytest.fixture(scope="module")
def start() -> TrainedNetwork:
    """The shipped network: random weights tell nothing apart."""
    return load(SHIPPED)


def sample(seed: int, *, bag: bool = False) -> Sample:
    """Return a grey image with a red block, a shoe, and a blue one if asked, a bag."""
    rng = np.random.default_rng(seed)
    rgb = rng.integers(90, 130, (SIZE.height, SIZE.width, 3), dtype=np.uint8)
    labels = np.zeros((SIZE.height, SIZE.width), dtype=np.uint8)
    row, col = (int(rng.integers(4, 40)) for _ in range(2))
    shoe, other = np.s_[row : row + 20, col : col + 24], np.s_[row : row + 20, col + 30 : col + 50]
    rgb[shoe], labels[shoe] = (200, 30, 30), SHOE
    if bag:
        rgb[other], labels[other] = (30, 30, 220), BAG
    depth = np.full(labels.shape, 1500, dtype=np.uint16)
    return Sample(rgb=rgb, depth=depth, labels=labels)


def taught(start: TrainedNetwork, *names: str, steps: int = 60) -> ClassTeacher:
    """Return a teacher of new classes with six images."""
    grown = grown_network(start, names)
    numbers = range(KNOWN, grown.card.num_classes)
    teacher = ClassTeacher(grown.network, SIZE, TeachingRecipe(steps=steps), numbers, known=KNOWN)
    for seed in range(6):
        image = sample(seed, bag=len(names) > 1)
        teacher.captured.append(teacher.encoded(image, start.card.depth, own_labels=True))
    return teacher


def found(teacher: ClassTeacher, start: TrainedNetwork, label: int, image: Sample) -> float:
    """Return the IoU of a class in an image."""
    seen = teacher.predicted(teacher.encoded(image, start.card.depth)) == label - 1
    truth = image.labels == label
    return float((seen & truth).sum() / (seen | truth).sum())


def test_a_class_is_found_where_it_was_never_seen_whatever_the_random_state(
    start: TrainedNetwork,
) -> None:
    ends = []
    for seed in (0, 2000):
        torch.manual_seed(seed)
        teacher = taught(start, "shoe")
        losses = list(teacher.losses())
        assert losses == sorted(losses, reverse=True) and losses[-1] < 0.5 * losses[0]
        assert found(teacher, start, SHOE, sample(100)) > 0.9
        ends.append(teacher.network.decoder.conv_out.weight)
    assert torch.equal(*ends)


def test_the_memory_of_a_training_grows_by_what_is_kept_of_each_image(
    start: TrainedNetwork,
) -> None:
    teacher = taught(start, "shoe")
    needed = [memory_needed(teacher.network, SIZE, count) for count in (0, 6)]
    kept = [(one.features.nbytes, one.others.nbytes, one.labels.nbytes) for one in teacher.captured]
    assert needed[1] - needed[0] == np.sum(kept)


def test_two_classes_are_taught_at_once(start: TrainedNetwork) -> None:
    teacher, image = taught(start, "shoe", "bag"), sample(100, bag=True)
    for _ in teacher.losses():
        pass
    assert all(found(teacher, start, label, image) > 0.9 for label in (SHOE, BAG))


def test_the_logits_of_all_other_classes_stay_as_they_are(start: TrainedNetwork) -> None:
    teacher = taught(start, "shoe", steps=5)
    features = teacher.captured[0].features.float()[None]
    for _ in teacher.losses():
        pass
    with torch.no_grad():
        was, now = (one.decoder.classified(features) for one in (start.network, teacher.network))
    # A convolution of one channel more may add up in another order.
    assert torch.allclose(now[:, :KNOWN], was, atol=1e-4)
    assert bool((now[:, KNOWN] > was.max(dim=1).values).any())


def test_a_taught_network_has_the_features_that_examples_were_made_of(
    start: TrainedNetwork,
) -> None:
    grown = grown_network(start, ["shoe"])
    grown.network.decoder.conv_out.weight.data[-1] += 1.0
    assert digest_of_features(grown) == digest_of_features(start)
    other = copy.deepcopy(start)
    other.network.encoder_rgb.conv1.weight.data[0, 0, 0, 0] += 1.0
    assert digest_of_features(other) != digest_of_features(start)


def test_a_network_that_is_saved_in_half_precision_keeps_its_features(
    start: TrainedNetwork, tmp_path: Path
) -> None:
    start = copy.deepcopy(start)  # the shipped one is in half precision
    start.network.encoder_rgb.conv1.weight.data *= 1.0001
    grown = grown_network(start, ["shoe"])
    save(grown.network, grown.card, tmp_path / "taught.safetensors", half=True)
    assert digest_of_features(load(tmp_path / "taught.safetensors")) == digest_of_features(start)


def test_the_loss_is_the_cross_entropy_of_the_network(start: TrainedNetwork) -> None:
    for names in (("shoe",), ("shoe", "bag")):
        teacher = taught(start, *names)
        numbers = range(KNOWN, KNOWN + len(names))
        rows = TaughtRows(teacher.network.decoder, numbers)
        rows.measure(teacher.captured)
        with torch.no_grad():
            rows.moved[0].normal_(std=0.1, generator=torch.Generator().manual_seed(1))
        rows.write()
        sums = count = 0.0
        for image in teacher.captured:
            with torch.no_grad():
                logits = teacher.network.decoder.classified(image.features.float()[None])
            others = torch.logsumexp(logits[:, :KNOWN], dim=1, keepdim=True)
            targets = torch.from_numpy(image.labels.astype(np.int64))[None] - KNOWN
            joint = torch.cat([others, logits[:, KNOWN:]], dim=1)
            sums += float(functional.cross_entropy(joint, targets.clamp(min=0), reduction="sum"))
            count += targets.numel()
        assert rows.loss(teacher.captured, 0.0) == pytest.approx(sums / count, rel=1e-3)


def test_what_no_annotation_names_stays_what_it_was_however_unsure_the_network_is(
    start: TrainedNetwork,
) -> None:
    grown, image = grown_network(start, ("shoe",)), sample(0)

    def targets(threshold: float, *taught: int) -> LabelArray:
        recipe = TeachingRecipe(confidence_threshold=threshold)
        teacher = ClassTeacher(grown.network, SIZE, recipe, taught, known=KNOWN)
        return teacher.encoded(image, start.card.depth, own_labels=True).labels

    own, marked = targets(0.0, KNOWN), image.labels > 0
    assert (own[marked] == SHOE).all()
    assert own[~marked].min() > 0 and own[~marked].max() <= KNOWN
    assert np.array_equal(targets(1.0, KNOWN), own)
    # Of a class that is taught, what the network is unsure of counts neither way.
    assert not targets(1.0, *range(KNOWN))[~marked].any()


def test_a_pixel_without_a_colour_is_no_target(start: TrainedNetwork) -> None:
    grown, image = grown_network(start, ("shoe",)), sample(0)
    uncoloured = np.zeros(image.labels.shape, dtype=np.bool_)
    uncoloured[:, np.nonzero(image.labels)[1].min() :] = True  # the shoe and what is beside it
    image = dataclasses.replace(image, uncoloured=uncoloured)
    teacher = ClassTeacher(grown.network, SIZE, TeachingRecipe(), [KNOWN], known=KNOWN)
    targets = teacher.encoded(image, start.card.depth, own_labels=True).labels
    assert np.array_equal(targets == 0, uncoloured)


def test_a_known_class_is_taught_from_what_it_was(start: TrainedNetwork) -> None:
    grown = grown_network(start, ("Cup",))
    assert grown.card.class_names == start.card.class_names
    teacher = ClassTeacher(grown.network, SIZE, TeachingRecipe(), [CUP - 1], known=KNOWN)
    before = grown.network.decoder.conv_out.weight.clone()
    assert torch.equal(before, start.network.decoder.conv_out.weight)
    cups = [
        dataclasses.replace(one, labels=np.minimum(one.labels, CUP))
        for one in map(sample, (0, 1, 2, 3, 100))
    ]
    for cup in cups[:-1]:
        teacher.captured.append(teacher.encoded(cup, start.card.depth, own_labels=True))
    assert found(teacher, start, CUP, cups[-1]) < 0.5
    for _ in teacher.losses():
        pass
    after = grown.network.decoder.conv_out.weight
    changed = [row for row in range(KNOWN) if not torch.equal(after[row], before[row])]
    assert changed == [CUP - 1]
    assert found(teacher, start, CUP, cups[-1]) > 0.9


def test_a_restored_teacher_goes_on_as_if_nothing_had_been(start: TrainedNetwork) -> None:
    whole, first = taught(start, "shoe", steps=15), taught(start, "shoe", steps=15)
    for _ in whole.losses():
        pass
    next(first.losses())
    second = taught(start, "shoe", steps=15)
    second.restore(first.state())
    for _ in second.losses():
        pass
    assert whole.step == second.step == 15
    third = taught(start, "shoe", steps=15)
    third.restore(second.state())  # as after an interruption when all steps were taken
    assert not list(third.losses())
    ends = [one.network.decoder.conv_out.weight for one in (whole, second, third)]
    assert torch.equal(ends[0], ends[1]) and torch.equal(ends[0], ends[2])


def test_without_an_image_there_is_nothing_to_learn(start: TrainedNetwork) -> None:
    grown = grown_network(start, ("shoe",))
    teacher = ClassTeacher(grown.network, SIZE, TeachingRecipe(), [KNOWN], known=KNOWN)
    with pytest.raises(BadConfiguration, match="no image"):
        next(teacher.losses())
