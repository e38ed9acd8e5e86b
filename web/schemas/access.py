"""Accounts as they may come in; rules for names and passwords are those of `web.access.users`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictStr

from web.auth.users import LONGEST_PASSWORD
from web.schemas.fields import Closed, Name

Password = Annotated[StrictStr, Field(max_length=LONGEST_PASSWORD)]


class RoleIn(Closed):
    """What somebody may do."""

    role: Literal["viewer", "operator", "admin"]


class PasswordIn(Closed):
    """A new password."""

    password: Password


class OwnPasswordIn(PasswordIn):
    """One's own new password, and the present one as a proof."""

    present: Password


class NewUserIn(RoleIn, PasswordIn):
    """Who may log in from now on."""

    name: Name
