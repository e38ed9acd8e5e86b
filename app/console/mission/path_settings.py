"""The operator's settings of the path: kept with the site, in force from the next tick on, and
undone like an edit of the zones."""

from __future__ import annotations

import dataclasses
import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from app.console.mission.saved_missions import DocumentStore
from app.runtime.control.operator_state import StateHolder
from navcore.errors import Refused
from web.interface.beware import OPERATOR
from web.interface.drafts import EditHistory

SETTINGS = ("settings", "path")
"""Kind and name of the stored document."""
MAX_UNDO = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class _Edit:
    """One step of the operator that can be undone; None is the price of the configuration."""

    number: int
    text: str
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
        self._number = number or itertools.count(1).__next__
        self._done: deque[_Edit] = deque(maxlen=MAX_UNDO)
        self._undone: list[_Edit] = []
        self._editing = threading.Lock()
        self._is_retired = False

    @contextmanager
    def retired(self) -> Iterator[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        with self._editing:
            yield
            self._is_retired = True

    @property
    def unknown_price(self) -> float:
        """Cost of a metre of unseen floor in metres of seen floor."""
        price = self._holder.intent.unknown_price
        return self._configured if price is None else price

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""
        return EditHistory.of(self._done, self._undone)

    def set_unknown_price(self, price: float) -> None:
        """Set the cost of a metre of unseen floor in metres of seen floor."""
        with self._editing:
            if price == self.unknown_price:
                return
            before = self._holder.intent.unknown_price
            self._apply(price)
            text = f"cost of unseen floor: × {price:g}"
            self._done.append(_Edit(number=self._number(), text=text, before=before, after=price))
            self._undone = []

    def undo(self, *, by: str = OPERATOR) -> str:
        """Undo the newest edit and return its description."""
        with self._editing:
            if not self._done:
                raise Refused("there is no edit of the path's settings to undo")
            edit = self._done[-1]
            self._apply(edit.before)
            self._undone.append(self._done.pop())
        return edit.text

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last and return its description."""
        with self._editing:
            if not self._undone:
                raise Refused("there is no edit of the path's settings to redo")
            edit = self._undone[-1]
            self._apply(edit.after)
            self._done.append(self._undone.pop())
        return edit.text

    def _apply(self, price: float | None) -> None:
        if self._is_retired:
            raise Refused("the site has been changed meanwhile; look at the settings again")
        document = None if price is None else {"unknown_price": price}
        self._store.save_document(*SETTINGS, document)
        self._holder.change(lambda state: dataclasses.replace(state, unknown_price=price))


def stored_unknown_price(store: DocumentStore) -> float | None:
    """Return the price of unseen floor that a site has of its own; None for that of the
    configuration."""
    kind, name = SETTINGS
    record = store.documents(kind).get(name)
    return None if record is None else float(record["unknown_price"])
