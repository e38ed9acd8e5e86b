"""Kernels that draw triangles into an image: which triangle each pixel shows, and its colour.

All kernels are in one file, because numba notices a change of a file but not of those that it
imports from. Double precision and no reordering of sums: every machine draws the same image.

Sources: Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates" (1997), for
triangles that reach behind the camera; Williams, "Pyramidal parametrics" (1983), for textures.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested

NOTHING = -1
"""Triangle of a pixel that shows none, and texture of a triangle without one."""
EDGE_PX = 1e-9
"""By how much a triangle reaches over its edges, so that no gap is left between neighbours."""
AVERTED = 0.7
"""Share of the diffuse light on a surface that is turned away from the lamp."""
SMALLEST_M3 = 1e-12
"""Volume between camera and triangle below which the triangle is seen from its edge."""
F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
U8 = npt.NDArray[np.uint8]


@compiled
def rasterise(
    corners: F64,
    groups: I32,
    spheres: F64,
    T_camera_map: F64,
    lens: F64,
    reach_m: tuple[float, float],
    planes: F64,
    nearest: F32,
    shown: I32,
) -> None:
    """Find the nearest triangle of each pixel.

    `corners`: (N, 3, 3) in the map, counter-clockwise as seen from the front; the back is not
    drawn. `groups`: (G, 2) first triangle and the one after the last; `spheres`: (G, 4) centre
    and radius around each group, which is skipped when it is out of view. `reach_m`: near and far
    plane. `lens`: fx, fy, cx, cy in pixels, whose centres have whole coordinates. `nearest`:
    (H, W) 1/z, filled with that of the far plane. Writes `planes`, (N, 3, 3): the share of corner
    i at pixel (u, v), divided by z, is planes[t, i] · (u, v, 1); and `shown`, (H, W) triangles.
    """
    seen = np.empty((3, 3))
    for g in range(len(groups)):
        if _in_view(spheres[g], T_camera_map, lens, reach_m, shown.shape):
            for t in range(groups[g, 0], groups[g, 1]):
                _to_camera(corners[t], T_camera_map, seen)
                if _front_in_view(seen, lens, reach_m[0], shown.shape):
                    _draw(t, seen, lens, reach_m[0], planes[t], nearest, shown)


@nested
def _in_view(
    sphere: F64,
    T_camera_map: F64,
    lens: F64,
    reach_m: tuple[float, float],
    shape: tuple[int, int],
) -> bool:
    """Return whether any part of a sphere may be in the image."""
    fx, fy, cx, cy = lens
    x = _row(T_camera_map[0], sphere)
    y = _row(T_camera_map[1], sphere)
    z = _row(T_camera_map[2], sphere)
    radius = sphere[3]
    if z + radius < reach_m[0] or z - radius > reach_m[1]:
        return False
    left, right = cx + 0.5, shape[1] - cx - 0.5
    upper, lower = cy + 0.5, shape[0] - cy - 0.5
    return bool(
        fx * x + left * z > -radius * math.hypot(fx, left)
        and -fx * x + right * z > -radius * math.hypot(fx, right)
        and fy * y + upper * z > -radius * math.hypot(fy, upper)
        and -fy * y + lower * z > -radius * math.hypot(fy, lower)
    )


@nested
def _to_camera(corners: F64, T_camera_map: F64, seen: F64) -> None:
    """Write the (3, 3) corners in the camera frame."""
    for i in range(3):
        for k in range(3):
            seen[i, k] = _row(T_camera_map[k], corners[i])


@nested
def _row(row: F64, point: F64) -> float:
    """Return one coordinate of a transformed point."""
    return float(row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3])


@nested
def _front_in_view(seen: F64, lens: F64, near_m: float, shape: tuple[int, int]) -> bool:
    """Return whether the front of a triangle may be in the image."""
    if max(seen[0, 2], seen[1, 2], seen[2, 2]) <= near_m or _volume(seen) >= -SMALLEST_M3:
        return False
    fx, fy, cx, cy = lens
    left = right = up = down = True
    for i in range(3):
        x, y, z = fx * seen[i, 0], fy * seen[i, 1], seen[i, 2]
        left &= x + (cx + 0.5) * z < 0.0
        right &= x + (cx + 0.5 - shape[1]) * z > 0.0
        up &= y + (cy + 0.5) * z < 0.0
        down &= y + (cy + 0.5 - shape[0]) * z > 0.0
    return not (left or right or up or down)


@nested
def _volume(seen: F64) -> float:
    """Return six times the volume between camera and triangle, negative from the front."""
    a, b, c = seen
    return float(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


@nested
def _draw(
    t: int, seen: F64, lens: F64, near_m: float, planes: F64, nearest: F32, shown: I32
) -> None:
    """Draw one triangle, (3, 3) corners in the camera frame, where it is the nearest."""
    height, width = shown.shape
    fx, fy, cx, cy = lens
    volume = _volume(seen)
    for i in range(3):
        a, b = seen[(i + 1) % 3], seen[(i + 2) % 3]
        across = (a[1] * b[2] - a[2] * b[1]) / (volume * fx)
        along = (a[2] * b[0] - a[0] * b[2]) / (volume * fy)
        planes[i, 0], planes[i, 1] = across, along
        planes[i, 2] = (a[0] * b[1] - a[1] * b[0]) / volume - across * cx - along * cy
    reaches_near = min(seen[0, 2], seen[1, 2], seen[2, 2]) <= near_m
    top, bottom = 0, height - 1
    if not reaches_near:
        rows = (
            fy * seen[0, 1] / seen[0, 2] + cy,
            fy * seen[1, 1] / seen[1, 2] + cy,
            fy * seen[2, 1] / seen[2, 2] + cy,
        )
        top = max(top, math.ceil(min(rows) - EDGE_PX))
        bottom = min(bottom, math.floor(max(rows) + EDGE_PX))
    step = planes[0, 0] + planes[1, 0] + planes[2, 0]
    for v in range(top, bottom + 1):
        low, high, start = 0.0, width - 1.0, 0.0
        for i in range(3):  # the share of corner i is not negative
            offset = planes[i, 1] * v + planes[i, 2]
            start += offset
            low, high = _narrowed(low, high, planes[i, 0], offset)
        if reaches_near:  # 1/z is at most 1/near
            low, high = _narrowed(low, high, -step, 1.0 / near_m - start)
        if low > high:
            continue
        for u in range(math.ceil(low), math.floor(high) + 1):
            inverse = np.float32(start + step * u)
            if inverse > nearest[v, u]:
                nearest[v, u] = inverse
                shown[v, u] = t


@nested
def _narrowed(low: float, high: float, slope: float, offset: float) -> tuple[float, float]:
    """Return the part of an interval of u in which slope · u + offset is not negative."""
    if slope > 0.0:
        return max(low, -offset / slope - EDGE_PX), high
    if slope < 0.0:
        return low, min(high, -offset / slope + EDGE_PX)
    return low, high if offset >= 0.0 else -1.0


@compiled
def shade(
    shown: I32,
    nearest: F32,
    planes: F64,
    normals: F32,
    flat: npt.NDArray[np.bool_],
    colours: F32,
    texture_of: I32,
    coordinates: F32,
    levels: I32,
    texels: U8,
    light: F64,
    sky: F64,
    rgb: U8,
    depth_m: F32,
) -> None:
    """Write (H, W, 3) colours and (H, W) depth in metres of the triangles that are shown.

    `normals`: (N, 3, 3) unit normals of the corners in the map; `flat`: whether all three are the
    same. `colours`: (N, 3), 0 to 255. `coordinates`: (N, 3, 2) texture coordinates of the corners,
    (0, 0) at the lower left; textures repeat. `levels`: (textures, levels, 3) with first texel,
    width and height of each level of a texture, 0 where it has no more; `texels`: (texels, 3).
    `light`: unit direction to the lamp, then ambient and diffuse share.
    """
    height, width = shown.shape
    for v in range(height):
        for u in range(width):
            t = shown[v, u]
            depth_m[v, u] = 1.0 / nearest[v, u]
            if t < 0:
                for k in range(3):
                    rgb[v, u, k] = np.uint8(sky[k])
                continue
            a = planes[t, 0, 0] * u + planes[t, 0, 1] * v + planes[t, 0, 2]
            b = planes[t, 1, 0] * u + planes[t, 1, 1] * v + planes[t, 1, 2]
            c = planes[t, 2, 0] * u + planes[t, 2, 1] * v + planes[t, 2, 2]
            z = 1.0 / (a + b + c)
            a, b, c = a * z, b * z, c * z
            nx, ny, nz = normals[t, 0, 0], normals[t, 0, 1], normals[t, 0, 2]
            if not flat[t]:
                nx = a * nx + b * normals[t, 1, 0] + c * normals[t, 2, 0]
                ny = a * ny + b * normals[t, 1, 1] + c * normals[t, 2, 1]
                nz = a * nz + b * normals[t, 1, 2] + c * normals[t, 2, 2]
            toward = (nx * light[0] + ny * light[1] + nz * light[2]) / math.sqrt(
                nx * nx + ny * ny + nz * nz
            )
            tone = brightness(toward, light[3], light[4])
            red, green, blue = tone * colours[t, 0], tone * colours[t, 1], tone * colours[t, 2]
            texture = texture_of[t]
            if texture >= 0:
                s = a * coordinates[t, 0, 0] + b * coordinates[t, 1, 0] + c * coordinates[t, 2, 0]
                r = a * coordinates[t, 0, 1] + b * coordinates[t, 1, 1] + c * coordinates[t, 2, 1]
                level = _level(planes[t], coordinates[t], s, r, z, levels[texture, 0])
                fine = int(level)
                share = level - fine
                if levels[texture, min(fine + 1, levels.shape[1] - 1), 1] == 0:
                    share = 0.0
                weight = (1.0 - share) / 255.0
                red_f, green_f, blue_f = _bilinear(levels[texture, fine], texels, s, r)
                if share > 0.0:
                    red_c, green_c, blue_c = _bilinear(levels[texture, fine + 1], texels, s, r)
                    share /= 255.0
                    red *= weight * red_f + share * red_c
                    green *= weight * green_f + share * green_c
                    blue *= weight * blue_f + share * blue_c
                else:
                    red, green, blue = (
                        red * weight * red_f,
                        green * weight * green_f,
                        blue * weight * blue_f,
                    )
            rgb[v, u, 0] = np.uint8(min(255.0, red) + 0.5)
            rgb[v, u, 1] = np.uint8(min(255.0, green) + 0.5)
            rgb[v, u, 2] = np.uint8(min(255.0, blue) + 0.5)


@nested
def brightness(toward: float, ambient: float, diffuse: float) -> float:
    """Return the factor of a colour. `toward`: cosine between normal and lamp; half-Lambert, and
    darker where the surface is turned away."""
    share = 0.5 + 0.5 * toward
    return ambient + diffuse * (share if share >= 0.5 else AVERTED * share)


@nested
def _level(planes: F64, coordinates: F32, s: float, r: float, z: float, finest: I32) -> float:
    """Return the level of a texture at which one texel is as large as the pixel, 0 the finest."""
    across = along = 0.0
    for axis in range(2):
        slope_s = slope_r = slope = 0.0
        for i in range(3):
            slope += planes[i, axis]
            slope_s += planes[i, axis] * coordinates[i, 0]
            slope_r += planes[i, axis] * coordinates[i, 1]
        ds = (slope_s - s * slope) * z * finest[1]
        dr = (slope_r - r * slope) * z * finest[2]
        square = ds * ds + dr * dr
        if axis == 0:
            across = square
        else:
            along = square
    larger = max(across, along)
    if larger <= 1.0:
        return 0.0
    deepest = math.floor(math.log2(max(finest[1], finest[2])))
    return min(0.5 * math.log2(larger), float(deepest))


@nested
def _bilinear(level: I32, texels: U8, s: float, r: float) -> tuple[float, float, float]:
    """Return red, green and blue, 0 to 255, at texture coordinates, between the four texels
    around."""
    first, width, height = level
    x, y = (s - math.floor(s)) * width - 0.5, (math.floor(r) + 1.0 - r) * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    # From −1 to the last column or row; the texture repeats.
    left, upper = int(x0), int(y0)
    right = left + 1 if left < width - 1 else 0
    lower = upper + 1 if upper < height - 1 else 0
    left = left if left >= 0 else width - 1
    upper = first + width * (upper if upper >= 0 else height - 1)
    lower = first + width * lower
    w00, w01, w10, w11 = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
    a, b, c, d = upper + left, upper + right, lower + left, lower + right
    return (
        w00 * texels[a, 0] + w01 * texels[b, 0] + w10 * texels[c, 0] + w11 * texels[d, 0],
        w00 * texels[a, 1] + w01 * texels[b, 1] + w10 * texels[c, 1] + w11 * texels[d, 1],
        w00 * texels[a, 2] + w01 * texels[b, 2] + w10 * texels[c, 2] + w11 * texels[d, 2],
    )
