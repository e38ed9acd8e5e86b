"""Zones to send, and what an answer that refuses must look like."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

SQUARE = [[4.0, -1.0], [5.0, -1.0], [5.0, 1.0], [4.0, 1.0]]


def zone(
    name: str = "wet floor", corners: list[list[float]] = SQUARE, **more: Any
) -> dict[str, Any]:
    """Return a zone as a GeoJSON Feature."""
    ring = [*corners, corners[0]]
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"name": name, **more},
    }


def wrong(answer: Any, status: int) -> dict[str, Any]:
    """Return the error of a refusal and check its shape."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    error = problem["error"]
    assert set(error) == {"code", "message", "where"}
    assert (problem["status"], problem["detail"]) == (status, error["message"])
    assert problem["type"] == "about:blank" and problem["title"] == HTTPStatus(status).phrase
    return dict(error)
