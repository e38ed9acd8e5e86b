"""Every hostile request is refused with a reason; stored values stay, the input is not echoed."""

from __future__ import annotations

import functools
import io
import json
import os
import re
import socket
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navcore.errors import Refused
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations
from web.auth.users import LONGEST_PASSWORD
from web.gateway import request_body
from web.gateway.request_body import MAX_BODY_BYTES
from web.interface.teaching import NetworkVersion
from web.server import ConsoleServer, create_app

JSON = {"Content-Type": "application/json"}
KNOWN = {"class_name": "cup", "zone_id": "z1", "name": "default"}
"""Values of the parameters of paths; every other one is 1."""


@functools.cache
def requests_with_json() -> list[tuple[str, str]]:
    """Return method and path of every request of the API that has a JSON body."""
    app = create_app(FakeOperations(), allowed_hosts=["console"])
    found = [
        (method.upper(), re.sub(r"\{(\w+)\}", lambda name: KNOWN.get(name[1], "1"), path))
        for path, methods in app.openapi()["paths"].items()
        for method, about in methods.items()
        if "application/json" in about.get("requestBody", {}).get("content", {})
    ]
    assert len(found) > 30
    return found


writes = st.deferred(lambda: st.sampled_from(requests_with_json()))
KEYS = [
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
]
KEYS += [
    "hue_deg",
    "goal",
    "polygon",
    "class_id",
    "version",
    "min_confidence",
    "yaw_rad",
    "features",
    "drawn",
    "kind",
    "ids",
    "\ud800",
    "x" * 300,
]

numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(min_value=-(10**400), max_value=10**400),
    st.sampled_from([0, -1, 1e308, 2**63, -0.0]),
)
words = st.one_of(
    st.text(st.characters(), max_size=20),
    st.sampled_from(
        ["\ud800", "\x00", "Feature", "Polygon", "Point", "FeatureCollection", "é" * 100, "‮"]
    ),
)
leaves = st.one_of(st.none(), st.booleans(), numbers, words)
keys = st.one_of(st.sampled_from(KEYS), words)
values = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.lists(inner, max_size=5),
        st.dictionaries(st.one_of(st.sampled_from(KEYS), words), inner, max_size=5),
    ),
    max_leaves=20,
)


@pytest.fixture(scope="module")
def lasting() -> Iterator[tuple[httpx.Client, FakeOperations]]:
    """Return one console for a thousand requests."""
    operations = FakeOperations()
    console = ConsoleServer(operations, port=0)
    console.start()
    with httpx.Client(base_url=console.url, trust_env=False, timeout=60.0) as program:
        program.post("/api/v1/zones", json=zone("kept"))
        yield program, operations
    console.stop()


def dumped(value: Any) -> bytes:
    """Return JSON of a careless or hostile client, with NaN, Infinity and lone surrogates."""
    return json.dumps(value, allow_nan=True, ensure_ascii=True).encode("ascii")


@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(request=writes, value=values)
def test_no_json_value_makes_the_console_fail(
    lasting: tuple[httpx.Client, FakeOperations], request: tuple[str, str], value: Any
) -> None:
    answer = lasting[0].request(*request, content=dumped(value), headers=JSON)
    assert answer.status_code < 500, (request, value, answer.text)
    answer.json()


@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(x=numbers, y=numbers)
def test_no_number_makes_a_goal_that_is_not_on_the_map(
    lasting: tuple[httpx.Client, FakeOperations], x: float, y: float
) -> None:
    program, operations = lasting
    answer = program.post("/api/v1/goals", content=dumped({"x_m": x, "y_m": y}), headers=JSON)
    assert answer.status_code in (201, 400, 422), answer.text
    assert all(abs(goal.x_m) <= 8 and abs(goal.y_m) <= 6 for goal in operations.state().queue)


@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(ring=st.lists(st.tuples(numbers, numbers), max_size=8), name=words, margin=numbers)
def test_no_polygon_and_no_name_make_the_console_fail(
    lasting: tuple[httpx.Client, FakeOperations],
    ring: list[tuple[float, float]],
    name: str,
    margin: float,
) -> None:
    body = {
        "name": name,
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "margin_m": margin,
    }
    program, operations = lasting
    for method, path in (("POST", "/api/v1/zones"), ("PUT", "/api/v1/zones/z1")):
        assert program.request(method, path, content=dumped(body), headers=JSON).status_code < 500
    listed = program.get("/api/v1/zones")
    assert listed.status_code == 200 and "z1" in listed.text
    for entry in listed.json()["features"][1:]:
        program.delete(f"/api/v1/zones/{entry['id']}")
    assert all(entry.name.isprintable() for entry in operations.zones.stored)


@settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(body=st.binary(max_size=200), request=writes)
def test_no_bytes_make_the_console_fail(
    lasting: tuple[httpx.Client, FakeOperations], body: bytes, request: tuple[str, str]
) -> None:
    assert lasting[0].request(*request, content=body, headers=JSON).status_code < 500


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('{"x_m": NaN, "y_m": 0}', "body.x_m: X: expected a finite number."),
        ('{"x_m": 0, "y_m": 1e999}', "body.y_m: Y: expected a finite number."),
        ('{"x_m": true, "y_m": 0}', "body.x_m"),
        ('{"x_m": "1", "y_m": 0}', "body.x_m"),
        ('{"x_m": 1, "y_m": 0, "z_m": 0}', "body.z_m: “z_m” is not known here."),
        ('{"x_m": 1}', "body.y_m"),
        ('{"x_m": 1e300, "y_m": 0}', "body.x_m"),
        ('{"x_m": 1, "y_m": 0, "\\ud800": 1}', ""),
        ('{"x_m": 1,', "not JSON"),
    ],
)
def test_a_refusal_names_the_key_and_the_reason(client: httpx.Client, body: str, says: str) -> None:
    told = wrong(client.post("/api/v1/goals", content=body, headers=JSON), 422)
    assert says in f"{told['where']}: {told['message']}"


@pytest.mark.parametrize(
    "bomb",
    ["[" * 100_000, '{"a":' * 100_000, "9" * 100_000, '{"x_m": ' + "9" * 5000 + ', "y_m": 1}'],
)
def test_bombs_of_depth_and_digits_are_refused(client: httpx.Client, bomb: str) -> None:
    assert client.post("/api/v1/goals", content=bomb, headers=JSON).status_code in (400, 422)


def test_a_name_with_a_lone_surrogate_is_refused_and_the_list_still_reads(
    client: httpx.Client,
) -> None:
    body = dumped(zone("\ud800"))
    assert "name" in str(
        wrong(client.post("/api/v1/zones", content=body, headers=JSON), 422)["where"]
    )
    assert client.get("/api/v1/zones").json()["features"] == []


def test_a_secret_in_the_input_is_not_echoed(client: httpx.Client) -> None:
    answer = client.post("/api/v1/goals", json={"x_m": "hunter2", "y_m": ["hunter2"]})
    assert answer.status_code == 422 and "hunter2" not in answer.text


def test_the_body_of_a_password_is_small_because_the_event_loop_reads_it(
    client: httpx.Client,
) -> None:
    url, longest = "/api/v1/me/password", "\U0001f511" * LONGEST_PASSWORD
    fits = dumped({"present": longest, "password": longest})
    wrong(client.put(url, content=fits, headers=JSON), 409)
    padded = fits + b" " * request_body.MAX_PASSWORD_BODY_BYTES
    wrong(client.put(url, content=padded, headers=JSON), 413)


def test_a_body_that_is_too_large_is_refused_whether_or_not_it_says_so(
    client: httpx.Client,
) -> None:
    large = b" " * (MAX_BODY_BYTES + 1)

    def chunks() -> Iterator[bytes]:
        for start in range(0, len(large), 50_000):
            yield large[start : start + 50_000]

    assert (
        wrong(client.post("/api/v1/goals", content=large, headers=JSON), 413)["code"] == "too_large"
    )
    assert (
        wrong(client.post("/api/v1/goals", content=chunks(), headers=JSON), 413)["code"]
        == "too_large"
    )
    assert client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0}).status_code == 201


def test_a_large_archive_lies_on_the_disk_while_it_arrives_and_is_bounded_there_too(
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    url, size = "/api/v1/teach/frames.zip", 5_000_000
    came: list[BinaryIO] = []

    def note(file: BinaryIO) -> int:
        came.append(file)
        return os.fstat(file.fileno()).st_size + len(file.read())

    def chunks(length: int) -> Iterator[bytes]:
        for _ in range(0, length, 50_000):
            yield bytes(50_000)

    monkeypatch.setattr(operations.teaching.frames, "add_archive", note)
    assert client.post(url, content=chunks(size)).json() == {"added": 2 * size}
    assert came[0].closed  # before the answer: the next one may follow at once
    monkeypatch.setitem(request_body.BODY_LIMITS, url, (size, 60.0))
    assert wrong(client.post(url, content=chunks(size + 1)), 413)["code"] == "too_large"

    class Full(io.FileIO):
        """A file on a full disk."""

        def write(self, part: object) -> int:
            raise OSError(28, "No space left on device")

    def full() -> BinaryIO:
        came.append(io.BufferedRandom(Full(tmp_path / "full", "w+")))
        return came[-1]

    monkeypatch.setattr(operations.teaching.frames, "import_file", full)
    refused = wrong(client.post(url, content=bytes(10)), 503)
    assert refused["message"] == "the body cannot be stored: No space left on device"
    assert all(file.closed for file in came) and len(came) == 2


def test_a_network_is_written_to_the_disk_as_it_arrives(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    came = list[tuple[str, bool, bytes]]()

    def note(name: str, file: BinaryIO) -> NetworkVersion:
        came.append((name, isinstance(file, io.BytesIO), file.read()))
        raise Refused("noted")

    monkeypatch.setattr(tempfile, "tempdir", "/no/such/folder")  # memory on many machines
    monkeypatch.setattr(operations.teaching.networks, "add", note)
    wrong(client.post("/api/v1/teach/networks?name=mine", content=b"weights"), 409)
    assert came == [("mine", False, b"weights")]


def test_an_archive_lies_below_the_data_folder_and_one_is_imported_at_a_time(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    url, frames = "/api/v1/teach/frames.zip", operations.teaching.frames
    monkeypatch.setattr(tempfile, "tempdir", "/no/such/folder")  # memory on many machines
    with frames.import_file():
        refused = wrong(client.post(url, content=b"PK"), 409)
        assert refused["message"].startswith("images are being imported already")
    assert "archive is damaged" in wrong(client.post(url, content=b"PK"), 422)["message"]


def test_a_request_that_is_cut_off_changes_nothing(server: ConsoleServer) -> None:
    # What came of it is a whole list in TOML by itself.
    whole = httpx.get(f"{server.url}/api/v1/beware.toml", trust_env=False).text
    part = whole[: whole.rindex("[[")].encode()
    before = httpx.get(f"{server.url}/api/v1/beware", trust_env=False).json()
    host = server.url.removeprefix("http://")
    head = (
        f"PUT /api/v1/beware.toml HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/toml\r\n"
        f"Content-Length: {len(whole.encode())}\r\n\r\n"
    ).encode()
    name, port = host.split(":")
    with socket.create_connection((name, int(port)), timeout=60) as connection:
        connection.sendall(head + part)
    time.sleep(0.5)
    assert httpx.get(f"{server.url}/api/v1/beware", trust_env=False).json() == before
    accepted = httpx.put(
        f"{server.url}/api/v1/beware.toml",
        content=part,
        headers={"Content-Type": "application/toml"},
        trust_env=False,
    )
    assert accepted.status_code == 200  # control: the part alone is a list


@pytest.mark.parametrize(
    "path",
    [
        "/page/%2e%2e%2fserver.py",
        "/page/..%2f..%2fetc%2fpasswd",
        "/viewer/..%2f..%2fetc/",
        "/api/v1/runs/..%2f..%2fzones.db",
        "/api/v1/runs/.hidden",
    ],
)
def test_no_path_leaves_its_folder(client: httpx.Client, path: str) -> None:
    assert client.get(path).status_code in (404, 422)


@pytest.mark.parametrize("version", ["3", 'W/"3"', '"x"', '"1", "2"', '"' + "9" * 50 + '"'])
def test_an_if_match_that_is_no_version_is_refused(client: httpx.Client, version: str) -> None:
    client.post("/api/v1/zones", json=zone())
    answer = client.delete("/api/v1/zones/z1", headers={"If-Match": version})
    assert wrong(answer, 400)["message"].startswith("If-Match")
    assert len(client.get("/api/v1/zones").json()["features"]) == 1


@pytest.mark.parametrize(
    "framing", ["Content-Length: 10", f"Content-Length: {10**9}", "Transfer-Encoding: chunked"]
)
def test_a_stop_does_not_wait_for_its_body(
    framing: str, server: ConsoleServer, operations: FakeOperations
) -> None:
    host = server.url.removeprefix("http://")
    name, port = host.split(":")
    with socket.create_connection((name, int(port)), timeout=5) as connection:
        connection.sendall(
            f"POST /api/v1/stop HTTP/1.1\r\nHost: {host}\r\n{framing}\r\n\r\n".encode()
        )
        assert connection.recv(100).startswith(b"HTTP/1.1 200")
    assert operations.stops == ["REST"]


def test_what_a_stop_says_in_its_body_matters_neither_for_it_nor_for_what_follows(
    client: httpx.Client, operations: FakeOperations
) -> None:
    for body in (b"{", b"[" * 5_000_000, b""):
        assert client.post("/api/v1/stop", content=body, headers=JSON).status_code == 200
        assert client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0}).status_code == 201
    assert len(operations.stops) == 3
