"""Nothing is compiled while a robot drives: `warm_up` has called every kernel that Python calls."""

from __future__ import annotations

import ast
import importlib
import json
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from numba.core.dispatcher import Dispatcher

import navcore
from navcore.warmup import warm_up
from tests.reliability.fault_runs import fault_run

OTHERS = {
    # Only benches and tests change a space other than through its layers.
    "navcore.grid.free_space._replace",
    "navcore.grid.free_space._set_cells",
    # Of the network, which runs while warming up where there is one.
    "navcore.perception.esanet.network.preprocess._look_up",
    "navcore.perception.esanet.inference.argmax._most_likely",
}


def kernels() -> dict[str, Dispatcher]:
    """The compiled functions that are called from Python somewhere in `navcore`, by name."""
    found = {}
    for info in pkgutil.walk_packages(navcore.__path__, "navcore."):
        module = importlib.import_module(info.name)
        source = Path(str(module.__file__)).read_text(encoding="utf-8")
        for name in called(ast.parse(source), module):
            kernel = getattr(module, name)
            found[f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"] = kernel
    return found


def called(node: ast.AST, module: ModuleType) -> Iterator[str]:
    """Names of compiled functions that are read outside of compiled functions."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.Name) and isinstance(getattr(module, part.id, None), Dispatcher):
            yield part.id
        if not (
            isinstance(part, ast.FunctionDef)
            and isinstance(getattr(module, part.name, None), Dispatcher)
        ):
            yield from called(part, module)


def report() -> None:
    """Print what was not compiled after warming up, and what was compiled again, for other types,
    during a drive."""
    compiled = kernels()
    warm_up()
    before = {name: len(kernel.signatures) for name, kernel in compiled.items()}
    fault_run(seed=0, until_s=4.0)
    again = [name for name, kernel in compiled.items() if len(kernel.signatures) > before[name]]
    cold = [name for name, count in before.items() if count == 0]
    sys.stdout.write(json.dumps({"cold": cold, "again": again, "all": len(compiled)}))


def test_nothing_is_left_to_be_compiled_while_the_robot_drives() -> None:
    # In a process of its own: in this one other tests have called the kernels.
    ran = subprocess.run(
        [sys.executable, "-c", "from tests.system.test_warmup import report; report()"],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(ran.stdout.splitlines()[-1])
    assert found["all"] > 40
    assert set(found["cold"]) <= OTHERS
    assert found["again"] == []
