"""While the console starts, its port answers with what the start waits for."""

from __future__ import annotations

import contextlib
import html
import socket
import threading
from collections.abc import Iterator

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from app.runtime.start.progress_lines import COMPILING, LOADING_NETWORK, STARTING_ROBOT, WARMING_UP
from web.languages.catalog import CATALOGS, COOKIE
from web.port import reserve
from web.starting import LOADING_PROGRAM, StartingPage


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with reserve("127.0.0.1", 0) as listener:
        yield listener


def url_of(listener: socket.socket) -> str:
    return f"http://127.0.0.1:{listener.getsockname()[1]}/"


def get(url: str, timeout_s: float = 5.0, headers: dict[str, str] | None = None) -> httpx.Response:
    """Ask again as a browser does: on a busy machine a request takes longer than the second for
    which the page waits for it."""
    for _ in range(5):
        with contextlib.suppress(httpx.RemoteProtocolError):
            return httpx.get(url, trust_env=False, timeout=timeout_s, headers=headers)
    raise AssertionError("the page has not answered")


def test_the_page_shows_the_step_and_loads_itself_again(listener: socket.socket) -> None:
    with StartingPage(listener) as page:
        page.say("Warming up <first time>", "Warming up <first time> … 20 s")
        for path in ("", "api/v1/state"):
            answer = get(url_of(listener) + path)
            assert answer.status_code == 503
            assert answer.headers["Retry-After"] == "1"
            assert answer.headers["Refresh"] == "1; url=/"
            assert "Warming up &lt;first time&gt; … 20 s" in answer.text
    # The control: without the page a browser waits.
    with pytest.raises(httpx.ReadTimeout):
        get(url_of(listener), 0.2)


def test_the_page_and_its_steps_are_in_the_language_of_the_browser(
    listener: socket.socket,
) -> None:
    words = CATALOGS["de"]
    with StartingPage(listener) as page:
        for step in (LOADING_PROGRAM, LOADING_NETWORK, COMPILING, WARMING_UP, STARTING_ROBOT):
            page.say(step, f"{step} … 20 s")
            for headers in (
                {"Accept-Language": "fr, de-AT;q=0.7"},
                {"Accept-Language": "es", "Cookie": f"{COOKIE}=de"},
            ):
                text = html.unescape(get(url_of(listener), headers=headers).text)
                assert '<html lang="de">' in text
                assert words.text("The console is starting") in text
                assert f"<p>{words.sentences[step]} … 20 s</p>" in text
            english = get(url_of(listener)).text
            page.say(step, "", is_over=True)
            assert '<html lang="en">' in english and f"<p>{step} … 20 s</p>" in english


def test_steps_that_go_on_at_one_time_are_shown_with_a_bar_each_until_they_are_over(
    listener: socket.socket,
) -> None:
    with StartingPage(listener) as page:
        page.say("Compiling", "Compiling … 50 / 200", 0.25)
        page.say("Trying", "Trying … 1 / 4", 0.25)
        page.say("Compiling", "Compiling … 100 / 200", 0.5)
        both = get(url_of(listener)).text
        page.say("Compiling", "Compiling … 200 / 200", 1.0, is_over=True)
        one = get(url_of(listener)).text
    assert LOADING_PROGRAM not in both, "the program is loaded"
    assert '100 / 200<br><progress value="0.50">' in both
    assert '1 / 4<br><progress value="0.25">' in both
    assert "Trying" in one and "Compiling" not in one


def test_a_request_that_is_none_is_answered_in_english(listener: socket.socket) -> None:
    with StartingPage(listener):
        for request in (b"\xff\r\nCookie: =;\xfe\r\nAccept-Language\r\n\r\n", b"\r\n\r\n"):
            with socket.create_connection(listener.getsockname(), timeout=5.0) as client:
                client.sendall(request)
                assert client.recv(4096).startswith(b"HTTP/1.1 503")
        assert '<html lang="en">' in get(url_of(listener)).text


def test_what_connects_after_the_end_is_answered_by_the_console(listener: socket.socket) -> None:
    console = FastAPI()
    console.add_api_route("/", lambda: "ready")
    with StartingPage(listener) as page:
        assert get(url_of(listener)).status_code == 503
        page.end()
        with socket.create_connection(listener.getsockname()) as early:
            early.sendall(b"GET / HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n")
            server = uvicorn.Server(uvicorn.Config(console, log_level="error", lifespan="off"))
            answered = _serve_one(server, listener, early)
    assert answered.startswith(b"HTTP/1.1 200")


def _serve_one(server: uvicorn.Server, listener: socket.socket, early: socket.socket) -> bytes:
    thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
    thread.start()
    early.settimeout(10.0)
    answered = early.recv(4096)
    server.should_exit = True
    thread.join()
    return answered


def test_clients_that_go_away_or_send_nothing_do_not_keep_the_page_from_others(
    listener: socket.socket,
) -> None:
    with StartingPage(listener):
        socket.create_connection(listener.getsockname()).close()
        with socket.create_connection(listener.getsockname()):
            assert get(url_of(listener)).status_code == 503


def test_a_client_that_sends_a_byte_now_and_then_keeps_the_page_for_a_second_at_most(
    listener: socket.socket,
) -> None:
    stop = threading.Event()

    def drip(client: socket.socket) -> None:
        while not stop.wait(0.05):
            try:
                client.sendall(b"x")
            except OSError:
                return

    with StartingPage(listener), socket.create_connection(listener.getsockname()) as client:
        thread = threading.Thread(target=drip, args=(client,), daemon=True)
        thread.start()
        try:
            assert get(url_of(listener)).status_code == 503
        finally:
            stop.set()
            thread.join()
