"""Routes of the edits of the map."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from tests.web.api.answers import SQUARE, wrong
from tests.web.fake_operations import FakeOperations

AREA = {"type": "Polygon", "coordinates": [SQUARE]}
DISC = {"type": "Point", "coordinates": [0.0, 1.0], "radius_m": 0.3}


@pytest.mark.parametrize("geometry", [AREA, DISC])
def test_an_area_is_erased_undone_and_redone(
    client: httpx.Client, operations: FakeOperations, geometry: dict[str, Any]
) -> None:
    assert client.get("/api/v1/map/edits").json() == {"undo": None, "redo": None, "rejected": []}
    wrong(client.post("/api/v1/map/undo"), 409)
    answer = client.post("/api/v1/map/erase", json={"geometry": geometry, "what": "geometry"})
    assert answer.json()["undo"].startswith("erasing of obstacles")
    assert client.post("/api/v1/map/undo").json()["undo"] is None
    assert client.post("/api/v1/map/redo").json()["redo"] is None
    assert len(operations.map_posts) == 3


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"geometry": AREA, "what": "walls"},
        {"geometry": AREA, "all": True},
        {"geometry": {"type": "Polygon", "coordinates": [SQUARE[:2]]}},
        {"geometry": {"type": "Polygon", "coordinates": [[[0, 0], [90, 0], [90, 90]]]}},
        {"geometry": {**DISC, "radius_m": -1.0}},
        {"geometry": {**DISC, "coordinates": [1e5, 0.0]}},
    ],
)
def test_a_bad_area_is_refused_in_words(
    client: httpx.Client, operations: FakeOperations, body: dict[str, Any]
) -> None:
    assert wrong(client.post("/api/v1/map/erase", json=body), 422)["message"]
    assert not operations.map_posts


def test_a_detection_is_rejected_listed_and_forgotten(
    client: httpx.Client, operations: FakeOperations
) -> None:
    wrong(client.post("/api/v1/sightings/9/reject", json={}), 404)
    wrong(client.post("/api/v1/sightings/1/reject", json={"all_of_class": 1}), 422)
    rejected = client.post("/api/v1/sightings/1/reject", json={}).json()
    assert rejected["undo"] == "“cup” at (2.5, 1.0) is not one"
    (place,) = rejected["rejected"]
    assert (place["class_name"], place["confidence"]) == ("cup", 0.9)
    assert client.get("/api/v1/sightings").json()["sightings"][0]["verdict"] == "rejected"
    wrong(client.post("/api/v1/sightings/1/reject", json={"all_of_class": True}), 409)
    wrong(client.delete("/api/v1/map/rejected/7"), 404)
    forgotten = client.delete(f"/api/v1/map/rejected/{place['id']}").json()
    assert forgotten["rejected"] == [] and "counts again" in forgotten["undo"]
    assert len(client.post("/api/v1/map/undo").json()["rejected"]) == 1
