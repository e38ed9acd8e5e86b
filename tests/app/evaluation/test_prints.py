"""Prints and the things that they show: their pixels, what counts as refuted, and the limits."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli.evaluate.settings import EvaluateSettings, check_options
from app.evaluation.perception import print_sites, prints
from app.evaluation.perception.print_figures import DISTANCES_M, by_distance, row_of
from app.evaluation.perception.print_sites import (
    Sight,
    renderer_of,
    sights,
    site_of,
    with_print,
)
from app.evaluation.perception.prints import decides_up_to, evaluate_prints
from app.evaluation.suites import Suite
from app.evaluation.tables.kinds import file_name
from app.evaluation.tables.pages import full_table
from app.runtime.start.segmentation import colour_perception
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from sim.dataset.renderer import SceneRenderer

SEED, VIEWS = 1, len(DISTANCES_M)
CUP = BewareClass(name="cup", class_id=1, min_height_m=0.05)
BOOK = BewareClass(name="book", class_id=2)
LIST = BewareList(classes=(CUP, BOOK))


@pytest.fixture(scope="module")
def renderer() -> SceneRenderer:
    return renderer_of(SEED)


class Believer:
    """A network that takes what lies there for the class of its site, unless it is far away."""

    def __init__(self, farthest_m: float = 10.0) -> None:
        self.outline, self.class_id = np.zeros((1, 1), dtype=np.bool_), NOTHING
        self._farthest_m = farthest_m

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        depth_m = float(np.median(frame.depth_m[self.outline]))
        near = self.outline & (depth_m < self._farthest_m)
        return Labels(
            class_ids=np.where(near, np.uint8(self.class_id), np.uint8(NOTHING)),
            confidence=np.full(near.shape, 0.9, dtype=np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


@pytest.fixture
def believer(monkeypatch: pytest.MonkeyPatch, renderer: SceneRenderer) -> Iterator[Believer]:
    """Return such a network, which is told the truth of each frame before it sees it."""
    network, view, place = Believer(), Sight.view, site_of

    def told(self: Sight, *args: Any) -> tuple[Frame, Bools]:
        frame, network.outline = view(self, *args)
        return frame, network.outline

    def at(seed: int, kind: str) -> Any:
        network.class_id = LIST.named(kind).class_id
        return place(seed, kind)

    monkeypatch.setattr(Sight, "view", told)
    monkeypatch.setattr(prints, "site_of", at)
    monkeypatch.setattr(prints, "renderer_of", lambda seed, size: renderer)
    yield network


@pytest.mark.parametrize("is_cut_out", [False, True])
def test_the_pixels_of_a_print_are_those_that_show_the_thing(
    renderer: SceneRenderer, is_cut_out: bool
) -> None:
    site = site_of(SEED, "wet-floor sign")
    scene, sheet = with_print(site, renderer)
    (poster,) = scene.posters
    scene = dataclasses.replace(scene, posters=(dataclasses.replace(poster, cut_out=is_cut_out),))
    images = {}
    for name, seen in (("with", scene), ("without", site.scene)):
        renderer.build(seen)
        images[name], _ = Sight(scene=seen, outlined=lambda *_: np.zeros((1, 1), np.bool_)).view(
            renderer, site.pose(1.2), site.rng(3)
        )
    renderer.build(scene)
    sight = Sight(scene=scene, outlined=lambda frame, depth_m, _: sheet.outlined(frame, depth_m))
    _, outline = sight.view(renderer, site.pose(1.2), site.rng(3))
    changed = np.abs(images["with"].rgb.astype(int) - images["without"].rgb).max(axis=-1) > 12
    assert np.count_nonzero(outline) > 300
    assert np.count_nonzero(changed & outline) > 0.9 * np.count_nonzero(outline)
    beside = np.count_nonzero(changed & ~outline) / np.count_nonzero(outline)
    assert beside < 0.2 if is_cut_out else beside > 0.5


def test_a_kept_seed_gives_the_same_frame_again(renderer: SceneRenderer) -> None:
    first, second = (_seen(own, number) for own, number in ((renderer, 0), (renderer_of(SEED), 0)))
    assert np.array_equal(first[0].rgb, second[0].rgb)
    assert np.array_equal(first[0].depth_m, second[0].depth_m)
    assert np.array_equal(first[1], second[1])


@pytest.mark.parametrize(("viewpoint_m", "least"), [(1.2, 0.9), (3.0, 0.0)])
def test_a_print_for_a_viewpoint_covers_the_thing_there_and_not_elsewhere(
    renderer: SceneRenderer, monkeypatch: pytest.MonkeyPatch, viewpoint_m: float, least: float
) -> None:
    monkeypatch.setattr(print_sites, "ANAMORPHIC_SHARE", 1.0)
    monkeypatch.setattr(print_sites, "VIEWPOINT_M", (viewpoint_m, viewpoint_m))
    flat, whole = (_seen(renderer, number)[1] for number in (0, 1))  # both from 1.2 m
    overlap = np.count_nonzero(flat & whole) / np.count_nonzero(flat | whole)
    assert least < overlap < least + 0.9


def test_depth_refutes_near_prints_of_what_stands_up_and_no_flat_ones_and_no_things(
    tmp_path: Path, believer: Believer, monkeypatch: pytest.MonkeyPatch
) -> None:
    perception = dataclasses.replace(colour_perception(), examples=believer)  # type: ignore[arg-type]
    told = evaluate_prints(perception, LIST, seeds=[SEED], out=tmp_path)
    cup, book = told["printed"]["cup"], told["printed"]["book"]
    assert cup["prints"]["claimed"] == cup["prints"]["in_view"]
    assert cup["prints"]["refuted"][:3] == [1, 1, 1] and cup["claimed_seeds"] == [SEED]
    assert cup["prints"]["refuted"] == cup["prints"]["outlines_refuted"]
    assert book["prints"]["claimed"][:4] == [1] * 4 and book["let_through_seeds"] == [SEED]
    for found in (book["prints"], book["things"], cup["things"]):
        assert found["refuted"] == found["outlines_refuted"] == [0] * VIEWS
    assert book["decides_up_to_m"] is None and cup["decides_up_to_m"] >= 1.6
    assert json.loads((tmp_path / "summary.json").read_text()) == told
    page = full_table([told])
    assert "| `prints` | 1 to 1 | cup | 1 of 1 |" in page and "never: no least height" in page
    assert file_name(told) == told["suite"] == Suite.PRINTS
    for module, name in ((prints, "LEAST_SHARE"), (print_sites, "FARTHEST_M")):
        with monkeypatch.context() as changed:
            changed.setattr(module, name, 0.5)
            with pytest.raises(BadConfiguration, match="sites or checks"):
                evaluate_prints(perception, LIST, seeds=[SEED], out=tmp_path)


def test_what_the_network_does_not_claim_is_no_find_of_depth(
    tmp_path: Path, believer: Believer
) -> None:
    believer.class_id = NOTHING
    believer._farthest_m = 0.0
    perception = dataclasses.replace(colour_perception(), examples=believer)  # type: ignore[arg-type]
    told = evaluate_prints(perception, BewareList(classes=(CUP,)), seeds=[SEED], out=tmp_path)
    cup = told["printed"]["cup"]
    assert cup["claimed_seeds"] == cup["let_through_seeds"] == []
    assert cup["prints"]["refuted"] == [0] * VIEWS
    assert cup["prints"]["outlines_refuted"][:3] == [1, 1, 1]
    assert row_of("cup", cup, 1)[1:5] == ("0 of 1", "0 of 1", "none", "none")


def test_the_limit_is_the_last_distance_before_the_first_wrong_one() -> None:
    every = {"in_view": [10] * VIEWS}
    refuted = every | {"outlines_refuted": [10, 10, 9, 8, 10, 0, 0]}
    kept = every | {"outlines_refuted": [0, 1, 0, 0, 0, 0, 0]}
    assert decides_up_to(refuted, kept) == 1.6
    assert decides_up_to(refuted, every | {"outlines_refuted": [0, 2, 0, 0, 0, 0, 0]}) == 0.8
    assert decides_up_to(kept, kept) is None
    hidden = {"in_view": [0, *[10] * (VIEWS - 1)], "outlines_refuted": [0, 10, 9, 8, 10, 0, 0]}
    assert decides_up_to(hidden, kept) == 1.6
    assert by_distance([1, 1, 0, 0, 0, 0, 2], [2, 2, 0, 0, 3, 0, 3]) == (
        "0.8 to 1.2 m 1/2, 2.5 m 0/3, 4 m 2/3"
    )


def test_what_cannot_be_judged_is_refused(tmp_path: Path, believer: Believer) -> None:
    with pytest.raises(BadConfiguration, match="needs a network"):
        evaluate_prints(colour_perception(), LIST, seeds=[SEED], out=tmp_path)
    perception = dataclasses.replace(colour_perception(), examples=believer)  # type: ignore[arg-type]
    off = dataclasses.replace(CUP, enabled=False)
    spill = BewareClass(name="spill", class_id=3)
    with pytest.raises(BadConfiguration, match="a class that is switched on"):
        evaluate_prints(perception, BewareList(classes=(off, spill)), seeds=[SEED], out=tmp_path)
    with pytest.raises(BadConfiguration, match="judges no commands"):
        check_options(EvaluateSettings(suite=Suite.PRINTS, latency="none"))


def _seen(renderer: SceneRenderer, number: int) -> tuple[Frame, Bools]:
    """Return the frame of the print (0) or the thing (1) at a site, and its pixels."""
    site = site_of(SEED, "bottle")
    sight = sights(site, renderer)[number]
    renderer.build(sight.scene)
    return sight.view(renderer, site.pose(1.2), site.rng(3))
