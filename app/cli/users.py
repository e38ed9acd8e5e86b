"""`bewarenav users`: the accounts of the console.

The console may be running; changes take effect within a second. One of an earlier version may not:
its data folder would be converted.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.cli.options import check_data_folder

if TYPE_CHECKING:
    from app.storage.users import UserTable

users_cli = typer.Typer(help="Accounts that may log in to the console.", no_args_is_help=True)
DataOption = Annotated[
    Path, typer.Option("--data", metavar="DIR", help="The console's data folder.")
]
RoleOption = Annotated[
    Literal["viewer", "operator", "admin"],
    typer.Option(
        help="viewer: watch and stop; operator: drive and edit as well; admin: users as well."
    ),
]
NameArgument = Annotated[str, typer.Argument(metavar="NAME")]


@users_cli.command("add")
def add(name: NameArgument, role: RoleOption = "operator", data: DataOption = Path("data")) -> None:
    """Add a user; the password is prompted for, or read from standard input."""
    from web.auth.roles import Role
    from web.auth.users import new_user

    user = new_user(name, Role(role), _password())
    with _users(data, makes=True) as users:
        users.add(user)
    typer.echo(f"{name} may log in as {role}.")


@users_cli.command("list")
def list_users(data: DataOption = Path("data")) -> None:
    """Print the users."""
    with _users(data) as users:
        for user in users.all():
            typer.echo(
                f"{user.name:20} {user.role:10} {'token' if user.token_hash else ''}".rstrip()
            )


@users_cli.command("remove")
def remove(name: NameArgument, data: DataOption = Path("data")) -> None:
    """Remove a user and end their sessions."""
    with _users(data) as users:
        users.remove(name)
    typer.echo(f"{name} may no longer log in.")


@users_cli.command("password")
def password(name: NameArgument, data: DataOption = Path("data")) -> None:
    """Set a new password for a user and end their sessions."""
    from web.auth.users import hash_password

    with _users(data) as users:
        users.change(name, password_hash=hash_password(_password()))
    typer.echo(f"{name} has a new password.")


@users_cli.command("role")
def change_role(
    name: NameArgument,
    role: Annotated[Literal["viewer", "operator", "admin"], typer.Argument()],
    data: DataOption = Path("data"),
) -> None:
    """Change the role of a user and end their sessions."""
    from web.auth.roles import Role

    with _users(data) as users:
        users.change(name, role=Role(role))
    typer.echo(f"{name} is {role} now.")


@users_cli.command("token")
def make_token(name: NameArgument, data: DataOption = Path("data")) -> None:
    """Print a bearer token for a program that acts as NAME; it is shown only once and replaces the
    previous one."""
    from web.auth.users import new_token

    token, token_hash = new_token()
    with _users(data) as users:
        users.change(name, token_hash=token_hash)
    typer.echo(token)


@contextmanager
def _users(data: Path, *, makes: bool = False) -> Iterator[UserTable]:
    """Open the users of a data folder; `makes`: also of a new one."""
    from app.storage.users import user_table

    check_data_folder(data, makes=makes)
    with user_table(data) as users:
        yield users


def _password() -> str:
    if sys.stdin.isatty():
        return str(typer.prompt("Password", hide_input=True, confirmation_prompt=True))
    return sys.stdin.readline().rstrip("\n")
