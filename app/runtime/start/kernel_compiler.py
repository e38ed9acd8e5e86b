"""Compiles the kernels in two processes beside the program, which then loads their code: compiling
them itself takes twice as long and leaves some hundreds of megabytes in it."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from app.runtime.start.progress_lines import COMPILING, Progress, announced, on_stderr
from navcore.kernel_cache import CACHE, KernelCache

PARTS = ("warm_kernels", "warm_planning")
"""Functions of `navcore.warmup`, each run in a process of its own. The first calls every kernel,
and loads from the cache what the other has compiled meanwhile."""
NICENESS = 10
"""Niceness of these processes: what else the start does comes first."""
POLL_S = 0.1
"""Time between two looks at them, seconds."""
log = logging.getLogger(__name__)


class KernelCompiler:
    """The processes that compile; where everything is in the cache, a thread that loads it."""

    def __init__(
        self,
        cache: KernelCache,
        processes: Sequence[subprocess.Popen[bytes]] = (),
        loading: threading.Thread | None = None,
    ) -> None:
        self._cache, self._processes, self._loading = cache, processes, loading

    def count(self) -> tuple[int, int]:
        """Return the number of compiled kernels, and that of all."""
        count = self._cache.count()
        return count.done, count.all

    def pause(self, paused: bool) -> None:
        """Pause and continue: the time of an engine is measured on a quiet machine."""
        if paused and self._loading is not None:
            self._loading.join()  # a second at most
        if sys.platform != "win32":
            for process in self._processes:
                process.send_signal(signal.SIGSTOP if paused else signal.SIGCONT)

    def wait(self) -> None:
        """Wait until everything is compiled or loaded. What could not be is compiled by the
        program."""
        if self._loading is not None:
            self._loading.join()
        if not self._processes:
            return
        self.pause(False)
        while (code := self._processes[0].poll()) is None:
            time.sleep(POLL_S)
        if code == 0:
            self._cache.complete()
        else:
            log.warning("the kernels could not be compiled beside the program (exit code %d)", code)

    def stop(self) -> None:
        """End the processes."""
        self.pause(False)
        for process in self._processes:
            process.terminate()
            process.wait()


@contextmanager
def compiling_apart(
    say: Callable[[Progress], None] = on_stderr, cache: KernelCache = CACHE
) -> Iterator[KernelCompiler]:
    """Compile in other processes while the body prepares other things, then wait for them; where
    everything is in the cache, load it meanwhile."""
    if cache.is_complete:
        loading = threading.Thread(target=_load, name="loading of kernels", daemon=True)
        loading.start()
        compiler = KernelCompiler(cache, loading=loading)
        yield compiler
        compiler.wait()
        return
    compiler = KernelCompiler(cache, [_process(part) for part in PARTS])
    try:
        with announced(COMPILING, say=say, count=compiler.count):
            yield compiler
            compiler.wait()
    finally:
        compiler.stop()


def compile_kernels(say: Callable[[Progress], None] = on_stderr) -> None:
    """Compile what is not in the cache yet."""
    with compiling_apart(say):
        pass


def _process(part: str) -> subprocess.Popen[bytes]:
    command = f"from app.runtime.start.kernel_compiler import compile_part; compile_part({part!r})"
    return subprocess.Popen(
        [sys.executable, "-c", command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _load() -> None:
    """Load the compiled kernels into this process."""
    from navcore import warmup

    warmup.warm_kernels()


def compile_part(part: str) -> None:
    """Run one of `PARTS` in this process, at a low priority."""
    from navcore import warmup

    with suppress(AttributeError, OSError):  # not on Windows
        os.nice(NICENESS)
    getattr(warmup, part)()
