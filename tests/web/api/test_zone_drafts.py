"""Drawing by HTTP: shapes, rules, undo, sets, files, previews, regions, and goals."""

from __future__ import annotations

import base64
from typing import Any
from urllib.parse import quote

import cv2
import httpx
import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from navcore.formats.keepout_mask import closed_cells, mask_spec
from navcore.formats.map_image import encode
from navcore.formats.nav2_map import map_from_cells, yaml_text
from navcore.grid.grid import GridSpec
from tests.web.api.answers import SQUARE, wrong, zone
from tests.web.fake_operations import FakeOperations
from tests.web.fake_world import SPEC
from web.gateway.request_body import MAX_BODY_BYTES


def geometry(kind: str, coordinates: Any, **more: float) -> dict[str, Any]:
    return {"type": kind, "coordinates": coordinates, **more}


def names(answer: httpx.Response) -> list[str]:
    return [feature["properties"]["name"] for feature in answer.json()["features"]]


def test_circles_and_corridors_come_back_as_polygons_that_remember_what_they_were(
    client: httpx.Client,
) -> None:
    circle = {"name": "round", "geometry": geometry("Point", [3.0, -3.0], radius_m=0.8)}
    strip = {
        "name": "tape",
        "geometry": geometry("LineString", [[-5, 3], [-3, 3], [-3, 4]], width_m=0.3),
    }
    stored = [client.post("/api/v1/zones", json=body).json() for body in (circle, strip)]
    assert [one["geometry"]["type"] for one in stored] == ["Polygon", "Polygon"]
    assert Polygon(stored[0]["geometry"]["coordinates"][0]).contains(Point(3.0, -3.0).buffer(0.79))
    assert [one["properties"]["drawn"] for one in stored] == [circle["geometry"], strip["geometry"]]
    again = client.put("/api/v1/zones/z1", json=stored[0]).json()
    assert again["properties"]["drawn"] == circle["geometry"]
    again["geometry"]["coordinates"][0][3][0] += 0.2
    assert client.put("/api/v1/zones/z1", json=again).json()["properties"]["drawn"] is None


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ({"name": "a", "geometry": geometry("Point", [0, 0], radius_m=0)}, "radius"),
        ({"name": "a", "geometry": geometry("Point", [9999.5, 0], radius_m=1)}, "out of range"),
        ({"name": "a", "geometry": geometry("LineString", [[0, 0]], width_m=1)}, "at least 2"),
        (
            {"name": "a", "geometry": geometry("LineString", [[0, 0], [1, 1]])},
            "body.geometry.width_m",
        ),
        (zone(kind="speed-limit"), "max_speed_mps"),
        (zone(kind="speed-limit", max_speed_mps=99), "body.properties.max_speed_mps"),
        (zone(kind="moat"), "body.properties.kind"),
        (zone(expires_at_s=5.0), "expiry"),
    ],
)
def test_shapes_and_rules_that_are_none_are_refused_by_name(
    client: httpx.Client, body: dict[str, Any], says: str
) -> None:
    told = wrong(client.post("/api/v1/zones", json=body), 422)
    assert says in f"{told['where']}: {told['message']}"
    assert client.get("/api/v1/zones").json()["features"] == []


def test_a_speed_limit_closes_nothing_and_an_expired_zone_is_switched_off(
    client: httpx.Client, operations: FakeOperations
) -> None:
    blocked = operations.newest_tick().blocked.sum()  # type: ignore[union-attr]
    slow = client.post(
        "/api/v1/zones", json=zone("slow", kind="speed-limit", max_speed_mps=0.3, colour="#112233")
    )
    assert slow.json()["properties"]["max_speed_mps"] == 0.3
    assert operations.newest_tick().blocked.sum() == blocked  # type: ignore[union-attr]
    wet = client.post("/api/v1/zones", json=zone("wet", expires_in_s=60.0)).json()
    assert wet["properties"]["expires_at_s"] == operations.calendar_s + 60
    assert operations.newest_tick().blocked.sum() > blocked  # type: ignore[union-attr]
    operations.calendar_s += 61
    operations.zones.expire()
    assert client.get(f"/api/v1/zones/{wet['id']}").json()["properties"]["enabled"] is False
    assert operations.newest_tick().blocked.sum() == blocked  # type: ignore[union-attr]


def test_edits_are_taken_back_and_done_again(client: httpx.Client) -> None:
    wrong(client.post("/api/v1/zones/undo"), 409)
    client.post("/api/v1/zones", json=zone("first"))
    client.delete("/api/v1/zones/z1")
    assert client.get("/api/v1/zones").json()["undo"] == "deletion of 'first'"
    assert names(client.post("/api/v1/zones/undo")) == ["first"]
    assert client.get("/api/v1/zones/z1").headers["etag"] == '"2"'  # a version is given once
    assert names(client.post("/api/v1/zones/redo")) == []
    assert client.get("/api/v1/zones").json()["redo"] is None


def test_sets_are_kept_used_and_forgotten(client: httpx.Client) -> None:
    client.post("/api/v1/zones", json=zone("guests only"))
    assert client.put("/api/v1/zone-sets/night shift").status_code == 204
    client.post("/api/v1/zones", json=zone("second"))
    taken = wrong(client.put("/api/v1/zone-sets/night shift"), 409)
    assert taken["message"].startswith(
        "a set of zones is called “night shift” already, with 1 zone;"
    )
    client.delete("/api/v1/zones/z2")
    assert client.put("/api/v1/zone-sets/night shift?replace=true").status_code == 204
    client.delete("/api/v1/zones/z1")
    assert client.get("/api/v1/zone-sets").json() == [{"name": "night shift", "zones": 1}]
    assert names(client.post("/api/v1/zone-sets/night shift/use")) == ["guests only"]
    assert names(client.post("/api/v1/zones/undo")) == []
    assert client.delete("/api/v1/zone-sets/night shift").status_code == 204
    wrong(client.post("/api/v1/zone-sets/night shift/use"), 404)
    wrong(client.put("/api/v1/zone-sets/%20"), 422)


def test_what_is_exported_can_be_imported_and_a_file_with_one_bad_zone_changes_nothing(
    client: httpx.Client,
) -> None:
    for body in (
        zone("a", margin_m=0.2),
        {"name": "b", "geometry": geometry("Point", [3.0, -3.0], radius_m=0.5)},
    ):
        client.post("/api/v1/zones", json=body)
    exported = client.get("/api/v1/zones").json()
    for one in ("z1", "z2"):
        client.delete(f"/api/v1/zones/{one}")
    brought = client.post("/api/v1/zones/import", json={**exported, "crs": {"type": "name"}})
    assert brought.status_code == 201
    for new, old in zip(brought.json()["features"], exported["features"], strict=True):
        assert (new["geometry"], new["properties"]) == (old["geometry"], old["properties"])
    foreign = {"type": "Feature", "geometry": zone()["geometry"], "properties": {"stroke": "#fff"}}
    crossed = zone(corners=[[0, 0], [1, 1], [1, 0], [0, 1]])
    wrong(
        client.post(
            "/api/v1/zones/import",
            json={"type": "FeatureCollection", "features": [foreign, crossed]},
        ),
        422,
    )
    assert names(client.get("/api/v1/zones")) == ["a", "b"]
    added = client.post(
        "/api/v1/zones/import?existing=keep",
        json={"type": "FeatureCollection", "features": [foreign]},
    )
    assert names(added)[-1] == "Imported zone"


def test_a_mask_goes_out_and_comes_in_with_the_same_cells(
    client: httpx.Client, operations: FakeOperations
) -> None:
    client.post("/api/v1/zones", json=zone("bent", corners=[[4, -1], [5, -1], [5, 1], [4.6, 0]]))
    yaml, pgm = client.get("/api/v1/zones.yaml").text, client.get("/api/v1/zones.pgm").content
    assert "image: zones.pgm" in yaml and "resolution: 0.1" in yaml
    cells = closed_cells(operations.zones.stored, SPEC)
    image = np.asarray(cv2.imdecode(np.frombuffer(pgm, np.uint8), cv2.IMREAD_UNCHANGED))
    np.testing.assert_array_equal(image[::-1] == 0, cells)
    client.delete("/api/v1/zones/z1")
    mask = {"yaml": yaml, "picture": base64.b64encode(pgm).decode(), "name": "from file"}
    assert names(client.post("/api/v1/zones/import-mask", json=mask)) == ["from file"]
    np.testing.assert_array_equal(closed_cells(operations.zones.stored, SPEC), cells)
    for wrongly, says in (
        ({"picture": "%"}, "base64"),
        ({"yaml": "a: b"}, "unknown key"),
        ({"picture": "AAAA"}, "neither PGM"),
    ):
        assert (
            says
            in wrong(client.post("/api/v1/zones/import-mask", json={**mask, **wrongly}), 422)[
                "message"
            ]
        )


def test_a_mask_with_zones_beyond_the_map_loses_none_of_them(
    client: httpx.Client, operations: FakeOperations
) -> None:
    far = [(20.0, 0.0), (-25.0, 3.0), (0.0, 0.0)]  # the map is 16 m × 12 m
    corners = ([[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]] for x, y in far)
    for number, ring in enumerate(corners):
        client.post("/api/v1/zones", json=zone(f"part {number}", corners=ring, margin_m=0.2))
    drawn = closed_cells(operations.zones.stored, mask_spec(operations.zones.stored, SPEC))
    yaml, pgm = client.get("/api/v1/zones.yaml").text, client.get("/api/v1/zones.pgm").content
    for number in (1, 2, 3):
        client.delete(f"/api/v1/zones/z{number}")
    mask = {"yaml": yaml, "picture": base64.b64encode(pgm).decode(), "name": "far"}
    assert names(client.post("/api/v1/zones/import-mask", json=mask)) == ["far 1", "far 2", "far 3"]
    again = closed_cells(operations.zones.stored, mask_spec(operations.zones.stored, SPEC))
    np.testing.assert_array_equal(again, drawn)


def test_a_fine_mask_beyond_the_map_comes_in_with_the_cells_of_the_map(
    client: httpx.Client, operations: FakeOperations
) -> None:
    fine = GridSpec(resolution_m=0.02, rows=500, cols=500, origin_x_m=20.0, origin_y_m=0.0)
    occupied = np.zeros((500, 500), dtype=np.bool_)
    occupied[7, 7] = True  # a speck, smaller than a zone may be
    occupied[100:200, 100:300] = True
    image = map_from_cells(occupied=occupied, known=np.ones_like(occupied), spec=fine)
    mask = {
        "yaml": yaml_text(image.description, "mask.pgm"),
        "picture": base64.b64encode(encode(image.image)).decode(),
        "name": "fine",
    }
    assert names(client.post("/api/v1/zones/import-mask", json=mask)) == ["fine 1", "fine 2"]
    spec = mask_spec(operations.zones.stored, SPEC)
    closed = closed_cells(operations.zones.stored, spec)
    assert closed.sum() == 1 + 20 * 40 and closed[spec.cell(20.15, 0.15)]


def test_a_zone_too_far_away_for_a_mask_is_named(client: httpx.Client) -> None:
    client.post(
        "/api/v1/zones", json=zone("dock", corners=[[9e3, 9e3], [9.1e3, 9e3], [9e3, 9.1e3]])
    )
    told = wrong(client.get("/api/v1/zones.pgm"), 422)
    assert "'dock'" in told["message"] and "GeoJSON" in told["message"]


@pytest.mark.parametrize("name", ["zones", "map"])
def test_the_second_file_of_a_map_is_refused_once_the_map_has_grown(
    client: httpx.Client, operations: FakeOperations, name: str
) -> None:
    asked = {"grid": client.get(f"/api/v1/{name}.yaml").headers["Grid"]}
    same = client.get(f"/api/v1/{name}.pgm", params=asked)
    assert same.status_code == 200 and same.headers["Grid"] == asked["grid"]
    operations.grow(20.0, 0.0)
    for file in (f"{name}.pgm", f"{name}.yaml"):
        refused = client.get(f"/api/v1/{file}", params=asked)
        assert wrong(refused, 409)["code"] == "outdated"
        assert client.get(f"/api/v1/{file}").status_code == 200


def test_as_many_circles_and_poses_as_are_allowed_are_not_too_large(client: httpx.Client) -> None:
    client.post(
        "/api/v1/zones",
        json={"name": "round", "geometry": geometry("Point", [3.1234567890123, 1], radius_m=0.5)},
    )
    (exported,) = client.get("/api/v1/zones").json()["features"]
    file = {"type": "FeatureCollection", "features": [exported] * 500}
    asked = client.post("/api/v1/zones/import", json=file)
    assert int(asked.request.headers["Content-Length"]) > MAX_BODY_BYTES
    assert wrong(asked, 409)["code"] == "already_there"
    pose = {"id": 99_999, "x_m": 1.2345678901234567, "y_m": -1.5, "yaw_rad": -1.2345678901234567}
    corrected = client.patch("/api/v1/map/poses", json={"poses": [pose] * 100_000})
    assert corrected.status_code != 413


def test_a_preview_compares_and_names_what_cuts_the_goal_off(client: httpx.Client) -> None:
    goal = {"x_m": 6.0, "y_m": 0.0}
    client.post(
        "/api/v1/zones", json=zone("wall", corners=[[3, -2], [3.5, -2], [3.5, 2.2], [3, 2.2]])
    )
    gone = client.post("/api/v1/preview", json={"goal": goal, "replaces": "z1"}).json()
    assert (
        gone["change_m"] < -0.5
        and gone["change_s"] < 0
        and gone["present"]["length_m"] > gone["length_m"]
    )
    small = zone("wall", corners=[[3, -2], [3.5, -2], [3.5, -1.8], [3, -1.8]])
    edited = client.post(
        "/api/v1/preview", json={"goal": goal, "zone": small, "replaces": "z1"}
    ).json()
    assert edited["change_m"] < -0.5
    slow = zone(
        "slow",
        corners=[[-4, -5], [-3, -5], [-3, 5], [-4, 5]],
        kind="speed-limit",
        max_speed_mps=0.1,
    )
    limited = client.post("/api/v1/preview", json={"goal": goal, "zone": slow}).json()
    assert limited["change_m"] == 0 and limited["change_s"] > 10
    across = zone("fence", corners=[[-4, -5.9], [-3, -5.9], [-3, 5.9], [-4, 5.9]])
    cut = client.post("/api/v1/preview", json={"goal": goal, "zone": across}).json()
    assert (cut["found"], cut["cut_by"], cut["change_m"]) == (False, ["fence"], None)
    near = client.post(
        "/api/v1/preview", json={"goal": goal, "start": {"x_m": 5.0, "y_m": 0.0}}
    ).json()
    assert near["length_m"] == pytest.approx(1.0, abs=0.1)
    assert names(client.get("/api/v1/zones")) == ["wall"]


def test_a_click_in_the_picture_finds_what_is_seen_there(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    red = client.post("/api/v1/camera/region", json={"right": 0.5, "down": 0.7}).json()
    assert red["name"] == "red floor" and Polygon(red["footprint"]).area > 0.05
    box = client.post("/api/v1/camera/region", json={"right": 0.12, "down": 0.42}).json()
    assert box["name"] is None and Polygon(box["footprint"]).is_valid
    assert min(x for x, _ in box["outline"]) > 0.05 and max(x for x, _ in box["outline"]) < 0.25
    assert (
        "floor"
        in wrong(client.post("/api/v1/camera/region", json={"right": 0.9, "down": 0.9}), 422)[
            "message"
        ]
    )
    wrong(client.post("/api/v1/camera/region", json={"right": 1.5, "down": 0.9}), 422)
    named = {"right": 0.5, "down": 0.7, "frame": client.get("/api/v1/camera.jpg").headers["Frame"]}
    operations.step()
    assert client.get("/api/v1/camera.jpg").headers["Frame"] != named["frame"]
    assert client.post("/api/v1/camera/region", json=named).json() == red
    monkeypatch.setattr("web.images.shown_images.MAX_AGE_S", 0.0)
    operations.step()
    newest = client.get("/api/v1/camera.jpg").headers["Frame"]
    wrong(client.post("/api/v1/camera/region", json=named), 409)
    named["frame"] = newest
    assert client.post("/api/v1/camera/region", json=named).status_code == 200
    gone = wrong(client.post("/api/v1/camera/region", json={**named, "frame": "0"}), 409)
    assert "click again" in gone["message"]
    drawn = {"name": "red", "geometry": geometry("Polygon", [red["footprint"]])}
    assert client.post("/api/v1/zones", json=drawn).status_code == 201


def test_a_goal_that_is_refused_comes_with_the_nearest_place_and_that_one_is_taken(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/zones", json=zone(corners=SQUARE))
    refused = client.post("/api/v1/goals", json={"x_m": 4.5, "y_m": 0.9})
    assert "inside a beware zone" in wrong(refused, 422)["message"]
    nearest = refused.json()["nearest"]
    assert np.hypot(nearest["x_m"] - 4.5, nearest["y_m"] - 0.9) < 1.2
    assert nearest["x_m"] < 5.0  # the floor beyond has not been seen
    assert client.post("/api/v1/goals", json=nearest).status_code == 201


def test_goals_have_headings_and_names_are_ordered_looped_and_kept(client: httpx.Client) -> None:
    client.post("/api/v1/goals", json={"x_m": 3.0, "y_m": 0.5, "yaw_rad": 1.5, "name": "dock"})
    client.post("/api/v1/goals", json={"x_m": -5.0, "y_m": -4.0})
    assert (
        client.patch("/api/v1/goals/2", json={"name": "gate", "yaw_rad": 0.5}).json()["name"]
        == "gate"
    )
    assert client.patch("/api/v1/goals/2", json={"yaw_rad": None}).json()["yaw_rad"] is None
    assert [
        goal["id"]
        for goal in client.put("/api/v1/goals/order", json={"ids": [2, 1]}).json()["queue"]
    ] == [2, 1]
    wrong(client.put("/api/v1/goals/order", json={"ids": [2]}), 409)
    assert client.put("/api/v1/mission/loop", json={"loop": True}).json()["loop"] is True
    assert client.put("/api/v1/missions/rounds").status_code == 204
    client.post("/api/v1/mission/cancel")
    wrong(client.put("/api/v1/missions/empty"), 409)
    assert client.get("/api/v1/missions").json() == [{"name": "rounds", "goals": 2, "loop": True}]
    loaded = client.post("/api/v1/missions/rounds/load").json()
    assert [(goal["name"], goal["yaw_rad"]) for goal in loaded["queue"]] == [
        ("gate", None),
        ("dock", 1.5),
    ]
    assert client.delete("/api/v1/missions/rounds").status_code == 204
    wrong(client.post("/api/v1/missions/rounds/load"), 404)


@pytest.mark.parametrize("name", ["Mon/Tue", "a/b/c", "use", "night/use"])
def test_a_name_with_a_slash_is_a_name(name: str, client: httpx.Client) -> None:
    at = quote(name, safe="")
    client.post("/api/v1/zones", json=zone("guests only"))
    assert client.put(f"/api/v1/zone-sets/{at}").status_code == 204
    assert [one["name"] for one in client.get("/api/v1/zone-sets").json()] == [name]
    assert names(client.post(f"/api/v1/zone-sets/{at}/use")) == ["guests only"]
    assert client.delete(f"/api/v1/zone-sets/{at}").status_code == 204
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0})
    assert client.put(f"/api/v1/missions/{at}").status_code == 204
    assert client.post(f"/api/v1/missions/{at}/load").status_code == 200
    assert client.delete(f"/api/v1/missions/{at}").status_code == 204
    assert (
        client.put("/api/v1/beware", json={"classes": [{"name": name, "class_id": 60}]}).status_code
        == 200
    )
    edited = client.patch(f"/api/v1/beware/{at}", json={"enabled": False})
    assert edited.status_code == 200 and edited.json()["classes"][0]["enabled"] is False


def test_the_unseen_part_of_path_and_preview_is_sent(client: httpx.Client) -> None:
    assert client.post("/api/v1/goals", json={"x_m": 6.5, "y_m": 4.0}).status_code == 201
    state, path = client.get("/api/v1/state").json(), client.get("/api/v1/path").json()
    assert 0.5 < state["unseen_m"] < state["distance_to_goal_m"]
    (part,) = path["unseen"]
    assert part[-1] == path["path"][-1] and 4.9 < part[0][0] < 5.2
    near, far = (
        client.post("/api/v1/preview", json={"goal": {"x_m": x, "y_m": 4.0}}).json()["unseen_m"]
        for x in (-5.0, 6.5)
    )
    assert near == 0.0 and far == pytest.approx(state["unseen_m"], abs=0.2)


def test_an_outline_that_crosses_itself_is_refused_with_the_crossing(client: httpx.Client) -> None:
    bow_tie = [[3.0, -1.0], [4.0, 1.0], [4.0, -1.0], [3.0, 1.0]]
    refused = client.post("/api/v1/zones", json=zone(corners=bow_tie))
    assert wrong(refused, 422)["message"] == (
        "the outline of the zone crosses itself at (3.50, 0.00); move a corner"
    )
    assert refused.json()["crossing"] == {"x_m": 3.5, "y_m": 0.0}


def test_an_import_says_which_zones_are_there_and_replaces_keeps_or_skips_them(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/zones", json=zone("old"))
    features = [zone("new name", margin_m=0.3), zone("other", [[-1, -1], [0, -1], [0, 0]])]
    file = {"type": "FeatureCollection", "features": features}

    def names() -> list[str]:
        stored = client.get("/api/v1/zones").json()["features"]
        return [entry["properties"]["name"] for entry in stored]

    def imported(existing: str) -> list[str]:
        address = f"/api/v1/zones/import?existing={existing}"
        assert client.post(address, json=file).status_code == 201
        after = names()
        client.post("/api/v1/zones/undo")
        assert names() == ["old"], "an import is one edit"
        return after

    asked = client.post("/api/v1/zones/import", json=file)
    assert wrong(asked, 409)["code"] == "already_there"
    assert wrong(asked, 409)["message"] == "2 zones: 1 is here already (“old”)"
    assert asked.json()["there"] == ["old"] and names() == ["old"]
    assert imported("keep") == ["old", "new name", "other"]
    assert imported("skip") == ["old", "other"]
    assert imported("replace") == ["new name", "other"]
    only = {"type": "FeatureCollection", "features": features[:1]}
    assert client.post("/api/v1/zones/import?existing=skip", json=only).status_code == 201
    assert names() == ["old"]


def test_a_mission_under_a_name_that_exists_is_replaced_only_when_that_is_asked_for(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/goals", json={"x_m": -3.0, "y_m": 0.0})
    assert client.put("/api/v1/missions/round").status_code == 204
    client.post("/api/v1/goals", json={"x_m": -4.0, "y_m": 0.0})
    refused = client.put("/api/v1/missions/round")
    assert wrong(refused, 409)["code"] == "already_there"
    assert "“round” already, with 1 goal;" in wrong(refused, 409)["message"]
    assert [entry["goals"] for entry in client.get("/api/v1/missions").json()] == [1]
    assert client.put("/api/v1/missions/round?replace=true").status_code == 204
    assert [entry["goals"] for entry in client.get("/api/v1/missions").json()] == [2]


def test_the_beware_list_comes_with_the_limits_of_its_numbers(client: httpx.Client) -> None:
    listed = client.get("/api/v1/beware").json()
    assert listed["limits"]["margin_m"] == {"low": 0.0, "high": 2.0}
    assert listed["limits"]["min_confidence"] == {"low": 0.0, "high": 1.0}
    assert client.put("/api/v1/beware", json=listed).status_code == 200
