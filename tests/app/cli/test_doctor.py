"""`bewarenav doctor`: every required package is looked at."""

from __future__ import annotations

import importlib.metadata
import tomllib
from pathlib import Path

import pytest

from app.cli import doctor

ROOT = Path(__file__).parents[3]


def test_every_required_package_is_looked_at_and_a_missing_one_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def version(package: str) -> str:
        if package == "scipy":
            raise importlib.metadata.PackageNotFoundError
        return "1.0"

    monkeypatch.setattr(importlib.metadata, "version", version)
    monkeypatch.setattr(doctor, "_segmentation", lambda: iter(()))
    assert doctor.examine() == 1
    said = capsys.readouterr().out
    assert "MISS scipy is missing" in said
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for package in {*project["dependencies"]} - {"scipy"}:
        assert f"ok   {package} 1.0" in said
    assert "pytest 1.0" not in said
