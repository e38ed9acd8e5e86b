"""Prose is plain: no docstring, comment, message or page uses a word of the list in NAMING.md."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = ("app", "navcore", "sim", "tests", "web")
NAMING = ROOT / "navcore" / "NAMING.md"
LIST = re.compile(r"^## Banned words\n.*?```text\n(.*?)```\n", re.MULTILINE | re.DOTALL)
TEXT = (".css", ".html", ".js", ".md", ".toml")
"""Files that are searched as a whole."""
PROSE = frozenset(
    kind
    for name in ("STRING", "COMMENT", "FSTRING_MIDDLE")
    if (kind := getattr(tokenize, name, None)) is not None
)
THIRD_PARTY = ROOT / "tests" / "web" / "page" / "axe"
"""Not our prose."""
AUTHOR = r"(?! et al|-init|['’]s? init)"
"""Does not follow a pronoun but a name that is spelled as one: He et al., He-initialised."""


def banned() -> re.Pattern[str]:
    """The words of the list, as whole words in either case."""
    (listed,) = LIST.findall(NAMING.read_text(encoding="utf-8"))
    words = sorted(listed.split())
    assert len(words) >= 10
    return re.compile(rf"\b(?:{'|'.join(map(re.escape, words))})\b{AUTHOR}", re.IGNORECASE)


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of prose of a file with their numbers."""
    text = path.read_text(encoding="utf-8")
    if path == NAMING:
        text = LIST.sub(lambda found: "\n" * found[0].count("\n"), text)
    if path.suffix != ".py":
        yield from enumerate(text.splitlines(), start=1)
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in PROSE:
            yield from enumerate(token.string.splitlines(), start=token.start[0])


def offenders(pattern: re.Pattern[str]) -> list[str]:
    """Every banned word, as file:line: word."""
    files = [*ROOT.glob("*.md"), *(file for room in ROOMS for file in ROOT.glob(f"{room}/**/*"))]
    return [
        f"{path.relative_to(ROOT)}:{number}: {word}"
        for path in sorted(files)
        if path.suffix in (".py", *TEXT) and "__pycache__" not in path.parts
        if THIRD_PARTY not in path.parents
        for number, line in lines_of(path)
        for word in pattern.findall(line)
    ]


def test_no_prose_uses_a_banned_word() -> None:
    found = offenders(banned())
    assert not found, "\n".join([f"{len(found)} banned words; see navcore/NAMING.md", *found])


def test_the_search_finds_a_word_in_every_kind_of_file(tmp_path: Path) -> None:
    word = next(iter(banned().pattern.partition("(?:")[2].split("|")))
    for name in ("a.py", "a.js", "a.md"):
        path = tmp_path / name
        path.write_text(f'# 1\n"""2\n{word.capitalize()}"""\n', encoding="utf-8")
        assert [n for n, line in lines_of(path) if banned().search(line)] == [3]


def test_the_author_of_an_initialisation_is_no_pronoun() -> None:
    assert banned().search("as h" + "e walks")
    assert not banned().search("He et al. 2015, He's initialisation, He-initialised")
