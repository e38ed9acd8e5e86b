"""The operator's edits of the beware list: on the disk first, then in force."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from navcore.errors import Outdated
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import LabelSource


class BewareEditor:
    """Satisfies `web.port.BewareEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        *,
        present: Callable[[], BewareList],
        save: Callable[[BewareList], None],
        put: Callable[[BewareList], None],
        finds: Callable[[BewareClass], LabelSource],
    ) -> None:
        """`present` is the list in force, `save` stores another, `put` puts it in force; `finds`
        asks the segmenter."""
        self._present, self._save, self._put, self._finds = present, save, put, finds
        self._editing = threading.Lock()

    @property
    def list(self) -> BewareList:
        """The list in force."""
        return self._present()

    def finder(self, entry: BewareClass) -> LabelSource:
        """What finds an entry in the pictures."""
        return self._finds(entry)

    def edit(
        self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None
    ) -> BewareList:
        """Change fields of one class."""
        with self._editing:
            return self._kept(self._expected(expected_version).edited(name, **changes))

    def replace(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Put another list in force."""
        with self._editing:
            return self._kept(self._expected(expected_version).replaced(beware.classes))

    def _expected(self, version: int | None) -> BewareList:
        beware = self._present()
        if version is not None and version != beware.version:
            raise Outdated(
                f"the beware list is at version {beware.version}, the edit was made on {version}"
            )
        return beware

    def _kept(self, beware: BewareList) -> BewareList:
        self._save(beware)
        self._put(beware)
        return beware
