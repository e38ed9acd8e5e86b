"""The entries of the audit log in words: "pressed STOP" instead of a method and a path."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote, urlsplit

from web.auth.permissions import POSE, only_checks

RULES: tuple[tuple[str, str, str], ...] = (
    ("POST", r"/stop", "pressed STOP"),
    ("POST", r"/stop/reset", "reset the stop"),
    ("POST", r"/mission/start", "started the mission"),
    ("POST", r"/mission/pause", "paused the mission"),
    ("POST", r"/mission/resume", "resumed the mission"),
    ("POST", r"/mission/cancel", "cancelled the mission"),
    ("POST", r"/mission/back-off", "had the robot back off"),
    ("POST", r"/mission/leave", "had the robot leave the area it stands in"),
    ("PUT", r"/mission/loop", "changed whether goals are repeated"),
    ("POST", r"/goals", "added a goal"),
    ("PUT", r"/goals/order", "changed the order of the goals"),
    ("PATCH", r"/goals/(?P<name>[^/]+)", "changed goal {name}"),
    ("DELETE", r"/goals/(?P<name>[^/]+)", "removed goal {name}"),
    ("PUT", r"/missions/(?P<name>.+)", "saved the mission “{name}”"),
    ("POST", r"/missions/(?P<name>.+)/load", "loaded the mission “{name}”"),
    ("DELETE", r"/missions/(?P<name>.+)", "deleted the mission “{name}”"),
    ("POST", r"/zones", "added the zone {given}"),
    ("POST", r"/zones/import(-mask)?", "imported zones"),
    ("POST", r"/zones/undo", "took back the last edit of the zones"),
    ("POST", r"/zones/redo", "repeated an edit of the zones"),
    ("PUT", r"/zones/[^/]+", "changed the zone {given}"),
    ("DELETE", r"/zones/[^/]+", "deleted a zone"),
    ("PUT", r"/zone-sets/(?P<name>.+)", "saved the set of zones “{name}”"),
    ("POST", r"/zone-sets/(?P<name>.+)/use", "put the set of zones “{name}” in force"),
    ("DELETE", r"/zone-sets/(?P<name>.+)", "deleted the set of zones “{name}”"),
    ("PUT", r"/beware", "replaced the beware list"),
    ("POST", r"/beware", "added {given} to the beware list"),
    ("PUT", r"/beware\.toml", "imported a beware list"),
    ("PUT", r"/beware/order", "changed the order of the beware list"),
    ("POST", r"/beware/versions/(?P<name>\d+)/restore", "brought back beware list {name}"),
    ("POST", r"/beware/defaults", "took a ready-made beware list"),
    ("POST", r"/beware/undo", "took back the last edit of the beware list"),
    ("POST", r"/beware/redo", "repeated an edit of the beware list"),
    ("DELETE", r"/beware/(?P<name>.+)", "removed “{name}” from the beware list"),
    ("PATCH", r"/beware/(?P<name>.+)", "changed “{name}” in the beware list"),
    ("POST", r"/sightings/(?P<name>\d+)/wrong", "marked detection {name} as wrong"),
    ("POST", r"/sightings/(?P<name>\d+)/reject", "said that detection {name} is not one"),
    ("DELETE", r"/map/rejected/(?P<name>\d+)", "took back rejection {name}"),
    ("POST", r"/sightings", "labelled a missed object"),
    ("POST", r"/sightings/snapshots", "held an image for labelling"),
    ("PATCH", r"/map/poses", "corrected poses of the map"),
    ("POST", r"/map/erase", "erased an area of the map"),
    ("POST", r"/map/reject", "said that something on the map is not what it was taken for"),
    ("POST", r"/edits/undo", "took back the last edit"),
    ("POST", r"/edits/redo", "repeated an edit"),
    ("PUT", r"/path/settings", "changed the settings of the path"),
    ("POST", r"/map/undo", "took back the last edit of the map"),
    ("POST", r"/map/redo", "repeated an edit of the map"),
    ("POST", r"/map/changes/accept", "accepted changes of the map"),
    ("POST", r"/pose", "placed the robot on the map"),
    ("POST", r"/localisation/search", "had the robot search for its place"),
    ("POST", r"/sites", "made the site {given}"),
    ("POST", r"/sites/import(-nav2)?", "imported a site"),
    ("POST", r"/sites/(?P<name>.+)/choose", "chose the site “{name}”"),
    ("POST", r"/sites/(?P<name>.+)/copy", "copied the site “{name}”"),
    ("PATCH", r"/sites/(?P<name>[^/]+)", "changed the site “{name}”"),
    ("POST", r"/sites/(?P<name>[^/]+)/tags", "set a tag of the site “{name}”"),
    ("DELETE", r"/sites/(?P<name>[^/]+)/tags/[^/]+", "removed a tag of the site “{name}”"),
    ("DELETE", r"/sites/(?P<name>[^/]+)", "deleted the site “{name}”"),
    ("POST", r"/camera/region", "picked an object in the camera image"),
    ("POST", r"/control/ask", "asked for control"),
    ("POST", r"/control/take", "took control"),
    ("POST", r"/control/give", "handed control over"),
    ("POST", r"/users", "added a user"),
    ("PUT", r"/users/(?P<name>[^/]+)/role", "changed the role of {name}"),
    ("PUT", r"/users/(?P<name>[^/]+)/password", "changed the password of {name}"),
    ("POST", r"/users/(?P<name>[^/]+)/token", "made a token for {name}"),
    ("DELETE", r"/users/(?P<name>[^/]+)", "deleted the user {name}"),
    ("PUT", r"/me/language", "changed the language of their pages"),
    ("PUT", r"/me/password", "changed their password"),
    ("POST", r"/teach/frames", "captured a frame"),
    ("PUT", r"/teach/capturing", "switched the capture of frames while driving"),
    ("POST", r"/teach/frames\.zip", "uploaded captured frames"),
    ("DELETE", r"/teach/frames/(?P<name>[^/]+)", "deleted captured frame {name}"),
    ("PUT", r"/teach/frames/(?P<name>[^/]+)/labels", "annotated captured frame {name}"),
    ("POST", r"/teach/frames/[^/]+/region", "picked a region of a captured frame"),
    ("POST", r"/teach/training", "started a training of the network"),
    ("POST", r"/teach/training/cancel", "cancelled the training of the network"),
    ("POST", r"/teach/training/resume", "resumed the training of the network"),
    ("POST", r"/teach/networks", "uploaded a network"),
    ("POST", r"/teach/networks/rollback", "went back to the network used before"),
    ("POST", r"/teach/networks/(?P<name>[^/]+)/use", "put the network “{name}” in use"),
    ("DELETE", r"/teach/networks/(?P<name>[^/]+)", "deleted the network “{name}”"),
    ("WS", r"stop", "pressed STOP"),
    ("WS", r"by hand: begins", "began to drive by hand"),
    ("WS", r"by hand: ends", "ended driving by hand"),
    ("POST", r"/login", "logged in"),
    ("POST", r"/logout", "logged out"),
)
"""Method, path below `/api/v1` and sentence; the first that matches the whole path applies."""


def describe_entry(entry: Mapping[str, Any]) -> str:
    """Return what the visitor did, in words; an action without words of its own keeps its
    method and path."""
    method, address = str(entry.get("method", "")), str(entry.get("path", ""))
    parts = urlsplit(address)
    below = unquote(parts.path).removeprefix("/api/v1")
    if (method, parts.path) == ("POST", POSE) and only_checks(parts.query):
        return "compared what the robot sees with a place on the map"
    for expected, pattern, text in RULES:
        found = re.fullmatch(pattern, below) if method == expected else None
        if found is not None:
            given = _name_in(entry.get("detail"))
            return text.format(given=given, **found.groupdict()).rstrip()
    return f"{method} {below}".strip() or str(entry.get("what", "did something"))


def _name_in(detail: object) -> str:
    """Return the name in a body, in quotation marks; empty without one."""
    if not isinstance(detail, Mapping):
        return ""
    properties = detail.get("properties")
    inner = properties if isinstance(properties, Mapping) else detail
    name = inner.get("name")
    return f"“{name}”" if isinstance(name, str) else ""
