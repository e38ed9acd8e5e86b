"""The beware list over the API."""

from __future__ import annotations

from pathlib import Path

import httpx

from navcore.mission.beware_list import load_beware_list
from tests.web.api.answers import wrong
from tests.web.fake_operations import FakeOperations


def test_switching_the_colour_rule_off_and_on_changes_the_map_and_the_path(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0.0})
    pictures, lengths = [], []
    for enabled in (True, False, True):
        listed = client.patch("/api/v1/beware/red floor", json={"enabled": enabled}).json()
        assert listed["classes"][0]["enabled"] is enabled
        pictures.append(client.get("/api/v1/map.png").content)
        lengths.append(client.get("/api/v1/state").json()["distance_to_goal_m"])
    assert pictures[0] == pictures[2] != pictures[1]
    assert lengths[0] == lengths[2] > lengths[1]


def test_the_beware_list_is_read_replaced_and_guarded_by_its_version(client: httpx.Client) -> None:
    listed = client.get("/api/v1/beware")
    body = listed.json()
    body["classes"][1]["margin_m"] = 0.4
    assert (
        client.put(
            "/api/v1/beware", json=body, headers={"If-Match": listed.headers["etag"]}
        ).json()["version"]
        == 1
    )
    late = client.put("/api/v1/beware", json=body, headers={"If-Match": listed.headers["etag"]})
    assert (
        wrong(late, 409)["code"] == "outdated"
        and late.json()["stored"]["classes"][1]["margin_m"] == 0.4
    )
    body["classes"][1]["name"] = body["classes"][0]["name"]
    assert "more than once" in wrong(client.put("/api/v1/beware", json=body), 422)["message"]
    rule = {"colour": {"hue_deg": [10, 20]}, "margin_m": 0.2}
    entry = client.patch("/api/v1/beware/book", json=rule).json()["classes"][1]
    assert entry["colour"]["hue_deg"] == [10, 20] and entry["margin_m"] == 0.2


def test_an_edit_of_one_class_is_guarded_by_the_lists_version_too(client: httpx.Client) -> None:
    seen = {"If-Match": client.get("/api/v1/beware").headers["etag"]}
    first = client.patch("/api/v1/beware/cup", json={"min_confidence": 0.7}, headers=seen)
    assert (first.status_code, first.headers["etag"]) == (200, '"1"')
    late = client.patch("/api/v1/beware/cup", json={"min_confidence": 0.1}, headers=seen)
    assert wrong(late, 409)["code"] == "outdated" and late.json()["stored_version"] == 1
    assert client.get("/api/v1/beware").json()["classes"][2]["min_confidence"] == 0.7


def test_each_class_says_what_finds_it_and_what_may_be_absent_can_be_taken_away(
    client: httpx.Client,
) -> None:
    found = {
        entry["name"]: entry["found_by"] for entry in client.get("/api/v1/beware").json()["classes"]
    }
    assert (found["red floor"], found["cable"]) == ("colour rule", "nothing")
    named = client.patch(
        "/api/v1/beware/cup", json={"label": "Tasse", "min_height_m": 0.08}
    ).json()["classes"][2]
    assert (named["name"], named["label"], named["min_height_m"]) == ("cup", "Tasse", 0.08)
    bare = client.patch(
        "/api/v1/beware/cup", json={"label": None, "colour": None, "enabled": None}
    ).json()["classes"][2]
    assert (bare["label"], bare["colour"], bare["enabled"], bare["min_height_m"]) == (
        None,
        None,
        True,
        0.08,
    )
    assert bare["found_by"] == "nothing"
    long = client.patch("/api/v1/beware/cable", json={"min_size_m": 0.4}).json()["classes"][4]
    assert (long["name"], long["min_size_m"]) == ("cable", 0.4)
    assert (
        client.patch("/api/v1/beware/cable", json={"min_size_m": None}).json()["classes"][4][
            "min_size_m"
        ]
        is None
    )


def test_the_list_as_a_file_is_the_list(
    client: httpx.Client, operations: FakeOperations, tmp_path: Path
) -> None:
    for label in ('Tasse "é" \\ 1', "kopje – 茶碗"):
        assert client.patch("/api/v1/beware/cup", json={"label": label}).status_code == 200
        answer = client.get("/api/v1/beware.toml")
        (tmp_path / "list.toml").write_bytes(answer.content)
        assert load_beware_list(tmp_path / "list.toml").classes == operations.beware.list.classes


def test_an_empty_beware_list_needs_force_and_the_defaults_come_back(
    client: httpx.Client, operations: FakeOperations
) -> None:
    shipped = operations.beware.list.classes
    refused = wrong(client.put("/api/v1/beware", json={"classes": []}), 409)
    assert refused["code"] == "needs_force"
    assert "the beware list would be empty" in refused["message"]
    assert operations.beware.list.classes == shipped
    assert operations.state().beware_enabled == sum(entry.enabled for entry in shipped)
    emptied = client.put("/api/v1/beware?force=true", json={"classes": []})
    assert emptied.status_code == 200 and emptied.json()["classes"] == []
    assert client.get("/api/v1/state").json()["beware_enabled"] == 0
    restored = client.post("/api/v1/beware/defaults").json()
    assert (
        operations.beware.list.classes == shipped
        and restored["version"] == emptied.json()["version"] + 1
    )


def test_a_ready_made_list_is_taken_by_name(client: httpx.Client) -> None:
    preview = {"ready_made": "outdoor"}
    changes = client.post("/api/v1/beware/preview", json=preview).json()["changes"]
    taken = client.post("/api/v1/beware/defaults?name=outdoor").json()["classes"]
    on = {entry["name"] for entry in taken if entry["enabled"]}
    assert "landmine" in on and "keyboard" not in on
    assert any("keyboard" in change for change in changes)
    wrong(client.post("/api/v1/beware/defaults?name=kitchen"), 422)
    wrong(client.post("/api/v1/beware/preview", json={"ready_made": "kitchen"}), 422)


def test_edits_of_the_beware_list_are_undone_one_by_one(
    client: httpx.Client, operations: FakeOperations
) -> None:
    shipped = operations.beware.list.classes
    assert not client.get("/api/v1/beware").json()["can_undo"]
    assert "no edit" in wrong(client.post("/api/v1/beware/undo"), 409)["message"]
    client.patch("/api/v1/beware/cup", json={"margin_m": 0.3})
    client.patch("/api/v1/beware/cup", json={"enabled": False})
    client.put("/api/v1/beware?force=true", json={"classes": []})
    cup = client.post("/api/v1/beware/undo").json()["classes"][2]
    assert (cup["name"], cup["margin_m"], cup["enabled"]) == ("cup", 0.3, False)
    assert client.post("/api/v1/beware/undo").json()["classes"][2]["enabled"]
    last = client.post("/api/v1/beware/undo")
    assert operations.beware.list.classes == shipped and not last.json()["can_undo"]
    assert last.json()["version"] == 6 and last.headers["etag"] == '"6"'
