"""What the bench of a console's ticks says where there is nothing to measure."""

from __future__ import annotations

import httpx
import pytest

from app.bench.console.latency import watch_drive
from navcore.errors import BewareNavError

IDLE = {"phase": "idle", "reasons": [{"code": "no_goal", "text": "There is no goal."}]}


def test_a_robot_that_never_drives_is_told_with_its_reasons() -> None:
    console = httpx.MockTransport(lambda _: httpx.Response(200, json=IDLE))
    with (
        httpx.Client(transport=console, base_url="http://console") as program,
        pytest.raises(BewareNavError, match=r"the mission is idle\. There is no goal\."),
    ):
        watch_drive(program, seconds=0.05)
