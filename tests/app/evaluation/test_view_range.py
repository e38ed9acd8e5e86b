"""What a longer view saves: the page and its rows."""

from __future__ import annotations

import re

import pytest

from app.evaluation.driving import view_range
from app.evaluation.driving.view_range import PAGE, lengths_m, page


def test_an_ideal_driver_is_at_least_as_long_as_the_shortest_path() -> None:
    shortest_m, near_m, far_m = lengths_m("clutter", 1000, (2.0, 9.0))
    assert shortest_m is not None and near_m is not None and far_m is not None
    assert min(near_m, far_m) >= 0.99 * shortest_m


def test_the_page_has_a_row_for_each_seed_and_sums_the_seeds_that_have_a_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn = {1000: [10.0, 12.0, 11.0], 1001: [None, 9.0, 9.0], 1002: [20.0, 30.0, 25.5]}
    monkeypatch.setattr(view_range, "lengths_m", lambda _world, seed, _ranges: drawn[seed])
    text = page("indoor", range(1000, 1003), (5.0, 9.0), "the command")
    assert "| 1001 | – | 9.0 | 9.0 |" in text
    assert "| sum | 30.0 | 42.0 | 36.5 |" in text
    assert text.endswith("    the command\n")


def test_the_kept_page_is_what_its_command_makes_of_its_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept = PAGE.read_text(encoding="utf-8")
    command = kept.splitlines()[-1].strip()
    world, _, seeds = command.removeprefix("python -m app.evaluation.driving.view_range ").split()
    first, last = map(int, seeds.split("-"))
    rows = {
        int(seed): [float(length_m) for length_m in lengths]
        for seed, *lengths in re.findall(r"\| (\d+) " + 5 * r"\| ([\d.]+) " + r"\|", kept)
    }
    monkeypatch.setattr(view_range, "lengths_m", lambda _world, seed, _ranges: rows[seed])
    made = page(world, range(first, last + 1), (5.0, 6.0, 7.0, 9.0), command)
    assert without_sums(kept) == without_sums(made)
    assert sums_of(kept) == pytest.approx(sums_of(made), abs=0.3)  # of lengths before rounding


def sums_of(text: str) -> list[float]:
    cells = text.partition("| sum |")[2].partition("\n")[0].split("|")
    return [float(cell) for cell in cells[:-1]]


def without_sums(text: str) -> str:
    return re.sub(r"\| sum .*", "", text)
