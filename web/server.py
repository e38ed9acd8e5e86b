"""Web application of the console, and the server that runs it in its own thread and event loop."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Sequence
from typing import Any

import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

from web.api.audit import audit_router
from web.api.beware.beware import beware_router
from web.api.beware.detections import sightings_router
from web.api.beware.drafts import beware_drafts_router
from web.api.events import events_router
from web.api.health import health_router
from web.api.insight import explain_router, journal_router
from web.api.map.edits import map_edits_router
from web.api.map.localisation import localisation_router
from web.api.map.maps import maps_router, poses_router
from web.api.mission.control import control_router
from web.api.mission.mission import mission_router
from web.api.mission.path_settings import path_settings_router
from web.api.sites import sites_router
from web.api.teach.frames import teach_frames_router
from web.api.teach.training import teach_training_router
from web.api.users import access_router
from web.api.viewer_link import viewer_link_router
from web.api.zone_drafts import drawing_router
from web.api.zones import zones_router
from web.auth.access import Access
from web.auth.audit import Auditor
from web.auth.presence import PresenceMonitor, Unattended
from web.gateway import problems
from web.gateway.guard import Guard
from web.gateway.problems import JsonResponse
from web.gateway.site_check import SiteCheck
from web.gateway.undo_number import UndoNumber
from web.images.shown_images import ShownImages
from web.interface.operations import RobotService
from web.interface.wire import build_schemas
from web.pages import pages_router
from web.port import reserve
from web.viewer.proxy import viewer_router
from web.viewer.viewer import Viewer

log = logging.getLogger(__name__)

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
MAX_MESSAGE_BYTES = 500_000
"""Largest websocket message from a browser in bytes, an explained path with all that it passes;
messages to browsers may be larger."""
HEAD_S = 10.0
"""Time in which a connection has to send the whole head of its next request, seconds."""
START_S, STOP_S = 60.0, 5.0
"""Time limits of start and stop, seconds."""
_ABOUT = """Operate the robot: goals, mission, zones, beware list, emergency stop; read map, path,
camera image and state.

Lengths are metres of the map frame, angles radians. Numbers that are not finite are null.
Every refusal has the fields of RFC 9457 and `{"error": {"code", "message", "where"}}`, and changes
nothing; control that was free is then still taken by a request that drives.
The state arrives by websocket at `/api/v1/events`, ten times a second and on every change."""


def create_app(
    operations: RobotService,
    *,
    allowed_hosts: Sequence[str],
    access: Access | None = None,
    viewer: Viewer | None = None,
) -> FastAPI:
    """Return the console as an ASGI app. `allowed_hosts` are the names it answers to, with or
    without a port."""
    build_schemas()
    access = access or Access()
    auditor = Auditor(access.audit_log)
    shown = ShownImages()
    app = FastAPI(
        title="Operator console",
        version="1",
        description=_ABOUT,
        docs_url=None,
        openapi_url=None,
        redoc_url=None,
        default_response_class=JsonResponse,
    )
    routers = [
        pages_router(
            lambda: app.openapi()
        ),  # first: most requests ask for their files, and routes are tried in order
        mission_router(operations),
        zones_router(operations),
        drawing_router(operations, shown),
        beware_drafts_router(operations),
        beware_router(operations),
        maps_router(operations, shown),
        poses_router(operations),
        map_edits_router(operations),
        path_settings_router(operations),
        sites_router(operations),
        events_router(operations),
        journal_router(operations),
        explain_router(operations),
        sightings_router(operations),
        localisation_router(operations),
        teach_frames_router(operations),
        teach_training_router(operations),
        control_router(operations, access.control, auditor),
        access_router(access.authenticator),
        audit_router(access.audit_log),
        viewer_link_router(viewer),
        health_router(operations),
        viewer_router(viewer),
    ]
    for router in routers:
        # Not included, which would build each route once more, at the first request.
        app.router.routes.extend(router.routes)
    problems.install(app)
    app.add_middleware(UndoNumber)
    app.add_middleware(SiteCheck, present=lambda: operations.sites.chosen_id)
    app.add_middleware(
        Guard,
        allowed_hosts=allowed_hosts,
        authenticator=access.authenticator,
        control=access.control,
        auditor=auditor,
        spools={
            "/api/v1/teach/frames.zip": lambda: operations.teaching.frames.import_file(),
            "/api/v1/teach/networks": lambda: operations.teaching.networks.import_file(),
        },
    )
    return app


class ConsoleServer:
    """Console on one port: `start`, `url`, `stop`."""

    def __init__(
        self,
        operations: RobotService,
        host: str = "127.0.0.1",
        port: int = 8000,
        *,
        listener: socket.socket | None = None,
        allowed_hosts: Sequence[str] = (),
        proxy: str | None = None,
        access: Access | None = None,
        unattended: Unattended = "go on",
    ) -> None:
        """`listener`: socket of `web.port.reserve`; without it, `start` opens the port.
        `allowed_hosts`: further names under which the console answers. `proxy`: address of a proxy
        whose headers tell scheme and address of the browser.
        `unattended`: treatment of a mission when the visitor in control has become silent.
        """
        self._operations, self._host, self._port = operations, host, port
        self._access = access or Access()
        self._presence = PresenceMonitor(operations, self._access, unattended)
        self._listener, self._proxy = listener, proxy
        self._allowed = (*LOOPBACK, *_names_of(host), *allowed_hosts)
        self._viewer: Viewer | None = None
        self._server: _Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """URL of the operator's page."""
        name = _names_of(self._host)[0]
        return f"http://{name}:{self._port}"

    def start(self) -> None:
        """Start serving; return when the port answers. Raises `PortInUse` when it is taken, and
        then starts nothing."""
        listener = self._listener or reserve(self._host, self._port)
        self._port = listener.getsockname()[1]
        self._viewer = Viewer(self._operations)
        app = create_app(
            self._operations, allowed_hosts=self._allowed, access=self._access, viewer=self._viewer
        )
        self._server = _Server(_config(app, self._proxy))
        self._thread = threading.Thread(
            target=self._server.run, args=([listener],), name="console", daemon=True
        )
        self._thread.start()
        self._presence.start()
        if not self._server.up.wait(START_S):
            self.stop()
            raise RuntimeError(f"the console did not come up within {START_S:g} s")

    def stop(self) -> None:
        """Stop serving and close all connections."""
        self._presence.stop()
        if self._server is not None:
            self._server.should_exit = True
        if self._viewer is not None:
            # viser first: then its relays end by themselves, and there is nothing to wait for.
            self._viewer.close()
        if self._thread is not None:
            self._thread.join(STOP_S)
        self._server = self._viewer = self._thread = None


class _Server(uvicorn.Server):
    """uvicorn in a thread; the main program handles the signals."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.up = threading.Event()
        self._waiting: dict[tuple[Any, Any], float] = {}

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start up and set `up`."""
        await super().startup(sockets)
        self.up.set()

    async def on_tick(self, counter: int) -> bool:
        """Close the connections that have sent no whole head of a request in time, now and then:
        each keeps one of the files that the process may open."""
        if counter % 10 == 0:
            now, waiting = time.monotonic(), dict[tuple[Any, Any], float]()
            for one in self.server_state.connections:
                if not isinstance(one, H11Protocol) or one.transport.get_write_buffer_size():
                    continue  # a slow network still takes an answer
                if one.cycle is None or one.cycle.response_complete:
                    # By its last request, too: many may come one after another on one connection.
                    waiting[one, one.cycle] = self._waiting.get((one, one.cycle), now)
            self._waiting = waiting
            for (one, _), since in waiting.items():
                if now - since > HEAD_S:
                    one.transport.abort()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Shut down, and close the connections of requests that did not end in time."""
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):
            if connection.transport is not None:
                connection.transport.abort()
        await asyncio.sleep(0)  # the loop closes their sockets


def _config(app: FastAPI, proxy: str | None) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        log_config=None,
        log_level="warning",
        access_log=False,
        lifespan="off",
        http="h11",
        ws="websockets-sansio",
        ws_per_message_deflate=False,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_ping_interval=5.0,
        ws_ping_timeout=10.0,
        timeout_graceful_shutdown=1,
        server_header=False,
        proxy_headers=proxy is not None,
        forwarded_allow_ips=proxy,
    )


def _names_of(host: str) -> tuple[str, ...]:
    """Return the names of this machine in a browser's address when it listens on `host`, the best
    one first."""
    if host not in ("0.0.0.0", "::"):
        return (f"[{host}]" if ":" in host else host,)
    name = socket.gethostname()
    return (_address_on_the_network(), name, f"{name}.local")


def _address_on_the_network() -> str:
    # Connecting a datagram socket sends nothing; it only selects the local address.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
