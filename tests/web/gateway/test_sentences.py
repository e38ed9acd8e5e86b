"""A refusal is a sentence for an operator: no word of the framework, no route, no echo."""

from __future__ import annotations

import re
from typing import Any

import httpx
import pytest

from tests.web.api.answers import wrong

MULTI = {"type": "MultiPolygon", "coordinates": []}
GEOMETRY = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1]]]}


WRONG: tuple[Any, ...] = (
    {},
    {"name": "a", "geometry": MULTI},
    {"name": 3, "x_m": "a", "margin_m": []},
    {"unknown": {}},
    [1],
    "x",
)


@pytest.mark.parametrize(
    ("method", "path", "body", "sentence"),
    [
        ("POST", "zones", {"name": "", "geometry": GEOMETRY}, "Give a name."),
        ("POST", "zones", {"geometry": GEOMETRY}, "Name is missing."),
        ("POST", "zones", {"name": "a" * 99, "geometry": GEOMETRY}, "Name: at most 80 characters."),
        (
            "POST",
            "zones",
            {"name": "a", "geometry": GEOMETRY, "kind": "speed-limit", "max_speed_mps": 99},
            "Speed limit: at most 5 m/s.",
        ),
        (
            "POST",
            "zones",
            {"name": "a", "geometry": GEOMETRY, "colour": "red"},
            "Colour: expected a colour as #rrggbb.",
        ),
        (
            "POST",
            "zones/import",
            {"hello": 1},
            "This is no GeoJSON of zones: expected a FeatureCollection.",
        ),
        (
            "POST",
            "zones/import",
            {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": MULTI}]},
            "Outline of entry 1: expected 'Polygon', 'Point', 'LineString'.",
        ),
        ("POST", "map/erase", {"geometry": {"coordinates": []}}, "Type is missing."),
        ("POST", "beware/preview", {"changes": {"²": {"margin_m": 99}}}, "Margin: at most 2 m."),
        ("POST", "beware/preview", {"changes": {"5": {"margin_m": 99}}}, "Margin: at most 2 m."),
        ("PATCH", "beware/cup", {"margin_m": 99}, "Margin: at most 2 m."),
        ("PATCH", "beware/cup", {"margin_m": "wide"}, "Margin: expected a number."),
        ("POST", "goals", {"x_m": 1}, "Y is missing."),
        ("PUT", "mission/loop", {"loop": 3}, "Repeat: expected true or false."),
    ],
)
def test_a_refused_value_is_told_in_a_sentence(
    client: httpx.Client, method: str, path: str, body: dict[str, Any], sentence: str
) -> None:
    answer = client.request(method, f"/api/v1/{path}", json=body)
    assert wrong(answer, 422)["message"] == sentence


def test_no_sentence_has_words_of_the_framework(client: httpx.Client) -> None:
    """Every type of value in every body of the API is given a wrong one."""
    framework = re.compile(r"Input should|Field required|String should|body\.|type=|pydantic|tag")
    seen = 0
    schema = client.get("/openapi.json", timeout=120.0).json()
    for path, methods in schema["paths"].items():
        for method, about in methods.items():
            if "requestBody" not in about or "{" in path.replace("{name}", ""):
                continue
            for body in WRONG:
                address = path.replace("{name}", "cup")
                answer = client.request(method.upper(), address, json=body)
                assert answer.status_code < 500, (address, body)
                if answer.status_code == 422:
                    seen += 1
                    assert not framework.search(str(answer.json()["error"]["message"])), address
    assert seen > 30
