"""Start and stop of the server, its port, and the 3D view behind the guard."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import json
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import msgspec
import numpy as np
import pytest
from fastapi import FastAPI, Response
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Request
from websockets.server import ServerProtocol
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Subprotocol

from app.bench.console.viser_client import SUBPROTOCOL, camera, names_in
from navcore.errors import BadConfiguration, Refused
from tests.web.fake_operations import FakeOperations
from web.port import PortInUse, reserve
from web.server import MAX_MESSAGE_BYTES, ConsoleServer, _config, _Server
from web.viewer.viewer import Viewer

PAGE = "0123456789abcdef"


def viewer_of(server: ConsoleServer, path: str = "/viewer", **options: Any) -> Connection:
    """Connect a viser client through the console."""
    return connect(
        server.url.replace("http", "ws") + path,
        subprotocols=[SUBPROTOCOL],
        proxy=None,
        max_size=None,
        **options,
    )


def scene(connection: Connection, wanted: set[str]) -> set[str]:
    """Read frames until all wanted nodes were seen."""
    seen: set[str] = set()
    while not wanted <= seen:
        frame = connection.recv(timeout=60)
        assert isinstance(frame, bytes)
        seen |= names_in(frame)
    return seen


def test_a_busy_port_is_refused_with_the_port_and_the_remedy(operations: FakeOperations) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(PortInUse, match=rf"127\.0\.0\.1:{port}.*--port"):
            ConsoleServer(operations, port=port).start()
        with pytest.raises(PortInUse):
            reserve("127.0.0.1", port)


@pytest.mark.parametrize("host", ["192.0.2.1", "no-such-host.invalid"])
def test_an_address_of_another_machine_is_not_said_to_be_in_use(host: str) -> None:
    with pytest.raises(BadConfiguration, match=r"--host") as refusal:
        reserve(host, 0)
    assert not isinstance(refusal.value, PortInUse)


def test_a_reserved_port_is_the_one_that_is_served(operations: FakeOperations) -> None:
    with reserve("127.0.0.1", 0) as place:
        console = ConsoleServer(operations, listener=place)
        console.start()
        assert console.url.endswith(f":{place.getsockname()[1]}")
        assert httpx.get(f"{console.url}/healthz", trust_env=False, timeout=60.0).status_code == 200
        console.stop()


def test_the_parts_of_an_answer_are_sent_at_once() -> None:
    # Nagle's algorithm holds the second part until the first is acknowledged, often 40 ms later.
    async def options() -> list[int]:
        found: list[int] = []

        async def serve(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            accepted = writer.get_extra_info("socket")
            found.append(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        with reserve("127.0.0.1", 0) as place:
            async with await asyncio.start_server(serve, sock=place):
                reader, writer = await asyncio.open_connection(*place.getsockname())
                await reader.read()
                writer.close()
        return found

    assert asyncio.run(options()) == [1]


def test_after_a_stop_no_thread_and_no_port_is_left_though_clients_were_connected(
    operations: FakeOperations,
) -> None:
    before = set(threading.enumerate())
    console = ConsoleServer(operations, port=0)
    console.start()
    port = int(console.url.rsplit(":", 1)[1])
    with (
        viewer_of(console) as viewer,
        connect(console.url.replace("http", "ws") + "/api/v1/events", proxy=None) as events,
    ):
        viewer.send(camera())
        scene(viewer, {"/floor/0_0"})
        events.recv(timeout=60)
        console.stop()
    left = {
        thread
        for thread in set(threading.enumerate()) - before
        if thread.is_alive() and "recv_events" not in thread.name
    }
    assert left == set()
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(("127.0.0.1", port))


def test_a_stop_closes_the_connection_to_a_3d_view_that_does_not_answer(
    operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"ws://127.0.0.1:{silent.getsockname()[1]}"
        monkeypatch.setattr(Viewer, "websocket_url", address)
        console = ConsoleServer(operations, port=0)
        console.start()
        with ThreadPoolExecutor() as pool:
            joining = pool.submit(viewer_of, console)
            accepted, _ = silent.accept()
            handshake = ServerProtocol(subprotocols=[SUBPROTOCOL])
            while not (requests := handshake.events_received()):
                handshake.receive_data(accepted.recv(4096))
            request = requests[0]
            assert isinstance(request, Request)
            handshake.send_response(handshake.accept(request))
            accepted.sendall(b"".join(handshake.data_to_send()))
            with joining.result():
                console.stop()
        accepted.settimeout(10)
        with accepted, contextlib.suppress(ConnectionResetError):
            while accepted.recv(4096):
                pass
    gc.collect()


def test_a_connection_without_a_request_is_closed_and_one_that_waits_for_its_answer_is_not(
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked, goes_on = threading.Event(), threading.Event()

    def explain() -> None:
        asked.set()
        assert goes_on.wait(60)
        raise Refused("a test")

    monkeypatch.setattr(operations.insight, "explain", explain)
    address = ("127.0.0.1", int(server.url.rsplit(":", 1)[1]))
    healthy = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with ThreadPoolExecutor() as pool, contextlib.ExitStack() as stack:
        answer = pool.submit(client.get, "/api/v1/explain")
        stack.callback(goes_on.set)
        assert asked.wait(60)
        monkeypatch.setattr("web.server.HEAD_S", 0.0)
        slow = [socket.create_connection(address, timeout=60) for _ in range(3)]
        for one, said in zip(slow, (b"", b"GET / HT", healthy + b"GET"), strict=True):
            stack.enter_context(one).sendall(said)
        for one in slow:
            with contextlib.suppress(ConnectionResetError):
                while one.recv(4096):
                    pass
        goes_on.set()
        assert answer.result(60).status_code == 409


def test_a_slow_network_takes_the_whole_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    size, app = 30_000_000, FastAPI()
    app.get("/large")(lambda: Response(bytes(size)))
    monkeypatch.setattr("web.server.HEAD_S", 0.0)
    ticks = list[int]()
    serving = _Server(_config(app, None))

    async def on_tick(counter: int) -> bool:
        ticks.append(counter)
        return await _Server.on_tick(serving, counter)

    monkeypatch.setattr(serving, "on_tick", on_tick)
    listener = reserve("127.0.0.1", 0)
    thread = threading.Thread(target=serving.run, args=([listener],))
    thread.start()
    try:
        assert serving.up.wait(60)
        with socket.create_connection(listener.getsockname(), timeout=60) as slow:
            slow.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n")
            received = len(slow.recv(1))
            begun = len(ticks)
            while len(ticks) < begun + 30:  # three looks at the connections
                time.sleep(0.01)
            while part := slow.recv(1 << 20):
                received += len(part)
        assert received > size
    finally:
        serving.should_exit = True
        thread.join()


def test_a_stop_closes_connections_that_come_meanwhile(operations: FakeOperations) -> None:
    console = ConsoleServer(operations, port=0)
    console.start()
    port, clients, done = (
        int(console.url.rsplit(":", 1)[1]),
        list[socket.socket](),
        threading.Event(),
    )

    def knock() -> None:
        while not done.is_set():
            try:
                clients.append(socket.create_connection(("127.0.0.1", port), timeout=1.0))
                clients[-1].sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            except OSError:
                return

    knocking = threading.Thread(target=knock)
    knocking.start()
    time.sleep(0.1)
    console.stop()
    done.set()
    knocking.join()
    for client in clients:
        client.close()
    gc.collect()  # what was left open warns now, and a warning is an error


def test_the_page_of_the_viewer_comes_through_the_door(client: httpx.Client) -> None:
    for path in ("/viewer/", "/viewer", f"/viewer/{PAGE}/"):
        answer = client.get(path)
        assert (
            answer.status_code == 200
            and "text/html" in answer.headers["content-type"]
            and len(answer.text) > 100_000
        )
        known = client.get(path, headers={"If-None-Match": answer.headers["etag"]})
        assert (known.status_code, known.content) == (304, b"")


def test_the_websocket_of_the_viewer_speaks_its_own_protocol_and_brings_the_scene(
    server: ConsoleServer,
) -> None:
    with viewer_of(server) as viewer:
        assert viewer.subprotocol == SUBPROTOCOL
        viewer.send(camera())
        expected = {
            "/floor/0_0",
            "/robot/base",
            "/robot/base/body",
            "/camera/frustum",
            "/cloud/camera/-1_-1",
        }
        assert expected <= scene(viewer, expected)


def test_goals_path_and_zones_appear_in_the_scene_and_go_again(
    server: ConsoleServer, client: httpx.Client, operations: FakeOperations
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0})
    ring = [[4, -1], [5, -1], [5, 1]]
    client.post(
        "/api/v1/zones",
        json={"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [ring]}},
    )
    with viewer_of(server) as viewer:
        viewer.send(camera())
        scene(
            viewer,
            {
                "/goals/waiting-1",
                "/path/planned",
                "/waypoints/points",
                "/zones/z1",
                "/zones/z1/outline",
            },
        )
        client.delete("/api/v1/zones/z1")
        assert "/zones/z1" in scene(viewer, {"/zones/z1"})


@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}])
def test_an_upgrade_from_another_page_is_refused(
    server: ConsoleServer, headers: dict[str, str]
) -> None:
    for path in ("/viewer", f"/viewer/{PAGE}", "/api/v1/events", f"/api/v1/viewer/{PAGE}"):
        with (
            pytest.raises(InvalidStatus) as refused,
            viewer_of(server, path, additional_headers=headers),
        ):
            pass
        assert refused.value.response.status_code == 403


@pytest.mark.parametrize("headers", [{}, {"X-Console-Secret": "a guess"}])
def test_the_port_of_the_3d_view_itself_answers_the_relay_alone(
    server: ConsoleServer, headers: dict[str, str]
) -> None:
    assert server._viewer is not None
    address = server._viewer.websocket_url
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(address, subprotocols=[SUBPROTOCOL], proxy=None, additional_headers=headers),
    ):
        pass
    assert refused.value.response.status_code == 403
    page = httpx.get(address.replace("ws", "http"), headers=headers, trust_env=False)
    assert page.status_code == 403


def test_a_viewer_of_another_version_is_refused(server: ConsoleServer) -> None:
    address = server.url.replace("http", "ws") + "/viewer"
    with (
        pytest.raises(InvalidStatus),
        connect(address, subprotocols=[Subprotocol("viser-v0.0.1")], proxy=None),
    ):
        pass


def test_a_viewer_that_sends_nonsense_is_cut_off_and_the_others_go_on(
    server: ConsoleServer,
) -> None:
    nonsense: list[bytes | str] = [
        b"",
        b"\xff" * 64,
        "text",
        msgspec.msgpack.encode({"type": "NoSuchMessage"}),
        b"\x93\x01\x02",
    ]
    with viewer_of(server) as good:
        good.send(camera())
        for message in nonsense:
            with viewer_of(server) as bad:
                bad.send(message)
                with pytest.raises(ConnectionClosed):
                    for _ in range(10_000):
                        bad.recv(timeout=30)
        scene(good, {"/floor/0_0"})


def test_a_viewer_cannot_open_the_public_tunnel_nor_upload(server: ConsoleServer) -> None:
    assert server._viewer is not None
    sockets = server._viewer._server._websock_server
    with viewer_of(server) as viewer:
        viewer.send(camera())
        scene(viewer, {"/floor/0_0"})
        (client,) = server._viewer._server.get_clients().values()
        kinds = (*sockets._incoming_handlers, *client._websock_connection._incoming_handlers)
        heard = {kind.__name__ for kind in kinds}
    clicks = {"ScenePointerMessage", "SceneNodeClickMessage", "SceneNodeDragMessage"}
    assert "ViewerCameraMessage" in heard and heard <= {"ViewerCameraMessage", *clicks}


def test_a_click_in_the_viewer_reaches_its_own_page_as_a_point_on_the_floor(
    server: ConsoleServer,
) -> None:
    links = server.url.replace("http", "ws") + "/api/v1/viewer/"
    with (
        connect(links + PAGE, proxy=None) as page,
        connect(links + "f" * 16, proxy=None) as other,
        viewer_of(server, f"/viewer/{PAGE}") as viewer,
    ):
        viewer.send(camera())
        assert json.loads(page.recv(timeout=60)) == {"type": "viewer", "connected": True}
        click = {
            "type": "ScenePointerMessage",
            "event_type": "click",
            "modifier": None,
            "screen_pos": [[0.5, 0.5]],
        }
        for direction in ([0.0, 0.0, 1.0], [float("nan")] * 3, [1.0, 0.0, 0.0], [0.1, 0.2, -1.0]):
            ray = {"ray_origin": [1.0, 1.0, 10.0], "ray_direction": direction}
            viewer.send(msgspec.msgpack.encode({**click, **ray}))
        point = json.loads(page.recv(timeout=60))
        assert point["type"] == "click" and np.allclose([point["x_m"], point["y_m"]], [2.0, 3.0])
        with pytest.raises(TimeoutError):
            other.recv(timeout=0.2)


def test_a_reloaded_view_that_comes_before_the_old_one_has_gone_stays_live(
    server: ConsoleServer,
) -> None:
    with connect(server.url.replace("http", "ws") + f"/api/v1/viewer/{PAGE}", proxy=None) as page:
        heard = []
        with viewer_of(server, f"/viewer/{PAGE}") as reloaded:
            with viewer_of(server, f"/viewer/{PAGE}") as old:
                for viewer in (reloaded, old):
                    viewer.send(camera())
                    heard.append(json.loads(page.recv(timeout=60)))
            heard.append(json.loads(page.recv(timeout=60)))
        heard.append(json.loads(page.recv(timeout=60)))
    assert heard == [{"type": "viewer", "connected": live} for live in (True, True, True, False)]


def test_a_draft_is_drawn_for_its_own_viewer_and_goes_with_the_page(server: ConsoleServer) -> None:
    draft = {
        "type": "draft",
        "mode": "edit",
        "corners": [[0, 0], [1, 0], [1, 1]],
        "path": [[0, 0], [2, 2]],
    }
    with viewer_of(server, f"/viewer/{PAGE}") as mine:
        mine.send(camera())
        with connect(
            server.url.replace("http", "ws") + f"/api/v1/viewer/{PAGE}", proxy=None
        ) as page:
            page.send(json.dumps(draft))
            scene(mine, {"/draft/outline", "/draft/corners", "/draft/path"})
        with viewer_of(server) as other:
            other.send(camera())
            assert not any(
                name.startswith("/draft")
                for name in scene(other, {"/floor/0_0", "/cloud/camera/-1_-1"})
            )


@pytest.mark.parametrize(
    "message",
    [
        "",
        "[]",
        "[" * 50_000,
        " " * MAX_MESSAGE_BYTES + '{"type":"look","at":"top"}',
        '{"type":"draft","corners":[[NaN,0]]}',
        '{"type":"look","at":"moon"}',
    ],
)
def test_a_page_that_sends_nonsense_is_cut_off(server: ConsoleServer, message: str) -> None:
    with connect(server.url.replace("http", "ws") + f"/api/v1/viewer/{PAGE}", proxy=None) as page:
        page.send(message)
        with pytest.raises(ConnectionClosed):
            page.recv(timeout=60)


def test_a_client_that_does_not_read_gets_the_newest_state_when_it_wakes(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with connect(
        server.url.replace("http", "ws") + "/api/v1/events", proxy=None, max_queue=1
    ) as lazy:
        lazy.recv(timeout=60)
        operations.goals.add(3, 0)
        operations.stop("test")
        latest = json.loads(lazy.recv(timeout=60))
        while not latest["stop_latched"]:
            latest = json.loads(lazy.recv(timeout=60))
        assert latest["queue"]


URDF = (
    '<robot name="r"><link name="base"><visual><geometry><box size="1 0.7 0.3"/>'
    "</geometry></visual></link></robot>"
)


def test_a_robot_with_a_urdf_is_drawn_from_it_and_a_broken_one_as_a_box(tmp_path: Path) -> None:
    good, broken = tmp_path / "good.urdf", tmp_path / "broken.urdf"
    good.write_text(URDF)
    broken.write_text("<robot")
    for path, wanted in ((good, "visual"), (broken, "body")):
        console = ConsoleServer(FakeOperations(robot_urdf=path), port=0)
        console.start()
        with viewer_of(console) as viewer:
            viewer.send(camera())
            assert any(
                wanted in name for name in scene(viewer, {"/robot/base/state", "/floor/0_0"})
            )
        console.stop()


def test_viser_is_not_announced_on_the_terminal(
    operations: FakeOperations, capsys: pytest.CaptureFixture[str]
) -> None:
    console = ConsoleServer(operations, port=0)
    console.start()
    console.stop()
    said = capsys.readouterr()
    assert said.out == said.err == ""
