"""Answers and refusals of the routes of event log, explanation, detections, series and tiles."""

from __future__ import annotations

import cv2
import httpx
import numpy as np
import pytest

from navcore.errors import StorageFailed
from tests.web.fake_operations import FakeOperations
from web.images.encode import SCALE, paint_map
from web.images.tiles import TILE, TileVersions, changed_since, tile_cells
from web.interface.drafts import ZoneDraft
from web.interface.insight import LabellingState

WET = ZoneDraft(name="Wet floor", polygon=((3.0, -2.0), (3.6, -2.0), (3.6, 0.6), (3.0, 0.6)))


def test_the_journal_is_filtered_and_read_on_from_where_one_was(
    client: httpx.Client, operations: FakeOperations
) -> None:
    for number in range(5):
        operations.insight.event_log.note(
            float(number), "seen" if number % 2 else "stopped", f"entry {number}", (1.0, 2.0)
        )
    whole = client.get("/api/v1/journal").json()
    assert (whole["newest"], whole["oldest"], len(whole["entries"])) == (5, 1, 5)
    assert whole["entries"][0] == {
        "id": 1, "start": 1, "stamp_s": 0.0, "unix_s": 1_700_000_000.0,
        "kind": "stopped", "text": "entry 0", "place": [1.0, 2.0],
    }  # fmt: skip
    part = client.get("/api/v1/journal", params={"kind": ["seen"], "since": 2, "limit": 1}).json()
    assert [entry["id"] for entry in part["entries"]] == [4]
    back = client.get("/api/v1/journal", params={"before": 4, "limit": 2}).json()
    assert [entry["id"] for entry in back["entries"]] == [2, 3] and back["start"] == 1
    refused: tuple[dict[str, str | int], ...] = (
        {"kind": "nonsense"},
        {"limit": 0},
        {"limit": 5000},
        {"since": -1},
        {"before": -1},
    )
    for wrong in refused:
        assert client.get("/api/v1/journal", params=wrong).status_code == 422


def test_why_names_the_zone_that_bends_the_path_and_what_it_costs(
    client: httpx.Client, operations: FakeOperations
) -> None:
    assert client.get("/api/v1/explain").status_code == 409
    zone = operations.zones.add(WET)
    operations.goals.add(4.4, -0.5)
    said = client.get("/api/v1/explain").json()
    assert (
        said["found"]
        and said["lift"] is None
        and said["stretches"][-1]["last"] == len(said["path"]) - 1
    )
    rule = next(rule for rule in said["rules"] if rule["key"] == f"zone:{zone.id}")
    assert rule["name"] == "Wet floor" and rule["along_m"] > 0.3 and rule["saves_m"] > 0.2
    other = client.post("/api/v1/explain", json={"without": [rule["key"]]}).json()
    assert other["found"] and other["difference_m"] == pytest.approx(-rule["saves_m"], abs=1e-6)
    assert client.post("/api/v1/explain", json={"without": ["zone:none"]}).status_code == 404
    for wrong in ('{"without": []}', '{"without": [3]}', '{"keys": ["wall"]}', "{}"):
        assert (
            client.post(
                "/api/v1/explain", content=wrong, headers={"Content-Type": "application/json"}
            ).status_code
            == 422
        )


def test_without_a_path_the_fewest_rules_to_lift_are_named(
    client: httpx.Client, operations: FakeOperations
) -> None:
    operations.goals.add(6.0, 0.5)
    fence = ((2.6, -5.7), (3.0, -5.7), (3.0, 5.7), (2.6, 5.7))
    fences = [operations.zones.add(ZoneDraft(name=f"Fence {i}", polygon=fence)) for i in range(2)]
    said = client.get("/api/v1/explain").json()
    assert not said["found"] and said["reason"]
    assert said["lift"] == {
        "keys": [f"zone:{fence.id}" for fence in fences],
        "exact": True,
        "at_least": 2,
    }
    assert (
        client.post("/api/v1/explain", json={"without": said["lift"]["keys"][:1]}).json()["found"]
        is False
    )
    assert (
        client.post("/api/v1/explain", json={"without": said["lift"]["keys"]}).json()["found"]
        is True
    )


def test_sightings_are_listed_shown_and_corrected(
    client: httpx.Client, operations: FakeOperations
) -> None:
    listed = client.get("/api/v1/sightings").json()
    assert listed["seen"] == {"3": 1} and listed["sightings"][0]["class_name"] == "cup"
    assert client.get("/api/v1/sightings/1/picture.jpg").content.startswith(b"\xff\xd8")
    assert client.get("/api/v1/sightings/9/picture.jpg").status_code == 404
    assert (
        client.post("/api/v1/sightings/1/wrong", json={"class_name": "book"}).json()["pictures"]
        == 1
    )
    assert client.get("/api/v1/sightings").json()["seen"] == {}
    snapshot = client.post("/api/v1/sightings/snapshots").json()["snapshot"]
    assert (
        client.get(f"/api/v1/sightings/snapshots/{snapshot}.jpg").headers["content-type"]
        == "image/jpeg"
    )
    missed = {"snapshot": snapshot, "class_name": "cup", "box": [130, 80, 200, 140]}
    assert client.post("/api/v1/sightings", json=missed).status_code == 201
    assert operations.insight.taught == [("book", None), ("cup", (130, 80, 200, 140))]
    for wrong in (
        {"box": [1, 2, 3]},
        {"box": [0, 0, -1, 5]},
        {"class_name": "\n"},
        {"snapshot": "x"},
    ):
        refused = client.post("/api/v1/sightings", json={**missed, **wrong})
        assert refused.status_code == 422, wrong


def test_a_labelling_folder_that_cannot_be_read_hides_no_detections(
    client: httpx.Client, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert client.get("/api/v1/sightings").json()["labelling_failure"] is None

    def damaged() -> LabellingState:
        raise StorageFailed("the card cannot be read")

    monkeypatch.setattr(operations.insight.labelling, "state", damaged)
    listed = client.get("/api/v1/sightings").json()
    assert listed["seen"] == {"3": 1} and listed["labelling"] is None
    assert listed["labelling_failure"] == "the card cannot be read"


def test_the_figures_come_column_by_column_after_a_time(client: httpx.Client) -> None:
    whole, part = (
        client.get("/api/v1/series", params=params).json() for params in ({}, {"since_s": 24.5})
    )
    assert len(whole["t_s"]) == 30 and part["t_s"] == [25.0, 26.0, 27.0, 28.0, 29.0]
    assert {len(column) for column in part.values()} == {5}
    assert client.get("/api/v1/series", params={"since_s": "nan"}).status_code == 422


def test_candidates_end_where_they_would_touch_something_and_one_is_chosen(
    client: httpx.Client,
) -> None:
    answer = client.get("/api/v1/candidates")
    said = answer.json()
    assert len(said["arcs"]) == 3 and said["chosen"] == 2 and len(answer.content) < 2000
    free, blocked, _ = said["arcs"]
    assert free["touch"] is None and blocked["touch"] is not None
    assert (
        blocked["points"][-1][0] < blocked["touch"][0] < free["points"][-1][0]
        and len(free["points"]) == 5
    )


def test_tiles_put_together_are_the_map_and_tell_every_layer_apart(
    client: httpx.Client, operations: FakeOperations
) -> None:
    operations.zones.add(WET)
    told = client.get("/api/v1/map/tiles").json()
    picture = operations.newest_tick()
    assert picture is not None
    cells = np.zeros((told["rows"], told["cols"], 3), dtype=np.uint8)
    for row, col, _ in told["changed"]:
        data = client.get(f"/api/v1/map/tiles/{row}/{col}.png").content
        tile = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))[
            ::-1, :, ::-1
        ]
        cells[row * TILE : row * TILE + tile.shape[0], col * TILE : col * TILE + tile.shape[1]] = (
            tile
        )
    for bit, mask in (
        (1, picture.seen),
        (2, picture.grid.geometric),
        (4, picture.blocked),
        (8, picture.grid.zones),
    ):
        assert mask.any()
        np.testing.assert_array_equal(cells[..., 0] & bit > 0, mask)
    np.testing.assert_array_equal(cells[..., 1] == 1, picture.grid.beware[1])
    assert (cells[..., 0] & 16 == 0).all()
    again = client.get("/api/v1/map/tiles", params={"since": told["version"]}).json()
    assert again["changed"] == [] and again["version"] == told["version"]
    assert client.get("/api/v1/map/tiles/99/0.png").status_code == 404


def test_only_tiles_whose_cells_changed_are_new(operations: FakeOperations) -> None:
    tiles, before = TileVersions(), operations.newest_tick()
    assert before is not None
    version, versions = tiles.update(before, operations.beware.list)
    assert (versions == version).all()
    operations.step()
    after = operations.newest_tick()
    assert after is not None
    assert tiles.update(after, operations.beware.list)[0] == version
    operations.zones.add(WET)
    zoned = operations.newest_tick()
    assert zoned is not None
    newest, versions = tiles.update(zoned, operations.beware.list)
    changed = {tile for tile, _ in changed_since(versions, version)}
    differing = np.argwhere(
        (paint_map(after, operations.beware.list) != paint_map(zoned, operations.beware.list)).any(
            axis=2
        )[::-1]
    )
    assert newest == version + 1 and changed == {
        (int(i) // (TILE * SCALE), int(j) // (TILE * SCALE)) for i, j in differing
    }
    assert all(tile_cells(tile, zoned)[3] <= zoned.grid_spec.cols for tile in changed)


def test_the_page_of_runs_is_served(client: httpx.Client) -> None:
    assert "Past missions" in client.get("/runs").text
