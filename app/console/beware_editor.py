"""The operator's edits of the beware list: on the disk first, then in force; every edit can be
undone."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping

from navcore.errors import Outdated, Refused
from navcore.mission.beware_list import BewareClass, BewareList, default_beware_list
from navcore.perception.labels import LabelSource

MAX_UNDO = 100


class BewareEditor:
    """Satisfies `web.port.BewareEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        *,
        present: Callable[[], BewareList],
        save: Callable[[BewareList], None],
        put: Callable[[BewareList], None],
        finds: Callable[[BewareClass], LabelSource],
        earlier: Iterable[BewareList] = (),
    ) -> None:
        """`present` is the list in force, `save` stores another, `put` puts it in force; `finds`
        asks the segmenter.

        `earlier`: the lists that were in force before the present one, oldest first.
        """
        self._present, self._save, self._put, self._finds = present, save, put, finds
        self._earlier = deque(earlier, maxlen=MAX_UNDO)
        self._editing = threading.Lock()

    @property
    def list(self) -> BewareList:
        """The list in force."""
        return self._present()

    @property
    def can_undo(self) -> bool:
        """Whether an earlier list is known."""
        return bool(self._earlier)

    def finder(self, entry: BewareClass) -> LabelSource:
        """What finds an entry in the pictures."""
        return self._finds(entry)

    def edit(
        self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None
    ) -> BewareList:
        """Change fields of one class."""
        with self._editing:
            return self._changed(self._expected(expected_version).edited(name, **changes))

    def replace(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Put another list in force."""
        with self._editing:
            return self._changed(self._expected(expected_version).replaced(beware.classes))

    def restore_defaults(self) -> BewareList:
        """Put the shipped list in force."""
        with self._editing:
            return self._changed(self._present().replaced(default_beware_list().classes))

    def undo(self) -> BewareList:
        """Put the list before the newest edit in force, as another version."""
        with self._editing:
            if not self._earlier:
                raise Refused("there is no edit of the beware list to undo")
            beware = self._kept(self._present().replaced(self._earlier[-1].classes))
            self._earlier.pop()
            return beware

    def _expected(self, version: int | None) -> BewareList:
        beware = self._present()
        if version is not None and version != beware.version:
            raise Outdated(
                f"the beware list is at version {beware.version}, the edit was made on {version}"
            )
        return beware

    def _changed(self, beware: BewareList) -> BewareList:
        present = self._present()
        self._kept(beware)
        self._earlier.append(present)
        return beware

    def _kept(self, beware: BewareList) -> BewareList:
        self._save(beware)
        self._put(beware)
        return beware
