"""The shards of a campaign become what one run gives, and nothing else is merged."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from app.evaluation.campaign import Campaign, Fleet
from app.evaluation.conclusions import CONCLUSIONS
from app.evaluation.merge import Allowance, merge_shards
from app.evaluation.suites import CROSSING_SUITES, Suite
from app.fleet.campaign_files import EPISODES, read_card, recorded
from app.fleet.shard import Shard
from app.runtime.record.provenance import command_line
from navcore.errors import BadConfiguration

SEEDS = range(3000, 3005)
DRAWN: dict[str, dict[str, Any]] = {
    Suite.RANDOM: {},
    Suite.DOORS: {"door": [3.0, 1.5], "into_room": True, "first_try": True, "retreat_m": 0.1},
    **{suite: {"kind": "stops", "speed_mps": 1.2, "angle_deg": 90} for suite in CROSSING_SUITES},
}
"""What reports of each suite have besides those of an episode."""


def driven(
    report: dict[str, Any],
    out: Path,
    shard: Shard | None = None,
    seeds: range = SEEDS,
    suite: Suite = Suite.RANDOM,
    rules: str = "rules",
    **changes: Any,
) -> Path:
    """Write the folder of a campaign whose episodes differ by seed."""

    def drive(seed: int) -> dict[str, Any]:
        return {**report, **DRAWN[suite], "seed": seed, "distance_m": seed / 7, **changes}

    campaign = Campaign(
        suite=suite,
        key="seed",
        rules=rules,
        holds="another campaign",
        drive=drive,
        drive_alone=drive,
    )
    reports = campaign.run(seeds, fleet=Fleet(shard=shard), out=out)
    CONCLUSIONS[suite].write(read_card(out).command, reports, out)
    return out


def shares(report: dict[str, Any], folder: Path, **how: Any) -> list[Path]:
    return [driven(report, folder / str(i), Shard(i, 3), **how) for i in (1, 2, 3)]


@pytest.mark.parametrize("suite", DRAWN)
def test_merged_shards_are_to_the_byte_what_one_run_gives(
    report: dict[str, Any], suite: Suite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bewarenav", "evaluate", suite, "--seed", "3000"])
    whole = driven(report, tmp_path / "whole", suite=suite)
    parts = shares(report, tmp_path, suite=suite)
    monkeypatch.setattr(sys, "argv", ["bewarenav", "merge", "1", "2", "3"])
    merged = merge_shards(parts[::-1], out=tmp_path / "merged")
    assert merged["suite"] == suite
    assert merged["command"] == f"bewarenav evaluate {suite} --seed 3000"
    for name in (EPISODES, "summary.json", "campaign.json"):
        assert (tmp_path / "merged" / name).read_bytes() == (whole / name).read_bytes()


def test_a_suite_that_runs_as_a_whole_is_not_merged(report: dict[str, Any], tmp_path: Path) -> None:
    folder = driven(report, tmp_path / "one")
    card = json.loads((folder / "campaign.json").read_text())
    (folder / "campaign.json").write_text(json.dumps({**card, "suite": "finding"}))
    with pytest.raises(BadConfiguration, match="the suite 'finding' runs as a whole"):
        merge_shards([folder], out=tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_missing_and_repeated_episodes_are_named_and_merged_only_when_allowed(
    report: dict[str, Any], tmp_path: Path
) -> None:
    first, second, third = shares(report, tmp_path)
    with pytest.raises(BadConfiguration, match="no shard holds seed 3001, 3004; --allow missing"):
        merge_shards([first, third], out=tmp_path / "a")
    part = merge_shards([first, third], out=tmp_path / "a", allowed=[Allowance.MISSING])
    assert part["seeds"] == [3000, 3002, 3003]
    with pytest.raises(BadConfiguration, match=r"seed 3000 is in several shards, .*1 and .*1;"):
        merge_shards([first, second, third, first], out=tmp_path / "b")
    again = [first, second, third, first]
    assert merge_shards(again, out=tmp_path / "b", allowed=[Allowance.REPEATED])["episodes"] == 5
    with pytest.raises(BadConfiguration, match="holds episodes already"):
        merge_shards(again, out=tmp_path / "b")


def test_shards_of_another_version_network_or_command_are_refused_by_name(
    report: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = driven(report, tmp_path / "1", Shard(1, 2))
    older = driven(report, tmp_path / "old", Shard(2, 2), version="0.0.9")
    with pytest.raises(BadConfiguration, match=r"old has episodes of version '0\.0\.9'.*--allow"):
        merge_shards([first, older], out=tmp_path / "a")
    merged = merge_shards([first, older], out=tmp_path / "a", allowed=[Allowance.VERSIONS])
    assert len(merged["versions"]) == 2
    other = driven(report, tmp_path / "net", Shard(2, 2), segmenter="network sha256 00")
    with pytest.raises(BadConfiguration, match="net has episodes of segmenter 'network sha256 00'"):
        merge_shards([first, other], out=tmp_path / "b", allowed=list(Allowance))
    monkeypatch.setattr("app.evaluation.campaign.command_line", lambda: "bewarenav evaluate forest")
    forest = driven(report, tmp_path / "forest", Shard(2, 2))
    with pytest.raises(BadConfiguration, match="forest was made by 'bewarenav evaluate forest'"):
        merge_shards([first, forest], out=tmp_path / "b", allowed=list(Allowance))
    card = json.loads((first / "campaign.json").read_text())
    (forest / "campaign.json").write_text(json.dumps({**card, "campaign": "0", "shard": "2/2"}))
    with pytest.raises(BadConfiguration, match="of another campaign"):
        merge_shards([first, forest], out=tmp_path / "b", allowed=list(Allowance))
    with pytest.raises(BadConfiguration, match="is no folder of a campaign"):
        merge_shards([first, tmp_path], out=tmp_path / "b")


def test_the_kept_command_says_what_is_driven_and_not_where() -> None:
    given = "evaluate office --random --shard 2/8 --workers=4 --out a --engine ray --address h:1"
    assert command_line(given.split()) == "bewarenav evaluate office --random"


def test_a_share_without_episodes_is_refused(report: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="--shard 9/9: there are only 5 episodes"):
        driven(report, tmp_path, Shard(9, 9))


def test_a_line_that_a_kill_cut_short_is_no_episode() -> None:
    assert [report for _, report in recorded('{"seed": 1}\n{"se')] == [{"seed": 1}]
