"""The audit log says what was done in words, for every request that can change something."""

from __future__ import annotations

import re

import pytest

from tests.web.fake_operations import FakeOperations
from web.auth.audit import _entry
from web.auth.audit_text import describe_entry
from web.auth.permissions import SAFE, SILENT
from web.auth.roles import Role, Visitor
from web.server import create_app


@pytest.mark.parametrize(
    ("method", "path", "detail", "text"),
    [
        ("POST", "/api/v1/stop?by=console%20key", None, "pressed STOP"),
        ("PUT", "/api/v1/missions/Ronde%201", None, "saved the mission “Ronde 1”"),
        ("POST", "/api/v1/zones", {"properties": {"name": "Wet"}}, "added the zone “Wet”"),
        ("POST", "/api/v1/zones", {"name": "Wet"}, "added the zone “Wet”"),
        ("PUT", "/api/v1/zones/z1", "9000 bytes", "changed the zone"),
        ("PATCH", "/api/v1/beware/red%20floor", {"enabled": False},
         "changed “red floor” in the beware list"),
        ("POST", "/login", None, "logged in"),
        ("POST", "/api/v1/pose", {"x_m": 1.0}, "placed the robot on the map"),
        ("POST", "/api/v1/pose?check=true", {"x_m": 1.0},
         "compared what the robot sees with a place on the map"),
        ("POST", "/api/v1/pose?force=true&check=1", None,
         "compared what the robot sees with a place on the map"),
        ("POST", "/api/v1/pose?check=true&check=off", None, "placed the robot on the map"),
        ("WS", "stop?by=console key", None, "pressed STOP"),
        ("WS", "by hand: begins", None, "began to drive by hand"),
        ("POST", "/api/v1/new/thing", None, "POST /new/thing"),
    ],
)  # fmt: skip
def test_an_entry_is_told_in_words(method: str, path: str, detail: object, text: str) -> None:
    entry = {"who": "vera", "method": method, "path": path, "status": 200, "detail": detail}
    assert describe_entry(entry) == text


def test_a_name_is_logged_whole_whatever_its_characters() -> None:
    name = "Ward #1? 50%25"
    scope = {
        "method": "DELETE",
        "path": f"/api/v1/missions/{name}",
        "query_string": b"force=true",
    }
    visitor = Visitor(name="vera", role=Role.ADMIN, client_id="page vera")
    assert describe_entry(_entry(scope, visitor, 204)) == f"deleted the mission “{name}”"


def test_every_request_that_changes_something_has_words() -> None:
    app = create_app(FakeOperations(), allowed_hosts=["console"])
    for path, methods in app.openapi()["paths"].items():
        if path in SILENT:
            continue  # it changes nothing and is not logged
        for method in methods:
            if method.upper() in SAFE:
                continue
            actions = ["start"]
            if path.endswith("/control/{action}"):
                actions = ["take", "ask", "give"]
            for action in actions:
                address = path.replace("{action}", action)
                address = re.sub(r"\{\w*(id|version)\}", "7", address)
                address = re.sub(r"\{\w+\}", "cup", address)
                text = describe_entry({"method": method.upper(), "path": address})
                assert "/" not in text, f"{method} {path} has no words: {text}"
