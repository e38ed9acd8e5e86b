"""Counts contacts, once each, and tells whether the robot drove into something or somebody walked
into it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

CARRIED_ON_M = 0.1
"""A robot that was struck while standing and then moves so far without coming free collides after
all."""


@dataclass(slots=True, kw_only=True)
class Contact:
    """One contact, from touch to release."""

    t_s: float
    """When it began."""
    what: str
    """What it was with, e.g. `wall`, `chair`, `person`."""
    driven_m: float
    """Way that the robot had driven by then."""
    collided: bool
    """Whether the robot drove into it, or on with it; else it was walked into, or pushed there."""


class Contacts:
    """The contacts of a run."""

    def __init__(self, name_of: Callable[[int], str], walks: Callable[[int], bool]) -> None:
        """`name_of` a thing's number, and whether it `walks` by itself."""
        self._name_of, self._walks = name_of, walks
        self._open: dict[int, Contact] = {}
        self._all: list[Contact] = []
        self.struck_while_standing = 0
        """Times that somebody walked into the standing robot."""

    @property
    def collisions(self) -> int:
        """Contacts that began, or went on, while the robot drove."""
        return sum(contact.collided for contact in self._all)

    def judge(self, touched: set[int], *, drives: bool, t_s: float, driven_m: float) -> None:
        """Look at one step: the numbers of the things in contact, and whether the robot's wheels
        drive it."""
        for thing in touched:
            contact = self._open.get(thing)
            if contact is None:
                contact = Contact(
                    t_s=t_s, what=self._name_of(thing), driven_m=driven_m, collided=drives
                )
                self._open[thing] = contact
                self._all.append(contact)
                self.struck_while_standing += not drives and self._walks(thing)
            elif drives and driven_m - contact.driven_m > CARRIED_ON_M:
                contact.collided = True
        self._open = {thing: contact for thing, contact in self._open.items() if thing in touched}

    def log(self) -> list[dict[str, Any]]:
        """t_s, what and collided of each, in order of time."""
        return [{"t_s": round(c.t_s, 3), "what": c.what, "collided": c.collided} for c in self._all]
