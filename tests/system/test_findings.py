"""The table of findings: every row is there, and the tests that it names exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
ROW = re.compile(r"^\| (\d+) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)


def missing(named: str) -> bool:
    path, _, test = named.partition("::")
    file = ROOT / path
    return not file.is_file() or f"def {test}(" not in file.read_text()


def test_every_finding_has_a_row_whose_tests_exist() -> None:
    rows = ROW.findall((ROOT / "web" / "FINDINGS.md").read_text(encoding="utf-8"))
    assert [int(number) for number, _, _ in rows] == list(range(1, 47))
    for number, _, cell in rows:
        named = re.findall(r"`([^`]+)`", cell)
        assert named, f"finding {number} names no test"
        assert not [one for one in named if missing(one)], f"finding {number}"


def test_a_test_that_does_not_exist_is_found() -> None:
    assert missing("tests/system/test_findings.py::test_nothing") and missing("no/such/file.py")
    assert not missing("tests/system/test_findings.py::test_a_test_that_does_not_exist_is_found")
