"""The operator's settings of the path: kept with the site, in force from the next tick on, and
undone like an edit of the zones."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import NamedTuple

from app.console.edit_history import Edit, EditStack
from app.console.mission.saved_missions import DocumentStore
from app.runtime.control.operator_state import StateHolder
from web.interface.beware import OPERATOR
from web.interface.drafts import EditHistory

SETTINGS = ("settings", "path")
"""Kind and name of the stored document."""


class _Prices(NamedTuple):
    """Price of unseen floor before and after an edit; None for that of the configuration."""

    before: float | None
    after: float | None


class PathSettings:
    """Satisfies the console's port `PathSettings`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        store: DocumentStore,
        configured: float,
        number: Callable[[], int] | None = None,
    ) -> None:
        """`configured`: price of unseen floor where the site has none of its own. `number` counts
        the edits of all kinds."""
        self._holder, self._store, self._configured = holder, store, configured
        self._edits = EditStack[_Prices](number=number)

    def retired(self) -> AbstractContextManager[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        return self._edits.retired()

    @property
    def unknown_price(self) -> float:
        """Cost of a metre of unseen floor in metres of seen floor."""
        price = self._holder.intent.unknown_price
        return self._configured if price is None else price

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""
        return self._edits.history

    def set_unknown_price(self, price: float) -> None:
        """Set the cost of a metre of unseen floor in metres of seen floor."""
        with self._edits.editing():
            if price == self.unknown_price:
                return
            prices = _Prices(self._holder.intent.unknown_price, price)
            self._apply(price)
            self._edits.add(f"cost of unseen floor: × {price:g}", prices)

    def undo(self, *, by: str = OPERATOR, number: int | None = None) -> str:
        """Undo the newest edit and return its description."""
        return self._edits.undo(lambda edit: self._apply(edit.step.before), number=number)

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last and return its description."""
        return self._edits.redo(self._repeat)

    def _repeat(self, edit: Edit[_Prices]) -> _Prices:
        self._apply(edit.step.after)
        return edit.step

    def _apply(self, price: float | None) -> None:
        document = None if price is None else {"unknown_price": price}
        self._store.save_document(*SETTINGS, document)
        self._holder.change(lambda state: dataclasses.replace(state, unknown_price=price))


def stored_unknown_price(store: DocumentStore) -> float | None:
    """Return the price of unseen floor that a site has of its own; None for that of the
    configuration."""
    kind, name = SETTINGS
    record = store.documents(kind).get(name)
    return None if record is None else float(record["unknown_price"])
