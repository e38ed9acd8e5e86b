"""Kernels are compiled beside the program, which pauses that while it measures."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

import navcore
from app.runtime.start.kernel_compiler import KernelCompiler, _process, compiling_apart
from app.runtime.start.progress_lines import COMPILING, Progress
from navcore.kernel_cache import KernelCache


@pytest.fixture
def cache(tmp_path: Path) -> KernelCache:
    return KernelCache(Path(navcore.__file__).parents[1], tmp_path)


def ran(code: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", code])


def state(process: subprocess.Popen[bytes]) -> str:
    return (
        Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0]
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_the_compilers_stand_still_while_an_engine_is_timed(cache: KernelCache) -> None:
    process = ran("import time; time.sleep(60)")
    compiler = KernelCompiler(cache, [process])
    assert state(process) != "T"
    compiler.pause(True)
    while state(process) != "T":
        pass
    compiler.pause(False)
    while state(process) == "T":
        pass
    compiler.pause(True)
    compiler.stop()
    assert process.poll() is not None, "a paused process is ended, too"


def test_the_cache_is_complete_when_the_first_process_has_called_every_kernel(
    cache: KernelCache,
) -> None:
    failed = KernelCompiler(cache, [ran("raise SystemExit(1)")])
    failed.wait()
    assert not cache.is_complete, "what is missing is compiled by the program"
    slow = ran("import time; time.sleep(60)")
    compiler = KernelCompiler(cache, [ran(""), slow])
    compiler.wait()
    compiler.stop()
    assert cache.is_complete and slow.poll() is not None


def test_where_everything_is_compiled_it_is_loaded_before_an_engine_is_timed(
    cache: KernelCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    loaded: list[bool] = []

    def load() -> None:
        time.sleep(0.2)
        loaded.append(True)

    monkeypatch.setattr("app.runtime.start.kernel_compiler._load", load)

    def process(part: str) -> subprocess.Popen[bytes]:
        started.append(part)
        return ran("")

    monkeypatch.setattr("app.runtime.start.kernel_compiler._process", process)
    said: list[Progress] = []
    for start in range(2):
        with compiling_apart(said.append, cache) as compiler:
            compiler.pause(True)
            assert len(loaded) == start
    assert started == ["warm_kernels", "warm_planning"], "at the first start only"
    assert {progress.step for progress in said} == {COMPILING} and said[-1].is_over


def test_the_program_goes_on_when_it_fails_while_they_compile(
    cache: KernelCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = ran("import time; time.sleep(60)")
    monkeypatch.setattr("app.runtime.start.kernel_compiler._process", lambda part: slow)
    with pytest.raises(ValueError, match="bad weights"), compiling_apart(lambda said: None, cache):
        raise ValueError("bad weights")
    assert slow.poll() is not None and not cache.is_complete


def test_a_process_that_cannot_compile_says_so_by_its_exit_code() -> None:
    assert _process("no such part").wait() != 0
