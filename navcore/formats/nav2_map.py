"""Nav2 maps: a YAML file that describes the pixels of an image beside it.

Row 0 of the image is the top of the map, its largest y; grids of this project begin at the smallest
y. Pixels keep their values, so that a map is written as it was read.
"""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from pathlib import Path

import numpy as np
import numpy.typing as npt
import yaml

from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.formats.map_image import MAX_BYTES, MapImage, decode
from navcore.grid.grid import BoolGrid, GridSpec

OCCUPIED_PIXEL, FREE_PIXEL, UNKNOWN_PIXEL = 0, 254, 205
"""Pixel values of maps that are written here, those of Nav2's map saver."""
_LARGEST_YAML = 1 << 16
"""Largest YAML file that is read, in bytes."""


class Mode(StrEnum):
    """Conversion of a pixel's shade to the occupancy of a cell."""

    TRINARY = "trinary"
    """Dark pixels are occupied; opacity, if there is any, counts as a fourth colour."""
    SCALE = "scale"
    """Dark pixels are occupied; pixels that are not opaque are unknown."""
    RAW = "raw"
    """The value of a pixel, 0 to 100 of 255, is the occupancy in per cent, and larger ones are
    unknown; `negate` is ignored."""


class State(IntEnum):
    """Occupancy state of a cell."""

    FREE = 0
    """Occupancy below `free_thresh`."""
    OCCUPIED = 1
    """Occupancy above `occupied_thresh`."""
    UNKNOWN = 2
    """Occupancy between the thresholds, or not given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """Contents of the YAML file, except for the name of the image."""

    resolution_m: float
    """Side of a pixel in metres."""
    origin_x_m: float
    """x in metres of the lower-left corner of the lower-left pixel."""
    origin_y_m: float
    """y in metres of the lower-left corner of the lower-left pixel."""
    mode: Mode = Mode.TRINARY
    """Conversion of shades to occupancy."""
    negate: bool = False
    """Whether bright pixels, instead of dark ones, are occupied."""
    occupied_thresh: float = 0.65
    """Occupancy, 0 to 1, above which a cell is occupied."""
    free_thresh: float = 0.196
    """Occupancy, 0 to 1, below which a cell is free; a pixel of 205 has 0.19608 and is unknown."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nav2Map:
    """Map as it is stored."""

    description: Description
    """Description of the pixels."""
    image: MapImage
    """Pixels, row 0 at the top."""

    @property
    def spec(self) -> GridSpec:
        """Size and position of the map's grid, one cell a pixel."""
        rows, cols = self.image.pixels.shape[:2]
        about = self.description
        return GridSpec(
            resolution_m=about.resolution_m,
            rows=rows,
            cols=cols,
            origin_x_m=about.origin_x_m,
            origin_y_m=about.origin_y_m,
        )

    def states(self) -> npt.NDArray[np.uint8]:
        """Return the (rows, cols) `State` of every cell, row 0 at the smallest y."""
        return np.ascontiguousarray(_states(self.image, self.description)[::-1])

    def cells(self, state: State) -> BoolGrid:
        """Return the (rows, cols) cells in one state, row 0 at the smallest y."""
        return np.equal(self.states(), state)


def map_from_cells(*, occupied: BoolGrid, known: BoolGrid, spec: GridSpec) -> Nav2Map:
    """Return a map of (rows, cols) cells, row 0 at the smallest y; occupied cells need not be
    known."""
    pixels = np.where(known, np.uint8(FREE_PIXEL), np.uint8(UNKNOWN_PIXEL))
    pixels[occupied] = OCCUPIED_PIXEL
    return Nav2Map(
        description=description_of(spec),
        image=MapImage(pixels=np.ascontiguousarray(pixels[::-1]), white=255),
    )


def description_of(spec: GridSpec) -> Description:
    """Return the description of a map that is made here."""
    return Description(
        resolution_m=spec.resolution_m, origin_x_m=spec.origin_x_m, origin_y_m=spec.origin_y_m
    )


def load(path: Path) -> Nav2Map:
    """Return the map of a YAML file and its image; raises `BadConfiguration` with the invalid key.

    The image must be in the folder of the YAML file or below: a map from elsewhere must not make
    the program read other files.
    """
    entries = _entries(read_whole(path, at_most=_LARGEST_YAML), path.name)
    description = _description(entries, path.name)
    image_path = _image_path(entries, path)
    data = read_whole(image_path, at_most=MAX_BYTES)
    return Nav2Map(description=description, image=decode(data, str(image_path)))


def image_of(path: Path) -> Path:
    """Return the path of the image of a map's YAML file; raises as `load`."""
    return _image_path(_entries(read_whole(path, at_most=_LARGEST_YAML), path.name), path)


def read(text: bytes, image: bytes, where: str) -> Nav2Map:
    """Return the map of the contents of a YAML file and its image; the name of the image is
    ignored."""
    if len(text) > _LARGEST_YAML or len(image) > MAX_BYTES:
        raise BadConfiguration(f"{where}: larger than a map may be")
    description = _description(_entries(text, f"{where}.yaml"), f"{where}.yaml")
    return Nav2Map(description=description, image=decode(image, f"{where}.picture"))


def yaml_text(description: Description, image: str) -> str:
    """Return the YAML file that describes the image file `image`."""
    name = (
        image if re.fullmatch(r"[A-Za-z][\w-]*\.(pgm|png)", image, re.ASCII) else json.dumps(image)
    )
    x, y = _written(description.origin_x_m), _written(description.origin_y_m)
    return (
        f"image: {name}\nmode: {description.mode}\nresolution: "
        f"{_written(description.resolution_m)}\n"
        f"origin: [{x}, {y}, 0.0]\nnegate: {description.negate:d}\n"
        f"occupied_thresh: {_written(description.occupied_thresh)}\nfree_thresh: "
        f"{_written(description.free_thresh)}\n"
    )


def _written(number: float) -> str:
    """Return a text that reads as the same number; YAML 1.1 takes 1e-05 for text, but 1.0e-05 for a
    number."""
    text = repr(float(number))
    return text if "." in text else text.replace("e", ".0e")


def _states(image: MapImage, description: Description) -> npt.NDArray[np.uint8]:
    """Return (rows, cols) states, row 0 at the top, from a table with an entry for each sum of a
    pixel's channels."""
    pixels, mode = image.pixels, description.mode
    if pixels.ndim == 2:
        grey: npt.NDArray[np.uint8] = _table(image.white, 1, description)[pixels]
        return grey
    channels = pixels.shape[2] if mode is Mode.TRINARY else 3
    sums = pixels[..., :channels].sum(axis=2, dtype=np.int32)
    states: npt.NDArray[np.uint8] = _table(image.white, channels, description)[sums]
    if mode is Mode.SCALE and pixels.shape[2] == 4:
        states[pixels[..., 3] != image.white] = State.UNKNOWN
    return states


def _table(white: int, channels: int, description: Description) -> npt.NDArray[np.uint8]:
    shade = np.arange(white * channels + 1) / (white * channels)
    occupancy = shade if description.negate else 1.0 - shade
    known = np.ones_like(shade, dtype=np.bool_)
    if description.mode is Mode.RAW:
        percent = np.floor(shade * 255 + 0.5)
        occupancy, known = percent / 100, percent <= 100
    table = np.full(len(shade), State.UNKNOWN, dtype=np.uint8)
    table[known & (occupancy > description.occupied_thresh)] = State.OCCUPIED
    table[known & (occupancy < description.free_thresh)] = State.FREE
    return table


_KEYS = ("image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


def _entries(text: bytes, where: str) -> dict[str, yaml.Node]:
    """Return the keys with their unparsed values: Nav2 too reads text as a number where it needs
    one."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise BadConfiguration(
            f"{where}: not readable as YAML: {' '.join(str(error).split()):.300}"
        ) from None
    if not isinstance(root, yaml.MappingNode):
        raise BadConfiguration(f"{where}: expected keys and values, e.g. resolution: 0.05")
    entries: dict[str, yaml.Node] = {}
    for key, value in root.value:
        name = key.value if isinstance(key, yaml.ScalarNode) else "(a list or table)"
        if name not in _KEYS:
            raise BadConfiguration(
                f"{where}: unknown key {name!r:.60}; known keys: {', '.join(_KEYS)}"
            )
        if name in entries:
            raise BadConfiguration(f"{where}.{name}: given twice")
        entries[name] = value
    for name in _KEYS:
        if name not in entries and name != "mode":
            raise BadConfiguration(f"{where}: key {name!r} is missing")
    return entries


def _description(entries: dict[str, yaml.Node], where: str) -> Description:
    x_m, y_m, yaw_rad = _origin(entries["origin"], f"{where}.origin")
    if yaw_rad != 0:
        raise BadConfiguration(
            f"{where}.origin[2]: a yaw of {yaw_rad:g} rad is not supported, expected 0; rotate "
            "the image"
        )
    made = Description(
        resolution_m=_number(entries["resolution"], f"{where}.resolution", 1e-3, 100.0),
        origin_x_m=x_m,
        origin_y_m=y_m,
        mode=Mode(_word(entries["mode"], f"{where}.mode", tuple(Mode)))
        if "mode" in entries
        else Mode.TRINARY,
        negate=_word(entries["negate"], f"{where}.negate", ("0", "1", "false", "true"))
        in ("1", "true"),
        occupied_thresh=_number(entries["occupied_thresh"], f"{where}.occupied_thresh", 0.0, 1.0),
        free_thresh=_number(entries["free_thresh"], f"{where}.free_thresh", 0.0, 1.0),
    )
    if made.free_thresh >= made.occupied_thresh:
        raise BadConfiguration(
            f"{where}.free_thresh: {made.free_thresh:g} must be below occupied_thresh, "
            f"{made.occupied_thresh:g}"
        )
    return made


def _origin(node: yaml.Node, where: str) -> tuple[float, float, float]:
    if not isinstance(node, yaml.SequenceNode) or len(node.value) != 3:
        raise BadConfiguration(
            f"{where}: expected [x, y, yaw] in metres and radians, e.g. [-10.0, -5.0, 0.0]"
        )
    x_m, y_m, yaw_rad = (
        _number(part, f"{where}[{at}]", -1e6, 1e6) for at, part in enumerate(node.value)
    )
    return x_m, y_m, yaw_rad


def _image_path(entries: dict[str, yaml.Node], path: Path) -> Path:
    where, name = f"{path.name}.image", _text(entries["image"], f"{path.name}.image")
    if not name or "\0" in name:
        raise BadConfiguration(f"{where}: expected the name of a PGM or PNG file")
    folder = Path(os.path.abspath(path.parent))  # noqa: PTH100 - links are followed, dots are not
    image_path = Path(os.path.abspath(folder / name))  # noqa: PTH100
    if not image_path.is_relative_to(folder):
        raise BadConfiguration(
            f"{where}: {name!r:.200} is outside the map's folder; put the image beside the "
            "YAML file"
        )
    return image_path


def _text(node: yaml.Node, where: str) -> str:
    if not isinstance(node, yaml.ScalarNode):
        raise BadConfiguration(f"{where}: expected one value, got a list or a table")
    return str(node.value)


def _word(node: yaml.Node, where: str, allowed: tuple[str, ...]) -> str:
    text = _text(node, where).lower()
    if text not in allowed:
        raise BadConfiguration(f"{where}: expected one of {', '.join(allowed)}, got {text!r:.60}")
    return text


def _number(node: yaml.Node, where: str, low: float, high: float) -> float:
    text = _text(node, where)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if "_" in text or not math.isfinite(value):
        raise BadConfiguration(f"{where}: expected a number, got {text!r:.60}")
    if not low <= value <= high:
        raise BadConfiguration(f"{where}: {value:g} is out of range, allowed {low:g} to {high:g}")
    return value
