"""The texts of the console that need a translation, read from the sources.

Texts of the page: `t("…")` and `tn("…", "…", n)` in its scripts, `text("…")` in the log-in, and
what a person reads in the HTML files. Sentences of the robot's program: the strings of the modules
whose refusals, reasons and log lines the page shows; the values in an f-string become fields, a
number keeps its format: "{age_s:.2f} s old". So are the names of the classes of its beware list.
"""

from __future__ import annotations

import ast
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from babel.messages.catalog import Catalog

from navcore.mission.beware_changes import FIELDS
from web.gateway.sentences import LABELS
from web.languages.catalog import ROBOT, page_texts

REPOSITORY = Path(__file__).parents[2]
PAGES = (
    "web/page/index.html",
    "web/page/runs.html",
    "web/page/teach.html",
    "web/gateway/login.html",
    "web/starting.html",
)
SENTENCES = (
    "app/console/site/dock_and_tags.py",
    "app/console/mission/anchored_items.py",
    "app/console/back_off.py",
    "app/console/beware/beware_editor.py",
    "app/console/beware/colour_rules.py",
    "app/console/edit_history.py",
    "app/console/map_reading.py",
    "app/console/beware/examples.py",
    "app/console/beware/recent_frames.py",
    "app/console/mission/goals.py",
    "app/console/site/map_editor.py",
    "app/console/operations.py",
    "app/console/status_message.py",
    "app/console/stop_latch.py",
    "app/console/mission/path_preview.py",
    "app/console/mission/previews.py",
    "app/console/mission/path_settings.py",
    "app/console/site/place_editor.py",
    "app/console/mission/saved_missions.py",
    "app/console/site/site_archive.py",
    "app/console/site/site_files.py",
    "app/console/site/site_map.py",
    "app/console/site/sites.py",
    "app/console/mission/zone_editor.py",
    "app/insight/*.py",
    "app/runtime/record/map_keeper.py",
    "app/runtime/start/progress_lines.py",
    "app/runtime/control/robot_controller.py",
    "app/runtime/start/segmentation.py",
    "app/runtime/control/stop_reasons.py",
    "app/storage/database.py",
    "app/storage/site_store.py",
    "app/storage/sites.py",
    "app/storage/store.py",
    "app/storage/users.py",
    "app/teaching/frames/frame_archive.py",
    "app/teaching/frames/frame_store.py",
    "app/teaching/frames/live_frames.py",
    "app/teaching/networks/live_networks.py",
    "app/teaching/training/plan.py",
    "app/teaching/training/live_trainings.py",
    "app/teaching/training/run.py",
    "app/teaching/networks/versions.py",
    "web/interface/single_file.py",
    "navcore/control/motion.py",
    "navcore/costmap/cell_description.py",
    "navcore/files.py",
    "navcore/formats/alignment.py",
    "navcore/formats/keepout_mask.py",
    "navcore/formats/map_image.py",
    "navcore/formats/nav2_map.py",
    "navcore/grid/grid.py",
    "navcore/grid/growth.py",
    "navcore/localisation/estimate.py",
    "navcore/localisation/relocalisation/place_check.py",
    "navcore/localisation/relocalisation/place_fit.py",
    "navcore/localisation/relocalisation/relocalisation.py",
    "navcore/learning/data/zip_archive.py",
    "navcore/mapping/points/pose_ids.py",
    "navcore/mapping/storage/*.py",
    "navcore/mission/*.py",
    "navcore/perception/colour_rule.py",
    "navcore/perception/labels.py",
    "navcore/perception/prototype.py",
    "navcore/perception/region_growing.py",
    "navcore/planning/path.py",
    "navcore/robot/frame.py",
    "navcore/safety/gate.py",
    "navcore/safety/keep_out_monitor.py",
    "navcore/safety/sensor_monitor.py",
    "navcore/toml_config.py",
    "web/api/archive.py",
    "web/api/beware/beware.py",
    "web/api/beware/drafts.py",
    "web/api/map/edits.py",
    "web/api/map/maps.py",
    "web/api/mission/control.py",
    "web/api/nav2_files.py",
    "web/api/newest_tick.py",
    "web/api/sites.py",
    "web/api/users.py",
    "web/api/zone_drafts.py",
    "web/api/zones.py",
    "web/auth/audit_text.py",
    "web/auth/authenticator.py",
    "web/auth/control_lease.py",
    "web/auth/rate_limit.py",
    "web/auth/roles.py",
    "web/auth/users.py",
    "web/gateway/etag.py",
    "web/gateway/guard.py",
    "web/gateway/problems.py",
    "web/gateway/request_body.py",
    "web/gateway/sentences.py",
    "web/images/shown_images.py",
    "web/schemas/drafts.py",
    "web/schemas/fields.py",
    "web/api/teach/frames.py",
    "web/schemas/teaching.py",
    "web/schemas/zones.py",
)
"""Modules whose strings the page shows."""
LIST = "navcore/mission/beware.toml"
"""The beware list that comes with the program, the names of whose classes the page shows."""
_LITERAL = r'"(?:[^"\\]|\\.)*"'
_STRING = rf"({_LITERAL}(?:\s*\+\s*{_LITERAL})*)"
_CALL = re.compile(rf"(?<![\w$])(?:(?:t|text)\(\s*{_STRING}|tn\(\s*{_STRING},\s*{_STRING})")
MORE = (
    *(f"{{name}}: {title} {{before}} → {{after}}" for title, _, _ in FIELDS.values()),
    "{label}: {text}.",
    "{length:g} m",
    "{name} ({by})",
    "a viewer",
    "an admin",
    "an operator",
    "are",
    "console button",
    "console key",
    "is",
    "line {line}: {text}",
    "margin",
    "redo",
    "size",
    "the robot is at another site now; nothing was changed",
    "the simulator has ended with exit code {code}; start the console again",
    "Loading the program",
    "Something",
    "undo",
    "{where}.prototype: {error}",
    *LABELS.values(),
)
"""Sentences that the scan of those modules does not find."""
PAST = (
    "The camera sees an obstacle {where}, {contact_s:.2f} s before contact: too near to drive on.",
    "The camera's clock does not advance: an image is dated {back_s:.3f} s before the one that "
    "preceded it, or the same.",
    "The newest command is {age_s:.2f} s old, at most {command_life_s:g} s are allowed.",
    "There is no path to the goal: {why}.",
    "“{name}” is to be kept away from.",
    "“{name}” joins the beware list.",
    "“{name}” leaves the beware list.",
    "“{name}” need not be kept away from any more.",
    "“{name}” now has a margin of {margin_m:g} m, least confidence {min_confidence:.0%}.",
)
"""Sentences of earlier versions, which stored event logs still have: kept for good."""
_NUMBER = re.compile(r"[.\d,+]*[fgd%]")
_SILENT = re.compile(
    r"log\..*|.*(?:\bdatabase|\bconnection|query)\.\w+|Field|Query|Header|Path|Response|api_router"
    r"|PeriodicThread|threading\.Thread|typer\..*|.*\.(?:encode|removeprefix|replace|join)"
    r"|(?:error|context|scope|table)\.get"
)
"""Calls whose strings no operator reads."""
_NO_PROSE = re.compile(r"\s*[A-Z]{3,} |(?:attachment|image): |.*=|#|by hand: ")
"""SQL, headers and files."""
_FIGURE = re.compile(r"\{\w+:")
_WORDS = re.compile(r"[A-Za-z]{2}")


def texts(root: Path = REPOSITORY) -> Catalog:
    """Return all texts, untranslated, with the files that they come from."""
    found = Catalog(fuzzy=False)
    scripts = [*(root / "web/page").rglob("*.js"), root / "web/gateway/login.py"]
    for path in sorted(scripts):
        for text in texts_of(path.read_text(encoding="utf-8")):
            found.add(text, locations=[_at(path, root)])
    for name in PAGES:
        for _, _, text in page_texts((root / name).read_text(encoding="utf-8")):
            found.add(text, locations=[(name, 0)])
    for pattern in SENTENCES:
        for path in sorted(root.glob(pattern)):
            for text in sentences_of(path.read_text(encoding="utf-8")):
                found.add(text, locations=[_at(path, root)], context=ROBOT)
    for text in (*MORE, *PAST):
        found.add(text, context=ROBOT)
    for entry in tomllib.loads((root / LIST).read_text(encoding="utf-8"))["beware"]:
        found.add(entry["name"], locations=[(LIST, 0)], context=ROBOT)
    return found


def texts_of(source: str) -> Iterator[str | tuple[str, str]]:
    """Yield the texts of a script, with both forms of those that depend on a number."""
    for only, one, many in _CALL.findall(source):
        yield _joined(only) if only else (_joined(one), _joined(many))


def _joined(literals: str) -> str:
    return "".join(json.loads(literal) for literal in re.findall(_LITERAL, literals))


def _at(path: Path, root: Path) -> tuple[str, int]:
    # No line: it would change with every edit.
    return path.relative_to(root).as_posix(), 0


def sentences_of(source: str) -> Iterator[str]:
    """Yield the sentences of a module, as templates."""
    parents: dict[ast.AST, ast.AST] = {}
    for node in ast.walk(ast.parse(source)):
        parents |= dict.fromkeys(ast.iter_child_nodes(node), node)
    for node in parents:
        text = _template(node)
        if text is not None and _is_said(node, text, parents):
            yield text.replace("_", " ") if text.isidentifier() else text


def _template(node: ast.AST) -> str | None:
    """Return the text of a string, with fields for the values of an f-string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if not isinstance(node, ast.JoinedStr):
        return None
    pieces, names = list[str](), list[str]()
    for part in node.values:
        if isinstance(part, ast.FormattedValue):
            form = ast.unparse(part.format_spec)[2:-1] if part.format_spec else ""
            name = _name(part.value)
            names.append(name)
            name += str(names.count(name)) if names.count(name) > 1 else ""
            pieces.append(f"{{{name}:{form}}}" if _NUMBER.fullmatch(form) else f"{{{name}}}")
        elif isinstance(part, ast.Constant):
            pieces.append(str(part.value))
    return "".join(pieces)


def _name(value: ast.expr) -> str:
    """Return the last name in an expression."""
    found = [
        node.attr if isinstance(node, ast.Attribute) else node.id
        for node in ast.walk(value)
        if isinstance(node, ast.Attribute | ast.Name)
    ]
    return found[0].strip("_").lower() if found else "value"


def _is_said(node: ast.AST, text: str, parents: dict[ast.AST, ast.AST]) -> bool:
    """Return whether a string is a sentence, or a part of one, that a person may read."""
    if isinstance(parents[node], ast.Expr | ast.JoinedStr) or not (
        _FIGURE.search(text) or _WORDS.search(re.sub(r"\{.*?\}", "", text))
    ):
        return False  # a docstring, a part of an f-string, or neither words nor figures
    if _NO_PROSE.match(text):
        return False
    above: ast.AST | None = parents[node]
    while above is not None and not isinstance(above, ast.stmt):
        if isinstance(above, ast.Call) and _SILENT.fullmatch(ast.unparse(above.func)):
            return False
        if isinstance(above, ast.FormattedValue):
            return True
        above = parents.get(above)
    return " " in text or (isinstance(above, ast.Assign) and _is_enum(parents[above]))


def _is_enum(node: ast.AST) -> bool:
    return isinstance(node, ast.ClassDef) and any(
        isinstance(base, ast.Name) and base.id == "StrEnum" for base in node.bases
    )
