"""Catalogs, the choice of a language, and the pages that the console sends in it."""

from __future__ import annotations

import httpx
import pytest
from starlette.datastructures import Headers

from tests.web.auth.test_access import browser
from tests.web.conftest import PASSWORD, Accounts
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
    ("headers", "chosen", "expected"),
    [
        ({}, None, ENGLISH),
        ({"accept-language": "fr, de-AT;q=0.7, es;q=0.8"}, None, "es"),
        ({"accept-language": ";;q=9, fr;q=x"}, None, ENGLISH),
        ({"accept-language": "es", "cookie": f"{COOKIE}=de"}, None, "de"),
        ({"accept-language": "es", "cookie": f"{COOKIE}=../de"}, None, "es"),
        ({"cookie": f"{COOKIE}=de"}, "es", "es"),
        ({"cookie": f"{COOKIE}=de"}, "a removed one", "de"),
    ],
)
def test_the_language_is_that_of_the_user_else_of_the_browser(
    headers: dict[str, str], chosen: str | None, expected: str
) -> None:
    assert language_of(Headers(headers), chosen) == expected


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


def test_the_language_of_a_user_is_in_all_browsers_and_no_other_user_has_it(
    locked: ConsoleServer, accounts: Accounts
) -> None:
    with browser(locked, "viewer") as first, browser(locked, "viewer") as second:
        for visitor in (first, second):
            assert '<html lang="en"' in visitor.get("/").text
        chosen = first.put("/api/v1/me/language", json={"language": "de"})
        assert chosen.status_code == 204
        for path in ("/", "/runs"):  # the sessions go on
            assert '<html lang="de"' in second.get(path).text
        # The account's language goes before that of a browser in which others log in too.
        second.cookies.set(COOKIE, "es")
        assert '<html lang="de"' in second.get("/").text
        refused = first.put("/api/v1/me/language", json={"language": "xx"})
        assert refused.status_code == 422 and "de, en, es" in refused.text
    with browser(locked, "operator") as other:
        assert '<html lang="en"' in other.get("/").text
        audit = other.get("/api/v1/audit").json()
        assert "changed the language of their pages" in [entry["text"] for entry in audit]
    # It is stored: a console that starts again has it.
    assert {user.name: user.language for user in accounts.store.users.all()} == {
        "admin": None,
        "operator": None,
        "viewer": "de",
    }


def test_a_console_without_users_leaves_the_language_to_the_browser(client: httpx.Client) -> None:
    assert client.put("/api/v1/me/language", json={"language": "de"}).status_code == 409
    english, german = (
        client.get("/", headers={"Accept-Language": "en", "Cookie": f"{COOKIE}={code}"}).text
        for code in ("en", "de")
    )
    assert '<html lang="en"' in english and '<html lang="de"' in german


def test_the_log_in_speaks_the_language_of_the_browser(locked: ConsoleServer) -> None:
    with browser(locked) as visitor:
        visitor.headers["Accept-Language"] = "de"
        page = visitor.get("/").text
        assert '<html lang="de">' in page and CATALOGS["de"].text("Log in") in page
        refused = visitor.post("/login", data={"name": "admin", "password": PASSWORD + "?"})
        assert CATALOGS["de"].text("That name or password is wrong.") in refused.text
