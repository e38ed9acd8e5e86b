"""Campaigns that are kept go on where they ended, and their summaries are of their episodes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.evaluation.kept import FOLDER, SUFFIX, keep_campaign, resume_campaign
from app.evaluation.merge import conclude_campaign
from app.evaluation.tables.pages import RESULTS
from app.fleet.campaign_files import EPISODES, read_card, recorded
from navcore.errors import BadConfiguration
from tests.app.evaluation.test_merge import SEEDS, driven

Report = dict[str, Any]
KEPT = [path.name.removesuffix(SUFFIX) for path in sorted((RESULTS / FOLDER).glob(f"*{SUFFIX}"))]


def reports_in(folder: Path) -> list[Report]:
    return [report for _, report in recorded((folder / EPISODES).read_text())]


def test_a_kept_campaign_goes_on_where_it_ended(report: Report, tmp_path: Path) -> None:
    first = driven(report, tmp_path / "first", seeds=SEEDS[:2])
    whole = driven(report, tmp_path / "whole")
    name = keep_campaign(first, tmp_path)
    again = tmp_path / "again"
    assert resume_campaign(name, again, tmp_path) == read_card(first)
    assert [one["seed"] for one in reports_in(again)] == list(SEEDS[:2])
    driven(report, again)
    assert (again / "summary.json").read_bytes() == (whole / "summary.json").read_bytes()
    assert keep_campaign(again, tmp_path) == name
    assert json.loads((tmp_path / f"{name}.json").read_text())["seeds"] == list(SEEDS)


def test_what_is_no_ended_campaign_is_refused_and_nothing_kept_is_lost(
    report: Report, tmp_path: Path
) -> None:
    folder = driven(report, tmp_path / "one")
    name = keep_campaign(folder, tmp_path)
    kept = {path: path.read_bytes() for path in tmp_path.rglob(f"*{name}*") if path.is_file()}
    lines = (folder / EPISODES).read_text().splitlines()
    (folder / EPISODES).write_text("\n".join(lines[1:]))
    with pytest.raises(BadConfiguration, match="is not of the episodes that are recorded"):
        keep_campaign(folder, tmp_path)
    (folder / "summary.json").unlink()
    with pytest.raises(BadConfiguration, match="holds no ended campaign"):
        keep_campaign(folder, tmp_path)
    with pytest.raises(BadConfiguration, match="holds episodes already"):
        resume_campaign(name, folder, tmp_path)
    with pytest.raises(BadConfiguration, match="'other' are not kept"):
        resume_campaign("other", tmp_path / "new", tmp_path)
    assert {path: path.read_bytes() for path in kept} == kept and len(kept) == 2


def test_a_refusal_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "app.evaluation.kept", "resume", "other", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "kept: the episodes of 'other' are not kept\n"


@pytest.mark.parametrize("name", KEPT)
def test_the_summary_of_a_kept_campaign_is_that_of_its_episodes(name: str, tmp_path: Path) -> None:
    card = resume_campaign(name, tmp_path)
    made = conclude_campaign(card, reports_in(tmp_path), tmp_path)
    kept = json.loads((RESULTS / f"{name}.json").read_text())
    assert {**made, "command": kept["command"]} == kept
