"""A headless Chromium that this process has started: its processes, and what a page holds."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import httpx
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from app.bench.console.process_use import process_use
from navcore.errors import BewareNavError

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
"""No graphics card, as on a server; the sandbox needs privileges; nothing else is fetched."""
START_S = 60.0
"""Longest start of Chromium, seconds."""


class NoBrowser(BewareNavError):  # noqa: N818 - named after what happened, as all of them
    """Chromium or Playwright is not installed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageUse:
    """What a page holds at a moment."""

    script_mb: float
    """Memory of its scripts, MB (10⁶ bytes)."""
    elements: int
    """Number of nodes of the document, with those that scripts hold."""
    pss_mb: float
    """Memory of all processes of Chromium, shared pages divided among them, MB; Linux only."""


class DevTools(Protocol):
    """Connection to the tools for developers of a page."""

    def send(self, method: str) -> dict[str, Any]:
        """Call a method of the Chrome DevTools Protocol and return its result."""


class _PageTools:
    """`DevTools` over the page's websocket."""

    def __init__(self, socket: Connection) -> None:
        self._socket, self._calls = socket, 0

    def send(self, method: str) -> dict[str, Any]:
        self._calls += 1
        self._socket.send(json.dumps({"id": self._calls, "method": method}))
        while True:
            answer = json.loads(self._socket.recv(timeout=START_S))
            if answer.get("id") == self._calls:
                return dict(answer["result"])


@contextmanager
def watched_page(address: str, size: tuple[int, int]) -> Iterator[DevTools]:
    """Show a page in a headless Chromium whose traffic nothing records.

    Playwright follows the network of its pages, whose processes keep the responses for it and grow
    by some hundred megabytes an hour with the images of a camera. Raises `NoBrowser` without
    Chromium.
    """
    executable = shutil.which("chromium")
    if executable is None:
        raise NoBrowser("the page is not measured: chromium is not installed")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = ["--headless=new", *ARGUMENTS, f"--user-data-dir={profile}"]
        options += ["--remote-debugging-port=0", "--window-size={},{}".format(*size)]
        process = subprocess.Popen([executable, *options, address], stderr=subprocess.DEVNULL)
        try:
            with connect(_page_socket(Path(profile)), max_size=None) as socket:
                yield _PageTools(socket)
        finally:
            process.terminate()
            process.wait()


def _page_socket(profile: Path) -> str:
    """Return the address of the websocket of the only page of a Chromium that is starting."""
    deadline_s = time.monotonic() + START_S
    while time.monotonic() < deadline_s:
        with suppress(OSError, IndexError, StopIteration, httpx.HTTPError):
            port = (profile / "DevToolsActivePort").read_text().split()[0]
            with httpx.Client(trust_env=False) as client:
                targets = client.get(f"http://127.0.0.1:{port}/json/list").json()
            return str(next(t for t in targets if t["type"] == "page")["webSocketDebuggerUrl"])
        time.sleep(0.1)
    raise NoBrowser(f"the page is not measured: chromium did not start in {START_S:g} s")


@contextmanager
def chromium() -> Iterator[Browser]:
    """Run a headless Chromium; raises `NoBrowser` without Chromium or Playwright."""
    executable = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        executable = None
    if executable is None:
        raise NoBrowser(
            "the page is not measured: chromium or the Python package playwright is not installed"
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


def page_use(page: DevTools) -> PageUse:
    """Return what a page holds."""
    page.send("Performance.enable")
    rows = page.send("Performance.getMetrics")["metrics"]
    metrics = {row["name"]: row["value"] for row in rows}
    return PageUse(
        script_mb=round(metrics["JSHeapUsedSize"] / 1e6, 2),
        elements=int(metrics["Nodes"]),
        pss_mb=round(_chromium_mb(), 1),
    )


def _chromium_mb() -> float:
    total_mb = 0.0
    for pid, _ in processes(os.getpid()):
        with suppress(OSError):  # it has ended meanwhile
            total_mb += process_use(pid).pss_mb
    return total_mb


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
