"""Agreement of a map with reference voxels.

A reference is an `.npz` of `state` (X, Y, Z) uint8 (0 unknown, 1 free, 2 occupied), `origin` (3,)
and `voxel_size`, metres of a recording's world frame, which need not be level. Unknown voxels
cannot judge a cell: such cells are left out and counted.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.geometry.transform import Matrix, invert, transform_points
from navcore.grid.grid import BoolGrid, GridSpec

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
MAX_FILE_BYTES = 1 << 28
MAX_VOXELS = 1 << 28
PARTS = ("state", "origin", "voxel_size")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """Voxels in the recording's world frame."""

    state: npt.NDArray[np.uint8]
    """(X, Y, Z) states: `UNKNOWN`, `FREE` or `OCCUPIED`."""
    origin_m: npt.NDArray[np.float64]
    """(3,) lower corner of voxel (0, 0, 0), world frame."""
    voxel_m: float
    """Side length of a voxel."""

    def at(self, points_world: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """Return the states (N,) at world points (N, 3); `UNKNOWN` outside."""
        voxels = np.floor((points_world - self.origin_m) / self.voxel_m).astype(np.int64)
        inside = ((voxels >= 0) & (voxels < self.state.shape)).all(axis=1)
        state = np.zeros(len(voxels), dtype=np.uint8)
        state[inside] = self.state[tuple(voxels[inside].T)]
        return state


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Agreement of a map's occupied cells with a reference, where the reference is known."""

    iou: float
    """Intersection over union of the occupied cells."""
    precision_near: float
    """Share of the map's occupied cells with an occupied reference cell at most one cell away."""
    recall_near: float
    """Share of the reference's occupied cells with an occupied map cell at most one cell away."""
    judged: int
    """Number of occupied map cells where the reference is known."""
    reference: int
    """Number of occupied cells of the reference."""
    not_judged: int
    """Number of occupied map cells where the reference is unknown."""


def load_reference(path: Path) -> Reference:
    """Load the voxels of a file; raises `BadConfiguration` if it is damaged, too large or no
    reference."""
    try:
        with zipfile.ZipFile(io.BytesIO(read_whole(path, at_most=MAX_FILE_BYTES))) as packed:
            sizes = {entry.filename: entry.file_size for entry in packed.infolist()}
            if missing := [name for name in PARTS if f"{name}.npy" not in sizes]:
                raise BadConfiguration(f"{path}: no reference, it lacks {', '.join(missing)}")
            if max(sizes[f"{name}.npy"] for name in PARTS) > MAX_VOXELS:
                raise BadConfiguration(
                    f"{path}: more than the {MAX_VOXELS} voxels that are read at most"
                )
            state, origin, voxel = (
                np.lib.format.read_array(io.BytesIO(packed.read(f"{name}.npy")), allow_pickle=False)
                for name in PARTS
            )
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        KeyError,
        ValueError,
        RuntimeError,
        OSError,
    ) as error:
        raise BadConfiguration(f"{path}: no reference, or a damaged one: {error!s:.200}") from None
    if state.dtype != np.uint8 or state.ndim != 3 or state.max(initial=0) > OCCUPIED:
        raise BadConfiguration(
            f"{path}: state is {state.dtype} of {state.ndim} axes, "
            "expected uint8 (X, Y, Z) of 0, 1 and 2"
        )
    if (
        origin.shape != (3,)
        or voxel.shape != ()
        or not {origin.dtype.kind, voxel.dtype.kind} <= set("fiu")
        or not np.isfinite(origin).all()
        or not 1e-3 <= float(voxel) <= 1.0
    ):
        raise BadConfiguration(
            f"{path}: origin must be three finite numbers, voxel_size one from 0.001 to 1 m"
        )
    return Reference(state=state, origin_m=origin.astype(np.float64), voxel_m=float(voxel))


def occupied_cells(
    reference: Reference, T_map_world: Matrix, spec: GridSpec, *, heights_m: tuple[float, float]
) -> tuple[BoolGrid, BoolGrid]:
    """Return masks (rows, cols) of the cells where the reference is occupied, and where it is
    known, between two heights in metres.

    Sampled at the centre of the cell, every half voxel of height.
    """
    step = reference.voxel_m / 2
    cells = spec.centres(np.argwhere(np.ones((spec.rows, spec.cols), dtype=np.bool_)))
    T_world_map = invert(T_map_world)
    occupied, known = np.zeros(len(cells), dtype=np.bool_), np.zeros(len(cells), dtype=np.bool_)
    for height_m in np.arange(heights_m[0] + step / 2, heights_m[1], step):
        state = reference.at(
            transform_points(T_world_map, np.column_stack([cells, np.full(len(cells), height_m)]))
        )
        occupied |= state == OCCUPIED
        known |= state != UNKNOWN
    return occupied.reshape(spec.rows, spec.cols), known.reshape(spec.rows, spec.cols)


def agreement(
    occupied: npt.NDArray[np.bool_], reference: npt.NDArray[np.bool_], known: npt.NDArray[np.bool_]
) -> Agreement:
    """Compare two occupancy masks of the same shape, in two or three dimensions."""
    judged = occupied & known
    both, either = int((judged & reference).sum()), int((judged | reference).sum())
    return Agreement(
        iou=both / max(either, 1),
        precision_near=_share(judged, reference),
        recall_near=_share(reference, judged),
        judged=int(judged.sum()),
        reference=int(reference.sum()),
        not_judged=int((occupied & ~known).sum()),
    )


def _share(of: npt.NDArray[np.bool_], near: npt.NDArray[np.bool_]) -> float:
    """Return the share of the cells `of` with a cell of `near` at most one cell away; 1 for
    none."""
    return int((of & _dilated(near)).sum()) / max(int(of.sum()), 1) if of.any() else 1.0


def _dilated(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return a mask with all neighbours, diagonal ones too."""
    for axis in range(mask.ndim):
        narrow = np.moveaxis(mask, axis, 0)
        wide = narrow.copy()
        wide[1:] |= narrow[:-1]
        wide[:-1] |= narrow[1:]
        mask = np.moveaxis(wide, 0, axis)
    return mask
