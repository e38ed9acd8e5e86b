"""Contact counting: each contact once, with who caused it, the robot or a moving object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

PUSH_LIMIT_M = 0.1
"""Distance driven in contact after which a robot that was struck while standing has collided after
all."""


@dataclass(slots=True, kw_only=True)
class Contact:
    """One contact, from touch to release."""

    t_s: float
    """Time at which the contact began."""
    what: str
    """Kind of the object, e.g. `wall`, `chair`, `person`."""
    driven_m: float
    """Distance that the robot had driven by then."""
    collided: bool
    """Whether the robot drove into the object, or on with it; else it was struck or pushed."""


class Contacts:
    """The contacts of a run."""

    def __init__(self, name_of: Callable[[int], str], walks: Callable[[int], bool]) -> None:
        """Track contacts; `name_of` returns the kind of an object by its number, `walks` whether it
        moves by itself."""
        self._name_of, self._walks = name_of, walks
        self._open: dict[int, Contact] = {}
        self._all: list[Contact] = []
        self.struck_while_standing = 0
        """Number of contacts in which a person or mover struck the standing robot."""

    @property
    def collisions(self) -> int:
        """Number of contacts that began, or went on, while the robot drove."""
        return sum(contact.collided for contact in self._all)

    def judge(self, touched: set[int], *, driving: bool, t_s: float, driven_m: float) -> None:
        """Judge one step by the numbers of the objects in contact, and whether the wheels drive the
        robot."""
        for number in touched:
            contact = self._open.get(number)
            if contact is None:
                contact = Contact(
                    t_s=t_s, what=self._name_of(number), driven_m=driven_m, collided=driving
                )
                self._open[number] = contact
                self._all.append(contact)
                self.struck_while_standing += not driving and self._walks(number)
            elif driving and driven_m - contact.driven_m > PUSH_LIMIT_M:
                contact.collided = True
        self._open = {
            number: contact for number, contact in self._open.items() if number in touched
        }

    def log(self) -> list[dict[str, Any]]:
        """Return t_s, what and collided of each contact, in order of time."""
        return [{"t_s": round(c.t_s, 3), "what": c.what, "collided": c.collided} for c in self._all]
