"""The languages of the console's pages: gettext catalogs, `xx.po` beside this file.

A text in English is the key of its translations. What the page itself says has no context; what
the robot's program says, and the page only shows, has the context "robot" (`message.js` matches
such sentences with their figures). English needs no catalog.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from starlette.datastructures import Headers
from starlette.requests import cookie_parser

FOLDER = Path(__file__).parent
ENGLISH = "en"
ROBOT = "robot"
"""Context of the sentences of the robot's program."""
COOKIE = "bewarenav-language"
"""Cookie in which a browser keeps the language that was chosen last."""
_ENTRY = re.compile(
    r'(?:^msgctxt "(?P<context>.*)"\n)?^msgid (?P<text>(?:".*"\n)+)(?:^msgid_plural (?:".*"\n)+)?'
    r"(?P<forms>(?:^msgstr(?:\[\d\])? (?:\".*\"\n)+)+)",
    re.MULTILINE,
)
_FORM = re.compile(r'^msgstr(?:\[\d\])? ((?:".*"\n)+)', re.MULTILINE)
_STRING = re.compile(r'^(".*")$', re.MULTILINE)
_IN_PAGE = re.compile(
    r"<(style|code)>.*?</\1>"
    r'|(?:>|\s(?:title|aria-label|placeholder|alt)=")\s*(?P<text>[^<>"]*?[A-Za-z]{2}[^<>"]*?)\s*[<"]',
    re.DOTALL,
)
"""A text of an HTML file: of an element, or of an attribute that a person reads."""


@dataclass(frozen=True, slots=True)
class Catalog:
    """Translations into one language."""

    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Plural forms by text, one for a text without a plural."""
    sentences: Mapping[str, str] = field(default_factory=dict)
    """Translations of the robot's sentences by template."""

    def text(self, text: str, **values: object) -> str:
        """Return the translation, the text itself without one, with its `{values}`."""
        return self.texts.get(text, (text,))[0].format(**values)

    def page(self, source: str) -> str:
        """Return an HTML file with its texts translated."""
        pieces, end = [], 0
        for start, stop, text in page_texts(source):
            if text in self.texts:
                pieces += [source[end:start], html.escape(self.texts[text][0])]
                end = stop
        return "".join((*pieces, source[end:]))

    def json(self) -> bytes:
        """Return the catalog for the scripts of the page."""
        return json.dumps({"texts": self.texts, "sentences": self.sentences}).encode()


def read_catalog(source: str) -> Catalog:
    """Return the contents of a PO file."""
    texts, sentences = dict[str, tuple[str, ...]](), dict[str, str]()
    for entry in _ENTRY.finditer(source):
        text = _joined(entry["text"])
        forms = tuple(_joined(form) for form in _FORM.findall(entry["forms"]))
        if not (text and all(forms)):
            continue
        if entry["context"] == ROBOT:
            sentences[text] = forms[0]
        else:
            texts[text] = forms
    return Catalog(texts, sentences)


def _joined(lines: str) -> str:
    # The escapes of PO are those of JSON.
    return "".join(json.loads(line) for line in _STRING.findall(lines))


def page_texts(source: str) -> Iterator[tuple[int, int, str]]:
    """Yield start, end and text of all that a person reads in an HTML file."""
    at = 0
    while found := _IN_PAGE.search(source, at):
        if found["text"] is None:
            at = found.end() - 1
            continue
        yield *found.span("text"), html.unescape(found["text"])
        at = found.end() - 1  # the end of one text may begin the next tag


CATALOGS: Mapping[str, Catalog] = {
    ENGLISH: Catalog(),
    **{
        path.stem: read_catalog(path.read_text(encoding="utf-8"))
        for path in sorted(FOLDER.glob("*.po"))
    },
}
"""Catalogs by language."""


def language_of(headers: Headers, chosen: str | None = None) -> str:
    """Return the language that the user has chosen, else the last one that was chosen in this
    browser, else the first known one that it asks for, else English."""
    cookies = cookie_parser(headers.get("cookie", ""))
    ranked = sorted(headers.get("accept-language", "").split(","), key=_quality, reverse=True)
    wanted = [
        chosen or "",
        cookies.get(COOKIE, ""),
        *(entry.partition(";")[0].partition("-")[0].strip() for entry in ranked),
    ]
    return next((name for name in wanted if name in CATALOGS), ENGLISH)


def _quality(entry: str) -> float:
    found = re.search(r";\s*q=([01](?:\.\d*)?)\s*$", entry)
    return float(found[1]) if found else 1.0
