"""Layers and colours that one client of the 3D view shows: each operator has their own."""

from __future__ import annotations

from collections.abc import Mapping

import viser

from web.viewer.messages import CLOUD_COLOURS, LAYERS, DisplayOptions


class ClientDisplay:
    """Frames of one client that cover the common ones of the same names, and are hidden alone."""

    def __init__(self, client: viser.ClientHandle) -> None:
        with client.atomic():
            self._frames: Mapping[str, viser.FrameHandle] = {
                name: client.scene.add_frame(f"/{name}", show_axes=False)
                for name in (*LAYERS, *map(cloud_node, CLOUD_COLOURS))
            }

    def show(self, options: DisplayOptions) -> None:
        """Hide and show the layers."""
        hidden = {*options.hidden, *map(cloud_node, CLOUD_COLOURS)} - {
            cloud_node(options.cloud_colour)
        }
        for name, frame in self._frames.items():
            frame.visible = name not in hidden


def cloud_node(colour: str) -> str:
    """Return the name of the node with the points in one kind of colours."""
    return f"cloud/{colour}"
