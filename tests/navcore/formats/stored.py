"""Nav2 maps on disk for tests: the console hands them out in archives."""

from __future__ import annotations

from pathlib import Path

from navcore.formats.map_image import encode
from navcore.formats.nav2_map import Nav2Map, yaml_text


def save(nav2_map: Nav2Map, path: Path) -> Path:
    """Write the YAML file and the image beside it; return the path of the image."""
    image_path = path.with_suffix(nav2_map.image.suffix)
    image_path.write_bytes(encode(nav2_map.image))
    path.write_text(yaml_text(nav2_map.description, image_path.name))
    return image_path
