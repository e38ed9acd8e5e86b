"""What a process holds, as `/proc` says: Linux only."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessUse:
    """What a process holds at a moment."""

    rss_mb: float
    """Resident memory, MB (10⁶ bytes)."""
    pss_mb: float
    """Its proportional share: a page of n processes counts 1/n, MB."""
    threads: int
    """Number of threads."""
    files: int
    """Number of open file descriptors."""
    sockets: int
    """Number of those that are sockets."""


def process_use(pid: int) -> ProcessUse:
    """Return what a process holds; raises `OSError` when it has ended."""
    folder, sizes = Path(f"/proc/{pid}"), {}
    for line in (folder / "smaps_rollup").read_text().splitlines()[1:]:
        name, size_kb = line.split()[:2]
        sizes[name] = int(size_kb) * 1024 / 1e6
    targets = list(_targets(folder / "fd"))
    return ProcessUse(
        rss_mb=round(sizes["Rss:"], 1),
        pss_mb=round(sizes["Pss:"], 1),
        threads=len(list((folder / "task").iterdir())),
        files=len(targets),
        sockets=sum(target.startswith("socket:") for target in targets),
    )


def _targets(folder: Path) -> Iterator[str]:
    for descriptor in folder.iterdir():
        try:
            yield str(descriptor.readlink())
        except FileNotFoundError:
            continue  # it has been closed meanwhile
