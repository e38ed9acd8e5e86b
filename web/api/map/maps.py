"""Routes of the large values: map, point cloud, path, camera image, poses, and reports of past
missions."""

from __future__ import annotations

import secrets
from typing import Annotated, Any, Literal

from fastapi import APIRouter, HTTPException, Path, Query, Request, Response

from navcore.geometry.transform import Pose2
from web.api.nav2_files import OfGrid, on_grid
from web.api.newest_tick import newest_tick
from web.api.router import api_router
from web.gateway.etag import unless_known
from web.gateway.problems import refusals
from web.images.camera import camera_jpg, labels_of, with_overlay
from web.images.encode import (
    LatestOnly,
    cells_png,
    cloud_ply,
    floor_view,
    map_pgm,
    map_png,
    map_yaml,
)
from web.images.shown_images import ShownImages, name_of
from web.images.tiles import TILE, TileVersions, changed_since, tile_cells
from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot
from web.interface.wire import polyline, values_of
from web.schemas.map.maps import (
    CameraLabelOut,
    CameraLabelsOut,
    MapOut,
    PathOut,
    PersonOut,
    TilesOut,
)
from web.schemas.map.poses import NumberedPose, PosesIn, PosesOut
from web.schemas.zones import ZoneOut

_NOTHING_YET = refusals(404)
TileIndex = Annotated[int, Path(ge=0, le=10_000)]
WithZones = Annotated[bool, Query(description="Whether keep-out zones are occupied cells.")]
RUN_ID = r"^[A-Za-z0-9_][A-Za-z0-9_.:-]{0,99}$"


def maps_router(operations: RobotService, shown: ShownImages) -> APIRouter:
    """Return the routes below `/api/v1`; `shown` notes the camera images that are given out."""
    router = api_router("map and camera")
    png, camera, tinted, labelled, ply = (
        LatestOnly[bytes](),
        LatestOnly[bytes](),
        LatestOnly[bytes](),
        LatestOnly[bytes](),
        LatestOnly[bytes](),
    )
    # Another start of the console has other pictures. Its versions begin anywhere, so that one of
    # an earlier start is older than all of them, or newer.
    start = secrets.randbits(52)
    tiles = TileVersions(start)

    def frame_of(tick: TickSnapshot) -> dict[str, Any]:
        profile = operations.profile
        return values_of(tick.grid_spec) | {
            "robot_length_m": profile.length_m,
            "robot_width_m": profile.width_m,
        }

    @router.get("/map", response_model=MapOut, responses=_NOTHING_YET)
    def get_map() -> MapOut:
        """Return position and size of the map; `version` changes whenever its cells do."""
        tick = newest_tick(operations)
        return MapOut(**frame_of(tick), version=tick.grid_version)

    @router.get("/map.png", response_class=_Png, responses=_NOTHING_YET)
    def get_map_png(request: Request) -> Response:
        """Return an image of all layers, y upwards, two pixels per cell and side."""
        tick, beware = newest_tick(operations), operations.beware.list
        key = (tick.grid_version, beware.version)
        tag = f'"{start:x}-{tick.grid_version}-{beware.version}"'
        return unless_known(
            request, tag, lambda: png.get(key, lambda: map_png(tick, beware)), "image/png"
        )

    @router.get("/map/tiles", response_model=TilesOut, responses=_NOTHING_YET)
    def get_tiles(
        since: Annotated[
            int,
            Query(
                ge=0,
                le=2**53,
                description="Version of the previous answer; one of an earlier start of the "
                "console, or 0, asks for all tiles.",
            ),
        ] = 0,
    ) -> TilesOut:
        """Return the tiles that have changed since an earlier answer; row 0 is at the least y."""
        tick = newest_tick(operations)
        version, versions = tiles.update(tick, operations.beware.list)
        # A version larger than the newest is of an earlier start.
        changed = list(changed_since(versions, since if since <= version else 0))
        return TilesOut(
            **frame_of(tick),
            version=version,
            tile_cells=TILE,
            changed=[(row, col, at) for (row, col), at in changed],
        )

    @router.get("/map/tiles/{row}/{col}.png", response_class=_Png, responses=_NOTHING_YET)
    def get_tile(row: TileIndex, col: TileIndex) -> Response:
        """Return the cells of one tile, one pixel per cell, uppermost row first.

        Red holds bits: 1 observed, 2 obstacle, 4 closed to the robot's centre, 8 keep-out zone, 16
        prior map. Green and blue hold the ids of the classes of the beware list, 0 for none.
        """
        tick = newest_tick(operations)
        if row * TILE >= tick.grid_spec.rows or col * TILE >= tick.grid_spec.cols:
            raise HTTPException(404, "the map has no such tile")
        return Response(cells_png(tick, tile_cells((row, col), tick)), media_type="image/png")

    @router.get("/map.pgm", response_class=Response, responses=refusals(404, 409))
    def get_map_pgm(zones: WithZones = False, grid: OfGrid = None) -> Response:
        """Return Nav2's map image: occupied 0, free 254, unknown 205, row 0 at the top.

        The zones are in the mask `zones.pgm`; with `zones=1` they are occupied cells of the map.
        """
        tick = newest_tick(operations)
        headers = on_grid(tick.grid_spec, grid)
        image = map_pgm(tick, zones=zones)
        return Response(image, media_type="image/x-portable-graymap", headers=headers)

    @router.get("/map.yaml", response_class=Response, responses=refusals(404, 409))
    def get_map_yaml(grid: OfGrid = None) -> Response:
        """Return Nav2's description of `map.pgm`; the origin is its lower-left corner."""
        tick = newest_tick(operations)
        headers = on_grid(tick.grid_spec, grid)
        return Response(map_yaml(tick), media_type="application/yaml", headers=headers)

    @router.get("/cloud.ply", response_class=Response, responses=_NOTHING_YET)
    def get_cloud() -> Response:
        """Return the points of the map as binary PLY with colour and class id."""
        cloud = operations.cloud()
        if cloud is None:
            raise HTTPException(404, "the map has no points yet")
        return Response(
            ply.get(cloud.serial, lambda: cloud_ply(cloud)), media_type="application/octet-stream"
        )

    @router.get("/path", response_model=PathOut, responses=_NOTHING_YET)
    def get_path() -> PathOut:
        """Return the planned path, the driven path and the moving objects."""
        tick = newest_tick(operations)
        return PathOut(
            serial=tick.serial,
            path=polyline(tick.path),
            unseen=[polyline(tick.path[max(a - 1, 0) : b + 1]) for a, b in tick.unseen],
            waypoints=polyline(tick.waypoints),
            driven=polyline(tick.driven),
            people=[PersonOut.model_validate(person) for person in tick.people],
            closed=[ZoneOut.of(zone) for zone in tick.closed],
            view=polyline(floor_view(tick)),
        )

    @router.get("/camera.jpg", response_class=_Jpeg, responses=_NOTHING_YET)
    def get_camera(
        overlay: Annotated[Literal["none", "tint", "segmentation"], Query()] = "none",
    ) -> Response:
        """Return the camera image; with `overlay=segmentation`, each enabled class is named and
        tinted by its confidence, with `overlay=tint` only tinted: `camera/labels` has the names.
        The header `Frame` names the image, so that a click can refer to it."""
        tick, beware = newest_tick(operations), operations.beware.list
        if overlay == "none":
            data = camera.get(tick.serial, lambda: camera_jpg(tick.rgb))
        else:
            named = overlay == "segmentation"
            data = (labelled if named else tinted).get(
                (tick.serial, beware.version),
                lambda: camera_jpg(with_overlay(tick, beware, named=named)),
            )
        shown.note(tick, beware)
        headers = {"Frame": name_of(tick)}
        return Response(data, media_type="image/jpeg", headers=headers)

    @router.get("/camera/labels", response_model=CameraLabelsOut, responses=_NOTHING_YET)
    def get_camera_labels() -> CameraLabelsOut:
        """Return what the camera image shows of the enabled classes, each object with its box."""
        tick, beware = newest_tick(operations), operations.beware.list
        labels = labels_of(tick, beware)
        return CameraLabelsOut(
            serial=tick.serial, labels=[CameraLabelOut(**values_of(one)) for one in labels]
        )

    @router.get("/runs")
    def get_runs() -> list[dict[str, Any]]:
        """Return the reports of past missions, newest first, without their time series."""
        return [dict(run) for run in operations.runs()]

    @router.get("/runs/{run_id}", responses=_NOTHING_YET)
    def get_run(run_id: Annotated[str, Path(pattern=RUN_ID)]) -> dict[str, Any]:
        """Return the whole report of one mission."""
        return dict(operations.run(run_id))

    return router


class _Png(Response):
    media_type = "image/png"


class _Jpeg(Response):
    media_type = "image/jpeg"


def poses_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("map and camera")

    @router.get("/map/poses", response_model=PosesOut)
    def get_poses() -> PosesOut:
        """Return the poses from which the points of the map were observed; a new one follows after
        some metres or degrees."""
        poses = enumerate(operations.poses())
        return PosesOut(
            poses=[NumberedPose.model_construct(id=i, **values_of(pose)) for i, pose in poses]
        )

    @router.patch("/map/poses", status_code=204, response_class=Response, responses=refusals(422))
    def correct_poses(body: PosesIn) -> None:
        """Correct past poses; from the next tick on, the points observed from them, and the zones
        and goals that were drawn beside them, move along."""
        operations.correct_poses(
            {
                pose.id: Pose2(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
                for pose in body.poses
            }
        )

    return router
