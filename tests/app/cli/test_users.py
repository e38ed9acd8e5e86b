"""`bewarenav users`: users are added, listed, changed and removed while a console may run."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.users import users_cli
from app.storage import Store
from navcore.errors import BadConfiguration, BewareNavError, NotKnown, Refused
from web.auth.users import hash_token, is_password

PASSWORD = "long enough"


def users(data: Path, *arguments: str, said: str = f"{PASSWORD}\n") -> str:
    """Run a command; return its output or raise its refusal."""
    result = CliRunner().invoke(users_cli, [*arguments, "--data", str(data)], input=said)
    if isinstance(result.exception, BewareNavError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_users_are_stored_while_a_console_runs_with_only_the_hash_of_the_password(
    tmp_path: Path,
) -> None:
    console = Store(tmp_path)
    users(tmp_path, "add", "anna", "--role", "admin")
    users(tmp_path, "add", "bob")
    assert [line.split() for line in users(tmp_path, "list").splitlines()] == [
        ["anna", "admin"],
        ["bob", "operator"],
    ]
    token = users(tmp_path, "token", "bob").strip()
    users(tmp_path, "role", "bob", "viewer")
    users(tmp_path, "password", "bob", said="another long one\n")
    bob = console.users.all()[1]
    assert (str(bob.role), bob.token_hash) == ("viewer", hash_token(token))
    assert is_password("another long one", bob.password_hash) and not is_password(
        PASSWORD, bob.password_hash
    )
    users(tmp_path, "remove", "bob")
    assert [user.name for user in console.users.all()] == ["anna"]
    console.close()


def test_only_a_new_user_makes_a_new_data_folder(tmp_path: Path) -> None:
    mistyped = tmp_path / "dtaa"
    for command in (["list"], ["role", "anna", "admin"], ["remove", "anna"]):
        with pytest.raises(BadConfiguration, match="is no data folder of a console"):
            users(mistyped, *command)
    assert not mistyped.exists()
    users(mistyped, "add", "anna", "--role", "admin")
    assert users(mistyped, "list").split() == ["anna", "admin"]


def test_invalid_changes_are_refused_with_a_message(tmp_path: Path) -> None:
    users(tmp_path, "add", "anna", "--role", "admin")
    with pytest.raises(Refused, match="already"):
        users(tmp_path, "add", "anna")
    with pytest.raises(Refused, match="last admin"):
        users(tmp_path, "remove", "anna")
    with pytest.raises(BadConfiguration, match="10 to 200"):
        users(tmp_path, "add", "bob", said="short\n")
    with pytest.raises(NotKnown, match="'carol'"):
        users(tmp_path, "password", "carol")
