"""Goals and zones of the operator."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from web.images import palette
from web.viewer.layers.base import Scene
from web.viewer.layers.geometry import closed_ring, flag_mesh, polyline_segments, triangulate

ZONE_Z = 0.02
"""Height of the areas in metres."""


class GoalLayer:
    """Numbered flags of the waiting goals, paler ones of the reached goals."""

    name = "goals"
    period_s = 0.0

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: dict[str, object] = {}
        self._nodes: dict[str, list[Any]] = {}

    def push(self, scene: Scene) -> None:
        """Add, renumber and remove flags."""
        state = scene.state
        wanted: dict[str, tuple[Goal, str, palette.Rgb]] = {}
        for goal in state.reached[-20:]:
            wanted[f"reached-{goal.id}"] = (goal, "✓", palette.DRIVEN)
        for number, goal in enumerate(state.queue, 1):
            wanted[f"waiting-{goal.id}"] = (goal, f"⚑ {number}", palette.GOAL)
        with self._server.atomic():
            for key in [key for key in self._shown if wanted.get(key) != self._shown[key]]:
                for node in self._nodes.pop(key):
                    node.remove()
                del self._shown[key]
            for key, value in wanted.items():
                if key not in self._shown:
                    self._nodes[key], self._shown[key] = self._add(key, *value), value

    def _add(self, key: str, goal: Goal, text: str, colour: palette.Rgb) -> list[Any]:
        scene, at = self._server.scene, (goal.x_m, goal.y_m, 0.0)
        vertices, faces = flag_mesh()
        mesh = scene.add_mesh_simple(
            f"/goals/{key}",
            vertices,
            faces,
            color=colour,
            side="double",
            flat_shading=True,
            position=at,
        )
        label = scene.add_label(
            f"/goals/{key}/label", text, position=(0.0, 0.0, 1.05), anchor="bottom-center"
        )
        return [label, mesh]


def label_of(zone: Zone) -> str:
    """Return the name of a zone with its speed limit, or with a hollow circle where it is switched
    off; without words, because browsers of all languages share one scene."""
    if not zone.enabled:
        return f"○ {zone.name}"
    return zone.name if zone.max_speed_mps is None else f"{zone.name} ≤ {zone.max_speed_mps:g} m/s"


class ZoneLayer:
    """Area, outline and name of each zone."""

    name = "zones"
    period_s = 0.0

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: dict[str, Zone] = {}
        self._nodes: dict[str, list[Any]] = {}

    def push(self, scene: Scene) -> None:
        """Add, replace and remove zones."""
        wanted = {zone.id: zone for zone in scene.zones}
        with self._server.atomic():
            for key in [key for key, shown in self._shown.items() if wanted.get(key) != shown]:
                for node in self._nodes.pop(key):
                    node.remove()
                del self._shown[key]
            for key, zone in wanted.items():
                if key not in self._shown:
                    self._shown[key], self._nodes[key] = zone, self._add(zone)

    def _add(self, zone: Zone) -> list[Any]:
        scene, colour = (
            self._server.scene,
            palette.zone_colour(zone) if zone.enabled else palette.DRIVEN,
        )
        opacity = 0.35 if zone.enabled else 0.12
        corners = np.array(zone.polygon)
        base = f"/zones/{zone.id}"
        nodes = [
            scene.add_label(
                f"{base}/name",
                label_of(zone),
                position=(*corners.mean(axis=0), 0.25),
                anchor="bottom-center",
            ),
            scene.add_line_segments(
                f"{base}/outline",
                polyline_segments(closed_ring(corners), ZONE_Z + 0.02),
                colour,
                thickness=0.06,
            ),
        ]
        if not zone.forbids_outside:
            vertices, faces = triangulate(corners, ZONE_Z)
            area = scene.add_mesh_simple(
                base,
                vertices,
                faces,
                color=colour,
                opacity=opacity,
                side="double",
                cast_shadow=False,
            )
            nodes.append(area)
        return nodes
