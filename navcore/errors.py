"""What can be wrong with what the navigation is given.

    BewareNavError
    ├── BadConfiguration    a file or a value of the operator: names the key, the value and what is allowed
    ├── BadFrame            a camera frame that must not enter the map
    ├── BadGeometry         a zone or a goal that is no place on the map
    │   └── BlockedGoal     a goal where the robot cannot stand; knows the nearest place where it can
    ├── Refused             an action that does not fit the present state, e.g. start without a goal
    │   └── Outdated        an edit of a version that somebody else has changed meanwhile
    ├── NotKnown            an id that names nothing
    └── StorageFailed       the disk did not take it; what was stored before is intact

Outcomes that are to be expected while driving (no path, no safe motion, a stop) are values, not
exceptions.
"""


class BewareNavError(Exception):
    """Any refusal of this project; its text says what was expected, what was given and what to do."""


class BadConfiguration(BewareNavError):  # noqa: N818 - named after what is bad, as all of them
    """A configuration value is unknown, missing or out of range."""


class BadFrame(BewareNavError):  # noqa: N818
    """A frame is malformed: wrong shape or type, non-finite, negative or blind."""


class BadGeometry(BewareNavError):  # noqa: N818
    """A polygon or a point cannot stand on the map."""


class BlockedGoal(BadGeometry):
    """The robot cannot stand at the goal."""

    def __init__(self, text: str, nearest: tuple[float, float] | None) -> None:
        """`nearest`: (x, y) in metres of the map frame of the nearest place where it can stand;
        None without one."""
        super().__init__(text)
        self.nearest = nearest


class Refused(BewareNavError):  # noqa: N818
    """The action does not fit the present state; nothing was changed."""


class Outdated(Refused):
    """The edit was made against an older version than the stored one; nothing was changed."""


class NotKnown(BewareNavError):  # noqa: N818
    """The id names nothing that is stored."""


class StorageFailed(BewareNavError):  # noqa: N818
    """The store could not be written or read; what was stored before is intact."""
