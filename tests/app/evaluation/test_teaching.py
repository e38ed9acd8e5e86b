"""The suite of teaching succeeds only where something was taught and judged."""

from __future__ import annotations

from typing import Any

import pytest

from app.evaluation.perception.teaching import has_succeeded

KEPT = {"old": 0.8, "new": 0.8, "change": [-0.002, 0.001]}
UNJUDGED = {"old": 0.8, "new": 0.2, "change": None}
NOT_SHOWN = {"old": None, "new": None, "change": None}
LOST = {"old": 0.8, "new": 0.6, "change": [-0.22, -0.18]}


def summary(rendered: dict[str, Any], frames: dict[str, Any], taught: int = 2) -> dict[str, Any]:
    """Return the figures of a suite that found all that was taught."""
    return {
        "taught": [{"iou": 0.9}] * taught,
        "found": taught,
        "known": {"cup": {"rendered": rendered, "frames": frames}},
    }


@pytest.mark.parametrize(
    ("figures", "succeeded"),
    [
        (summary(KEPT, KEPT), True),
        (summary(KEPT, NOT_SHOWN), True),
        (summary(KEPT, UNJUDGED), True),
        (summary(KEPT, LOST), False),
        (summary(LOST, KEPT), False),
        (summary(UNJUDGED, KEPT), False),
        (summary(NOT_SHOWN, NOT_SHOWN, taught=0), False),
        (summary(KEPT, KEPT) | {"found": 1}, False),
    ],
)
def test_it_succeeds_where_all_is_found_and_nothing_was_lost(
    figures: dict[str, Any], succeeded: bool
) -> None:
    assert has_succeeded(figures) is succeeded
