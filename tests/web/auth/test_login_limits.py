"""Limits of sessions and of tries of a password: one visitor takes nothing from another."""

from __future__ import annotations

import dataclasses

import pytest

from tests.web.auth.test_access import ANNA, Clock, browser
from tests.web.conftest import PASSWORD
from web.auth.rate_limit import BURST, FOR_ALL, RateLimiter
from web.auth.sessions import MAX_OF_USER, MAX_SESSIONS, Sessions
from web.auth.users import LONGEST_PASSWORD
from web.gateway.request_body import MAX_PASSWORD_BODY_BYTES
from web.server import ConsoleServer


def test_a_user_who_logs_in_over_and_over_ends_own_sessions_only() -> None:
    sessions = Sessions()
    of_bert = sessions.begin(dataclasses.replace(ANNA, name="bert"))
    first, used = sessions.begin(ANNA), sessions.begin(ANNA)
    of_anna = [sessions.begin(ANNA) for _ in range(MAX_OF_USER - 2)]
    assert sessions.find(used, renews=True) and sessions.find(first)
    of_anna += [sessions.begin(ANNA) for _ in range(MAX_SESSIONS)]
    assert sessions.find(of_bert) is not None
    assert [cookie for cookie in [first, used, *of_anna] if sessions.find(cookie)] == (
        of_anna[-MAX_OF_USER:]
    )


def test_a_script_that_logs_in_over_and_over_does_not_end_the_session_of_an_open_page() -> None:
    clock = Clock()
    sessions = Sessions(clock=clock)
    page, left = sessions.begin(ANNA), sessions.begin(ANNA)
    for _ in range(2 * MAX_OF_USER):
        clock.now_s += 1.0
        sessions.begin(ANNA)
        assert sessions.find(page) is not None  # as a page that only watches
    assert sessions.find(left) is None


@pytest.mark.parametrize(
    ("first", "second", "is_same"),
    [
        ("2001:db8:1:2::1", "2001:db8:1:2:ffff::9", True),
        ("2001:db8:1:2::1", "2001:db8:1:3::1", False),
        ("fe80::1%eth0", "fe80::2%eth0", True),
        ("::ffff:192.0.2.1", "192.0.2.1", True),
        ("::ffff:192.0.2.1", "::ffff:192.0.2.2", False),
        ("192.0.2.1", "192.0.2.2", False),
    ],
)
def test_the_addresses_of_one_ipv6_network_share_their_tries(
    first: str, second: str, is_same: bool
) -> None:
    limiter = RateLimiter(clock=Clock())
    assert [limiter.wait_s(first) for _ in range(BURST)] == [0] * BURST
    assert (limiter.wait_s(second) > 0) == is_same
    limiter.refund(second)
    assert (limiter.wait_s(first) == 0) == is_same


def test_bad_tries_from_ever_new_addresses_keep_no_one_out_who_has_logged_in_before() -> None:
    limiter = RateLimiter(clock=Clock())
    assert limiter.wait_s("192.0.2.1", "anna") == 0
    limiter.succeed("192.0.2.1", "anna")
    waits = [limiter.wait_s(f"198.51.100.{host}") for host in range(2 * BURST * FOR_ALL)]
    assert waits[0] == 0 and waits[-1] > 0
    assert limiter.wait_s("203.0.113.1") > 0
    assert limiter.wait_s("192.0.2.1", "boss") > 0, "of another account"
    assert [limiter.wait_s("192.0.2.1", "anna") for _ in range(BURST)] == [0] * BURST
    assert limiter.wait_s("192.0.2.1", "anna") > 0, "its own tries are limited as before"


def test_the_longest_password_logs_in_and_no_larger_form_is_read(locked: ConsoleServer) -> None:
    longest = "\U0001f511" * LONGEST_PASSWORD
    with browser(locked, "viewer") as viewer:
        change = {"present": PASSWORD, "password": longest}
        assert viewer.put("/api/v1/me/password", json=change).is_success
    with browser(locked) as client:
        form = {"name": "viewer", "password": longest}
        assert client.post("/login", data=form).status_code == 200
        form["padding"] = " " * MAX_PASSWORD_BODY_BYTES
        assert client.post("/login", data=form).status_code == 413
