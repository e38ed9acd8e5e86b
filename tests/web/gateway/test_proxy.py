"""The console behind a TLS proxy: under its name, and with the scheme and address that it tells."""

from __future__ import annotations

import httpx
import pytest

from app.cli.console import ConsoleSettings, _check
from navcore.errors import BadConfiguration
from tests.web.conftest import PASSWORD, Accounts
from tests.web.fake_operations import FakeOperations
from web.server import ConsoleServer

FORWARDED = {
    "Host": "robot.example.org",
    "Origin": "https://robot.example.org",
    "X-Forwarded-Proto": "https",
    "X-Forwarded-For": "192.0.2.7",
}


@pytest.mark.parametrize("proxy", ["127.0.0.1", None])
def test_a_page_of_the_proxy_logs_in_and_is_known_by_its_own_address(
    operations: FakeOperations, accounts: Accounts, proxy: str | None
) -> None:
    console = ConsoleServer(
        operations,
        port=0,
        access=accounts.access,
        allowed_hosts=["robot.example.org"],
        proxy=proxy,
    )
    console.start()
    try:
        with httpx.Client(base_url=console.url, trust_env=False, timeout=60.0) as page:
            entered = {"name": "admin", "password": PASSWORD}
            answer = page.post("/login", data=entered, headers=FORWARDED)
            cookie = answer.headers["set-cookie"]
            token = {"Authorization": f"Bearer {accounts.tokens['admin']}"}
            assert page.post("/api/v1/stop", headers=FORWARDED | token).status_code == 200
            log = page.get("/api/v1/audit", headers=FORWARDED | token).json()
            foreign = FORWARDED | token | {"Origin": "https://elsewhere.example"}
            assert page.post("/api/v1/stop", headers=foreign).status_code == 403
            other = FORWARDED | token | {"Host": "elsewhere.example"}
            assert page.post("/api/v1/stop", headers=other).status_code == 421
    finally:
        console.stop()
    login = next(entry for entry in log if entry["path"] == "/login")
    told = (answer.status_code, "Secure" in cookie, login["from"])
    # Without a proxy nothing is believed that a browser could send itself.
    assert told == ((303, True, "192.0.2.7") if proxy else (303, False, "127.0.0.1"))


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (ConsoleSettings(allow_host=["https://robot"]), "--allow-host: 'https://robot'"),
        (ConsoleSettings(allow_host=["a b"]), "no name of a host"),
        (ConsoleSettings(proxy="localhost"), "--proxy: 'localhost' is no IP address"),
    ],
)
def test_what_is_no_host_or_address_is_refused(settings: ConsoleSettings, says: str) -> None:
    with pytest.raises(BadConfiguration, match=says):
        _check(settings)
