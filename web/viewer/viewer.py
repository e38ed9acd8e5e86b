"""The 3D view: a viser server on the loopback, the thread that feeds it, and the sketches of its
clients."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
import rich
import viser
from viser import _messages
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

log = logging.getLogger(__name__)

PERIOD_S = 0.1
JOIN_S = 2.0
# What a viewer of this console may say: where it looks, and what was pressed. Uploads, widgets and
# the public tunnel are deaf.
_HEARD = (
    _messages.ViewerCameraMessage,
    _messages.ScenePointerMessage,
    _messages.SceneNodeClickMessage,
    _messages.SceneNodeDragMessage,
)


class Viewer:
    """Start, feed, stop; safe to call from any thread."""

    def __init__(self, operations: RobotService) -> None:
        self.links = PageLinks()
        self._operations = operations
        self._lock = threading.RLock()
        self._drafts: dict[str, Draft] = {}
        self._marks: dict[str, Highlight] = {}
        self._sketches: dict[int, tuple[str, DraftOverlay]] = {}
        self._clients: dict[int, viser.ClientHandle] = {}
        self._show = DisplayOptions(type="show", cloud_colour="camera", hidden=["candidates"])
        self._wake, self._ending = threading.Event(), threading.Event()
        self._failed: set[str] = set()
        self._due: dict[str, float] = {}
        self._placed = False
        with _Quiet():
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        _restrict(self._server)
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
        self._layers = self._built_layers()
        self._server.on_client_connect(self._joined)
        self._server.on_client_disconnect(self._left)
        self._thread = threading.Thread(target=self._feed, name="viewer-feed", daemon=True)
        self._thread.start()

    @property
    def http_url(self) -> str:
        """Where viser's page is, on this machine only."""
        return f"http://127.0.0.1:{self._server.get_port()}"

    @property
    def websocket_url(self) -> str:
        """Where viser's websocket is, on this machine only."""
        return f"ws://127.0.0.1:{self._server.get_port()}"

    @property
    def subprotocol(self) -> str:
        """What viser's page and server must agree on."""
        return f"viser-v{viser.__version__}"

    def close(self) -> None:
        """Stop feeding and serving."""
        self._ending.set()
        self._wake.set()
        self._thread.join(JOIN_S)
        with _Quiet():
            self._server.stop()

    def receive(
        self, page_id: str, message: Draft | CameraMove | DisplayOptions | Highlight
    ) -> None:
        """What a console page wants of the 3D view."""
        with self._lock:
            if isinstance(message, Draft):
                self._drafts[page_id] = message
                for sketch in self._sketches_of(page_id):
                    sketch.show(message)
            elif isinstance(message, CameraMove):
                for client_id, (owner, _) in self._sketches.items():
                    if owner == page_id:
                        self._look(self._clients[client_id], message.at, message.place)
            elif isinstance(message, Highlight):
                self._marks[page_id] = message
                for sketch in self._sketches_of(page_id):
                    sketch.mark(message)
            else:
                self._show = message
                for name, root in self._roots.items():
                    root.visible = name not in message.hidden
                self._wake.set()

    def forget(self, page_id: str) -> None:
        """The page has gone, and its draft with it."""
        self.receive(page_id, Draft())
        with self._lock:
            self._drafts.pop(page_id, None)
            self._marks.pop(page_id, None)

    def _sketches_of(self, page_id: str) -> Iterable[DraftOverlay]:
        return [sketch for owner, sketch in self._sketches.values() if owner == page_id]

    async def _joined(self, client: viser.ClientHandle) -> None:
        page_id = self._page_of(client)
        sketch = DraftOverlay(client, lambda message: self.links.post(page_id, message), self._spec)
        with self._lock:
            self._clients[client.client_id] = client
            self._sketches[client.client_id] = (page_id, sketch)
            if (draft := self._drafts.get(page_id)) is not None:
                sketch.show(draft)
            if (mark := self._marks.get(page_id)) is not None:
                sketch.mark(mark)
        self._wake.set()
        self.links.post(page_id, {"type": "viewer", "connected": True})

    async def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._clients.pop(client.client_id, None)
            page_id, _ = self._sketches.pop(client.client_id, ("", None))
            another = any(
                owner == page_id for owner, _ in self._sketches.values()
            )  # reloaded: it joined before this one left
        self.links.post(page_id, {"type": "viewer", "connected": another})

    def _page_of(self, client: viser.ClientHandle) -> str:
        """The page that the proxy named when it opened this client's connection; empty for a viewer
        on its own."""
        connection = self._server._websock_server._live_connections.get(client.client_id)
        request = None if connection is None else connection.request
        page_id = "" if request is None else request.headers.get(PAGE_ID_HEADER, "")
        return page_id if PAGE_ID.fullmatch(page_id) else ""

    def _spec(self) -> GridSpec | None:
        picture = self._operations.picture()
        return None if picture is None else picture.grid_spec

    # ------------------------------------------------------------------------------------------------------ feeding

    def _feed(self) -> None:
        while not self._ending.is_set():
            self._guarded("scene", self._push)
            self._wake.wait(PERIOD_S)
            self._wake.clear()

    def _push(self) -> None:
        picture = self._operations.picture()
        if picture is None:
            return
        if not self._placed:
            self._place_camera(picture)
        if not self._clients:
            # Nobody looks: the machine's time belongs to the navigation.
            return
        snapshot = Scene(
            state=self._operations.state(),
            picture=picture,
            zones=(*self._operations.zones.stored, *picture.closed),
            beware=self._operations.beware.list,
            candidates=self._candidates,
            strength={str(name): share for name, share in self._show.strength.items()},
        )
        now = time.monotonic()
        for layer in self._layers:
            if self._ending.is_set():
                return
            if now >= self._due.get(layer.name, 0.0):
                self._due[layer.name] = now + layer.period_s
                self._guarded(layer.name, partial(layer.push, snapshot))
        cloud = self._operations.cloud()
        if cloud is not None:
            self._guarded(
                "cloud",
                partial(
                    self._cloud.push,
                    cloud,
                    self._show.cloud_colour,
                    self._show.strength.get("cloud", 1.0),
                ),
            )

    def _candidates(self) -> Candidates | None:
        return None if "candidates" in self._show.hidden else self._operations.insight.candidates()

    def _guarded(self, name: str, act: Callable[[], object]) -> None:
        """A layer that fails is said once and tried again; the others go on."""
        try:
            act()
            self._failed.discard(name)
        except Exception:
            if name not in self._failed and not self._ending.is_set():
                log.exception("3D view: the layer %r failed", name)
            self._failed.add(name)

    def _built_layers(self) -> tuple[Layer, ...]:
        robot = RobotLayer(self._server)
        self._guarded("robot body", self._add_body)
        server = self._server
        ways, marks = (
            (CameraLayer(server), PathLayer(server)),
            (GoalLayer(server), ZoneLayer(server), PeopleLayer(server)),
        )
        return (FloorLayer(server), robot, *ways, PrimitivesLayer(server), *marks)

    def _add_body(self) -> None:
        urdf, profile = self._operations.robot_urdf, self._operations.profile
        if urdf is not None:
            try:
                body = ViserUrdf(self._server, urdf, root_node_name="/robot/base")
                # Until it is told a configuration, it leaves every link at the origin.
                body.update_cfg(np.zeros(len(body.get_actuated_joint_names())))
                return
            except Exception:
                log.exception("3D view: %s could not be drawn, a box stands for the robot", urdf)
        size = (profile.length_m, profile.width_m, 0.35)
        self._server.scene.add_box(
            "/robot/base/body", palette.DRAFT, size, position=(0.0, 0.0, 0.2)
        )
        nose = (profile.length_m / 2, 0.0, 0.3)
        self._server.scene.add_box(
            "/robot/base/nose", (20, 20, 20), (0.08, profile.width_m * 0.6, 0.12), position=nose
        )

    # ------------------------------------------------------------------------------------------------------- camera

    def _place_camera(self, picture: TickSnapshot) -> None:
        self._placed = True
        eye, target = _overview(picture)
        self._server.initial_camera.position = eye
        self._server.initial_camera.look_at = target

    def _look(self, client: viser.ClientHandle, at: str, place: tuple[float, float] | None) -> None:
        picture, state = self._operations.picture(), self._operations.state()
        if picture is None:
            return
        spec, lens = picture.grid_spec, client.camera
        eye, target = _overview(picture) if at == "overview" else _top(spec, lens.fov, lens.aspect)
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


Place = tuple[float, float, float]


def _overview(picture: TickSnapshot) -> tuple[Place, Place]:
    """From the south, on what has been seen so far."""
    spec = picture.grid_spec
    seen = np.argwhere(picture.seen)
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
    # A hair to the south: straight down, "up" on the screen would be undefined.
    return (x, y - 1e-3 * up, up), (x, y, 0.0)


def _extent(spec: GridSpec) -> tuple[float, float, float, float]:
    width, height = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
    return spec.origin_x_m + width / 2, spec.origin_y_m + height / 2, width, height


def _restrict(server: viser.ViserServer) -> None:
    """Take from every client the messages this console has no use for, the request of a public
    tunnel first of all."""

    def deafen(listener: Any) -> None:
        for kind in [kind for kind in listener._incoming_handlers if kind not in _HEARD]:
            listener.unregister_handler(kind)

    deafen(server._websock_server)
    # viser makes the handlers of a client in a callback of the same list, so this one comes after
    # them.
    server._websock_server.on_client_connect(deafen)


class _Quiet:
    """viser reports its private address on the terminal; the operator must not mistake it for the
    console's."""

    def __enter__(self) -> None:
        self._was = rich.get_console().quiet
        rich.get_console().quiet = True

    def __exit__(self, *_: Any) -> None:
        rich.get_console().quiet = self._was
