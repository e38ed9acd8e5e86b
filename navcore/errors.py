"""Exceptions for invalid input of the navigation.

    BewareNavError
    ├── BadConfiguration    an invalid file or value; names key, value and allowed range
    ├── BadFrame            a camera frame that must not enter the map
    ├── BadGeometry         a zone or a goal that does not fit on the map
    │   ├── BlockedGoal     a goal in a blocked cell; has the nearest free position
    │   └── CrossedOutline  an outline that crosses itself; has the position
    ├── Refused             an action that the present state does not allow
    │   ├── Outdated        an edit of a version that has changed meanwhile
    │   └── AlreadyThere    what was to be stored exists; has the names
    ├── NotKnown            an id that does not exist
    └── StorageFailed       a failure of the disk; the older contents are intact

Expected outcomes of driving (no path, no safe motion, a stop) are values, not exceptions.
"""


class BewareNavError(Exception):
    """Base of all exceptions here; the text says what was expected, what was given and what to
    do."""


class BadConfiguration(BewareNavError):  # noqa: N818 - named after what is bad, like all of them
    """A configuration value is unknown, missing or out of range."""


class BadFrame(BewareNavError):  # noqa: N818
    """A frame is malformed: wrong shape or type, non-finite, negative or blind."""


class BadGeometry(BewareNavError):  # noqa: N818
    """A polygon or a point does not fit on the map."""


class BlockedGoal(BadGeometry):
    """The robot's centre cannot be at the goal."""

    def __init__(self, text: str, nearest: tuple[float, float] | None) -> None:
        """`nearest`: (x, y) in metres of the map frame of the nearest free position; None without
        one."""
        super().__init__(text)
        self.nearest = nearest


class CrossedOutline(BadGeometry):
    """The outline of a zone crosses or touches itself."""

    def __init__(self, text: str, crossing: tuple[float, float]) -> None:
        """`crossing`: (x, y) in metres of the map frame of a point where it does."""
        super().__init__(text)
        self.crossing = crossing


class Refused(BewareNavError):  # noqa: N818
    """The present state does not allow the action; nothing was changed."""


class Outdated(Refused):
    """The edit was made against an older version than the stored one; nothing was changed."""


class OtherSite(Refused):
    """The robot is at another site than the one that was meant."""


class NeedsForce(Refused):
    """The action is asked for again before it is done; nothing was changed."""


class AlreadyThere(Refused):
    """What was to be stored is stored already; nothing was changed."""

    def __init__(self, text: str, names: tuple[str, ...]) -> None:
        """`names`: names of what is there."""
        super().__init__(text)
        self.names = names


class NotKnown(BewareNavError):  # noqa: N818
    """The id does not exist."""


class StorageFailed(BewareNavError):  # noqa: N818
    """The disk could not be read or written; the older contents are intact."""
