"""Routes of the captured frames: capture, annotate, take along, and what is refused in words."""

from __future__ import annotations

import asyncio
import io
import json
import socket
import tempfile
import time
from typing import BinaryIO, cast

import httpx
import pytest
from starlette.types import Message

from app.teaching.frames import frame_archive
from app.teaching.frames.frame_store import FrameStore
from navcore.geometry.transform import Pose2
from tests.app.teaching.scenes import BLOCK, HEIGHT, WIDTH, frame_at
from tests.web.fake_operations import FakeOperations
from web.api import archive
from web.server import ConsoleServer


def runs_of_block(label: int = 1) -> list[int]:
    """Return the runs of an annotation of the block."""
    rows, cols = BLOCK
    before, width = rows.start * WIDTH + cols.start, cols.stop - cols.start
    runs = [0, before]
    for _ in range(rows.stop - rows.start):
        runs += [label, width, 0, WIDTH - width]
    runs[-1] += HEIGHT * WIDTH - sum(runs[1::2])
    return runs


def look(operations: FakeOperations, x_m: float = 1.0, brightness: int = 120) -> None:
    """Show the robot a frame."""
    frame = frame_at(x_m, brightness=brightness)
    operations.recent.note(frame, 0, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))


def test_a_frame_is_captured_annotated_and_taken_along(
    operations: FakeOperations, client: httpx.Client
) -> None:
    look(operations)
    frame = client.post("/api/v1/teach/frames").json()["frame"]
    assert client.post("/api/v1/teach/frames").json()["frame"] is None  # a near-duplicate
    url = f"/api/v1/teach/frames/{frame['id']}"
    assert client.get(f"{url}.png").content.startswith(b"\x89PNG")
    region = client.post(f"{url}/region", json={"row": 35, "col": 30}).json()
    assert region["runs"] == runs_of_block()
    body = {"class_names": ["cup"], "runs": region["runs"]}
    assert client.put(f"{url}/labels", json=body).json()["class_names"] == ["cup"]
    stored = client.get(f"{url}/labels").json()
    label = stored["class_names"].index("cup") + 1
    assert stored["runs"] == runs_of_block(label)
    archive = client.get("/api/v1/teach/frames.zip").content
    assert client.post("/api/v1/teach/frames.zip", content=archive).json() == {"added": 1}
    listed = client.get("/api/v1/teach/frames").json()
    assert listed["folder"]["annotated"] == 2 and listed["folder"]["dropped"] == 1
    assert client.delete(url).status_code == 204
    assert client.get(f"{url}/labels").status_code == 404


def test_the_marks_of_another_operator_are_not_overwritten_unseen(
    operations: FakeOperations, client: httpx.Client
) -> None:
    look(operations)
    client.post("/api/v1/teach/frames")
    url = "/api/v1/teach/frames/000001/labels"
    empty = client.get(url)
    first = {"If-Match": empty.headers["ETag"]}
    cup, book = ({"class_names": [name], "runs": runs_of_block()} for name in ("cup", "book"))
    marked = client.put(url, json=cup, headers=first)
    assert marked.headers["ETag"] == f'"{marked.json()["version"]}"' != empty.headers["ETag"]
    late = client.put(url, json=book, headers=first)
    assert late.status_code == 409 and late.json()["error"]["code"] == "outdated"
    stored = client.get(url)
    assert late.json()["stored"] == stored.json() and "cup" in stored.json()["class_names"]
    assert late.headers["ETag"] == stored.headers["ETag"] == marked.headers["ETag"]
    assert client.put(url, json=cup, headers=first).status_code == 200, "it is stored already"
    listed = client.get("/api/v1/teach/frames").json()["frames"][0]
    assert listed["version"] == stored.json()["version"] and listed["class_names"] == ["cup"]
    assert client.put(url, json=book).json()["class_names"] == ["book"]
    seen = {"If-Match": client.get(url).headers["ETag"]}
    assert client.put(url, json=cup, headers=seen).json()["class_names"] == ["cup"]


def test_a_client_that_stops_reading_does_not_hold_the_export(
    operations: FakeOperations,
    server: ConsoleServer,
    client: httpx.Client,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def large(store: FrameStore) -> BinaryIO:
        file = cast(BinaryIO, tempfile.TemporaryFile())  # noqa: SIM115 - the answer closes it
        file.truncate(50_000_000)
        return file

    def export() -> int:
        with client.stream("GET", "/api/v1/teach/frames.zip") as answer:
            return answer.status_code

    monkeypatch.setattr(frame_archive, "exported", large)
    monkeypatch.setattr(archive, "STALL_S", 2.0)
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=60) as stalled:
        request = f"GET /api/v1/teach/frames.zip HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n"
        stalled.sendall(request.encode())
        assert stalled.recv(12) == b"HTTP/1.1 200"
        assert export() == 409
        deadline = time.monotonic() + 60
        while export() != 200:
            assert time.monotonic() < deadline
            time.sleep(0.1)


@pytest.mark.parametrize(("bytes_per_s", "taken"), [(2e6, 1_000_000), (1e3, 0)])
def test_an_export_goes_on_for_a_slow_client_and_ends_with_one_line_for_one_that_stalls(
    bytes_per_s: float,
    taken: int,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    file, came = io.BytesIO(bytes(1_000_000)), [0]

    async def send(message: Message) -> None:
        size = len(message.get("body", b""))
        await asyncio.sleep(size / bytes_per_s)
        came[0] += size

    monkeypatch.setattr(archive, "STALL_S", 0.3)
    asyncio.run(archive.Archive(file, "frames.zip").stream_response(send))
    assert file.closed and came == [taken]
    lines = [] if taken else ["an export ends: its client has taken no part within 0.3 s"]
    assert caplog.messages == lines


def test_an_annotation_of_very_many_runs_is_no_too_large_request(
    operations: FakeOperations, client: httpx.Client
) -> None:
    look(operations)
    client.post("/api/v1/teach/frames")
    body = json.dumps({"class_names": ["cup"], "runs": runs_of_block()}) + " " * 2_000_000
    headers = {"Content-Type": "application/json"}
    url = "/api/v1/teach/frames/000001/labels"
    assert client.put(url, content=body, headers=headers).status_code == 200
    assert client.put(url, content=body + " " * 4_000_000, headers=headers).status_code == 413


def test_what_cannot_be_an_annotation_is_refused_in_words(
    operations: FakeOperations, client: httpx.Client
) -> None:
    operations.recent.forget()
    assert "no image yet" in refusal(client.post("/api/v1/teach/frames"), 409)
    look(operations)
    client.post("/api/v1/teach/frames")
    url = "/api/v1/teach/frames/000001/labels"
    runs, few = runs_of_block(), [1, 5]
    assert "beware list" in refused(client, url, {"class_names": ["dragon"], "runs": runs})
    assert "twice" in refused(client, url, {"class_names": ["cup", "Cup"], "runs": runs})
    assert "cover 5 pixels" in refused(client, url, {"class_names": ["cup"], "runs": few})
    assert "beyond" in refused(client, url, {"class_names": [], "runs": runs})
    many = {"class_names": ["cup"], "runs": [2, HEIGHT * WIDTH]}
    assert "label 2" in refused(client, url, many)
    damaged = client.post("/api/v1/teach/frames.zip", content=b"PK\x03\x04 no more")
    assert "damaged" in refusal(damaged, 422)
    assert client.get("/api/v1/teach/frames").json()["folder"]["annotated"] == 0


def refused(client: httpx.Client, url: str, body: dict[str, object]) -> str:
    """Return the sentence by which an annotation is refused."""
    return refusal(client.put(url, json=body), 422)


def refusal(answer: httpx.Response, status: int) -> str:
    """Return the sentence of a refusal."""
    assert answer.status_code == status, answer.text
    return str(answer.json()["error"]["message"])
