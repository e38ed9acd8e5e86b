"""Nav2 maps: the meaning of pixels, nothing lost in reading and writing, and errors by name."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from navcore.errors import BadConfiguration
from navcore.formats.map_image import MapImage, decode, encode
from navcore.formats.nav2_map import (
    Description,
    Mode,
    Nav2Map,
    State,
    load,
    map_from_cells,
    yaml_text,
)
from navcore.grid.grid import GridSpec
from tests.navcore.formats.stored import save
from tests.navcore.laws import law
from tests.navcore.planning.test_planner import map_data

GOOD = {
    "image": "hall.pgm",
    "mode": "trinary",
    "resolution": "0.05",
    "origin": "[-1.5, 2.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
PIXELS = b"P5\n3 2\n255\n" + bytes([0, 205, 254, 254, 254, 0])


def written(
    folder: Path, changes: Mapping[str, str | None] | None = None, *, pixels: bytes = PIXELS
) -> Path:
    """Write the two files of a map; a key that is changed to None is left out."""
    values = {key: value for key, value in {**GOOD, **(changes or {})}.items() if value is not None}
    (folder / "hall.pgm").write_bytes(pixels)
    path = folder / "hall.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in values.items()))
    return path


def test_the_top_row_of_the_image_is_the_largest_y(tmp_path: Path) -> None:
    nav2_map = load(written(tmp_path))
    assert nav2_map.spec == GridSpec(
        resolution_m=0.05, rows=2, cols=3, origin_x_m=-1.5, origin_y_m=2.0
    )
    assert nav2_map.states().tolist() == [[0, 0, 1], [1, 2, 0]]
    assert nav2_map.cells(State.OCCUPIED)[nav2_map.spec.cell(-1.49, 2.09)]
    assert nav2_map.cells(State.OCCUPIED)[nav2_map.spec.cell(-1.36, 2.01)]
    assert nav2_map.cells(State.UNKNOWN)[nav2_map.spec.cell(-1.42, 2.09)]


@pytest.mark.parametrize(
    ("changes", "states"),
    [
        ({}, [[1, 1, 2, 2, 0, 0]]),
        ({"mode": None}, [[1, 1, 2, 2, 0, 0]]),
        ({"negate": "true"}, [[0, 2, 2, 1, 1, 1]]),
        ({"mode": "scale"}, [[1, 1, 2, 2, 0, 0]]),
        ({"mode": "raw"}, [[0, 1, 1, 2, 2, 2]]),
        ({"mode": "raw", "negate": "1"}, [[0, 1, 1, 2, 2, 2]]),
        ({"free_thresh": "0.25"}, [[1, 1, 2, 0, 0, 0]]),
        ({"occupied_thresh": "6.55e-1"}, [[1, 1, 2, 2, 0, 0]]),
    ],
)
def test_the_mode_and_the_thresholds_decide_what_a_shade_means(
    tmp_path: Path, changes: dict[str, str | None], states: list[list[int]]
) -> None:
    """In raw mode 0 to 100 are per cent: 0 is free, 66 and 100 are above 65 %, the others are no
    percentage."""
    image = b"P5\n6 1\n255\n" + bytes([0, 66, 100, 205, 206, 255])
    assert load(written(tmp_path, changes, pixels=image)).states().tolist() == states


def test_opacity_counts_as_a_colour_in_trinary_and_makes_unknown_in_scale() -> None:
    pixels = np.array(
        [[[0, 0, 0, 255], [0, 0, 0, 0], [255, 255, 255, 255], [255, 255, 255, 0]]], dtype=np.uint8
    )

    def states(mode: Mode) -> list[int]:
        about = Description(resolution_m=1.0, origin_x_m=0.0, origin_y_m=0.0, mode=mode)
        return [
            int(state)
            for state in Nav2Map(
                description=about, image=MapImage(pixels=pixels, white=255)
            ).states()[0]
        ]

    assert states(Mode.TRINARY) == [State.OCCUPIED, State.OCCUPIED, State.FREE, State.UNKNOWN]
    assert states(Mode.SCALE) == [State.OCCUPIED, State.UNKNOWN, State.FREE, State.UNKNOWN]


@st.composite
def images(draw: st.DrawFn) -> MapImage:
    shape: tuple[int, ...] = (draw(st.integers(1, 6)), draw(st.integers(1, 6)))
    white = draw(st.sampled_from([1, 100, 255, 256, 1000, 65535]))
    channels = draw(st.sampled_from([1, 3, 4]))
    if channels > 1:
        shape, white = (*shape, channels), 65535 if white > 255 else 255
    values = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).integers(0, white + 1, shape)
    return MapImage(
        pixels=values.astype(np.uint8) if white < 256 else values.astype(np.uint16), white=white
    )


@st.composite
def maps(draw: st.DrawFn) -> Nav2Map:
    free = draw(st.floats(0, 0.999))
    about = Description(
        resolution_m=draw(st.floats(1e-3, 100.0)),
        origin_x_m=draw(st.floats(-1e6, 1e6)),
        origin_y_m=draw(st.floats(-1e6, 1e6)),
        mode=draw(st.sampled_from(Mode)),
        negate=draw(st.booleans()),
        occupied_thresh=draw(st.floats(free, 1.0, exclude_min=True)),
        free_thresh=free,
    )
    return Nav2Map(description=about, image=draw(images()))


@law(40)
@given(maps())
def test_a_map_comes_back_as_it_went_out_number_by_number_and_pixel_by_pixel(
    tmp_path_factory: pytest.TempPathFactory, nav2_map: Nav2Map
) -> None:
    folder = tmp_path_factory.mktemp("maps")
    picture = save(nav2_map, folder / "a map: 1.yaml")
    again = load(folder / "a map: 1.yaml")
    assert again.description == nav2_map.description
    assert (again.image.white, again.image.pixels.dtype) == (
        nav2_map.image.white,
        nav2_map.image.pixels.dtype,
    )
    np.testing.assert_array_equal(again.image.pixels, nav2_map.image.pixels)
    np.testing.assert_array_equal(again.states(), nav2_map.states())
    text, data = (folder / "a map: 1.yaml").read_bytes(), picture.read_bytes()
    save(again, folder / "a map: 1.yaml")
    assert ((folder / "a map: 1.yaml").read_bytes(), picture.read_bytes()) == (text, data)


@law(60)
@given(
    st.builds(
        Description,
        resolution_m=st.floats(1e-3, 100),
        origin_x_m=st.floats(-1e6, 1e6),
        origin_y_m=st.floats(-1e6, 1e6),
    )
)
def test_what_is_written_is_numbers_to_other_readers_of_yaml_too(about: Description) -> None:
    assert yaml.safe_load(yaml_text(about, "on")) == {
        "image": "on",
        "mode": "trinary",
        "resolution": about.resolution_m,
        "origin": [about.origin_x_m, about.origin_y_m, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }


@law(60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_a_drawn_map_gives_every_cell_the_state_it_was_drawn_with(
    seed: int, rows: int, cols: int
) -> None:
    rng, spec = (
        np.random.default_rng(seed),
        GridSpec(resolution_m=0.1, rows=rows, cols=cols, origin_x_m=-3, origin_y_m=1.5),
    )
    occupied, known = rng.random((2, rows, cols)) < 0.5
    made = map_from_cells(occupied=occupied, known=known, spec=spec)
    assert made.spec == spec
    np.testing.assert_array_equal(made.cells(State.OCCUPIED), occupied)
    np.testing.assert_array_equal(made.cells(State.FREE), known & ~occupied)
    np.testing.assert_array_equal(made.cells(State.UNKNOWN), ~known & ~occupied)


def test_a_plain_pgm_with_comments_is_the_same_image_as_a_binary_one() -> None:
    plain = b"P2 # made by hand\n#\n3\t2\n# white:\n255\n0 205 254 # first row\n254 254\n0\n"
    np.testing.assert_array_equal(decode(plain, "plain").pixels, decode(PIXELS, "binary").pixels)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"image": None}, "key 'image' is missing"),
        ({"origin": None}, "key 'origin' is missing"),
        ({"free_tresh": "0.2"}, "unknown key 'free_tresh'"),
        ({"image": "other.pgm"}, "other.pgm: no such file"),
        ({"image": "/etc/passwd"}, "outside the map's folder"),
        ({"image": "../hall.pgm"}, "outside the map's folder"),
        ({"image": "sub/../../hall.pgm"}, "outside the map's folder"),
        ({"image": "."}, "not a regular file"),
        ({"image": "''"}, "hall.yaml.image: expected the name"),
        ({"image": "[a]"}, "hall.yaml.image: expected one value"),
        ({"image": "hall.yaml"}, "neither PGM (P2 or P5) nor PNG"),
        ({"mode": "colour"}, "hall.yaml.mode: expected one of trinary, scale, raw, got 'colour'"),
        ({"resolution": "fine"}, "hall.yaml.resolution: expected a number, got 'fine'"),
        ({"resolution": "0"}, "hall.yaml.resolution: 0 is out of range"),
        ({"resolution": ".nan"}, "hall.yaml.resolution: expected a number"),
        ({"resolution": "nan"}, "hall.yaml.resolution: expected a number"),
        ({"resolution": "{a: 1}"}, "hall.yaml.resolution: expected one value"),
        ({"origin": "[0, 0]"}, "hall.yaml.origin: expected [x, y, yaw]"),
        ({"origin": "0"}, "hall.yaml.origin: expected [x, y, yaw]"),
        ({"origin": "[0, inf, 0]"}, "hall.yaml.origin[1]: expected a number"),
        ({"origin": "[0, 1e9, 0]"}, "hall.yaml.origin[1]: 1e+09 is out of range"),
        ({"origin": "[0, 0, 0.1]"}, "a yaw of 0.1 rad is not supported, expected 0"),
        ({"negate": "2"}, "hall.yaml.negate: expected one of 0, 1, false, true"),
        ({"occupied_thresh": "65"}, "hall.yaml.occupied_thresh: 65 is out of range"),
        ({"free_thresh": "0.7"}, "hall.yaml.free_thresh: 0.7 must be below occupied_thresh"),
        ({"resolution": "0.05\nresolution: 0.1"}, "hall.yaml.resolution: given twice"),
        ({"resolution": "[" * 5000}, "not readable as YAML"),
        (
            {"resolution": "!!python/object/apply:os.getcwd []"},
            "hall.yaml.resolution: expected one value",
        ),
        ({"resolution": "0.05\n? [a, b]\n: 1"}, "unknown key '(a list or table)'"),
    ],
)
def test_a_field_that_is_wrong_is_refused_by_name(
    tmp_path: Path, changes: dict[str, str | None], words: str
) -> None:
    with pytest.raises(BadConfiguration) as refusal:
        load(written(tmp_path, changes))
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 500


def test_an_image_below_the_folder_or_with_an_absolute_path_is_read(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "deep.pgm").write_bytes(PIXELS)
    for name in ("sub/deep.pgm", "./sub/../sub/deep.pgm", str(tmp_path / "sub" / "deep.pgm")):
        assert load(written(tmp_path, {"image": name})).spec.rows == 2


@pytest.mark.parametrize(
    "text", [b"", b"a", b"- 1", b"\xff\xfe", b"a: b: c", b"&a [*a]", b"x" * (1 << 17)]
)
def test_a_file_that_is_no_yaml_of_a_map_is_refused(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "m.yaml").write_bytes(text)
    with pytest.raises(BadConfiguration, match=r"m\.yaml"):
        load(tmp_path / "m.yaml")


def png(rows: int, cols: int) -> bytes:
    """Return a valid PNG that declares a size and has no pixels."""
    head, parts = struct.pack(">IIBBBBB", cols, rows, 8, 0, 0, 0, 0), []
    for kind, body in ((b"IHDR", head), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")):
        parts.append(
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"P5\n3 2\n255\n12345", "expected 6 bytes of pixels, got 5"),
        (b"P5\n3 2\n255\n1234567", "expected 6 bytes of pixels, got 7"),
        (b"P5\n3 2\n70000\n123456", "the value of white is 70000"),
        (b"P5\n3 2\n0\n123456", "the value of white is 0"),
        (b"P5\n3 2\n100\nzzzzzz", "a pixel has the value 122, white is 100"),
        (b"P5\n0 2\n255\n", "0 × 2 pixels"),
        (b"P5\n60000 60000\n255\n", "60000 × 60000 pixels"),
        (b"P5\n3 -2\n255\n123456", "the PGM header is invalid"),
        (b"P5", "the PGM header is invalid"),
        (b"P2\n2 1\n255\n1 2 3", "expected 2 pixels, got 3"),
        (b"P2\n2 1\n255\n1 x", "numbers only"),
        (b"P2\n2 1\n255\n1 99999999999999999999999", "white is 255"),
        (b"P6\n1 1\n255\n123", "neither PGM"),
        (png(40_000, 40_000), "40000 × 40000 pixels"),
        (png(40, 40), "the PNG cannot be read"),
        (png(2, 2)[:-1], "the PNG is truncated"),
        (png(2, 2)[:20], "the PNG is truncated"),
        (png(2, 2).replace(b"IDAT", b"IDAX"), "the PNG is damaged"),
    ],
)
def test_a_truncated_damaged_or_huge_image_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(BadConfiguration) as refusal:
        decode(data, "hall.pgm")
    assert words in str(refusal.value)


@law(150)
@given(
    st.sampled_from(
        [encode(MapImage(pixels=np.arange(48, dtype=np.uint8).reshape(4, 4, 3), white=255)), PIXELS]
    ),
    st.data(),
)
def test_a_damaged_image_is_decoded_or_refused_and_nothing_else(
    whole: bytes, data: st.DataObject
) -> None:
    bent = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        bent[data.draw(st.integers(0, len(bent) - 1))] = data.draw(st.integers(0, 255))
    try:
        decode(bytes(bent[: data.draw(st.integers(0, len(bent)))]), "bent")
    except BadConfiguration:
        return


def test_grey_images_of_few_bits_and_16_bits_are_read_as_opencv_writes_them() -> None:
    deep = np.array([[0, 65535], [40000, 1]], dtype=np.uint16)
    assert decode(cv2.imencode(".png", deep)[1].tobytes(), "deep").pixels.tolist() == deep.tolist()
    one_bit = cv2.imencode(
        ".png", np.array([[0, 255]], dtype=np.uint8), [cv2.IMWRITE_PNG_BILEVEL, 1]
    )[1].tobytes()
    assert decode(one_bit, "bits").pixels.tolist() == [[0, 255]]


@pytest.mark.parametrize(("name", "inflated_by_m"), [("tb3_sandbox", 0.15), ("warehouse", 0.25)])
def test_the_cells_of_published_robot_maps_are_where_their_queries_say(
    name: str, inflated_by_m: float
) -> None:
    """The grids of the queries are our cells, unknown ones included, inflated by a distance, except
    for 23 cells of the warehouse."""
    nav2_map = load(map_data("ros", f"{name}.yaml"))
    with np.load(map_data("ros", f"{name}_queries.npz")) as stored:
        rows, cols = (int(side) for side in stored["shape"])
        free = np.unpackbits(stored["free"], axis=1)[:rows, :cols].astype(np.bool_)
    distance_m = distance_transform_edt(nav2_map.cells(State.FREE)) * nav2_map.spec.resolution_m
    grown = distance_m >= inflated_by_m - 1e-9
    assert (free[::-1] != grown).mean() < 2e-5
    assert (free != grown).mean() > 1e-3  # control: upside down they differ
