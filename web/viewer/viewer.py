"""3D view: a viser server on the loopback, the thread that feeds it, and the draft overlays of its
clients."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import viser

from web.images import palette
from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot
from web.viewer.camera import floor_below, follow, overview, view_of
from web.viewer.display import ClientDisplay, cloud_node
from web.viewer.draft_overlay import DraftOverlay
from web.viewer.layers.base import Layer, Scene
from web.viewer.layers.cloud import CloudLayer
from web.viewer.layers.floor import FloorLayer
from web.viewer.layers.goals_zones import GoalLayer, ZoneLayer
from web.viewer.layers.people import PeopleLayer
from web.viewer.layers.primitives import PrimitivesLayer
from web.viewer.layers.robot import CameraLayer, PathLayer, RobotLayer
from web.viewer.messages import (
    CLOUD_COLOURS,
    CameraMove,
    DisplayOptions,
    Draft,
    Highlight,
    Message,
)
from web.viewer.page_link import PAGE_ID, PAGE_ID_HEADER, SECRET_HEADER, PageLinks
from web.viewer.viser_compat import (
    Quiet,
    accept_only_needed_messages,
    refusing_others,
    request_header,
)

log = logging.getLogger(__name__)

PERIOD_S, JOIN_S = 0.1, 2.0
"""Period of the feeding thread, and time limit of its end, seconds."""
OVERVIEW_PERIOD_S = 10.0
"""Period after which new clients begin with the view of what is known by then, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Client:
    """Browser that shows the 3D view."""

    page_id: str
    """Id of the console page around it; empty without one."""
    handle: viser.ClientHandle
    overlay: DraftOverlay
    display: ClientDisplay


class Viewer:
    """3D view of the console; safe from any thread."""

    def __init__(self, operations: RobotService) -> None:
        self.links = PageLinks()
        self._operations = operations
        self._lock = threading.RLock()
        self._drafts: dict[str, Draft] = {}
        self._highlights: dict[str, Highlight] = {}
        self._displays: dict[str, DisplayOptions] = {}
        self._clients: dict[int, _Client] = {}
        self._wake, self._ending = threading.Event(), threading.Event()
        self._failed: set[str] = set()
        self._due: dict[str, float] = {}
        self._has_body = False
        self.secret = secrets.token_urlsafe(32)
        """Value of `SECRET_HEADER` without which viser's server answers nothing."""
        with Quiet(), refusing_others(SECRET_HEADER, self.secret):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        accept_only_needed_messages(self._server)
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self._server.gui.main_panel.minimize()
        # Shadow maps are the dearest part of a frame that a processor draws, and tell an operator
        # nothing.
        self._server.scene.configure_default_lights(cast_shadow=False)
        self._clouds = {
            colour: CloudLayer(self._server, cloud_node(colour), colour) for colour in CLOUD_COLOURS
        }
        self._layers = self._build_layers()
        self._server.on_client_connect(self._joined)
        self._server.on_client_disconnect(self._left)
        self._thread = threading.Thread(target=self._feed, name="viewer-feed", daemon=True)
        self._thread.start()

    @property
    def websocket_url(self) -> str:
        """URL of viser's websocket, on this machine only."""
        return f"ws://127.0.0.1:{self._server.get_port()}"

    @property
    def subprotocol(self) -> str:
        """Websocket subprotocol of viser's page and server."""
        return f"viser-v{viser.__version__}"

    def close(self) -> None:
        """Stop feeding and serving."""
        self._ending.set()
        self._wake.set()
        self._thread.join(JOIN_S)
        with Quiet():
            self._server.stop()

    def receive(self, page_id: str, message: Message) -> None:
        """Apply a message of a console page."""
        with self._lock:
            clients = [one for one in self._clients.values() if one.page_id == page_id]
            if isinstance(message, Draft):
                self._drafts[page_id] = message
                for client in clients:
                    client.overlay.show(message)
            elif isinstance(message, CameraMove):
                for client in clients:
                    self._move_camera(client.handle, message)
            elif isinstance(message, Highlight):
                self._highlights[page_id] = message
                for client in clients:
                    client.overlay.highlight(message)
            elif isinstance(message, DisplayOptions):
                self._displays[page_id] = message
                for client in clients:
                    client.display.show(message)
                self._wake.set()
            else:
                for client in clients[-1:]:
                    place = floor_below(message, client.handle.camera)
                    answer = {"type": "pointer", "phase": message.phase, "place": place}
                    self.links.post(page_id, answer)

    def forget(self, page_id: str) -> None:
        """Remove the draft and the highlights of a page that has closed."""
        self.receive(page_id, Draft())
        with self._lock:
            for kept in (self._drafts, self._highlights, self._displays):
                kept.pop(page_id, None)

    def _display_of(self, page_id: str) -> DisplayOptions:
        return self._displays.get(page_id, DisplayOptions())

    async def _joined(self, handle: viser.ClientHandle) -> None:
        page_id = self._page_of(handle)
        client = _Client(
            page_id=page_id,
            handle=handle,
            overlay=DraftOverlay(handle, lambda message: self.links.post(page_id, message)),
            display=ClientDisplay(handle),
        )
        with self._lock:
            self._clients[handle.client_id] = client
            client.display.show(self._display_of(page_id))
            if (draft := self._drafts.get(page_id)) is not None:
                client.overlay.show(draft)
            if (highlight := self._highlights.get(page_id)) is not None:
                client.overlay.highlight(highlight)
        self._wake.set()
        self.links.post(page_id, {"type": "viewer", "connected": True})

    async def _left(self, handle: viser.ClientHandle) -> None:
        with self._lock:
            gone = self._clients.pop(handle.client_id, None)
            page_id = "" if gone is None else gone.page_id
            # After a reload, the new client joins before the old one leaves.
            another = any(client.page_id == page_id for client in self._clients.values())
        self.links.post(page_id, {"type": "viewer", "connected": another})

    def _page_of(self, client: viser.ClientHandle) -> str:
        """Return the id of the page that the proxy named when it opened the connection; empty for a
        client without a page."""
        page_id = request_header(self._server, client, PAGE_ID_HEADER)
        return page_id if PAGE_ID.fullmatch(page_id) else ""

    # Feeding

    def _feed(self) -> None:
        while not self._ending.is_set():
            self._run_guarded("scene", self._push)
            self._wake.wait(PERIOD_S)
            self._wake.clear()

    def _push(self) -> None:
        tick = self._operations.newest_tick()
        if tick is None:
            return
        now = time.monotonic()
        if now >= self._due.get("overview", 0.0):
            self._due["overview"] = now + OVERVIEW_PERIOD_S
            self._run_guarded("overview", partial(self._place_camera, tick))
        if not self._clients:
            # Without a viewer, the processor time belongs to the navigation.
            return
        if not self._has_body:
            self._has_body = True
            self._run_guarded("robot body", self._add_body)
        with self._lock:
            clients = list(self._clients.values())
            displays = {client.page_id: self._display_of(client.page_id) for client in clients}
        shows_candidates = any("candidates" not in one.hidden for one in displays.values())
        state = self._operations.state()
        scene = Scene(
            state=state,
            tick=tick,
            zones=(*self._operations.zones.stored, *tick.closed),
            beware=self._operations.beware.list,
            candidates=self._operations.insight.candidates if shows_candidates else lambda: None,
        )
        for client in clients:
            if displays[client.page_id].follows:
                self._run_guarded("camera", partial(follow, client.handle.camera, state.pose))
        for layer in self._layers:
            if self._ending.is_set():
                return
            if now >= self._due.get(layer.name, 0.0):
                self._due[layer.name] = now + layer.period_s
                self._run_guarded(layer.name, partial(layer.push, scene))
        cloud = self._operations.cloud()
        if cloud is None:
            return
        wanted = {one.cloud_colour for one in displays.values() if "cloud" not in one.hidden}
        for colour, points in self._clouds.items():
            if colour in wanted:
                self._run_guarded(f"cloud by {colour}", partial(points.push, cloud))
            else:
                points.clear()

    def _run_guarded(self, name: str, act: Callable[[], object]) -> None:
        """Run an action of a layer; a failure is logged once and tried again, the others go on."""
        try:
            act()
            self._failed.discard(name)
        except Exception:
            if name not in self._failed and not self._ending.is_set():
                log.exception("3D view: the layer %r failed", name)
            self._failed.add(name)

    def _build_layers(self) -> tuple[Layer, ...]:
        server = self._server
        return (
            FloorLayer(server),
            RobotLayer(server),
            CameraLayer(server),
            PathLayer(server),
            PrimitivesLayer(server),
            GoalLayer(server),
            ZoneLayer(server),
            PeopleLayer(server),
        )

    def _add_body(self) -> None:
        urdf, profile = self._operations.robot_urdf, self._operations.profile
        if urdf is not None:
            # A second of imports that the start does not wait for.
            from viser.extras import ViserUrdf

            try:
                body = ViserUrdf(self._server, urdf, root_node_name="/robot/base")
                # Without a configuration, every link stays at the origin.
                body.update_cfg(np.zeros(len(body.get_actuated_joint_names())))
                return
            except Exception:
                log.exception("3D view: %s could not be drawn; the robot is a box", urdf)
        size = (profile.length_m, profile.width_m, 0.35)
        self._server.scene.add_box(
            "/robot/base/body", palette.DRAFT, size, position=(0.0, 0.0, 0.2)
        )
        nose = (profile.length_m / 2, 0.0, 0.3)
        self._server.scene.add_box(
            "/robot/base/nose", (20, 20, 20), (0.08, profile.width_m * 0.6, 0.12), position=nose
        )

    # Camera

    def _place_camera(self, tick: TickSnapshot) -> None:
        """Have new clients begin with what is known by now; the cameras of others stay."""
        eye, target = overview(tick)
        self._server.initial_camera.position = eye
        self._server.initial_camera.look_at = target

    def _move_camera(self, client: viser.ClientHandle, move: CameraMove) -> None:
        tick = self._operations.newest_tick()
        if tick is None:
            return
        eye, target = view_of(move, tick, self._operations.state().pose, client.camera)
        with client.atomic():
            client.camera.position = eye
            client.camera.look_at = target
