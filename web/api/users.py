"""Routes of the visitor and, for admins, of the users. A console without log-in has no users."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Path, Request

from navcore.errors import BadConfiguration, NotKnown, Refused
from web.api.router import api_router
from web.auth.authenticator import Authenticator, PasswordAuthenticator
from web.auth.rate_limit import TooManyTries, address_of
from web.auth.roles import CurrentVisitor, Role
from web.auth.users import User, hash_password, is_password, new_token, new_user
from web.gateway.problems import refusals
from web.languages.catalog import CATALOGS
from web.schemas.access import (
    LanguageIn,
    NewUserIn,
    OwnPasswordIn,
    PasswordIn,
    RoleIn,
    TokenOut,
    UserOut,
    VisitorOut,
)

_REFUSALS = refusals(404, 409, 422, 503)
UserName = Annotated[str, Path(max_length=40)]


def access_router(authenticator: Authenticator) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("access")

    def locked() -> PasswordAuthenticator:
        if not isinstance(authenticator, PasswordAuthenticator):
            raise Refused("this console serves its own machine without a log-in; it has no users")
        return authenticator

    def user(name: str) -> User:
        for known in locked().users.all():
            if known.name == name:
                return known
        raise NotKnown("no user has this name")

    def change(name: str, **what: Any) -> UserOut:
        changed = locked().users.change(name, **what)
        locked().refresh()
        return _user_of(changed)

    @router.get("/me", response_model=VisitorOut)
    async def get_me(visitor: CurrentVisitor) -> VisitorOut:
        """Return the visitor as the console knows them."""
        return VisitorOut.model_validate(visitor)

    @router.put("/me/password", status_code=204, responses=_REFUSALS | refusals(429))
    async def change_own_password(
        body: OwnPasswordIn, visitor: CurrentVisitor, request: Request
    ) -> None:
        """Change the visitor's own password; every session of this user ends. Tries count with
        those of logging in."""

        def changed() -> bool:
            known = user(visitor.name)
            if not is_password(body.present, known.password_hash):
                return False
            password_hash = hash_password(body.password)
            change(known.name, password_hash=password_hash, instead_of=known.password_hash)
            return True

        try:
            is_right = await locked().tries.attempt(
                address_of(request.scope), changed, account=visitor.name
            )
        except TooManyTries as error:
            wait = {"Retry-After": str(error.wait_s)}
            raise HTTPException(429, str(error), wait) from None
        if not is_right:
            raise Refused("the present password is another")

    @router.put("/me/language", status_code=204, responses=_REFUSALS)
    def change_own_language(body: LanguageIn, visitor: CurrentVisitor) -> None:
        """Change the language of the visitor's pages, in every browser in which this user is or
        will be logged in."""
        if body.language not in CATALOGS:
            known = ", ".join(sorted(CATALOGS))
            raise BadConfiguration(f"language: the console has {known}")
        change(user(visitor.name).name, language=body.language)

    @router.get("/users", response_model=list[UserOut], responses=refusals(409))
    def list_users() -> list[UserOut]:
        """Return all users."""
        return [_user_of(known) for known in locked().users.all()]

    @router.post("/users", status_code=201, response_model=UserOut, responses=_REFUSALS)
    def add_user(body: NewUserIn) -> UserOut:
        """Add a user."""
        added = new_user(body.name, Role(body.role), body.password)
        locked().users.add(added)
        locked().refresh()
        return _user_of(added)

    @router.put("/users/{name}/role", response_model=UserOut, responses=_REFUSALS)
    def change_role(name: UserName, body: RoleIn) -> UserOut:
        """Change the role of a user; the user's sessions end."""
        return change(name, role=Role(body.role))

    @router.put("/users/{name}/password", response_model=UserOut, responses=_REFUSALS)
    def change_password(name: UserName, body: PasswordIn) -> UserOut:
        """Change the password of a user; the user's sessions end."""
        return change(name, password_hash=hash_password(body.password))

    @router.post(
        "/users/{name}/token", status_code=201, response_model=TokenOut, responses=_REFUSALS
    )
    def make_token(name: UserName) -> TokenOut:
        """Return a new bearer token for programs, shown only once; the previous one becomes
        invalid."""
        token, token_hash = new_token()
        change(name, token_hash=token_hash)
        return TokenOut(token=token)

    @router.delete("/users/{name}", status_code=204, responses=_REFUSALS)
    def remove_user(name: UserName) -> None:
        """Remove a user; the user's sessions end at once."""
        locked().users.remove(name)
        locked().refresh()

    return router


def _user_of(user: User) -> UserOut:
    return UserOut(name=user.name, role=user.role, has_token=user.token_hash is not None)
