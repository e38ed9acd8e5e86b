"""Catalogs, the choice of a language, and the pages that the console sends in it."""

from __future__ import annotations

import httpx
import pytest
from starlette.datastructures import Headers

from tests.web.auth.test_access import browser
from tests.web.conftest import PASSWORD
from web.languages.catalog import (
    CATALOGS,
    COOKIE,
    ENGLISH,
    Catalog,
    language_of,
    page_texts,
    read_catalog,
)
from web.server import ConsoleServer

FILE = r"""msgid ""
msgstr ""
"Language: de\n"

#: a.js
msgid "“{name}” is \"saved\"\n."
msgstr "„{name}“ ist "
"gesichert."

msgid "{n} goal"
msgid_plural "{n} goals"
msgstr[0] "{n} Ziel"
msgstr[1] "{n} Ziele"

msgctxt "robot"
msgid "goal"
msgstr "Ziel"

msgid "not yet"
msgstr ""
"""
PAGE = """<style>a > b { color: red }</style><p title="A &amp; B">  Hello <kbd>G</kbd> there</p>
<input placeholder="one&#10;two"><code>not me</code><i>+</i>"""


def test_a_file_gives_texts_plurals_and_sentences_and_leaves_out_what_is_missing() -> None:
    catalog = read_catalog(FILE)
    assert catalog.texts == {
        '“{name}” is "saved"\n.': ("„{name}“ ist gesichert.",),
        "{n} goal": ("{n} Ziel", "{n} Ziele"),
    }
    assert catalog.sentences == {"goal": "Ziel"}
    assert catalog.text("not yet") == "not yet"
    assert Catalog().text("wait {wait_s} s", wait_s=3) == "wait 3 s"


def test_the_texts_of_a_page_are_replaced_and_its_markup_stays() -> None:
    assert [text for _, _, text in page_texts(PAGE)] == ["A & B", "Hello", "there", "one\ntwo"]
    catalog = Catalog(texts={"Hello": ('"Hallo"',), "A & B": ("B & A",), "not me": ("wrong",)})
    changed = PAGE.replace("Hello", "&quot;Hallo&quot;").replace("A &amp; B", "B &amp; A")
    assert catalog.page(PAGE) == changed
    assert Catalog().page(PAGE) == PAGE


@pytest.mark.parametrize(
    ("headers", "user", "expected"),
    [
        ({}, "", ENGLISH),
        ({"accept-language": "fr, de-AT;q=0.7, es;q=0.8"}, "", "es"),
        ({"accept-language": ";;q=9, fr;q=x"}, "", ENGLISH),
        ({"accept-language": "es", "cookie": f"{COOKIE}=de"}, "", "de"),
        ({"accept-language": "es", "cookie": f"{COOKIE}=../de"}, "", "es"),
        ({"cookie": f"{COOKIE}=de; {COOKIE}.vera=es"}, "vera", "es"),
        ({"cookie": f"{COOKIE}=de; {COOKIE}.vera=es"}, "anna", "de"),
    ],
)
def test_the_language_is_that_of_the_user_else_of_the_browser(
    headers: dict[str, str], user: str, expected: str
) -> None:
    assert language_of(Headers(headers), user) == expected


def test_the_page_and_its_catalog_come_in_the_language_and_are_cached_by_it(
    client: httpx.Client,
) -> None:
    english, german = (
        client.get("/", headers={"Accept-Language": language}) for language in ("en", "de")
    )
    assert '<html lang="en" data-languages="en de es">' in english.text
    assert '<html lang="de"' in german.text and CATALOGS["de"].text("Mission") in german.text
    assert english.headers["etag"] != german.headers["etag"]
    assert english.headers["vary"] == "Accept-Language, Cookie"
    again = {"Accept-Language": "de", "If-None-Match": german.headers["etag"]}
    assert client.get("/", headers=again).status_code == 304
    catalog = client.get("/page/languages/de.json").json()
    assert catalog["texts"]["STOP"] == ["STOPP"]
    assert catalog["sentences"]["Driven by hand."] == CATALOGS["de"].sentences["Driven by hand."]
    assert client.get("/page/languages/xx.json").status_code == 404


def test_the_log_in_speaks_the_language_of_the_browser(locked: ConsoleServer) -> None:
    with browser(locked) as visitor:
        visitor.headers["Accept-Language"] = "de"
        page = visitor.get("/").text
        assert '<html lang="de">' in page and CATALOGS["de"].text("Log in") in page
        refused = visitor.post("/login", data={"name": "admin", "password": PASSWORD + "?"})
        assert CATALOGS["de"].text("That name or password is wrong.") in refused.text
