"""Users, visitors and control in requests and answers; the rules for names and passwords
are in `web.auth.users`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictStr

from web.auth.roles import Role
from web.auth.users import LONGEST_PASSWORD
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed, NewName

Password = Annotated[StrictStr, Field(max_length=LONGEST_PASSWORD)]


class RoleIn(Closed):
    """Role of a user."""

    role: Literal["viewer", "operator", "admin"]
    """Role of the user."""


class PasswordIn(Closed):
    """New password."""

    password: Password
    """New password."""


class OwnPasswordIn(PasswordIn):
    """New password of the visitor, with the present one as a proof."""

    present: Password
    """Present password."""


class LanguageIn(Closed):
    """Language of the visitor's pages."""

    language: Annotated[StrictStr, Field(max_length=20)]
    """Code of a language that the console has, such as `de`."""


class NewUserIn(RoleIn, PasswordIn):
    """New user."""

    name: NewName
    """Unique name of the user."""


class UserOut(BaseModel):
    """User who may log in."""

    model_config = DOCUMENTED

    name: str
    """Unique name of the user."""
    role: Role
    """Role of the user."""
    has_token: bool
    """Whether the user has a bearer token."""


class TokenOut(BaseModel):
    """Bearer token; it is shown only once."""

    model_config = DOCUMENTED

    token: str
    """Bearer token."""


class VisitorOut(BaseModel):
    """Visitor of the console."""

    model_config = DOCUMENTED | ConfigDict(from_attributes=True)

    name: str
    """Name of the visitor."""
    role: Role
    """Role of the visitor."""
    logged_in: bool
    """Whether the visitor has logged in; false on a console without users."""


class ControlOut(BaseModel):
    """Control of the robot, as one visitor sees it."""

    model_config = DOCUMENTED

    type: Literal["control"] = "control"
    """Kind of the message."""
    serial: int
    """Number of changes of control."""
    you: VisitorOut | None
    """Visitor who asked."""
    yours: bool
    """Whether this visitor is in control."""
    holder: VisitorOut | None
    """Visitor in control; null for none."""
    asking: VisitorOut | None
    """Visitor who asked for control last; null for none."""
    asked_by_you: bool
    """Whether this visitor asked for control last."""
    before: VisitorOut | None
    """Visitor who was in control before; null for none."""
    was_yours: bool
    """Whether this visitor was in control before."""
    taken: bool
    """Whether the holder took control without being given it."""
