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

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import app
import navcore
import sim
from navcore.compiled import NestedKernel
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.relocalisation.place_map import place_map_of
from navcore.localisation.scans.matching import search
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.planning.search.open_list import octile
from navcore.warmup import warm_up
from tests.kernels import from_python
from tests.reliability.fault_runs import fault_run

OTHERS = {
    # Only benches and tests change a space other than through its layers.
    "navcore.grid.free_space._replace",
    "navcore.grid.free_space._set_cells",
    # Of the network, which runs while warming up where there is one.
    "navcore.perception.esanet.network.preprocess._look_up",
    "navcore.perception.esanet.inference.argmax._most_likely",
}


def kernels(package: ModuleType = navcore) -> dict[str, Dispatcher]:
    """The compiled functions that are called from Python somewhere in a package, by name."""
    found = {}
    for module in modules(package):
        source = Path(str(module.__file__)).read_text(encoding="utf-8")
        for name in called(ast.parse(source), module):
            kernel = getattr(module, name)
            found[f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"] = kernel
    return found


def modules(package: ModuleType) -> Iterator[ModuleType]:
    """The modules of a package, but for those that are programs."""
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not info.name.endswith("__main__"):
            yield importlib.import_module(info.name)


def called(node: ast.AST, module: ModuleType) -> Iterator[str]:
    """Names of compiled functions that are read outside of compiled functions."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.Name) and isinstance(getattr(module, part.id, None), Dispatcher):
            yield part.id
        if isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name):
            read = getattr(getattr(module, part.value.id, None), part.attr, None)
            assert not isinstance(read, NestedKernel), ast.unparse(part)
        if not (
            isinstance(part, ast.FunctionDef)
            and isinstance(getattr(module, part.name, None), Dispatcher)
        ):
            yield from called(part, module)


def start_in_a_kept_map() -> None:
    """Search with as many points as real scans have, in the layout that a file may have them in."""
    points = np.asfortranarray(np.random.default_rng(0).uniform(-3.0, 3.0, (300, 2)))
    normals = np.asfortranarray(np.tile([0.0, 1.0], (300, 1)))
    here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    scan = Scan(
        points_base=np.ascontiguousarray(points),
        variance_m2=np.full(300, 1e-4),
        normals=np.ascontiguousarray(normals),
        origin=np.zeros(2),
    )
    kept = ScanMap()
    kept.put(Keyframe(pose_id=0, T_map_base=here, scan=scan))
    search(scan, kept, here)
    place_map_of(points, normals, RelocalisationConfig().search)


def report() -> None:
    """Print what was not compiled after warming up, and what was compiled again, for other types,
    during a drive."""
    compiled = kernels()
    warm_up()
    before = {name: len(kernel.signatures) for name, kernel in compiled.items()}
    fault_run(seed=0, until_s=4.0)
    start_in_a_kept_map()
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


def test_kernels_have_an_entry_for_python_if_it_calls_them() -> None:
    called_by_python = kernels(navcore) | kernels(sim) | kernels(app)
    for module in (*modules(navcore), *modules(sim)):
        for name, value in vars(module).items():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__:
                is_nested = f"{module.__name__}.{name}" not in called_by_python
                assert isinstance(value, NestedKernel) == is_nested, f"{module.__name__}.{name}"


def test_a_nested_kernel_refuses_a_call_by_python() -> None:
    with pytest.raises(TypeError, match="octile can be called by compiled functions only"):
        octile(3, 4)
    assert from_python(octile)(3, 4) > 0
