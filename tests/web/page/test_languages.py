"""The page in other languages: every text that is shown comes from a catalog, the robot's sentences
are translated with their figures, and longer words fit."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from babel.messages.catalog import Catalog as Texts
from playwright.sync_api import BrowserContext, Page, expect

from app.insight.event_detector import EventDetector
from app.insight.event_log import EventLog
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.stop_reasons import CONTROLLER_STOPS, POSE_STOPS, UNSEEN_FLOOR
from app.storage import Store
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.mission import Mission, Phase
from navcore.mission.zone import Zone
from tests.languages.sources import REPOSITORY, texts
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import await_map, click_map
from tests.web.page.states import SIZES, STATES, furnish
from web.languages.catalog import CATALOGS, ENGLISH, ROBOT, Catalog
from web.server import ConsoleServer

Opener = Callable[..., BrowserContext]
SAID = """() => {
  const isShown = (node) => node.checkVisibility();
  const said = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode())
    if (isShown(walker.currentNode.parentElement)) said.push(walker.currentNode.nodeValue.trim());
  for (const name of ["title", "aria-label", "placeholder", "alt"])
    for (const node of document.querySelectorAll(`[${name}]`))
      if (isShown(node)) said.push(node.getAttribute(name));
  return said;
}"""
"""JavaScript: all that the page says to a person."""
CLIPPED = """() => [...document.querySelectorAll("button, label, summary, h2, select, .badge")]
  .filter((node) => node.checkVisibility() && node.clientWidth)
  .filter((node) => node.scrollWidth > node.clientWidth + 1)
  .map((node) => node.textContent)"""
"""JavaScript: what is wider than its box."""
TRANSLATE = """async ([language, sentences]) => {
  document.documentElement.lang = language;
  const { sentence } = await import(`/page/core/text/language.js?${language}`);
  return sentences.map(sentence);
}"""
"""JavaScript: the robot's sentences in a language."""
MARKED = "eo"
"""Language of the catalog whose translations are the texts themselves in brackets."""
BRACKETS = re.compile("⟦[^⟦⟧]*⟧")
MENUS = (
    "missions",
    "path-settings",
    "sites-button",
    "zone-files",
    "beware-versions-button",
    "beware-add",
    "tab-why",
)
"""What opens a part of the page that no main state shows."""
CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
ENGLISH_WORDS = re.compile(r"\b(?:the|was|is|has|now|lasted|any|list)\b")
KEYS = {"Enter", "Esc", "Backspace", "Delete", "Ctrl", "Shift"}
FIELD = re.compile(r"\{(\w+)(:[^}]*)?\}")
OTHERS = sorted(CATALOGS.keys() - {ENGLISH})


@pytest.fixture
def current() -> Texts:
    """Return the texts of the sources."""
    return texts()


@pytest.fixture
def marked(
    monkeypatch: pytest.MonkeyPatch, operations: FakeOperations, current: Texts
) -> Iterator[ConsoleServer]:
    """Yield a console with one more language, in which every known text is in brackets."""
    known = [message for message in current if message.id]
    catalog = Catalog(
        texts={forms[0]: tuple(f"⟦{form}⟧" for form in forms) for forms in map(_forms, known)},
        sentences={str(one.id): f"⟦{one.id}⟧" for one in known if one.context == ROBOT},
    )
    monkeypatch.setitem(CATALOGS, MARKED, catalog)
    console = ConsoleServer(operations, port=0)
    console.start()
    yield console
    console.stop()


def _forms(message: object) -> tuple[str, ...]:
    text = message.id  # type: ignore[attr-defined]
    return (text,) if isinstance(text, str) else tuple(text)


def opened(
    new_context: Opener, server: ConsoleServer, language: str, size: tuple[int, int] = (1440, 900)
) -> Page:
    """Open the page in a browser of a language."""
    width, height = size
    context = new_context(
        viewport={"width": width, "height": height}, locale=language, has_touch=width < 1200
    )
    page = context.new_page()
    page.goto(f"{server.url}/#map")
    await_map(page)
    return page


def test_all_that_the_page_says_comes_from_the_catalog(
    new_context: Opener, marked: ConsoleServer, operations: FakeOperations
) -> None:
    furnish(operations)
    page = opened(new_context, marked, MARKED)
    given = {zone.name for zone in operations.zones.stored}
    given |= {goal.name for goal in operations.state().queue} | KEYS
    given |= {"default", "fake hall", "Nav2"}
    foreign = set()
    menus = [lambda page, name=name: page.get_by_test_id(name).click() for name in MENUS]
    for reach in (*STATES.values(), *menus):
        reach(page)
        page.wait_for_timeout(300)
        said = {text for text in page.evaluate(SAID) if re.search("[A-Za-z]{3}", unmarked(text))}
        foreign |= {text for text in said if not _has(text, given)}
        page.keyboard.press("Escape")
    assert foreign == set(), foreign


def unmarked(text: str) -> str:
    """Return what is in no brackets."""
    while (inner := BRACKETS.sub("", text)) != text:
        text = inner
    return text


def _has(text: str, names: set[str]) -> bool:
    return any(name and name in text for name in names)


def test_every_sentence_of_the_robot_is_translated_with_its_figures(
    new_context: Opener, server: ConsoleServer, current: Texts
) -> None:
    page = opened(new_context, server, "en-US")
    samples = [str(one.id) for one in current if one.id and one.context == ROBOT]
    filled = [FIELD.sub(lambda field: "2.5" if field[2] else "Ω", text) for text in samples]
    for language in OTHERS:
        translated = page.evaluate(TRANSLATE, [language, filled])
        expected = [_translated(text, language) for text in samples]
        assert [pair for pair in zip(translated, expected, strict=True) if len(set(pair)) > 1] == []
        # As they come: one in the other, and one that no catalog has.
        reasons = (*CONTROLLER_STOPS.values(), *POSE_STOPS.values(), UNSEEN_FLOOR)
        stops = [reason.text for reason in reasons]
        assert set(page.evaluate(TRANSLATE, [language, stops])).isdisjoint(stops)
        unknown = "a sentence of a later version, 1.5 m"
        assert page.evaluate(TRANSLATE, [language, [unknown]]) == [unknown]


def test_the_refusal_of_a_file_is_translated_whole(
    new_context: Opener, server: ConsoleServer
) -> None:
    page = opened(new_context, server, "en-US")
    said = {
        "the file: line 4: beware[0].enabled: expected bool, got 1": "die Datei: Zeile 4: "
        "beware[0].enabled: bool erwartet, nicht 1",
        "the file: line 6: beware[0].margin_m: nan is out of range, allowed 0 to 2": "die Datei: "
        "Zeile 6: beware[0].margin_m: nan liegt außerhalb von 0 bis 2",
        "map.npz: head.x_m: nan is out of range, allowed -inf to inf": "map.npz: head.x_m: nan "
        "liegt außerhalb von -inf bis inf",
        "map.npz: no map of this program; expected the parts head, rgb": "map.npz: keine Karte "
        "dieses Programms; erwartet werden die Teile head, rgb",
        "site.json: at dock.x_m: X: at most 5 m.": "site.json: bei dock.x_m: X: höchstens 5 m.",
        "the file: not readable as TOML, see line 4": "die Datei: nicht als TOML lesbar, siehe "
        "Zeile 4",
        "the file: beware: expected a list, got 3": "die Datei: beware: eine Liste erwartet, nicht "
        "3",
        "the file: line 4: beware[0].prototype: typical 1 has to be above threshold 2": "die "
        "Datei: Zeile 4: beware[0].prototype: typical 1 muss über threshold 2 liegen",
        "site.json: at zones.0.geometry: Outline of entry 1 is missing.": "site.json: bei "
        "zones.0.geometry: Umriss von Eintrag 1 fehlt.",
    }
    assert page.evaluate(TRANSLATE, ["de", list(said)]) == list(said.values())


def _translated(text: str, language: str) -> str:
    """Return the translation of a sample: a figure in the form of the language, but in a position,
    whose translation has no format."""

    def value(field: re.Match[str]) -> str:
        if field[2]:
            return "2,5"
        return "2.5" if f"{{{field[1]}:" in text else "Ω"

    return FIELD.sub(value, CATALOGS[language].sentences[text])


@pytest.mark.parametrize("language", OTHERS)
def test_reasons_refusals_and_figures_are_in_the_language_of_the_browser(
    new_context: Opener, server: ConsoleServer, operations: FakeOperations, language: str
) -> None:
    furnish(operations)
    page = opened(new_context, server, language)
    words = CATALOGS[language]
    expect(page.get_by_test_id("state-badge")).to_have_text(words.text("● IDLE"))
    expect(page.get_by_test_id("stop")).to_contain_text(words.text("STOP"))
    expect(page.locator("#figures")).to_contain_text(re.compile(r"\d,\d m"))
    classes = page.get_by_test_id("beware-class").all_text_contents()
    assert any(words.sentences["book"] in text for text in classes)
    operations.place.now = replace(operations.place.now, on_trial=True)
    expect(page.locator("#figures")).to_contain_text(f"{words.text('being confirmed')} ± ")
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("state-badge")).to_have_text(words.text("■ STOPPED"))
    reason = words.sentences["Emergency stop by {stopped_by}; it holds until it is reset."]
    by = words.sentences["console button"]
    expect(page.get_by_test_id("state-text")).to_contain_text(reason.format(stopped_by=by))
    page.get_by_test_id("mode-draw").click()
    for corner in ((0.0, 3.0), (1.0, 4.0), (1.0, 3.0), (0.0, 4.0)):
        click_map(page, *corner)
    crossing = words.sentences[
        "the outline of the {what} crosses itself at ({x_m:.2f}, {y_m:.2f}); move a corner"
    ]
    expect(page.get_by_test_id("draft-note")).to_contain_text(crossing.rpartition(";")[2])
    assert_fits(page)
    english = {text for text, forms in words.texts.items() if text not in forms and " " in text}
    assert english.isdisjoint(page.evaluate(SAID))


def assert_fits(page: Page) -> None:
    """Assert that no word is wider than its box, and the page no wider than the window."""
    assert page.evaluate(CLIPPED) == []
    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0


@pytest.mark.parametrize("language", OTHERS)
def test_a_number_is_typed_as_the_page_writes_it(
    new_context: Opener, server: ConsoleServer, operations: FakeOperations, language: str
) -> None:
    page = opened(new_context, server, language)
    for typed, x_m, y_m in (("3,5 -1", 3.5, -1.0), ("3,5, 0,5", 3.5, 0.5), ("3.5, -1", 3.5, -1.0)):
        page.get_by_test_id("goal-input").fill(typed)
        page.get_by_test_id("goal-add").click()
        expect(page.get_by_test_id("goal-input")).to_have_value("")
        goal = operations.state().queue[-1]
        assert (goal.x_m, goal.y_m) == (x_m, y_m)
    # One number alone, and a comma that may be a decimal sign or a separator.
    for unclear in ("3,5", "1,5 2.25", "3.5,1", "5,3,-90", "5,3, 90"):
        page.get_by_test_id("goal-input").fill(unclear)
        page.get_by_test_id("goal-add").click()
        expect(page.get_by_test_id("toasts")).to_contain_text(re.compile(f"{unclear}[“»]"))
    assert len(operations.state().queue) == 3


def test_an_explanation_leaves_the_names_of_zones_as_they_were_given(
    new_context: Opener, server: ConsoleServer
) -> None:
    named = """async () => {
        const { titleOf } = await import("/page/insight/explanation_text.js");
        return ["zone:1", "class:1", "wall"].map((key) =>
          titleOf({ key, name: key === "wall" ? "obstacles" : "cable" }));
    }"""
    page = opened(new_context, server, "de")
    assert page.evaluate(named) == ["cable", "Kabel", "Hindernisse"]


@pytest.mark.parametrize("language", OTHERS)
def test_longer_words_fit_a_tablet_and_a_phone(
    new_context: Opener, server: ConsoleServer, operations: FakeOperations, language: str
) -> None:
    furnish(operations)
    page = opened(new_context, server, language, SIZES["tablet"])
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("reset")).to_be_enabled()
    STATES["draft"](page)
    for width, height in (SIZES["tablet"], SIZES["phone"]):
        page.set_viewport_size({"width": width, "height": height})
        is_whole = "(text) => text.scrollHeight <= text.clientHeight + 1"
        assert page.get_by_test_id("state-text").evaluate(is_whole)
        for tab in ("map", "goals", "zones", "camera", "more"):
            page.get_by_test_id(f"page-tab-{tab}").click()
            page.wait_for_timeout(50)
            assert_fits(page)


CUT_OFF = """() => {
  const bar = document.querySelector(".bar").getBoundingClientRect();
  return [...document.querySelectorAll(".bar :is(button, span)")].filter((node) => {
    const box = node.getBoundingClientRect();
    const isOut = box.top < bar.top || box.bottom > bar.bottom;
    return box.width > 0 && !node.closest(".unseen") && isOut;
  }).map((node) => node.textContent.trim());
}"""
"""JavaScript: the texts of what stands out of the header."""


@pytest.mark.parametrize("language", OTHERS)
def test_the_header_has_room_for_who_has_control(
    new_context: Opener, server: ConsoleServer, language: str
) -> None:
    first = opened(new_context, server, language)
    first.get_by_test_id("goal-input").fill("3, 0")
    first.get_by_test_id("goal-add").click()  # who acts has control
    second = opened(new_context, server, language, (1200, 768))
    expect(second.get_by_test_id("control-ask")).to_be_visible()
    for width in (1440, 1180, 1024, 960):
        second.set_viewport_size({"width": width, "height": 768})
        second.wait_for_timeout(50)
        assert second.evaluate(CUT_OFF) == [], f"{width} px"


def test_the_language_that_is_chosen_stays(new_context: Opener, server: ConsoleServer) -> None:
    page = opened(new_context, server, "en-US")
    expect(page.get_by_test_id("start")).to_contain_text("Start")
    page.get_by_test_id("language").click()
    page.get_by_test_id("language-es").click()
    expect(page.get_by_test_id("start")).to_contain_text("Iniciar")
    expect(page.locator("html")).to_have_attribute("lang", "es")


def test_the_fields_of_a_past_mission_are_named_in_the_language_of_the_browser(
    new_context: Opener,
    server: ConsoleServer,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    report = {"id": "run-1", **dict.fromkeys(report_fields(), 1.5), "of_a_later_version": "x"}
    report |= {"goals": [[1.0, 2.0]], "stops": []}
    monkeypatch.setattr(operations, "runs", lambda: (report,))
    monkeypatch.setattr(operations, "run", lambda _: report)
    page = new_context(locale="de").new_page()
    page.goto(f"{server.url}/runs")
    rows = page.get_by_test_id("report").locator("tr th:first-child")
    expect(rows).to_have_count(len(report) + 1)
    names = rows.all_text_contents()[1:]
    assert [name for name in names if name.replace(" ", "_") in report] == [
        "of a later version",
    ]
    assert CATALOGS["de"].text("least clearance, m") in names
    expect(page.get_by_test_id("report")).to_contain_text("1,5")


def report_fields() -> set[str]:
    """Return the fields of the reports of console and referee, but for the series."""
    found = set[str]()
    for path, functions in (
        ("app/runtime/record/run_report.py", {"_report_of", "report"}),
        ("sim/referee/referee.py", {"summary"}),
    ):
        tree = ast.parse((REPOSITORY / path).read_text(encoding="utf-8"))
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and function.name in functions:
                dicts = [node for node in ast.walk(function) if isinstance(node, ast.Dict)]
                found |= {str(key.value) for key in dicts[0].keys if isinstance(key, ast.Constant)}
    assert {"scenario", "sim_time_s", "min_clearance_m"} < found
    return found - {"series"}


def test_stored_log_entries_are_shown_to_each_reader_in_their_language(
    new_context: Opener, server: ConsoleServer, operations: FakeOperations, tmp_path: Path
) -> None:
    with closing(Store(tmp_path)) as store:
        before = EventLog(store.events)
        said = [*note_events(before), "“cable” leaves the beware list."]
        before.note(100.0, "beware", said[-1])  # as an earlier version said it
        before.write()
        operations.insight.event_log = EventLog(store.events)  # of the next start
        english, *others = (
            logged(opened(new_context, server, language), len(said))
            for language in (ENGLISH, *OTHERS)
        )
    assert english == said
    for language, shown in zip(OTHERS, others, strict=True):
        words = CATALOGS[language].sentences
        assert words["Zone “{name}” was switched off."].format(name="wet") in shown
        assert any(
            words["“{title}” removed"].format(title=words["cable"]) in text for text in shown
        )
        assert words["“{name}” leaves the beware list."].format(name=words["cable"]) == shown[-1]
        assert any("0,9 m" in text and words["cable"] in text for text in shown)
        assert [text for text in shown if ENGLISH_WORDS.search(text)] == []
        assert set(shown).isdisjoint(said)


def note_events(event_log: EventLog) -> list[str]:
    """Have the robot log changes of mission, zones and beware list, and return what it says."""
    zone = Zone(id="a", name="wet", polygon=CORNERS)
    base, other, *_ = default_beware_list().classes
    cable = replace(other, name="cable", margin_m=0.1)
    bewares = [
        BewareList(classes=classes)
        for classes in (
            (base,),
            (base, cable),
            (base, replace(cable, margin_m=0.9)),
            (base, replace(cable, margin_m=0.9, enabled=not cable.enabled)),
            (base, replace(cable, margin_m=0.9)),
            (base,),
        )
    ]
    off, moved = replace(zone, enabled=False), replace(zone, margin_m=0.5)
    zones = [(), (zone,), (off,), (zone,), (moved,), ()]
    phases = [Phase.IDLE, Phase.DRIVING, Phase.PAUSED, Phase.LEAVING, Phase.IDLE, Phase.IDLE]
    intents = [
        OperatorState(mission=Mission(phase=phase), beware=beware, zones=drawn)
        for beware, drawn, phase in zip(bewares, zones, phases, strict=True)
    ]
    detector = EventDetector(event_log, intents[0])
    for tick, intent in enumerate(intents):
        detector.on_change(float(tick), intent, (0.0, 0.0))
    for second, reasons in ((10.0, (POSE_STOPS[next(iter(POSE_STOPS))],)), (11.0, ()), (99.0, ())):
        detector.on_gate(second, reasons, (0.0, 0.0))
    said = [entry.text for entry in event_log.page(kinds=(), since=0, limit=100).entries]
    assert len(said) == 16
    return said


def logged(page: Page, count: int) -> list[str]:
    """Return the sentences of the log, oldest first."""
    page.get_by_test_id("tab-log").click()
    words = page.get_by_test_id("log-entry").locator(".words")
    expect(words).to_have_count(count)
    return words.all_text_contents()[::-1]


def test_the_stop_works_without_the_catalog(
    new_context: Opener, server: ConsoleServer, operations: FakeOperations
) -> None:
    page = new_context(locale="de").new_page()
    page.route("**/languages/de.json", lambda route: route.abort())
    page.goto(f"{server.url}/#map")
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("state-badge")).to_have_text("■ STOPPED")
    assert operations.state().stop_latched
