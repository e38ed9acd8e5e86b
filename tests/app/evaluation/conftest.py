"""A driven episode for tests of what campaigns make of their reports."""

from __future__ import annotations

import json
from typing import Any

import pytest

from app.fleet.campaign_files import EPISODES
from navcore.mission.beware_list import default_beware_list
from tests.app.evaluation.test_scenario import task


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Report of a short episode that was driven."""
    from app.evaluation.driving.scenario import evaluate_scenario

    out = tmp_path_factory.mktemp("one")
    short = task(max_time_s=1.0)
    evaluate_scenario(short, seeds=[3000], out=out, beware=default_beware_list(), draw_first=0)
    return dict(json.loads((out / EPISODES).read_text()))
