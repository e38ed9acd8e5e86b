"""The draft of an operator in the 3D view."""

from __future__ import annotations

from unittest.mock import MagicMock

import pytest
from pydantic import ValidationError

from web.viewer.draft_overlay import DRAFT_Z, DraftOverlay
from web.viewer.messages import MAX_NOTE, Draft

DIAMOND = ((1.15, 2.0), (1.0, 2.15), (0.85, 2.0), (1.0, 1.85))


def test_the_length_of_the_path_stands_beside_the_goal_and_goes_with_it() -> None:
    client = MagicMock()
    overlay = DraftOverlay(client, lambda message: None)
    overlay.show(Draft(mode="goal", outline=DIAMOND, note="5.1 m"))
    (shown,) = client.scene.add_label.call_args_list
    assert shown.args == ("/draft/note", "5.1 m")
    label = client.scene.add_label.return_value
    assert label.position == pytest.approx((1.0, 2.0, DRAFT_Z))
    moved = tuple((x + 1.0, y) for x, y in DIAMOND)
    overlay.show(Draft(mode="goal", outline=moved, note="5.1 m"))
    assert client.scene.add_label.call_count == 1
    assert label.position == pytest.approx((2.0, 2.0, DRAFT_Z))
    overlay.show(Draft(mode="goal", note="5.1 m"))
    label.remove.assert_called_once_with()
    assert client.scene.add_label.call_count == 1


def test_a_note_is_bounded() -> None:
    with pytest.raises(ValidationError):
        Draft(mode="goal", note="x" * (MAX_NOTE + 1))
