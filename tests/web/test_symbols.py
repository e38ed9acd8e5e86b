"""Every symbol of the page is in the font that browsers on Linux fall back to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib
from matplotlib.ft2font import FT2Font

import web

FOLDER = Path(web.__file__).parent
SOURCES = {".js", ".html", ".css", ".po", ".webmanifest"}


def glyphs() -> set[int]:
    """Code points of DejaVu Sans, of which matplotlib brings a copy."""
    font = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return set(FT2Font(str(font)).get_charmap())


def without_glyph(text: str, known: set[int]) -> set[str]:
    return {letter for letter in text if ord(letter) > 0x7F and ord(letter) not in known}


def sources() -> Iterator[Path]:
    yield from (path for path in sorted(FOLDER.rglob("*")) if path.suffix in SOURCES)


def test_every_symbol_of_the_page_has_a_glyph() -> None:
    known = glyphs()
    assert len(list(sources())) > 50
    missing = {
        str(path.relative_to(FOLDER)): letters
        for path in sources()
        if (letters := without_glyph(path.read_text(encoding="utf-8"), known))
    }
    assert missing == {}
    # The control: a symbol that the font lacks, and that was a box on the page.
    assert without_glyph("\N{POSITION INDICATOR} place", known) == {"\N{POSITION INDICATOR}"}
