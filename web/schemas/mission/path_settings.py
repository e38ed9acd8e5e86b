"""Settings of the path in requests and answers."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from web.interface.wire import DOCUMENTED
from web.schemas.fields import UNKNOWN_PRICE_RANGE, Closed, Limits, UnknownPrice


class PathSettingsIn(Closed):
    """Settings of the path."""

    unknown_price: UnknownPrice
    """Cost of a metre of path over floor that was not seen yet, in metres of seen floor; with 1, as
    in the paper of Kumar and Sandhan, unseen floor costs what seen floor does."""


class PathSettingsOut(BaseModel):
    """Settings of the path in force."""

    model_config = DOCUMENTED

    unknown_price: float
    """Cost of a metre of path over floor that was not seen yet, in metres of seen floor."""
    limits: Mapping[str, Limits] = {"unknown_price": UNKNOWN_PRICE_RANGE}
    """Ranges of the numbers."""
