"""The names that outsiders rely on are where the packages promise them, and their examples run."""

from __future__ import annotations

import doctest
import subprocess
import sys

import pytest

import navcore
import sim
import web


@pytest.mark.parametrize("package", [navcore, sim, web], ids=lambda package: package.__name__)
def test_every_public_name_of_a_package_exists(package: object) -> None:
    for name in package.__all__:  # type: ignore[attr-defined]
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = package.no_such_name  # type: ignore[attr-defined]


@pytest.mark.parametrize("package", [navcore], ids=lambda package: package.__name__)
def test_the_example_of_a_package_runs(package: object) -> None:
    result = doctest.testmod(package)  # type: ignore[arg-type]
    assert result.attempted > 0
    assert result.failed == 0


def test_importing_a_package_loads_neither_torch_nor_the_simulator() -> None:
    code = (
        "import sys, navcore, sim, web; "
        "print([m for m in ('torch', 'pybullet', 'viser') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
