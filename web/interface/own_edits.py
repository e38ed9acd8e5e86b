"""Numbers of the edits that one request makes: editors note them, and its answer names the newest.

A history that is read after an edit may have another operator's edit on top.
"""

from __future__ import annotations

from contextvars import ContextVar

_made: ContextVar[list[int] | None] = ContextVar("edits of this request", default=None)


def collected_edits() -> list[int]:
    """Return the list to which the edits of the present request are added from now on."""
    made: list[int] = []
    _made.set(made)
    return made


def note_edit(number: int) -> None:
    """Add an edit, by its number among all edits, to those of the present request, if it is one."""
    made = _made.get()
    if made is not None:
        made.append(number)
