"""Figures of printed tables, and their ratios pair by pair."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table
from typer.testing import CliRunner

from app.bench import compare, main
from app.bench.compare import comparison_table, figures, ratios
from app.bench.main import DESCRIPTIONS
from app.cli.main import cli
from app.runtime.control.stage_timer import STAGES, TICK
from navcore.errors import BadConfiguration


def _printed(**rows: tuple[str, ...]) -> str:
    table = Table("stage", "p50", "p99", title="a title")
    for name, values in rows.items():
        table.add_row(name, *values)
    text = StringIO()
    terminal = Console(file=text, width=120)
    terminal.print(table)
    terminal.print("0.5 simulated seconds per second")
    terminal.print(table)
    return text.getvalue()


def test_the_numbers_of_all_tables_are_found_by_row_and_column() -> None:
    found = figures(_printed(tick=("4.5", "6.0"), plan=("–", "1.0")))
    assert found == {
        (table, row, column): value
        for table in (1, 2)
        for row, column, value in (
            ("tick", "p50", 4.5),
            ("tick", "p99", 6.0),
            ("plan", "p99", 1.0),
        )
    }


def test_a_figure_with_a_unit_is_found_and_a_word_or_a_size_is_none() -> None:
    found = figures(_printed(a=("12 ms", "99.5%"), b=("640×480", "held"), c=("+1.5", "3 kB, 4")))
    assert [found[key] for key in sorted(found) if key[0] == 1] == [12.0, 99.5, 1.5, 3.0]


def test_benchmarks_without_a_figure_in_common_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compare, "_extract", lambda *_: None)
    monkeypatch.setattr(compare, "_run", lambda *_: "")
    with pytest.raises(BadConfiguration, match="no figure"):
        comparison_table("HEAD", ["tick"])


def test_the_other_revision_gets_the_same_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = list[str]()
    monkeypatch.setattr(main, "print_comparison", lambda _, arguments: given.extend(arguments))
    monkeypatch.chdir(tmp_path)
    options = ("--against", "HEAD", "--scenario", "my.toml", "--segmenter", "colour")
    assert CliRunner().invoke(cli, ["bench", "soak", *options]).exit_code == 0
    assert str(tmp_path / "my.toml") in given and given[-2:] == ["--segmenter", "colour"]
    refused = CliRunner().invoke(
        cli, ["bench", "latency", "--against", "HEAD", "--ticks", "t.json"]
    )
    assert "--ticks" in str(refused.exception)


def test_ratios_are_those_of_the_pairs_and_not_of_the_medians() -> None:
    key = (1, "tick", "p50")
    pairs = [({key: old}, {key: new}) for old, new in ((1.0, 2.0), (10.0, 10.0), (100.0, 50.0))]
    ratio = ratios(pairs)[key]
    assert (ratio.old, ratio.new) == (10.0, 10.0)
    assert (ratio.least, ratio.median, ratio.most) == (0.5, 1.0, 2.0)


def test_a_figure_that_one_run_lacks_is_left_out() -> None:
    here, there = (1, "tick", "p50"), (1, "track", "p50")
    assert list(ratios([({here: 1.0, there: 1.0}, {here: 1.0})])) == [here]


def test_an_unknown_revision_is_refused_by_name() -> None:
    with pytest.raises(BadConfiguration, match="--against no-such-revision"):
        comparison_table("no-such-revision", ["tick"])


def test_every_stage_of_the_tick_has_a_description() -> None:
    assert set(DESCRIPTIONS) == {TICK, *STAGES}
