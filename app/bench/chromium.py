"""The processes of a Chromium that this process has started."""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path


def processes(root: int) -> Iterator[tuple[int, str]]:
    """Yield number and kind of each process of Chromium below a process: `browser`, `renderer`,
    `gpu-process` or `utility`."""
    for pid in _descendants(root):
        try:
            line = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ")
        except OSError:
            continue  # it has ended meanwhile
        command = line.decode(errors="replace")
        if "chromium" in command.split(" ", 1)[0]:
            found = re.search(r"--type=(\S+)", command)
            yield pid, found.group(1) if found else "browser"


def chromium_cpu_s(root: int) -> Mapping[str, float]:
    """Return the processor seconds that each kind of process has used so far."""
    used: dict[str, float] = defaultdict(float)
    for pid, kind in processes(root):
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue  # it has ended meanwhile
        used[kind] += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return used


def _descendants(root: int) -> Iterator[int]:
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue
            children.setdefault(parent, []).append(int(folder.name))
    waiting = [root]
    while waiting:
        pid = waiting.pop()
        yield pid
        waiting += children.get(pid, [])
