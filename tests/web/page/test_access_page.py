"""Several users of one robot, each in a Chromium profile: roles, control, users, audit log."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Error, Page, expect

from tests.web.conftest import PASSWORD, Accounts
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import eventually, middle_of
from web.auth.users import hash_token, is_password
from web.server import ConsoleServer

Opener = Callable[..., Page]


@pytest.fixture
def open_page(new_context: Callable[..., BrowserContext]) -> Opener:
    """Open the console in a browser profile of its own, logged in if a name is given."""

    def opened(server: ConsoleServer, name: str | None, **options: object) -> Page:
        page = new_context(**({"viewport": {"width": 1280, "height": 720}} | options)).new_page()
        page.goto(f"{server.url}/#map")
        if name is not None:
            page.get_by_test_id("login-name").fill(name)
            page.get_by_test_id("login-password").fill(PASSWORD)
            page.get_by_test_id("log-in").click()
            expect(page.get_by_test_id("connection")).to_have_text("live")
            page.goto("about:blank")
            page.goto(f"{server.url}/#map")
        expect(page.get_by_test_id("connection")).to_have_text("live")
        return page

    return opened


def test_a_viewer_watches_and_stops_and_does_nothing_else(
    open_page: Opener, locked: ConsoleServer, accounts: Accounts, operations: FakeOperations
) -> None:
    operator, viewer = open_page(locked, "operator"), open_page(locked, "viewer")
    expect(viewer.get_by_test_id("control-text")).to_contain_text("you watch")
    expect(viewer.get_by_test_id("who-am-i")).to_have_text("viewer")
    operator.get_by_test_id("goal-input").fill("3, 0")
    operator.get_by_test_id("goal-add").click()
    operator.get_by_test_id("start").click()
    expect(viewer.get_by_test_id("control-text")).to_contain_text("operator has control")
    expect(viewer.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    expect(viewer.get_by_test_id("control-take")).to_be_hidden()
    with pytest.raises(Error, match="Timeout"):
        viewer.get_by_test_id("pause").click(timeout=500)
    expect(viewer.get_by_test_id("beware-this")).to_be_hidden()
    viewer.keyboard.press("z")
    viewer.mouse.click(*middle_of(viewer.get_by_test_id("camera")))
    viewer.mouse.move(*middle_of(viewer.get_by_test_id("beware")))
    viewer.mouse.wheel(0, 60)
    eventually(
        viewer, lambda: viewer.get_by_test_id("beware").evaluate("(list) => list.scrollTop") > 0
    )
    expect(viewer.get_by_test_id("draft")).to_be_hidden()
    viewer.get_by_test_id("stop").click()
    expect(operator.get_by_test_id("state-text")).to_contain_text("viewer (console button)")
    expect(viewer.get_by_test_id("reset")).to_be_disabled()
    expect(viewer.get_by_test_id("reset")).to_have_attribute(
        "title", "Viewers cannot reset the stop"
    )
    expect(operator.get_by_test_id("reset")).to_be_enabled()
    viewer.get_by_test_id("log-out").click()
    expect(viewer.get_by_test_id("login-name")).to_be_visible()
    assert [
        entry["status"] for entry in accounts.store.audit.newest() if entry["who"] == "viewer"
    ] == [303, 200, 200]


def test_control_is_asked_for_and_taken_over_and_both_pages_say_so(
    open_page: Opener, server: ConsoleServer, operations: FakeOperations
) -> None:
    first, second = open_page(server, None), open_page(server, None)
    expect(first.get_by_test_id("control-text")).to_have_text("○ Control is free")
    first.get_by_test_id("goal-input").fill("3, 0")
    first.get_by_test_id("goal-add").click()
    expect(first.get_by_test_id("control-text")).to_have_text("● You have control")
    expect(second.get_by_test_id("control-text")).to_have_text("▲ Chrome on computer has control")
    second.get_by_test_id("start").click()
    expect(second.get_by_test_id("toasts")).to_contain_text("is in control")
    second.get_by_test_id("control-ask").click()
    expect(first.get_by_test_id("toasts")).to_contain_text("asks for control")
    second.get_by_test_id("control-take").click()
    expect(first.get_by_test_id("toasts")).to_contain_text("has taken over control")
    expect(second.get_by_test_id("control-text")).to_have_text("● You have control")
    # A newer message about control takes the place of the one before.
    assert "asks for control" not in first.get_by_test_id("toasts").inner_text()
    second.get_by_test_id("start").click()
    expect(first.get_by_test_id("state-badge")).to_contain_text("DRIVING")


def test_a_refusal_for_want_of_control_offers_to_take_over(
    open_page: Opener, server: ConsoleServer, operations: FakeOperations
) -> None:
    first, second = open_page(server, None), open_page(server, None)
    mine = "● You have control"

    def drive_by_hand(page: Page) -> None:
        page.get_by_test_id("drive-forward").press("ArrowUp")

    def add_goal(page: Page) -> None:
        page.get_by_test_id("goal-input").fill("3, 0")
        page.get_by_test_id("goal-add").click()

    def start(page: Page) -> None:
        page.get_by_test_id("start").click()

    add_goal(first)
    for page in (first, second):
        page.get_by_test_id("teleop-open").click()
    holder, other = first, second
    for act in (drive_by_hand, add_goal, start):
        expect(holder.get_by_test_id("control-text")).to_have_text(mine)
        act(other)
        take = other.get_by_test_id("toast-action").filter(has_text="Take over")
        take.click()
        expect(other.get_by_test_id("control-text")).to_have_text(mine)
        holder, other = other, holder
    # The control: what is refused for another reason offers nothing of the kind.
    holder.get_by_test_id("goal-input").fill("99")
    holder.get_by_test_id("goal-add").click()
    refused = holder.locator("#toasts .toast").filter(has_text="is no goal")
    expect(refused).to_be_visible()
    expect(refused.get_by_test_id("toast-action")).to_have_count(0)


def test_on_a_phone_the_audit_log_says_what_was_done_as_a_whole(
    open_page: Opener, locked: ConsoleServer
) -> None:
    page = open_page(locked, "admin")
    page.get_by_test_id("goal-input").fill("3, 0")
    page.get_by_test_id("goal-add").click()
    expect(page.get_by_test_id("control-text")).to_have_text("● You have control")
    page.set_viewport_size({"width": 390, "height": 844})
    page.get_by_test_id("admin-button").click()
    page.get_by_test_id("admin-audit-tab").click()
    what = page.locator(".audit .what").filter(has_text="added a goal")
    expect(what).to_be_visible()
    assert what.evaluate("(text) => text.scrollWidth <= text.clientWidth")


@pytest.mark.long
def test_an_admin_manages_users_by_keyboard_and_only_admins_see_the_panel(
    open_page: Opener, locked: ConsoleServer, accounts: Accounts
) -> None:
    for name in ("viewer", "operator"):
        other = open_page(locked, name)
        expect(other.get_by_test_id("who-am-i")).to_have_text(name)
        other.keyboard.press("u")
        expect(other.get_by_test_id("admin-button")).to_be_hidden()
        expect(other.get_by_test_id("admin")).to_be_hidden()
    page = open_page(locked, "admin")
    expect(page.get_by_test_id("admin-button")).to_be_visible()
    page.keyboard.press("u")
    expect(page.get_by_test_id("user")).to_have_count(3)
    page.get_by_test_id("new-user-name").focus()
    page.keyboard.type("anna")
    page.keyboard.press("Tab")
    page.keyboard.type("with a space")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("user")).to_have_count(4)
    anna = page.locator('[data-testid="user"][data-name="anna"]')
    expect(anna.get_by_test_id("user-role")).to_have_value("operator")
    anna.get_by_test_id("user-role").select_option("viewer")
    eventually(
        page,
        lambda: any(
            user.name == "anna" and user.role == "viewer" for user in accounts.store.users.all()
        ),
    )
    anna.get_by_test_id("user-password-open").press("Enter")
    page.keyboard.type("another secret")
    page.keyboard.press("Enter")
    expect(anna.get_by_test_id("user-password")).to_be_hidden()
    known = {user.name: user for user in accounts.store.users.all()}
    assert is_password("another secret", known["anna"].password_hash)
    anna.get_by_test_id("user-remove").press("Enter")
    expect(anna.get_by_test_id("user-remove")).to_have_text("Really remove?")
    assert "anna" in {user.name for user in accounts.store.users.all()}
    anna.get_by_test_id("user-remove").press("Enter")
    expect(page.get_by_test_id("user")).to_have_count(3)
    page.locator('[data-name="admin"]').get_by_test_id("user-role").select_option("viewer")
    expect(page.get_by_test_id("toasts")).to_contain_text("last admin")
    expect(page.locator('[data-name="admin"]').get_by_test_id("user-role")).to_have_value("admin")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("admin")).to_be_hidden()


def test_an_admin_makes_a_token_and_it_is_shown_once(
    open_page: Opener, locked: ConsoleServer, accounts: Accounts
) -> None:
    page = open_page(locked, "admin")
    page.keyboard.press("u")
    row = page.locator('[data-testid="user"][data-name="operator"]')
    row.get_by_test_id("user-token-make").click()
    shown = row.get_by_test_id("user-token").locator("code")
    expect(shown).not_to_be_empty()
    kept = {user.name: user.token_hash for user in accounts.store.users.all()}
    assert kept["operator"] == hash_token(str(shown.text_content()))


def test_users_change_their_own_password_and_log_in_with_it(
    open_page: Opener, locked: ConsoleServer
) -> None:
    page = open_page(locked, "viewer")
    page.get_by_test_id("who-am-i").click()
    page.get_by_test_id("account-present").fill("not this one")
    page.get_by_test_id("account-new").fill("a better secret")
    page.get_by_test_id("account-save").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("another")
    page.get_by_test_id("account-present").fill(PASSWORD)
    page.get_by_test_id("account-save").click()
    page.get_by_test_id("login-name").fill("viewer")
    page.get_by_test_id("login-password").fill("a better secret")
    page.get_by_test_id("log-in").click()
    expect(page.get_by_test_id("connection")).to_have_text("live")


def test_the_audit_log_is_filtered_by_name_and_time_and_never_covers_the_stop(
    open_page: Opener, locked: ConsoleServer, accounts: Accounts
) -> None:
    for number in range(130):
        accounts.store.audit.add(
            {"who": "operator", "role": "operator", "method": "POST", "path": f"/api/v1/x{number}"}
        )
    page = open_page(locked, "admin")
    page.get_by_test_id("admin-button").click()
    page.get_by_test_id("admin-audit-tab").click()
    entries = page.get_by_test_id("audit-entry")
    expect(entries).to_have_count(100)
    page.get_by_test_id("audit-who").fill("operator")
    page.get_by_test_id("audit-show").click()
    expect(entries.first).to_contain_text("POST /x129")
    page.get_by_test_id("audit-older").click()
    expect(entries).to_have_count(130)
    expect(page.get_by_test_id("audit-older")).to_be_hidden()
    page.get_by_test_id("audit-until").fill("2020-01-01T00:00")
    page.get_by_test_id("audit-show").click()
    expect(entries).to_have_count(0)
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")


def test_a_held_key_or_button_drives_and_releasing_it_or_closing_the_page_stops(
    open_page: Opener, server: ConsoleServer, operations: FakeOperations
) -> None:
    page = open_page(server, None)
    page.keyboard.down("ArrowUp")
    page.wait_for_timeout(200)
    page.keyboard.up("ArrowUp")
    assert operations.hands == []  # the pad is closed
    page.keyboard.press("b")
    page.keyboard.down("ArrowUp")
    page.keyboard.down("ArrowLeft")
    expect(page.get_by_test_id("state-badge")).to_contain_text("BY HAND")
    # A browser that draws the 3D view in software may be silent for longer than a velocity lives:
    # some arrive, and are both.
    eventually(
        page,
        lambda: any(
            hand is not None and hand.v_mps > 0 and hand.w_radps > 0 for hand in operations.hands
        ),
    )
    page.keyboard.up("ArrowUp")
    page.keyboard.up("ArrowLeft")
    expect(page.get_by_test_id("state-badge")).to_contain_text("IDLE")
    assert operations.hands[-1] is None
    page.mouse.move(*middle_of(page.get_by_test_id("drive-back")))
    page.mouse.down()
    expect(page.get_by_test_id("state-badge")).to_contain_text("BY HAND")
    page.close()
    page = open_page(server, None)
    expect(page.get_by_test_id("state-badge")).to_contain_text("IDLE")
    assert operations.hands[-1] is None


@pytest.mark.long
def test_a_user_has_the_chosen_language_in_another_browser(
    open_page: Opener, locked: ConsoleServer
) -> None:
    here, there = open_page(locked, "viewer"), open_page(locked, "viewer")
    here.get_by_test_id("language").click()
    here.get_by_test_id("language-es").click()
    expect(here.locator("html")).to_have_attribute("lang", "es")
    there.reload()
    expect(there.locator("html")).to_have_attribute("lang", "es")


def test_users_are_read_by_their_names_and_removed_by_touch_on_a_phone(
    open_page: Opener, locked: ConsoleServer
) -> None:
    phone = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}
    page = open_page(locked, "admin", **phone)
    page.get_by_test_id("admin-button").tap()
    names = page.get_by_test_id("user").locator(".label > span")
    expect(names).to_have_text(["admin (you)", "operator", "viewer"])
    cut = (
        "(names) => names.filter((it) => it.scrollWidth > it.clientWidth).map((it) => it.outerHTML)"
    )
    labels = page.get_by_test_id("user").locator(".label")
    assert labels.evaluate_all(cut) == []
    for field in ("new-user-name", "new-user-password", "new-user-role"):
        box = page.get_by_test_id(field).bounding_box()
        assert box is not None and box["width"] >= 120, field
    viewer = page.locator("[data-testid=user][data-name=viewer]")
    remove = viewer.get_by_test_id("user-remove")
    remove.tap()
    expect(remove).to_have_text("Really remove?")
    expect(viewer).to_have_count(1)
    remove.tap()
    expect(viewer).to_have_count(0)
