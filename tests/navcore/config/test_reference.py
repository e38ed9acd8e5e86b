"""The reference page of the configuration."""

from __future__ import annotations

import dataclasses

from navcore.config.navigator import NavigatorConfig
from navcore.config.reference import PAGE, field_docs, reference
from navcore.robot.profile import RobotProfile


def test_the_page_equals_the_code() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == reference(), "run `python -m navcore.config.reference`"


def test_every_field_has_a_docstring() -> None:
    for kind in (NavigatorConfig, RobotProfile):
        assert set(field_docs(kind)) == {field.name for field in dataclasses.fields(kind)}


def test_every_row_of_the_page_says_what_the_field_means() -> None:
    rows = [line for line in reference().splitlines() if line.startswith("| `")]
    assert rows
    for row in rows:
        assert row.count(" | ") == 4, row
        assert not row.endswith("|  |"), row
