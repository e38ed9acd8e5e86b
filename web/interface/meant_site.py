"""The site whose map a request is meant for: an edit is checked where it is made, since the robot
may be at another site by then."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar

from web.interface.sites import at_another_site

_is_there: ContextVar[Callable[[], bool] | None] = ContextVar("site of this request", default=None)


def mean_site(is_there: Callable[[], bool] | None) -> None:
    """Say for the present request whether the robot is at the site that it is meant for; None for a
    request that means none."""
    _is_there.set(is_there)


def require_meant_site() -> None:
    """Raise `OtherSite` if the present request is meant for another site than the one in use. An
    editor calls it while no change of site can come between."""
    is_there = _is_there.get()
    if is_there is not None and not is_there():
        raise at_another_site()
