"""What is slow in a request, its body, its answer, the disk, is waited for beside the event loop: a
stop gets through meanwhile."""

from __future__ import annotations

import asyncio
import gc
import io
import json
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fastapi.applications
import httpx
import pytest
from starlette.types import Message
from websockets.sync.client import connect

import web.schemas.fields
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from tests.web.fake_operations import FakeOperations
from web.gateway.pooled_route import LARGE_BYTES, _Arrived
from web.gateway.problems import JsonResponse
from web.schemas.zones import ZoneImportIn
from web.server import ConsoleServer
from web.viewer.messages import PageMessage
from web.viewer.viewer import Viewer

TAG = {"id": 12, "x_m": 3, "y_m": 0, "z_m": 1, "yaw_rad": 0, "size_m": 0.2, "sigma_m": 0.02}


@contextmanager
def stopped_within(
    slow: Any, name: str, server: ConsoleServer, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Stop the robot from within the first call of a method, while a request of the block waits
    for it; return when that has been answered."""
    act, is_first, ended = getattr(slow, name), threading.Lock(), threading.Event()
    stopped: list[int | str] = []

    def stop() -> None:
        try:
            address = f"{server.url}/api/v1/stop"
            stopped.append(httpx.post(address, trust_env=False, timeout=10).status_code)
        except httpx.HTTPError as error:
            stopped.append(repr(error))

    def held(*args: Any, **named: Any) -> Any:
        if is_first.acquire(blocking=False):
            stopping = threading.Thread(target=stop)
            stopping.start()
            stopping.join()
            ended.set()
        return act(*args, **named)

    monkeypatch.setattr(slow, name, held)
    yield
    assert ended.wait(30) and stopped == [200]


@pytest.mark.parametrize(
    ("slow", "name", "method", "path"),
    [
        (json, "loads", "POST", "/api/v1/sites/default/tags"),
        (web.schemas.fields, "from_table", "POST", "/api/v1/sites/default/tags"),
        (JsonResponse, "render", "GET", "/api/v1/zones"),
        (fastapi.applications, "get_openapi", "GET", "/openapi.json"),
    ],
)
def test_a_stop_gets_through_while_another_request_is_read_or_answered(
    slow: Any,
    name: str,
    method: str,
    path: str,
    server: ConsoleServer,
    client: httpx.Client,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with stopped_within(slow, name, server, monkeypatch):
        client.request(method, path, json=TAG if method == "POST" else None)


@pytest.mark.parametrize("name", ["write", "seek", "close"])
def test_a_stop_gets_through_while_the_disk_keeps_an_upload_waiting(
    name: str,
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    class File(io.BufferedRandom):
        """A file whose methods can be replaced."""

    networks = operations.teaching.networks
    with File(io.FileIO(tmp_path / "upload", "w+")) as file:
        monkeypatch.setattr(networks, "import_file", lambda: file)
        with stopped_within(file, name, server, monkeypatch):
            client.post("/api/v1/teach/networks?name=mine", content=b"weights")
        monkeypatch.undo()


def test_a_stop_gets_through_while_the_disk_keeps_the_file_of_an_upload_waiting(
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with stopped_within(operations.teaching.networks, "import_file", server, monkeypatch):
        client.post("/api/v1/teach/networks?name=mine", content=b"weights")


@pytest.mark.parametrize(("slow", "name"), [(Viewer, "receive"), (PageMessage, "validate_json")])
def test_a_stop_gets_through_while_the_3d_view_reads_or_follows_a_message_of_its_page(
    slow: Any, name: str, server: ConsoleServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = server.url.replace("http", "ws") + f"/api/v1/viewer/{'a' * 16}"
    with (
        stopped_within(slow, name, server, monkeypatch),
        connect(link, proxy=None) as page,
    ):
        page.send(json.dumps({"type": "draft", "mode": "goal", "corners": [], "path": []}))


def test_requests_that_wait_for_one_another_leave_the_pool_to_all_others(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, goes_on, inside = threading.Semaphore(0), threading.Event(), list[int]()
    read, count = _Arrived.body, 41  # one more than the pool has threads

    async def arrived(request: _Arrived) -> bytes:
        body = await read(request)
        if request.url.path.endswith("explain"):
            begun.release()
        return body

    def explain() -> None:
        inside.append(threading.get_ident())
        assert goes_on.wait(60)
        raise Refused("a test")

    monkeypatch.setattr(_Arrived, "body", arrived)
    monkeypatch.setattr(operations.insight, "explain", explain)
    with ThreadPoolExecutor(count) as pool:
        asked = [pool.submit(client.get, "/api/v1/explain") for _ in range(count)]
        try:
            for _ in range(count):
                assert begun.acquire(timeout=60)
            assert client.get("/api/v1/zones", timeout=30).status_code == 200
            assert len(inside) == 1
        finally:
            goes_on.set()
        assert {one.result(60).status_code for one in asked} == {409}


@pytest.mark.parametrize("is_large", [False, True])
def test_the_garbage_collector_rests_while_a_large_body_is_read(
    is_large: bool,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    collects = list[bool]()

    def note(poses: dict[int, Pose2]) -> None:
        collects.append(gc.isenabled())

    monkeypatch.setattr(operations, "correct_poses", note)
    body = {"poses": [{"id": 0, "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0}]}
    content = json.dumps(body) + " " * (LARGE_BYTES if is_large else 0)
    headers = {"Content-Type": "application/json"}
    answer = client.patch("/api/v1/map/poses", content=content, headers=headers)
    assert answer.status_code == 204 and collects == [not is_large] and gc.isenabled()


def test_the_garbage_collector_rests_until_the_last_of_two_large_bodies_is_read(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, answered, collects = threading.Barrier(2), threading.Event(), list[bool]()

    def note(poses: dict[int, Pose2]) -> None:
        inside.wait(30)
        if 1 in poses:
            assert answered.wait(30)
            collects.append(gc.isenabled())

    def send(pose_id: int) -> int:
        body = {"poses": [{"id": pose_id, "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0}]}
        content = json.dumps(body) + " " * LARGE_BYTES
        headers = {"Content-Type": "application/json"}
        return client.patch("/api/v1/map/poses", content=content, headers=headers).status_code

    monkeypatch.setattr(operations, "correct_poses", note)
    with ThreadPoolExecutor() as pool:
        first, last = pool.submit(send, 0), pool.submit(send, 1)
        assert first.result(60) == 204
        answered.set()
        assert last.result(60) == 204
    assert collects == [False] and gc.isenabled()


def calls_within(act: Callable[[], object]) -> int:
    """Return the number of calls of Python functions, at which the interpreter may change
    threads."""
    calls = 0

    def note(_: object, event: str, __: object) -> None:
        nonlocal calls
        calls += event == "call"

    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.parametrize("number", [0.5, 5])
def test_threads_may_change_at_every_number_of_a_body(number: float) -> None:
    body = json.dumps([number] * 1000).encode()

    async def arrived() -> Message:
        return {"type": "http.request", "body": body}

    async def read() -> None:
        request = _Arrived({"type": "http", "headers": []}, arrived)
        assert await request.json() == [number] * 1000

    assert (
        calls_within(lambda: asyncio.run(read()))
        - calls_within(lambda: asyncio.run(asyncio.sleep(0)))
        > 1000
    )


def test_threads_may_change_at_every_zone_of_an_import() -> None:
    ring = [[0, 0], [1, 0], [1, 1]]
    zone = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [ring]}}
    zones = {"type": "FeatureCollection", "features": [zone] * 100}
    assert calls_within(lambda: ZoneImportIn.model_validate(zones)) > 100


def test_an_answer_is_always_json() -> None:
    content = {"far": float("inf"), "none": [float("nan")], "name": "é", 3: 10**30}
    assert json.loads(bytes(JsonResponse(content).body), parse_constant=pytest.fail) == {
        "far": None,
        "none": [None],
        "name": "é",
        "3": 10**30,
    }
    torn = JsonResponse({"far": float("inf"), "name": "\ud800"}).body
    assert torn == b'{"far":null,"name":"\\ud800"}'
