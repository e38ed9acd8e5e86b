"""Rows 22 to 25: the console refuses whatever is sent to it, and goes on."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import random
import tempfile
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import websockets.exceptions
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from app.storage.database import Database
from app.storage.users import UserTable
from navcore.errors import BadConfiguration
from navcore.perception.esanet.weights.weights_file import load
from navcore.robot.profile import HUSKY
from tests.reliability.console_rig import BenchConsole, bench_console
from tests.reliability.result import Measurement
from tests.reliability.routes import FOREIGN_HEADERS, PARAMETER, response_status, routes_of
from web.auth.access import Access
from web.server import create_app

KEYS = [
    *(
        "x_m",
        "y_m",
        "name",
        "geometry",
        "type",
        "coordinates",
        "properties",
        "enabled",
        "margin_m",
        "classes",
        "colour",
    ),
    *("hue_deg", "goal", "polygon", "class_id", "version", "role", "password", "\ud800", "x" * 300),
]
NUMBERS = (
    "NaN",
    "-Infinity",
    "1e999",
    "-1e999",
    "0",
    "-1",
    "1e308",
    "9" * 400,
    "0.5",
    "true",
    "null",
)
WORDS = (
    "",
    "\ud800",
    "\x00",
    "Feature",
    "Polygon",
    "é" * 100,
    "‮",
    "../../etc/passwd",
    "<script>",
    "z1",
    "red floor",
)
BOMBS = ("[" * 100_000, '{"a":' * 50_000, "9" * 100_000, '"' + "\\ud800" * 1000 + '"')
PAGE = "0123456789abcdef"
VISER_PROTOCOL = Subprotocol("viser-v1.1.1")


def hostile_requests(trials: int) -> Measurement:
    """Row 22: random nonsense to every route with a body; answers of 5xx, or none."""
    failed, refused = 0, 0
    with bench_console() as console, console.client() as client:
        routes = [
            route for route in routes_of(_app(console)) if route[0] not in ("GET", "HEAD", "WS")
        ]
        for number in range(trials):
            rng = random.Random(number)
            method, path = rng.choice(routes)
            path = path.replace(
                PARAMETER, quote(rng.choice(WORDS) or "z", safe="", errors="surrogatepass")
            )
            body = _body(rng)
            headers = {
                "Content-Type": rng.choice(
                    ["application/json", "text/plain", "application/json; charset=utf-16"]
                )
            }
            try:
                status = client.request(method, path, content=body, headers=headers).status_code
            except httpx.TransportError:
                status = HTTPStatus.INTERNAL_SERVER_ERROR  # connection cut within the answer
            failed += status >= HTTPStatus.INTERNAL_SERVER_ERROR
            refused += HTTPStatus.BAD_REQUEST <= status < HTTPStatus.INTERNAL_SERVER_ERROR
        with console.client() as other:  # a failed answer may have cut the first connection
            alive = other.get("/healthz").is_success
    return Measurement(
        trials=trials,
        measured=f"{refused} refused, {failed} answers of 5xx or none",
        met=failed == 0 and alive,
    )


def hostile_frames(trials: int) -> Measurement:
    """Row 23: nonsense on every websocket; other clients go on, and no command leaves the limits of
    the platform."""
    with bench_console() as console, console.client() as program:
        address = console.server.url.replace("http", "ws")
        paths = [
            f"/viewer/{PAGE}",
            f"/api/v1/viewer/{PAGE}",
            "/api/v1/control/live",
            "/api/v1/events",
        ]
        with connect(f"{address}/api/v1/events", proxy=None) as other_client:
            for number in range(trials):
                rng = random.Random(number)
                path = paths[number % len(paths)]
                protocol = [VISER_PROTOCOL] if path.startswith("/viewer") else None
                try:
                    with connect(
                        address + path,
                        subprotocols=protocol,
                        proxy=None,
                        max_size=None,
                        close_timeout=1,
                    ) as hostile:
                        for _ in range(rng.randint(1, 3)):
                            hostile.send(_frame(rng))
                except websockets.exceptions.ConnectionClosed:
                    continue
            told = [json.loads(other_client.recv(timeout=10))["type"] for _ in range(5)]
        beyond = sum(
            not (
                abs(twist.v_mps) <= HUSKY.max_speed_mps
                and abs(twist.w_radps) <= HUSKY.max_yaw_rate_radps
            )
            for _, twist in console.robot.sent
        )
        alive = (
            program.get("/healthz").is_success
            and program.get("/viewer/").is_success
            and told == ["state"] * 5
        )
    others = "others went on" if alive else "OTHER CLIENTS FAILED"
    measured = f"{others}, {beyond} commands beyond the limits"
    return Measurement(trials=trials, measured=measured, met=alive and beyond == 0)


def foreign_requests(trials: int) -> Measurement:
    """Row 24: every route of the app with every kind of foreign request, and without a log-in."""
    admitted, asked = [], 0
    with bench_console() as console, tempfile.TemporaryDirectory() as folder:
        database = Database(Path(folder))
        locked = _app(console, Access.by_login(UserTable(database)))
        for app, requests in (
            (_app(console), FOREIGN_HEADERS),
            (locked, {"not logged in": {"Host": "console"}}),
        ):
            for route in routes_of(app):
                for who, headers in requests.items():
                    asked += 1
                    status = response_status(app, *route, headers, quiet=True)
                    if status not in (401, 403, 421):
                        admitted.append(f"{who}: {' '.join(route)} {status}")
        database.close()
    first = f"; the first: {admitted[0]}" if admitted else ""
    return Measurement(
        trials=asked,
        measured=f"{len(admitted)} admitted{first}",
        met=not admitted and asked >= trials,
    )


def path_traversal(trials: int) -> Measurement:
    """Row 25: paths that lead out of every folder, and weights that would run a program."""
    escaped, executed = 0, _executed_pickles()
    with bench_console() as console, console.client() as client:
        for number in range(trials):
            answer = client.get(_path(random.Random(number)))
            escaped += answer.status_code not in (400, 404, 405, 422) or "root:" in answer.text
    measured = f"{escaped} paths escaped, {executed} of 1 pickles executed"
    return Measurement(trials=trials, measured=measured, met=escaped == 0 and executed == 0)


def _app(console: BenchConsole, access: Access | None = None) -> Any:
    return create_app(console.operations, allowed_hosts=["console"], access=access)


def _body(rng: random.Random) -> bytes:
    if rng.random() < 0.02:
        return rng.choice(BOMBS).encode()
    if rng.random() < 0.1:
        return rng.randbytes(rng.randint(0, 200))
    return _json(rng, 4).encode("utf-8", "surrogatepass")


def _json(rng: random.Random, depth: int) -> str:
    kind = rng.randrange(4) if depth else rng.randrange(2)
    if kind == 0:
        return rng.choice(NUMBERS)
    if kind == 1:
        return json.dumps(rng.choice(WORDS))
    if kind == 2:
        return "[" + ",".join(_json(rng, depth - 1) for _ in range(rng.randrange(5))) + "]"
    pairs = (
        f"{json.dumps(rng.choice(KEYS))}:{_json(rng, depth - 1)}" for _ in range(rng.randrange(5))
    )
    return "{" + ",".join(pairs) + "}"


def _frame(rng: random.Random) -> bytes | str:
    drive = (
        f'{{"type":"drive","v_mps":{rng.choice(NUMBERS)},"w_radps":{rng.choice(NUMBERS)},"t_ms":0}}'
    )
    text = _json(rng, 3).encode("utf-8", "replace").decode()
    frames: list[bytes | str] = [rng.randbytes(rng.randint(0, 300)), text, drive]
    return rng.choice(frames)


def _path(rng: random.Random) -> str:
    up = rng.choice(
        [
            "../",
            "..%2f",
            "%2e%2e/",
            "%2e%2e%2f",
            "..%5c",
            "....//",
            "%252e%252e%252f",
            "..%00/",
            "/",
            "%2f",
        ]
    )
    target = rng.choice(
        [
            "etc/passwd",
            "console.sqlite",
            "server.py",
            "proc/self/environ",
            "guard.py",
            "__init__.py",
        ]
    )
    base = rng.choice(["page", "viewer", "api/v1/runs", "api/v1/zones"])
    return f"/{base}/{up * rng.randint(1, 8)}{target}"


class _Program:
    """A pickle that makes a folder when it is loaded."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.path),)


def _executed_pickles() -> int:
    with tempfile.TemporaryDirectory() as folder:
        trap, weights = Path(folder) / "trap", Path(folder) / "model.safetensors"
        weights.write_bytes(pickle.dumps(_Program(trap)))
        with contextlib.suppress(BadConfiguration):
            load(weights)
        return int(trap.exists())
