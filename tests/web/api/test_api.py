"""What all of the API has in common: refusals, documents, events, pages and health."""

from __future__ import annotations

import json
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from navcore.errors import StorageFailed
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations
from web.server import ConsoleServer


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/api/v1/zones/none"),
        ("DELETE", "/api/v1/zones/none"),
        ("PUT", "/api/v1/zones/none"),
        ("DELETE", "/api/v1/goals/77"),
        ("PATCH", "/api/v1/beware/unicorn"),
        ("GET", "/api/v1/runs/none"),
        ("GET", "/nowhere"),
    ],
)
def test_what_does_not_exist_is_said_to_be_missing(
    client: httpx.Client, method: str, path: str
) -> None:
    body = {"PUT": zone(), "PATCH": {"enabled": False}}.get(method)
    wrong(client.request(method, path, json=body), 404)


def test_a_store_that_fails_is_a_503_with_its_reason(
    client: httpx.Client, operations: FakeOperations
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise StorageFailed("the disk is full; nothing was changed")

    operations.zones.add = fail  # type: ignore[method-assign]
    assert "disk is full" in wrong(client.post("/api/v1/zones", json=zone()), 503)["message"]


def test_the_state_says_what_labels_the_pictures_and_when_it_is_not_what_it_should_be(
    client: httpx.Client, operations: FakeOperations
) -> None:
    assert client.get("/api/v1/state").json()["segmenter_warning"] is None
    operations.segmenter_warning = "The network does not run: the weights are damaged"
    state = client.get("/api/v1/state").json()
    assert (state["segmenter"], state["segmenter_warning"]) == (
        "colour rules",
        operations.segmenter_warning,
    )


def test_reports_with_figures_that_are_none_are_still_json(client: httpx.Client) -> None:
    listed, _ = client.get("/api/v1/runs").json()
    assert listed["id"] == "run-1" and listed["success"] is True
    assert listed["spl"] is None
    assert client.get("/api/v1/runs/run-1").json()["series"]["t_s"] == [0.0, 1.0, 2.0]


def test_health_and_metrics_read_the_state(client: httpx.Client) -> None:
    assert client.get("/healthz").json()["status"] == "ok"
    client.post("/api/v1/stop")
    metrics = client.get("/metrics").text
    assert (
        "\nbewarenav_stop_latched 1.0\n" in metrics
        and '\nbewarenav_phase{phase="idle"} 1.0\n' in metrics
    )
    assert all(
        line.startswith("#") or len(line.split(" ")) == 2 for line in metrics.strip().split("\n")
    )


def test_the_contract_is_in_the_openapi_document(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    routes = {
        (method.upper(), path) for path, methods in document["paths"].items() for method in methods
    }
    v1 = "/api/v1"
    expected = {
        ("GET", "/healthz"),
        ("GET", "/metrics"),
        ("GET", f"{v1}/state"),
        ("GET", f"{v1}/goals"),
        ("POST", f"{v1}/goals"),
    }
    expected |= {
        ("DELETE", f"{v1}/goals/{{goal_id}}"),
        ("POST", f"{v1}/mission/{{action}}"),
        ("POST", f"{v1}/preview"),
    }
    expected |= {(method, f"{v1}/zones") for method in ("GET", "POST")}
    expected |= {(method, f"{v1}/zones/{{zone_id}}") for method in ("GET", "PUT", "DELETE")}
    expected |= {
        ("GET", f"{v1}/beware"),
        ("PUT", f"{v1}/beware"),
        ("PATCH", f"{v1}/beware/{{class_name}}"),
    }
    expected |= {("POST", f"{v1}/beware/defaults"), ("POST", f"{v1}/beware/undo")}
    expected |= {("GET", f"{v1}/beware.toml")}
    expected |= {
        ("POST", f"{v1}/stop"),
        ("POST", f"{v1}/stop/reset"),
        ("GET", f"{v1}/runs"),
        ("GET", f"{v1}/runs/{{run_id}}"),
    }
    names = ("map.png", "map.yaml", "map.pgm", "cloud.ply", "path", "camera.jpg")
    expected |= {("GET", f"{v1}/{name}") for name in names}
    assert expected <= routes
    operations = [
        operation for methods in document["paths"].values() for operation in methods.values()
    ]
    assert all(operation.get("description") for operation in operations)
    schemas = document["components"]["schemas"]
    assert (
        "where" in schemas["ProblemBody"]["properties"]
        and "error" in schemas["Problem"]["required"]
    )
    refused = [
        answer["content"]
        for operation in operations
        for status, answer in operation["responses"].items()
        if status.startswith(("4", "5"))
    ]
    shape = {"schema": {"$ref": "#/components/schemas/Problem"}}
    assert refused and all(one == {"application/problem+json": shape} for one in refused)


def test_the_events_bring_the_state_at_once_and_again_on_a_change(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with connect(server.url.replace("http", "ws") + "/api/v1/events", proxy=None) as socket:
        first = json.loads(socket.recv(timeout=60))
        assert first["type"] == "state" and not first["stop_latched"]
        operations.stop("test")
        assert any(json.loads(socket.recv(timeout=60))["stop_latched"] for _ in range(3))


def test_pages_come_from_the_console_itself_and_ask_nothing_of_the_network(
    client: httpx.Client,
) -> None:
    for path, kind in (
        ("/", "text/html"),
        ("/docs", "text/html"),
        ("/page/app.js", "text/javascript"),
        ("/page/styles/base.css", "text/css"),
    ):
        answer = client.get(path)
        assert answer.status_code == 200 and answer.headers["content-type"].startswith(kind)
        assert "https://" not in answer.text and "http://" not in answer.text.replace(
            "http://www.w3.org", ""
        )
    assert (
        client.get("/page/__init__.py").status_code
        == client.get("/page/..%2fserver.py").status_code
        == 404
    )


def test_what_needs_control_or_names_its_site_is_described_with_that_refusal(
    client: httpx.Client,
) -> None:
    silent = {
        path
        for path, methods in client.get("/openapi.json").json()["paths"].items()
        for method, operation in methods.items()
        if method != "get" and "409" not in operation["responses"]
    }
    assert silent == {"/api/v1/stop"}


def test_every_field_of_what_is_served_is_described(client: httpx.Client) -> None:
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    assert not [name for name in schemas if "__" in name], "two models of one name"
    assert {"State", "Goal", "ListedClass", "MapOut", "SightingOut", "Explanation"} <= set(schemas)
    silent = {
        f"{name}.{field}"
        for name, schema in schemas.items()
        for field, entry in schema.get("properties", {}).items()
        if "description" not in entry
    }
    assert silent == set()
