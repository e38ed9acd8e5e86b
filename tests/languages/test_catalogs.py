"""Every text of the sources has a translation in every language, and no other text has one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po

from tests.languages.sources import REPOSITORY, SENTENCES, sentences_of, texts
from web.languages.catalog import ENGLISH, FOLDER, ROBOT, read_catalog

FIELD = re.compile(r"\{(\w+)")
CODES = sorted(path.stem for path in FOLDER.glob("*.po"))


@pytest.fixture(scope="module")
def current() -> Catalog:
    """Return the texts of the sources."""
    return texts()


def catalog_of(code: str) -> Catalog:
    """Return a language's catalog, as Babel reads it."""
    with (FOLDER / f"{code}.po").open("rb") as file:
        return read_po(file, locale=code)


def keys(catalog: Catalog) -> set[tuple[str, object]]:
    """Return what identifies the messages of a catalog."""
    return {(message.context or "", message.id) for message in catalog if message.id}


def forms(string: object) -> tuple[str, ...]:
    """Return the plural forms of a message, or its only one."""
    return tuple(string) if isinstance(string, tuple | list) else (str(string),)


def problems(catalog: Catalog, current: Catalog) -> list[str]:
    """Return what is wrong with a catalog."""
    found = [f"no entry: {key}" for key in sorted(keys(current) - keys(catalog), key=str)]
    found += [f"obsolete: {key}" for key in sorted(keys(catalog) - keys(current), key=str)]
    found += [f"obsolete: {text}" for text in catalog.obsolete]
    for message in catalog:
        translations, ids = forms(message.string), forms(message.id)
        if message.id and not all(translations):
            found.append(f"not translated: {message.id}")
        elif message.id:
            expected = {frozenset(FIELD.findall(text)) for text in ids}
            given = {frozenset(FIELD.findall(text)) for text in translations}
            if not given <= expected:
                found.append(f"other fields: {message.id} – {message.string}")
    return found


@pytest.mark.parametrize("code", CODES)
def test_every_text_is_translated_and_no_other(code: str, current: Catalog) -> None:
    assert problems(catalog_of(code), current) == []


def test_a_missing_an_obsolete_and_an_altered_entry_are_found() -> None:
    current, catalog = Catalog(), Catalog()
    for text in ("Stop", "{n} goals"):
        current.add(text)
    for text, translation in (("{n} goals", "{m} Ziele"), ("Go", "Los")):
        catalog.add(text, translation)
    assert problems(catalog, current) == [
        "no entry: ('', 'Stop')",
        "obsolete: ('', 'Go')",
        "other fields: {n} goals – {m} Ziele",
    ]


def test_strings_that_a_person_reads_become_templates(tmp_path: Path) -> None:
    source = '''
"""About the module."""
log.info("for developers %s", x)
raise Refused(f"zone {zone.name!r} is {age_s:.2f} s old, {'on' if x else 'off'}")
'''
    found = list(sentences_of(source))
    assert found == ["zone {name} is {age_s:.2f} s old, {x}", "on", "off"]


@pytest.mark.parametrize("code", CODES)
def test_the_console_reads_a_catalog_as_babel_does(code: str) -> None:
    expected = catalog_of(code)
    given = read_catalog((FOLDER / f"{code}.po").read_text(encoding="utf-8"))
    assert given.sentences == {
        message.id: message.string for message in expected if message.context == ROBOT
    }
    assert given.texts == {
        forms(message.id)[0]: forms(message.string)
        for message in expected
        if message.id and message.context != ROBOT
    }
    assert ENGLISH not in CODES


def test_no_text_has_an_expression_that_new_users_had_to_guess(current: Catalog) -> None:
    guessed = ("binds", "again and again", "▲ nothing", "motions to choose from", "wrong: it is")
    said = [text for message in current if message.id for text in forms(message.id)]
    assert any("in force" in text for text in said)  # what is said instead
    assert [text for text in said for words in guessed if words in text] == []


MAKES_SENTENCES = re.compile(
    r"StopReason\(\s*cause|raise (?:Refused|NotKnown|Outdated|AlreadyThere|BlockedGoal)\("
    r"|event_log\.note\(|\btell\(f?\""
)
"""What makes a reason, a refusal or a log entry."""


def test_every_module_that_makes_a_reason_a_refusal_or_a_log_entry_is_searched() -> None:
    searched = {path for pattern in SENTENCES for path in REPOSITORY.glob(pattern)}
    making = {
        path
        for package in ("app", "navcore", "web")
        for path in (REPOSITORY / package).rglob("*.py")
        if path.parent.name != "cli"  # says it in a terminal
        if MAKES_SENTENCES.search(path.read_text(encoding="utf-8"))
    }
    assert making - searched == set()
