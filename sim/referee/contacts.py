"""Contact counting: each contact once, with who caused it, the robot or a moving object."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

PUSH_LIMIT_M = 0.02
"""Distance driven against an object in contact after which a robot that was struck while standing
has collided after all."""
AGAIN_S = 5.0
"""Time since the end of a contact within which a new one with the same object goes on with it."""


@dataclass(slots=True, kw_only=True)
class Contact:
    """One contact, from touch to release."""

    t_s: float
    """Time at which the contact began."""
    what: str
    """Kind of the object, e.g. `wall`, `chair`, `person`."""
    collided: bool
    """Whether the robot drove into the object, or on against it; else it was struck or pushed while
    it stood or made way."""
    pressed_m: float = 0.0
    """Distance that the robot has driven, or rolled its wheels, against the object since."""


class Contacts:
    """The contacts of a run."""

    def __init__(self, name_of: Callable[[int], str], walks: Callable[[int], bool]) -> None:
        """Track contacts; `name_of` returns the kind of an object by its number, `walks` whether it
        moves by itself."""
        self._name_of, self._walks = name_of, walks
        self._open: dict[int, Contact] = {}
        self._pressed: dict[int, tuple[float, float]] = {}
        """Time of the newest contact with each object, and how far the robot has driven against it
        by then."""
        self._all: list[Contact] = []
        self.struck_while_standing = 0
        """Number of contacts in which a person or mover struck a robot that stood or made way."""

    @property
    def touched(self) -> bool:
        """Whether there was any contact, however slow, of whatever cause."""
        return bool(self._all)

    @property
    def collisions(self) -> int:
        """Number of contacts that began, or went on, while the robot drove, but for people and
        movers from whom it drove away."""
        return sum(contact.collided for contact in self._all)

    def judge(
        self, touched: Mapping[int, tuple[float, float]], *, driving: bool, t_s: float
    ) -> None:
        """Judge one step by the objects in contact, each with the distances in metres by which the
        robot moved against it, and by which its wheels rolled against it, and whether the wheels
        drive the robot. A robot that pushes against a wall, or a person who stands, does not move,
        and one that creeps counts as standing beside people, who may push it, and not beside
        walls."""
        for number, (advance_m, rolled_m) in touched.items():
            contact = self._open.get(number)
            if contact is None:
                walks = self._walks(number)
                collided = driving and (advance_m > 0.0 or not walks)
                last_s, pressed_m = self._pressed.get(number, (-math.inf, 0.0))
                contact = Contact(
                    t_s=t_s,
                    what=self._name_of(number),
                    collided=collided,
                    pressed_m=pressed_m if t_s - last_s <= AGAIN_S else 0.0,
                )
                self._open[number] = contact
                self._all.append(contact)
                self.struck_while_standing += walks and not collided
            elif driving or not self._walks(number):
                pushed_m = max(advance_m, rolled_m) if driving else rolled_m
                contact.pressed_m += pushed_m
                contact.collided |= pushed_m > 0.0 and contact.pressed_m > PUSH_LIMIT_M
            # What has counted once does not make the next contact one, too.
            self._pressed[number] = t_s, 0.0 if contact.collided else contact.pressed_m
        self._open = {
            number: contact for number, contact in self._open.items() if number in touched
        }

    def log(self, part: slice) -> list[dict[str, Any]]:
        """Return t_s, what and collided of each contact of a part of all, in order of time."""
        return [
            {"t_s": round(c.t_s, 3), "what": c.what, "collided": c.collided}
            for c in self._all[part]
        ]
