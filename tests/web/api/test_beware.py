"""Routes of the beware list: edit it, preview an edit, make a colour rule, bring back versions."""

from __future__ import annotations

import base64
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from tests.web import fake_operations
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations

BEWARE = "/api/v1/beware"
RED = {"right": 170 / 320, "down": 130 / 180}
BLUE = {"hue_deg": [200.0, 250.0], "min_saturation": 0.5, "min_value": 0.2}


def names(client: httpx.Client) -> list[str]:
    """Return the names in the list, in order."""
    return [entry["name"] for entry in client.get(BEWARE).json()["classes"]]


def test_a_class_is_added_renamed_moved_and_removed(client: httpx.Client) -> None:
    before = names(client)
    added = client.post(BEWARE, json={"name": "blue tape", "colour": BLUE, "margin_m": 0.1})
    assert added.status_code == 201 and added.headers["ETag"] == '"1"'
    tape = added.json()["classes"][-1]
    assert (tape["name"], tape["found_by"], tape["margin_m"]) == ("blue tape", "colour rule", 0.1)
    renamed = client.patch(f"{BEWARE}/blue tape", json={"name": "tape"}).json()["classes"][-1]
    assert (renamed["name"], renamed["class_id"]) == ("tape", tape["class_id"])
    order = ["tape", *before]
    assert client.put(f"{BEWARE}/order", json={"names": order}).status_code == 200
    assert names(client) == order
    assert client.delete(f"{BEWARE}/tape").status_code == 200
    assert names(client) == before
    assert client.post(f"{BEWARE}/undo").json()["can_redo"] and names(client) == order
    client.post(f"{BEWARE}/redo")
    assert names(client) == before
    assert wrong(client.delete(f"{BEWARE}/tape"), 404)
    stale = client.delete(f"{BEWARE}/cup", headers={"If-Match": '"1"'})
    assert wrong(stale, 409)["code"] == "outdated"


def test_a_pattern_of_colours_is_given_changed_and_kept(client: httpx.Client) -> None:
    pattern = {"max_gap_m": 0.3, "max_value": 0.2}
    tape = {"name": "blue-black tape", "colour": {**BLUE, "pattern": pattern}}
    added = client.post(BEWARE, json=tape).json()["classes"][-1]
    assert added["colour"]["pattern"] == added["colour"]["pattern"] | pattern
    wider = {"colour": {**added["colour"], "hue_deg": [190, 260]}}
    changed = client.patch(f"{BEWARE}/blue-black tape", json=wider).json()["classes"][-1]
    assert changed["colour"] == wider["colour"]
    text = client.get(f"{BEWARE}.toml").text
    assert client.put(f"{BEWARE}.toml", content=text).json()["classes"][-1] == changed
    plain = {"colour": {**added["colour"], "pattern": None}}
    after = client.patch(f"{BEWARE}/blue-black tape", json=plain).json()["classes"][-1]
    assert after["colour"]["pattern"] is None
    endless = {"colour": {**BLUE, "pattern": {"max_gap_m": 99}}}
    assert "max_gap_m" in str(
        wrong(client.patch(f"{BEWARE}/blue-black tape", json=endless), 422)["where"]
    )


def test_versions_are_listed_compared_and_brought_back(client: httpx.Client) -> None:
    client.patch(f"{BEWARE}/cup", json={"margin_m": 0.4})
    client.patch(f"{BEWARE}/cup", json={"enabled": False})
    versions = client.get(f"{BEWARE}/versions").json()["versions"]
    assert [one["version"] for one in versions] == [2, 1, 0]
    assert versions[0]["what"] == "“cup” switched off" and versions[0]["unix_s"] == 1e9
    compared = client.get(f"{BEWARE}/versions/0").json()
    assert compared["changes"] == ["“cup” switched on", "“cup”: margin 0.4 m → 0.05 m"]
    back = client.post(f"{BEWARE}/versions/0/restore").json()
    assert back["version"] == 3
    assert client.get(f"{BEWARE}/versions/0").json()["changes"] == []
    assert wrong(client.get(f"{BEWARE}/versions/9"), 404)
    assert wrong(client.post(f"{BEWARE}/versions/9/restore"), 404)


def test_the_file_of_the_list_is_exported_and_imported(client: httpx.Client) -> None:
    text = client.get(f"{BEWARE}.toml").text
    changed = text.replace('name = "cup"', 'name = "mug"')
    assert client.put(f"{BEWARE}.toml", content=changed).status_code == 200
    assert "mug" in names(client) and "cup" not in names(client)
    wide = text.replace("min_size_m = 0.5", "min_size_m = 9")
    line = next(i for i, said in enumerate(wide.splitlines(), 1) if said == "min_size_m = 9")
    damaged = wrong(client.put(f"{BEWARE}.toml", content=wide), 422)
    assert f"line {line}: beware[10].min_size_m: 9.0 is out of range" in damaged["message"]
    assert "UTF-8" in wrong(client.put(f"{BEWARE}.toml", content=b"\xff"), 422)["message"]
    assert "would be empty" in wrong(client.put(f"{BEWARE}.toml", content=""), 409)["message"]
    assert "mug" in names(client)
    assert client.put(f"{BEWARE}.toml?force=true", content="").json()["classes"] == []


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        ({"name": "cup"}, 422, "there is a class 'cup' already"),
        ({"name": "\n"}, 422, "name"),
        ({}, 422, "name"),
        ({"name": "x", "class_id": 4}, 422, "class_id"),
        ({"name": "x", "margin_m": 3}, 422, "margin_m"),
        ({"name": "x", "colour": {"hue_deg": [0, 999]}}, 422, "hue_deg"),
        ({"name": "x", "colour": {"hue_deg": [0, 360], "min_saturation": 0, "min_value": 0,
                                  "max_height_m": 3.0}},
         422, "the colour rule of “x” takes"),
    ],
)  # fmt: skip
def test_a_wrong_class_is_refused_by_name(
    client: httpx.Client, body: dict[str, Any], status: int, words: str
) -> None:
    before = client.get(BEWARE).json()
    for path, sent in ((BEWARE, body), (f"{BEWARE}/preview", {"add": body})):
        error = wrong(client.post(path, json=sent), status)
        assert words in error["message"] + str(error["where"])
    assert client.get(BEWARE).json() == before


def test_the_last_class_needs_force(client: httpx.Client) -> None:
    for name in names(client)[1:]:
        client.delete(f"{BEWARE}/{name}")
    assert "nothing" in wrong(client.delete(f"{BEWARE}/red floor"), 409)["message"]
    assert client.delete(f"{BEWARE}/red floor?force=true").json()["classes"] == []
    client.post(f"{BEWARE}/undo")
    assert names(client) == ["red floor"]


def test_a_preview_says_which_cells_and_how_the_path_changes_and_applies_nothing(
    client: httpx.Client,
) -> None:
    bare = client.post(f"{BEWARE}/preview", json={"changes": {"red floor": None}}).json()
    assert bare["go_count"] == len(bare["go"]) > 300 and bare["appear"] == []
    assert bare["path"] is None and bare["change_m"] is None
    client.post("/api/v1/goals", json={"x_m": 3.0, "y_m": 0.0})
    off = {"changes": {"red floor": {"enabled": False}}}
    without = client.post(f"{BEWARE}/preview", json=off).json()
    assert without["change_m"] < -0.3 and without["change_s"] < 0
    assert without["go_count"] == bare["go_count"] and without["cut_off"] == []
    wide = client.post(
        f"{BEWARE}/preview", json={"changes": {"red floor": {"margin_m": 0.8}}}
    ).json()
    assert wide["change_m"] > 0.5 and wide["go"] == wide["appear"] == []
    assert client.get(BEWARE).json()["version"] == 0
    unknown = client.post(f"{BEWARE}/preview", json={"changes": {"forklift": None}})
    assert "no class 'forklift'" in wrong(unknown, 422)["message"]


def test_a_preview_says_what_another_list_changes(
    client: httpx.Client, operations: FakeOperations
) -> None:
    file = client.get("/api/v1/beware.toml").text
    client.patch(f"{BEWARE}/red floor", json={"enabled": False, "margin_m": 0.5})
    told = ["“red floor” switched on", "“red floor”: margin 0.5 m → 0 m"]
    for draft in ({"version": 0}, {"ready_made": "default"}, {"toml": file}):
        answer = client.post(f"{BEWARE}/preview", json=draft).json()
        assert answer["appear_count"] > 300 and answer["changes"] == told
    unknown = client.post(f"{BEWARE}/preview", json={"version": 7})
    assert "no version 7" in wrong(unknown, 404)["message"]
    damaged = client.post(f"{BEWARE}/preview", json={"toml": file.replace("0.5", "50", 1)})
    assert "line 6" in wrong(damaged, 422)["message"]
    assert client.get(BEWARE).json()["version"] == 1


def test_a_preview_counts_the_cells_to_which_the_robot_may_come_nearer(
    client: httpx.Client,
) -> None:
    wide = {"changes": {"red floor": {"margin_m": 0.8}}}
    assert client.post(f"{BEWARE}/preview", json=wide).json()["nearer_count"] == 0
    client.patch(f"{BEWARE}/red floor", json={"margin_m": 0.8})
    narrow = {"changes": {"red floor": {"margin_m": 0.1}}}
    answer = client.post(f"{BEWARE}/preview", json=narrow).json()
    assert answer["nearer_count"] > 300 and answer["go_count"] == 0
    off = {"changes": {"red floor": {"enabled": False}}}
    answer = client.post(f"{BEWARE}/preview", json=off).json()
    assert answer["nearer_count"] == 0 and answer["go_count"] > 300


def test_a_preview_names_the_goals_that_would_be_cut_off(
    client: httpx.Client, operations: FakeOperations
) -> None:
    operations.block_by_red()
    client.patch(f"{BEWARE}/red floor", json={"enabled": False})
    client.post("/api/v1/goals", json={"x_m": -4.0, "y_m": 0.0})
    client.post("/api/v1/goals", json={"x_m": 3.0, "y_m": 0.0, "name": "door"})
    on = {"changes": {"red floor": {"enabled": True}}}
    answer = client.post(f"{BEWARE}/preview", json=on).json()
    assert answer["cut_off"] == ["“door”"] and answer["path"]["found"]


def test_a_click_into_the_picture_makes_a_colour_rule_that_takes_what_was_clicked(
    client: httpx.Client,
) -> None:
    rule = client.post(f"{BEWARE}/colour", json=RED).json()["rule"]
    first, last = rule["hue_deg"]
    assert first > 340 and last < 20 and rule["max_height_m"] == 0.05
    looks = client.post(f"{BEWARE}/colour/looks", json=rule).json()["looks"]
    head, _, data = looks[0]["mask"].partition(",")
    assert head == "data:image/png;base64" and looks[0]["picture"] == ""
    mask = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)
    assert mask is not None and mask.shape == (180, 320, 4)
    taken = mask[..., 3] > 0
    assert taken[112:148, 122:218].all() and looks[0]["share"] == round(taken.mean(), 4) > 0.05
    assert not taken[:90].any()
    grey = client.post(f"{BEWARE}/colour", json={"right": 0.9, "down": 0.95}).json()["rule"]
    assert grey["hue_deg"] == [0, 360] and grey["max_saturation"] < 0.3
    blue = client.post(f"{BEWARE}/colour/looks", json=BLUE).json()["looks"][0]
    assert blue["share"] == 0
    assert wrong(client.post(f"{BEWARE}/colour", json={"right": 7, "down": 0}), 422)


def test_a_click_refers_to_the_image_that_was_shown(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = client.get("/api/v1/camera.jpg").headers["Frame"]
    rule = client.post(f"{BEWARE}/colour", json=RED).json()["rule"]
    blue = np.full((180, 320, 3), (20, 20, 220), dtype=np.uint8)
    monkeypatch.setattr(
        fake_operations, "camera_image", lambda: (blue, np.zeros_like(blue[..., 0]))
    )
    operations.step()
    newest = client.get("/api/v1/camera.jpg").headers["Frame"]
    assert newest != shown
    assert client.post(f"{BEWARE}/colour", json={**RED, "frame": shown}).json()["rule"] == rule
    other = client.post(f"{BEWARE}/colour", json={**RED, "frame": newest}).json()["rule"]
    assert 200 < other["hue_deg"][0] < 250
    gone = client.post(f"{BEWARE}/colour", json={**RED, "frame": "7"})
    assert "the picture has moved on" in wrong(gone, 409)["message"]


def test_one_undo_takes_back_the_last_edit_whatever_it_was_of(client: httpx.Client) -> None:
    square = {"type": "Polygon", "coordinates": [[[4, -1], [5, -1], [5, 1], [4, 1], [4, -1]]]}
    assert wrong(client.post("/api/v1/edits/undo"), 409)["message"] == "there is no edit to undo"
    client.post("/api/v1/zones", json=zone("wet"))
    client.patch(f"{BEWARE}/cup", json={"enabled": False})
    client.post("/api/v1/map/erase", json={"geometry": square})
    answer = client.patch(f"{BEWARE}/cup", json={"margin_m": 1.0})
    number = client.get("/api/v1/edits").json()["undo_number"]
    assert answer.headers["Undo-Number"] == str(number)
    assert "Undo-Number" not in client.get("/api/v1/edits").headers
    earlier = client.post(f"/api/v1/edits/undo?number={number - 1}")
    assert "another edit was made since" in wrong(earlier, 409)["message"]
    undone = [client.post(f"/api/v1/edits/undo?number={number}").json()["text"].split()[0]]
    while client.get("/api/v1/edits").json()["undo"]:
        undone.append(client.post("/api/v1/edits/undo").json()["text"].split()[0])
    assert undone == ["“cup”:", "erasing", "“cup”", "new"]
    assert client.get("/api/v1/zones").json()["features"] == []
    for _ in range(3):
        client.post("/api/v1/edits/redo")
    cup = next(entry for entry in client.get(BEWARE).json()["classes"] if entry["name"] == "cup")
    assert (cup["enabled"], cup["margin_m"]) == (False, 0.05)
    client.patch(f"{BEWARE}/book", json={"enabled": False})
    assert client.get("/api/v1/edits").json()["redo"] is None  # a newer edit was made
    assert wrong(client.post("/api/v1/edits/redo"), 409)["message"] == "there is no edit to redo"
