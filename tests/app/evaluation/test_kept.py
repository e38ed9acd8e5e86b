"""Campaigns that are kept go on where they ended, and their summaries are of their episodes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.evaluation.conclusions import CONCLUSIONS, conclusion_of
from app.evaluation.kept import FOLDER, SUFFIX, keep_results, resume_campaign
from app.evaluation.tables.pages import RESULTS, ROOT
from app.fleet.campaign_files import EPISODES, read_card, recorded
from navcore.errors import BadConfiguration
from tests.app.cli.test_main import bewarenav
from tests.app.evaluation.test_merge import SEEDS, driven

Report = dict[str, Any]
KEPT = [path.name.removesuffix(SUFFIX) for path in sorted((RESULTS / FOLDER).glob(f"*{SUFFIX}"))]


def reports_in(folder: Path) -> list[Report]:
    return [report for _, report in recorded((folder / EPISODES).read_text())]


def test_a_kept_campaign_goes_on_where_it_ended(report: Report, tmp_path: Path) -> None:
    first = driven(report, tmp_path / "first", seeds=SEEDS[:2])
    whole = driven(report, tmp_path / "whole")
    name = keep_results(first, tmp_path)
    again = tmp_path / "again"
    assert resume_campaign(name, again, tmp_path) == read_card(first)
    assert [one["seed"] for one in reports_in(again)] == list(SEEDS[:2])
    driven(report, again)
    assert (again / "summary.json").read_bytes() == (whole / "summary.json").read_bytes()
    assert keep_results(again, tmp_path) == name
    assert json.loads((tmp_path / f"{name}.json").read_text())["seeds"] == list(SEEDS)


def test_what_is_no_ended_campaign_is_refused_and_nothing_kept_is_lost(
    report: Report, tmp_path: Path
) -> None:
    folder = driven(report, tmp_path / "one")
    name = keep_results(folder, tmp_path)
    kept = {path: path.read_bytes() for path in tmp_path.rglob(f"*{name}*") if path.is_file()}
    lines = (folder / EPISODES).read_text().splitlines()
    (folder / EPISODES).write_text("\n".join(lines[1:]))
    with pytest.raises(BadConfiguration, match="is not of the episodes that are recorded"):
        keep_results(folder, tmp_path)
    (folder / "summary.json").unlink()
    with pytest.raises(BadConfiguration, match="holds no ended campaign"):
        keep_results(folder, tmp_path)
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
    made = conclusion_of(card).write(card.command, reports_in(tmp_path), tmp_path)
    assert made == json.loads((RESULTS / f"{name}.json").read_text())


def test_the_page_names_the_campaigns_that_are_kept_as_summaries_alone() -> None:
    page = (ROOT / "app" / "evaluation" / "README.md").read_text(encoding="utf-8")
    (named,) = re.findall(r"there are summaries alone: (.*)\.\n", page)
    kept = {path.stem: json.loads(path.read_text()) for path in RESULTS.glob("*.json")}
    drive = {name for name, result in kept.items() if result["suite"] in CONCLUSIONS}
    assert set(re.findall(r"`(.*?)`", named)) == drive - set(KEPT)


def test_the_kept_doors_can_go_on_with_the_rules_of_today(tmp_path: Path) -> None:
    card = resume_campaign("doors", tmp_path)
    before = (tmp_path / EPISODES).read_bytes()
    ended = bewarenav(*card.command.split()[1:], "--out", str(tmp_path))
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / EPISODES).read_bytes() == before


def test_another_campaign_overwrites_what_is_kept_only_when_asked(
    report: Report, tmp_path: Path
) -> None:
    name = keep_results(driven(report, tmp_path / "one"), tmp_path)
    kept = tmp_path / FOLDER / f"{name}{SUFFIX}"
    before = kept.read_bytes()
    others = {
        "of other rules": driven(report, tmp_path / "rules", rules="others"),
        "of other seeds": driven(report, tmp_path / "seeds", seeds=range(3001, 3007)),
    }
    for folder in others.values():
        with pytest.raises(BadConfiguration, match=f"{name} is kept of another campaign; --repl"):
            keep_results(folder, tmp_path)
        assert kept.read_bytes() == before
    for folder in others.values():
        assert keep_results(folder, tmp_path, replace=True) == name
        assert kept.read_bytes() != before
    kept.unlink()  # as what was kept before there were episodes
    with pytest.raises(BadConfiguration, match="is kept of another campaign"):
        keep_results(others["of other seeds"], tmp_path)


def test_a_campaign_of_another_robot_is_kept_beside_the_usual_one(
    report: Report, tmp_path: Path
) -> None:
    usual = keep_results(driven(report, tmp_path / "usual"), tmp_path)
    poor = keep_results(driven(report, tmp_path / "poor", odometry="poor"), tmp_path)
    assert "-odometry-poor" in poor and poor != usual
    assert all((tmp_path / f"{name}.json").exists() for name in (usual, poor))


def test_a_summary_is_made_of_its_episodes_by_the_rules_of_today(
    report: Report, tmp_path: Path
) -> None:
    folder = driven(report, tmp_path / "old", success=False, spl=0.5)
    summary = json.loads((folder / "summary.json").read_text())
    del summary["suite"]  # as a version before wrote it, with an SPL over violations
    (folder / "summary.json").write_text(json.dumps({**summary, "spl": 0.5}))
    name = keep_results(folder, tmp_path)
    kept = json.loads((tmp_path / f"{name}.json").read_text())
    assert (kept["suite"], kept["spl"]) == ("random", 0.0)


def test_a_suite_that_runs_as_a_whole_is_kept_as_its_summary_alone(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    told = {"command": "bewarenav evaluate localisation --seed 5", "scenario": "office"}
    (folder / "summary.json").write_text(json.dumps({**told, "odometry": "typical"}))
    assert keep_results(folder, tmp_path) == "office-localisation-typical"
    kept = json.loads((tmp_path / "office-localisation-typical.json").read_text())
    assert kept == {**told, "suite": "localisation", "odometry": "typical"}
    assert not (tmp_path / FOLDER).exists()
    (folder / "summary.json").write_text('{"command": "bewarenav evaluate office"}')
    with pytest.raises(BadConfiguration, match="neither its summary nor its command names a suite"):
        keep_results(folder, tmp_path)
    (folder / "summary.json").write_text(json.dumps({**told, "odometry": "typical"}))
    with pytest.raises(BadConfiguration, match="is kept of another campaign"):
        keep_results(folder, tmp_path)
