"""The sites over HTTP: made, chosen, renamed, copied, exported, imported, deleted."""

from __future__ import annotations

import asyncio
import base64
import io
import math
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import httpx
import pytest
from starlette.types import Message

from navcore.errors import Refused
from tests.web.fake_operations import FakeOperations
from web.api.archive import PART_BYTES, Archive
from web.gateway.request_body import MAX_BODY_BYTES
from web.interface.single_file import SingleFile
from web.server import ConsoleServer

YAML = (
    "image: map.pgm\nresolution: 0.1\norigin: [-1.0, -1.0, 0.0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
PICTURE = base64.b64encode(b"P5 20 20 255\n" + bytes([254] * 400)).decode()

OTHER_SITE = {
    "code": "other_site",
    "message": "the robot is at another site now; nothing was changed",
    "where": None,
}
RING = [[0, 0], [1, 0], [1, 1], [0, 0]]
ZONE: dict[str, Any] = {"name": "wet", "geometry": {"type": "Polygon", "coordinates": [RING]}}


def names(client: httpx.Client) -> list[str]:
    return [site["name"] for site in client.get("/api/v1/sites").json()["sites"]]


def test_a_site_is_made_chosen_renamed_copied_and_deleted(client: httpx.Client) -> None:
    assert client.post("/api/v1/sites", json={"name": "Ward 3"}).status_code == 201
    assert names(client) == ["Ward 3", "default"]
    assert client.post("/api/v1/sites/Ward%203/choose").is_success
    assert client.get("/api/v1/state").json()["site"] == "Ward 3"
    answer = client.patch("/api/v1/sites/Ward%203", json={"name": "Ward 4"})
    assert answer.json()["name"] == "Ward 4"
    assert client.get("/api/v1/sites").json()["chosen"] == "Ward 4"
    assert client.post("/api/v1/sites/Ward%204/copy", json={"name": "Ward 5"}).status_code == 201
    assert client.delete("/api/v1/sites/Ward%205").status_code == 204
    assert client.delete("/api/v1/sites/Ward%205").status_code == 404
    refused = client.delete("/api/v1/sites/Ward%204")
    assert refused.status_code == 409 and "choose another" in refused.text
    assert names(client) == ["Ward 4", "default"]


def test_what_is_meant_for_the_map_of_another_site_changes_nothing(client: httpx.Client) -> None:
    there = {"Site-Id": client.get("/api/v1/state").json()["site_id"]}
    goal = {"x_m": -4.0, "y_m": 3.0}
    client.post("/api/v1/sites", json={"name": "hall"})
    client.post("/api/v1/sites/hall/choose")
    for path, body in (("goals", goal), ("zones", ZONE)):
        refused = client.post(f"/api/v1/{path}", json=body, headers=there)
        assert refused.status_code == 409 and refused.json()["error"] == OTHER_SITE
    assert client.post("/api/v1/stop", headers=there).is_success, "wherever the robot is"
    assert client.post("/api/v1/stop/reset", headers=there).is_success
    taught = client.put("/api/v1/teach/capturing", json={"on": True}, headers=there)
    assert taught.is_success, "what is taught lies on no map"
    state = client.get("/api/v1/state", headers=there).json()
    assert state["queue"] == [] and client.get("/api/v1/zones").json()["features"] == []
    here = {"Site-Id": state["site_id"]}
    client.patch("/api/v1/sites/hall", json={"name": "nave"}, headers=here)
    assert client.post("/api/v1/goals", json=goal, headers=here).status_code == 201
    assert client.post("/api/v1/zones", json=ZONE, headers=here).status_code == 201


@pytest.mark.parametrize(
    ("owner", "name", "method", "path", "body"),
    [
        ("goals", "add", "POST", "goals", {"x_m": -4.0, "y_m": 3.0}),
        ("goals", "loop", "PUT", "mission/loop", {"loop": True}),
        ("goals", "save", "PUT", "missions/night", None),
        ("zones", "add", "POST", "zones", ZONE),
        ("zones", "save_set", "PUT", "zone-sets/night", None),
        ("beware", "edit", "PATCH", "beware/cup", {"margin_m": 0.5}),
        ("map_edits", "erase", "POST", "map/erase", {"geometry": ZONE["geometry"]}),
        ("path_settings", "set_unknown_price", "PUT", "path/settings", {"unknown_price": 2.0}),
        ("edits", "undo", "POST", "edits/undo", None),
    ],
)
def test_an_edit_is_refused_where_the_site_has_changed_between_its_check_and_its_turn(
    owner: str,
    name: str,
    method: str,
    path: str,
    body: dict[str, Any] | None,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client.post("/api/v1/zones", json=ZONE)
    before = client.get("/api/v1/edits").json()
    here = {"Site-Id": client.get("/api/v1/state").json()["site_id"]}
    operations.sites.make("hall")
    editor = getattr(operations, owner)
    act = getattr(editor, name)

    def in_turn(*given: Any, **named: Any) -> Any:
        operations.sites.choose("hall")
        return act(*given, **named)

    monkeypatch.setattr(editor, name, in_turn)
    refused = client.request(method, f"/api/v1/{path}", json=body, headers=here)
    assert refused.status_code == 409 and refused.json()["error"] == OTHER_SITE
    assert client.get("/api/v1/edits").json() == before
    assert client.get("/api/v1/goals").json()["queue"] == []
    assert client.get("/api/v1/missions").json() == client.get("/api/v1/zone-sets").json() == []


def test_the_site_stays_while_a_mission_drives(client: httpx.Client) -> None:
    client.post("/api/v1/sites", json={"name": "hall"})
    client.post("/api/v1/goals", json={"x_m": -4.0, "y_m": 3.0})
    client.post("/api/v1/mission/start")
    refused = client.post("/api/v1/sites/hall/choose")
    assert refused.status_code == 409 and "pause or cancel" in refused.text
    assert client.get("/api/v1/state").json()["site"] == "default"
    client.post("/api/v1/mission/pause")
    assert client.post("/api/v1/sites/hall/choose").is_success


@pytest.mark.parametrize(
    "name",
    ["", " a", "a ", "../up", "a/b", "a\\b", ".hidden", "a\x00b", "a\n", "★", "x" * 41, "CON:", 7],
)
def test_a_name_that_is_no_plain_file_name_is_refused(client: httpx.Client, name: Any) -> None:
    assert client.post("/api/v1/sites", json={"name": name}).status_code == 422
    assert client.patch("/api/v1/sites/default", json={"name": name}).status_code == 422
    assert client.post("/api/v1/sites/default/copy", json={"name": name}).status_code == 422
    assert names(client) == ["default"]


def test_dock_and_tags_are_set_one_by_one_and_removed_by_null(client: httpx.Client) -> None:
    dock = {"x_m": 1.0, "y_m": -2.0, "yaw_rad": 0.5}
    tag = {"id": 7, "x_m": 3.0, "y_m": 1.0, "z_m": 0.4, "yaw_rad": math.pi, "size_m": 0.16}
    measured = {"sigma_m": 0.01, "sigma_rad": 0.0175}
    assert client.patch("/api/v1/sites/default", json={"dock": dock}).json()["dock"] == dock
    site = client.patch("/api/v1/sites/default", json={"tags": [tag]}).json()
    assert (site["dock"], site["tags"]) == (dock, [tag | measured])
    site = client.patch("/api/v1/sites/default", json={"dock": None}).json()
    assert (site["dock"], site["tags"]) == (None, [tag | measured])
    for bad in ({"tags": [{**tag, "size_m": 0.0}]}, {"dock": {"x_m": 1.0}}, {"colour": "red"}):
        assert client.patch("/api/v1/sites/default", json=bad).status_code == 422


def test_two_operators_who_add_tags_at_once_keep_both(client: httpx.Client) -> None:
    tag = {"id": 7, "x_m": 3.0, "y_m": 1.0, "z_m": 0.4, "yaw_rad": 0.0, "size_m": 0.16}
    dock = {"x_m": 1.0, "y_m": -2.0, "yaw_rad": 0.5}
    client.patch("/api/v1/sites/default", json={"dock": dock})
    for number in (9, 7, 8):
        client.post("/api/v1/sites/default/tags", json={**tag, "id": number})
    site = client.post("/api/v1/sites/default/tags", json={**tag, "id": 8, "x_m": 4.0}).json()
    assert [(one["id"], one["x_m"]) for one in site["tags"]] == [(7, 3.0), (8, 4.0), (9, 3.0)]
    assert site["dock"] == dock
    site = client.delete("/api/v1/sites/default/tags/7").json()
    assert [one["id"] for one in site["tags"]] == [8, 9] and site["dock"] == dock
    assert client.delete("/api/v1/sites/default/tags/7").status_code == 404
    assert client.post("/api/v1/sites/default/tags", json={**tag, "size_m": 0}).status_code == 422


def test_a_refused_name_leaves_dock_and_tags_as_they_were(client: httpx.Client) -> None:
    client.post("/api/v1/sites", json={"name": "hall"})
    changes = {"name": "hall", "dock": {"x_m": 1.0, "y_m": 0.0, "yaw_rad": 0.0}}
    assert client.patch("/api/v1/sites/default", json=changes).status_code == 409
    assert client.get("/api/v1/sites/default").json()["dock"] is None


def test_tags_in_view_are_returned_as_they_can_be_stored(client: httpx.Client) -> None:
    (seen,) = client.get("/api/v1/tags/seen?size_m=0.16").json()
    assert (seen["tag"]["id"], seen["tag"]["size_m"], seen["known"]) == (12, 0.16, False)
    site = client.patch("/api/v1/sites/default", json={"tags": [seen["tag"]]}).json()
    assert site["tags"] == [seen["tag"]]
    assert client.get("/api/v1/tags/seen?size_m=0.16").json()[0]["known"]
    for bad in ("", "?size_m=0", "?size_m=nan", "?size_m=1e9"):
        assert client.get(f"/api/v1/tags/seen{bad}").status_code == 422


def test_an_archive_larger_than_other_bodies_is_taken(
    client: httpx.Client, operations: FakeOperations
) -> None:
    archive = bytes(MAX_BODY_BYTES + 1)
    assert client.post("/api/v1/sites/import?name=big", content=archive).status_code == 201
    assert operations.sites.archives == [archive]
    elsewhere = client.post("/api/v1/sites/default/copy", content=archive)
    assert elsewhere.status_code == 413
    assert client.post("/api/v1/sites/import?name=..", content=b"-").status_code == 422


def test_a_site_and_its_nav2_map_are_files_to_download(client: httpx.Client) -> None:
    for kind in ("export", "nav2"):
        answer = client.get(f"/api/v1/sites/default/{kind}")
        assert answer.headers["content-type"] == "application/zip"
        assert "default" in answer.headers["content-disposition"] and b"default" in answer.content
        assert client.get(f"/api/v1/sites/elsewhere/{kind}").status_code == 404


def test_a_name_has_letters_of_any_language_also_as_that_of_a_file(client: httpx.Client) -> None:
    for name in ("Küche", "倉庫 2"):
        assert client.post("/api/v1/sites", json={"name": name}).status_code == 201
        assert name in names(client)
        answer = client.get(f"/api/v1/sites/{quote(name)}/export")
        assert answer.status_code == 200
        file = answer.headers["content-disposition"].removeprefix("attachment; filename*=UTF-8''")
        assert unquote(file) == f"{name}.site.zip"
        assert client.delete(f"/api/v1/sites/{quote(name)}").status_code == 204
    assert client.post("/api/v1/sites", json={"name": "Ward 7"}).status_code == 201
    assert client.get(f"/api/v1/sites/{quote('ward  7')}/export").status_code == 200
    assert client.delete(f"/api/v1/sites/{quote('Ward 7')}").status_code == 204
    for name in ("a/b", "★", "", "x" * 41, "_a"):
        assert client.post("/api/v1/sites", json={"name": name}).status_code == 422


def test_one_site_is_exported_at_a_time(
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def pack(name: str) -> bytes:
        inner.append(httpx.get(f"{server.url}/api/v1/sites/default/nav2", trust_env=False))
        return b"zip"

    inner = list[httpx.Response]()
    monkeypatch.setattr(operations.sites, "export", pack)
    assert client.get("/api/v1/sites/default/export").content == b"zip"
    assert inner[0].status_code == 409 and "exported already" in inner[0].text
    assert client.get("/api/v1/sites/default/nav2").is_success
    assert client.get("/api/v1/sites/elsewhere/export").status_code == 404
    assert client.get("/api/v1/sites/default/export").is_success


def test_an_archive_is_closed_before_its_last_part_is_sent() -> None:
    file, was_closed = io.BytesIO(bytes(PART_BYTES + 1)), list[bool]()

    async def send(message: Message) -> None:
        if message.get("body"):
            was_closed.append(file.closed)

    asyncio.run(Archive(file, "a.zip").stream_response(send))
    assert was_closed == [False, True]


def test_an_archive_whose_client_has_gone_is_closed_also_where_no_thread_is_free() -> None:
    file = io.BytesIO(bytes(2 * PART_BYTES))

    async def leave() -> None:
        began, freed = asyncio.Event(), threading.Event()
        loop = asyncio.get_running_loop()
        loop.set_default_executor(ThreadPoolExecutor(1))
        loop.run_in_executor(None, freed.wait, 30)

        async def send(message: Message) -> None:
            if message.get("body"):
                began.set()
                await asyncio.Event().wait()

        async def receive() -> Message:
            await began.wait()
            return {"type": "http.disconnect"}

        await Archive(file, "a.zip")({"type": "http"}, receive, send)
        assert not file.closed
        freed.set()
        await asyncio.to_thread(lambda: None)

    asyncio.run(leave())
    assert file.closed


def test_an_archive_counts_as_one_until_its_answer_has_ended() -> None:
    one = SingleFile("is exported already")
    first = one.open(lambda: io.BytesIO(b"1"))
    with pytest.raises(Refused, match="exported already"):
        one.open(io.BytesIO)
    first.close()
    with pytest.raises(OSError):
        one.open(lambda: io.BytesIO(Path("/no/such/file").read_bytes()))
    second = one.open(io.BytesIO)
    del second  # an answer that was never begun
    one.open(io.BytesIO)


def test_a_nav2_map_is_placed_by_two_points(
    client: httpx.Client, operations: FakeOperations
) -> None:
    body = {
        "name": "hall",
        "yaml": YAML,
        "picture": PICTURE,
        "alignment": {"on_map": [[0, 0], [4, 0]], "on_site": [[1.0, 1.0], [1.0, 5.0]]},
    }
    assert client.post("/api/v1/sites/import-nav2", json=body).status_code == 201
    placed = operations.sites.placed
    assert placed is not None
    assert (placed.x_m, placed.y_m, placed.yaw_rad) == pytest.approx((1.0, 1.0, math.pi / 2))
    body["alignment"] = {"on_map": [[0, 0], [4, 0]], "on_site": [[1.0, 1.0], [1.0, 9.0]]}
    refused = client.post("/api/v1/sites/import-nav2", json={**body, "name": "other"})
    assert refused.status_code == 422 and "+100 %" in refused.text
    for bad in ({"picture": "%"}, {"yaml": "{"}, {"picture": base64.b64encode(b"P5").decode()}):
        refused = client.post(
            "/api/v1/sites/import-nav2", json={**body, "alignment": None, "name": "bad", **bad}
        )
        assert refused.status_code == 422
    assert names(client) == ["default", "hall"]


def test_changes_are_accepted_area_by_area_as_they_were_listed(client: httpx.Client) -> None:
    first = client.get("/api/v1/map/changes").json()
    assert (first["accepted"], first["areas"]) == (False, [])
    listed = client.post("/api/v1/map/changes/accept", json={}).json()
    assert [area["kind"] for area in listed["areas"]] == ["appeared", "gone"]
    assert listed["areas"][0]["outline"] == [[-4.0, 3.0], [-3.0, 3.0], [-3.0, 4.0]]
    body = {"listing": listed["listing"], "areas": [1]}
    rest = client.post("/api/v1/map/changes/accept", json=body).json()
    assert [area["id"] for area in rest["areas"]] == [0]
    outdated = client.post("/api/v1/map/changes/accept", json=body)
    assert outdated.status_code == 409 and outdated.json()["error"]["code"] == "outdated"
