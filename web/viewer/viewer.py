"""3D view: a viser server on the loopback, the thread that feeds it, and the draft overlays of its
clients."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import viser
from viser.extras import ViserUrdf

from navcore.grid.grid import GridSpec
from web.images import palette
from web.interface.insight import Candidates
from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot
from web.viewer.draft_overlay import DraftOverlay
from web.viewer.layers.base import Layer, Scene
from web.viewer.layers.cloud import CloudLayer
from web.viewer.layers.floor import FloorLayer
from web.viewer.layers.goals_zones import GoalLayer, ZoneLayer
from web.viewer.layers.people import PeopleLayer
from web.viewer.layers.primitives import PrimitivesLayer
from web.viewer.layers.robot import CameraLayer, PathLayer, RobotLayer
from web.viewer.messages import LAYERS, CameraMove, DisplayOptions, Draft, Highlight
from web.viewer.page_link import PAGE_ID, PAGE_ID_HEADER, PageLinks
from web.viewer.viser_compat import Quiet, accept_only_needed_messages, request_header

log = logging.getLogger(__name__)

PERIOD_S, JOIN_S = 0.1, 2.0
"""Period of the feeding thread, and time limit of its end, seconds."""
Place = tuple[float, float, float]


class Viewer:
    """3D view of the console; safe from any thread."""

    def __init__(self, operations: RobotService) -> None:
        self.links = PageLinks()
        self._operations = operations
        self._lock = threading.RLock()
        self._drafts: dict[str, Draft] = {}
        self._highlights: dict[str, Highlight] = {}
        self._overlays: dict[int, tuple[str, DraftOverlay]] = {}
        self._clients: dict[int, viser.ClientHandle] = {}
        self._display = DisplayOptions(type="show", cloud_colour="camera", hidden=["candidates"])
        self._wake, self._ending = threading.Event(), threading.Event()
        self._failed: set[str] = set()
        self._due: dict[str, float] = {}
        self._camera_placed = False
        with Quiet():
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        accept_only_needed_messages(self._server)
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self._server.gui.main_panel.minimize()
        # Shadow maps are the dearest part of a frame that a processor draws, and tell an operator
        # nothing.
        self._server.scene.configure_default_lights(cast_shadow=False)
        self._roots = {
            name: self._server.scene.add_frame(f"/{name}", show_axes=False) for name in LAYERS
        }
        self._roots["candidates"].visible = False
        self._cloud = CloudLayer(self._server)
        self._layers = self._build_layers()
        self._server.on_client_connect(self._joined)
        self._server.on_client_disconnect(self._left)
        self._thread = threading.Thread(target=self._feed, name="viewer-feed", daemon=True)
        self._thread.start()

    @property
    def http_url(self) -> str:
        """URL of viser's page, on this machine only."""
        return f"http://127.0.0.1:{self._server.get_port()}"

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

    def receive(
        self, page_id: str, message: Draft | CameraMove | DisplayOptions | Highlight
    ) -> None:
        """Apply a message of a console page."""
        with self._lock:
            if isinstance(message, Draft):
                self._drafts[page_id] = message
                for overlay in self._overlays_of(page_id):
                    overlay.show(message)
            elif isinstance(message, CameraMove):
                for client_id, (owner, _) in self._overlays.items():
                    if owner == page_id:
                        self._move_camera(self._clients[client_id], message.at, message.place)
            elif isinstance(message, Highlight):
                self._highlights[page_id] = message
                for overlay in self._overlays_of(page_id):
                    overlay.highlight(message)
            else:
                self._display = message
                for name, root in self._roots.items():
                    root.visible = name not in message.hidden
                self._wake.set()

    def forget(self, page_id: str) -> None:
        """Remove the draft and the highlights of a page that has closed."""
        self.receive(page_id, Draft())
        with self._lock:
            self._drafts.pop(page_id, None)
            self._highlights.pop(page_id, None)

    def _overlays_of(self, page_id: str) -> Iterable[DraftOverlay]:
        return [overlay for owner, overlay in self._overlays.values() if owner == page_id]

    async def _joined(self, client: viser.ClientHandle) -> None:
        page_id = self._page_of(client)
        overlay = DraftOverlay(client, lambda message: self.links.post(page_id, message))
        with self._lock:
            self._clients[client.client_id] = client
            self._overlays[client.client_id] = (page_id, overlay)
            if (draft := self._drafts.get(page_id)) is not None:
                overlay.show(draft)
            if (highlight := self._highlights.get(page_id)) is not None:
                overlay.highlight(highlight)
        self._wake.set()
        self.links.post(page_id, {"type": "viewer", "connected": True})

    async def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._clients.pop(client.client_id, None)
            page_id, _ = self._overlays.pop(client.client_id, ("", None))
            # After a reload, the new client joins before the old one leaves.
            another = any(owner == page_id for owner, _ in self._overlays.values())
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
        tick = self._operations.picture()
        if tick is None:
            return
        if not self._camera_placed:
            self._place_camera(tick)
        if not self._clients:
            # Without a viewer, the processor time belongs to the navigation.
            return
        scene = Scene(
            state=self._operations.state(),
            tick=tick,
            zones=(*self._operations.zones.stored, *tick.closed),
            beware=self._operations.beware.list,
            candidates=self._candidates,
            strength={str(name): share for name, share in self._display.strength.items()},
        )
        now = time.monotonic()
        for layer in self._layers:
            if self._ending.is_set():
                return
            if now >= self._due.get(layer.name, 0.0):
                self._due[layer.name] = now + layer.period_s
                self._run_guarded(layer.name, partial(layer.push, scene))
        cloud = self._operations.cloud()
        if cloud is not None:
            self._run_guarded(
                "cloud",
                partial(
                    self._cloud.push,
                    cloud,
                    self._display.cloud_colour,
                    self._display.strength.get("cloud", 1.0),
                ),
            )

    def _candidates(self) -> Candidates | None:
        return (
            None if "candidates" in self._display.hidden else self._operations.insight.candidates()
        )

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
        robot = RobotLayer(self._server)
        self._run_guarded("robot body", self._add_body)
        server = self._server
        return (
            FloorLayer(server),
            robot,
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
        self._camera_placed = True
        eye, target = _overview(tick)
        self._server.initial_camera.position = eye
        self._server.initial_camera.look_at = target

    def _move_camera(
        self, client: viser.ClientHandle, at: str, place: tuple[float, float] | None
    ) -> None:
        tick, state = self._operations.picture(), self._operations.state()
        if tick is None:
            return
        spec, lens = tick.grid_spec, client.camera
        eye, target = _overview(tick) if at == "overview" else _top(spec, lens.fov, lens.aspect)
        if at == "robot" and math.isfinite(state.pose.x_m + state.pose.y_m + state.pose.yaw_rad):
            x, y, yaw = state.pose.x_m, state.pose.y_m, state.pose.yaw_rad
            cos, sin = math.cos(yaw), math.sin(yaw)
            eye, target = (
                (x - 2.8 * cos - 1.2 * sin, y - 2.8 * sin + 1.2 * cos, 2.2),
                (x + cos, y + sin, 0.0),
            )
        if at == "place" and place is not None:
            eye, target = (place[0], place[1] - 3.5, 4.0), (*place, 0.0)
        with client.atomic():
            client.camera.position = eye
            client.camera.look_at = target


def _overview(tick: TickSnapshot) -> tuple[Place, Place]:
    """Return eye and target of a view from −y onto the observed area."""
    spec = tick.grid_spec
    seen = np.argwhere(tick.seen)
    x, y, width, height = _extent(spec)
    if len(seen):
        (low, left), (high, right) = (
            spec.centres(seen).min(axis=0)[::-1],
            spec.centres(seen).max(axis=0)[::-1],
        )
        x, y, width, height = (left + right) / 2, (low + high) / 2, right - left, high - low
    away = min(max(width, 1.3 * height, 9.0), 40.0)
    return (x - 0.1 * away, y - 0.6 * away, 0.58 * away), (x, y - 0.1 * away, 0.0)


def _top(spec: GridSpec, fov: float, aspect: float) -> tuple[Place, Place]:
    x, y, width, height = _extent(spec)
    fov, aspect = (fov if 0.1 < fov < 3 else 1.3), (aspect if 0.1 < aspect < 10 else 1.5)
    up = 1.05 * max(height, width / aspect) / 2 / math.tan(fov / 2)
    # Slightly off vertical: straight down, the up direction of the screen would be undefined.
    return (x, y - 1e-3 * up, up), (x, y, 0.0)


def _extent(spec: GridSpec) -> tuple[float, float, float, float]:
    width, height = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
    return spec.origin_x_m + width / 2, spec.origin_y_m + height / 2, width, height
