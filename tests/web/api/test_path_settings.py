"""The settings of the path by HTTP: read, changed, tried, undone, refused by name."""

from __future__ import annotations

import httpx
import pytest

from tests.web.api.answers import wrong
from tests.web.fake_operations import FakeOperations

SETTINGS = "/api/v1/path/settings"
GOAL = {"x_m": 4.8, "y_m": 0.0}


def test_a_price_is_read_changed_and_undone(client: httpx.Client) -> None:
    assert client.get(SETTINGS).json() == {
        "unknown_price": 1.0,
        "limits": {"unknown_price": {"low": 1.0, "high": 20.0}},
    }
    assert client.put(SETTINGS, json={"unknown_price": 3}).json()["unknown_price"] == 3.0
    assert client.get("/api/v1/state").json()["unknown_price"] == 3.0
    assert client.post("/api/v1/edits/undo").json()["text"] == "cost of unseen floor: × 3"
    assert client.get(SETTINGS).json()["unknown_price"] == 1.0
    client.post("/api/v1/edits/redo")
    assert client.get(SETTINGS).json()["unknown_price"] == 3.0


@pytest.mark.parametrize("price", [0.5, 20.5, "2", None])
def test_a_price_out_of_range_is_refused_by_name(client: httpx.Client, price: object) -> None:
    told = wrong(client.put(SETTINGS, json={"unknown_price": price}), 422)
    assert "unknown_price" in told["where"]
    assert client.get(SETTINGS).json()["unknown_price"] == 1.0


def test_a_price_is_tried_before_it_is_applied(
    client: httpx.Client, operations: FakeOperations
) -> None:
    operations.unsee(2.5, 4.0, -1.5, 5.9)
    free = client.post("/api/v1/preview", json={"goal": GOAL}).json()
    tried = client.post("/api/v1/preview", json={"goal": GOAL, "unknown_price": 10.0}).json()
    assert tried["present"]["length_m"] == free["length_m"] and free["present"] is None
    assert tried["change_m"] > 0.2 and free["unseen_m"] > 1.0 > tried["unseen_m"]
    assert client.get(SETTINGS).json()["unknown_price"] == 1.0
    client.put(SETTINGS, json={"unknown_price": 10.0})
    applied = client.post("/api/v1/preview", json={"goal": GOAL}).json()
    assert applied["length_m"] == tried["length_m"]
