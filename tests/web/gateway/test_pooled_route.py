"""What is slow in a request, its body, its answer, the description of the API, is made beside the
event loop: a stop gets through meanwhile."""

from __future__ import annotations

import gc
import json
import threading
from typing import Any

import fastapi.applications
import httpx
import pytest

import web.schemas.fields
from navcore.geometry.transform import Pose2
from tests.web.fake_operations import FakeOperations
from web.gateway.pooled_route import LARGE_BYTES
from web.gateway.problems import JsonResponse
from web.server import ConsoleServer

TAG = {"id": 12, "x_m": 3, "y_m": 0, "z_m": 1, "yaw_rad": 0, "size_m": 0.2, "sigma_m": 0.02}


@pytest.mark.parametrize(
    ("owner", "slow", "request_of"),
    [
        (json, "loads", ("POST", "/api/v1/sites/default/tags")),
        (web.schemas.fields, "from_table", ("POST", "/api/v1/sites/default/tags")),
        (JsonResponse, "render", ("GET", "/api/v1/zones")),
        (fastapi.applications, "get_openapi", ("GET", "/openapi.json")),
    ],
)
def test_a_stop_gets_through_while_another_request_is_read_or_answered(
    owner: Any,
    slow: str,
    request_of: tuple[str, str],
    server: ConsoleServer,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began, stopped = threading.Event(), threading.Event()
    act = getattr(owner, slow)

    def held(*args: Any, **named: Any) -> Any:
        if not began.is_set():
            began.set()
            stopped.wait(30)
        return act(*args, **named)

    def ask() -> None:
        method, path = request_of
        body = TAG if method == "POST" else None
        httpx.request(method, server.url + path, json=body, trust_env=False, timeout=60)

    asking = threading.Thread(target=ask)
    monkeypatch.setattr(owner, slow, held)
    asking.start()
    try:
        assert began.wait(30)
        httpx.post(f"{server.url}/api/v1/stop", trust_env=False, timeout=10).raise_for_status()
        assert operations.stops == ["REST"]
    finally:
        stopped.set()
        asking.join()


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
