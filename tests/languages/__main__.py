"""`python -m tests.languages [xx]`: write the texts of the sources into every catalog, without a
translation where one is missing, and drop those that are gone; with a code, begin a new one."""

from __future__ import annotations

import sys
from io import BytesIO

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

from tests.languages.sources import texts
from web.languages.catalog import FOLDER


def updated(catalog: Catalog, current: Catalog) -> bytes:
    """Return a catalog as a PO file with the texts of another."""
    kept = Catalog(locale=catalog.locale, fuzzy=False, header_comment="#")
    for message in current:
        if message.id:
            known = catalog.get(message.id, message.context)
            string = "" if known is None else known.string
            kept.add(message.id, string, locations=message.locations, context=message.context)
    file = BytesIO()
    write_po(file, kept, width=100, omit_header=True)
    head = (
        'msgid ""\nmsgstr ""\n"Content-Type: text/plain; charset=utf-8\\n"\n'
        f'"Language: {catalog.locale}\\n"\n"Plural-Forms: {catalog.plural_forms}\\n"\n\n'
    )
    return head.encode() + file.getvalue()


def main(codes: list[str]) -> None:
    """Update the catalogs, and add those of other languages."""
    current = texts()
    for code in sorted({path.stem for path in FOLDER.glob("*.po")} | set(codes)):
        path = FOLDER / f"{code}.po"
        known = Catalog(locale=code)
        if path.exists():
            with path.open("rb") as file:
                known = read_po(file, locale=code)
        path.write_bytes(updated(known, current))


if __name__ == "__main__":
    main(sys.argv[1:])
