"""The large values as files: map, cloud, path, camera, and reports of past missions."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, HTTPException, Path, Query, Request, Response

from navcore.geometry.transform import Pose2
from navcore.perception.people.track import Track
from web.gateway.problems import RESPONSES, JsonResponse
from web.images.encode import (
    LatestOnly,
    camera_jpg,
    cells_png,
    cloud_ply,
    floor_view,
    map_pgm,
    map_png,
    map_yaml,
    with_overlay,
)
from web.images.tiles import TILE, TileVersions, changed_since, tile_cells
from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot
from web.schemas.convert import finite, track, zone_of
from web.schemas.poses import PosesIn
from web.schemas.responses import MapOut, NumberedPoseOut, PathOut, PersonOut, PosesOut, TilesOut

_NOTHING_YET: dict[int | str, dict[str, Any]] = {404: RESPONSES[404]}
TileIndex = Annotated[int, Path(ge=0, le=10_000)]
RUN_ID = r"^[A-Za-z0-9_][A-Za-z0-9_.:-]{0,99}$"


def maps_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["map and camera"], default_response_class=JsonResponse)
    png, camera, labelled, ply = LatestOnly[bytes](), LatestOnly[bytes](), LatestOnly[bytes](), LatestOnly[bytes]()
    tiles = TileVersions()

    def newest() -> TickSnapshot:
        picture = operations.picture()
        if picture is None:
            raise HTTPException(404, "the camera has delivered no picture yet")
        return picture

    @router.get("/map", response_model=MapOut, responses=_NOTHING_YET)
    def get_map() -> MapOut:
        """Where the map lies; `version` changes whenever its cells do."""
        picture, profile = newest(), operations.profile
        spec = picture.grid_spec
        return MapOut(
            version=picture.grid_version,
            resolution_m=spec.resolution_m,
            rows=spec.rows,
            cols=spec.cols,
            origin_x_m=spec.origin_x_m,
            origin_y_m=spec.origin_y_m,
            robot_length_m=profile.length_m,
            robot_width_m=profile.width_m,
        )

    @router.get("/map.png", response_class=_Png, responses=_NOTHING_YET)
    def get_map_png(request: Request) -> Response:
        """All layers as a picture, north up, two pixels per cell and side."""
        picture, beware = newest(), operations.beware.list
        key = (picture.grid_version, beware.version)
        return _tagged(
            request, key, lambda: png.get(key, lambda: map_png(picture, beware)), "image/png"
        )

    @router.get("/map/tiles", response_model=TilesOut, responses=_NOTHING_YET)
    def get_tiles(
        since: Annotated[
            int, Query(ge=0, le=2**53, description="version of the answer before")
        ] = 0,
    ) -> TilesOut:
        """Which tiles of the map have changed since an answer before; row 0 lies at the smallest y."""
        picture = newest()
        version, versions = tiles.update(picture, operations.beware.list)
        spec = picture.grid_spec
        # A version from before a restart of the console is newer than the newest: then everything
        # is.
        changed = list(changed_since(versions, since if since <= version else 0))
        return TilesOut(
            version=version,
            tile_cells=TILE,
            rows=spec.rows,
            cols=spec.cols,
            changed=[(row, col, at) for (row, col), at in changed],
        )

    @router.get("/map/tiles/{row}/{col}.png", response_class=_Png, responses=_NOTHING_YET)
    def get_tile(row: TileIndex, col: TileIndex) -> Response:
        """The cells of one tile, a pixel a cell, its uppermost row at the top, for a page that
        paints the map itself.

        Red holds bits: 1 seen, 2 obstacle, 4 the robot's centre may not be here, 8 keep-out zone,
        16 prior map. Green and blue hold the class ids of the beware list of what is there, 0 for
        none.
        """
        picture = newest()
        if row * TILE >= picture.grid_spec.rows or col * TILE >= picture.grid_spec.cols:
            raise HTTPException(404, "the map has no such tile")
        return Response(cells_png(picture, tile_cells((row, col), picture)), media_type="image/png")

    @router.get("/map.pgm", response_class=Response, responses=_NOTHING_YET)
    def get_map_pgm() -> Response:
        """Nav2's map image: occupied 0, free 254, unknown 205, row 0 at the top."""
        return Response(map_pgm(newest()), media_type="image/x-portable-graymap")

    @router.get("/map.yaml", response_class=Response, responses=_NOTHING_YET)
    def get_map_yaml() -> Response:
        """Nav2's description of `map.pgm`; the origin is its lower-left corner."""
        return Response(map_yaml(newest()), media_type="application/yaml")

    @router.get("/cloud.ply", response_class=Response, responses=_NOTHING_YET)
    def get_cloud() -> Response:
        """The points of the map as binary PLY with colour and class id."""
        cloud = operations.cloud()
        if cloud is None:
            raise HTTPException(404, "the map has no points yet")
        return Response(
            ply.get(cloud.serial, lambda: cloud_ply(cloud)), media_type="application/octet-stream"
        )

    @router.get("/path", response_model=PathOut, responses=_NOTHING_YET)
    def get_path() -> PathOut:
        """The planned path, its corners, and the way driven so far."""
        picture = newest()
        return PathOut(
            serial=picture.serial,
            path=track(picture.path),
            waypoints=track(picture.waypoints),
            driven=track(picture.driven),
            people=[_person(someone) for someone in picture.people],
            closed=[zone_of(zone) for zone in picture.closed],
            view=track(floor_view(picture)),
        )

    @router.get("/camera.jpg", response_class=_Jpeg, responses=_NOTHING_YET)
    def get_camera(
        overlay: Annotated[Literal["none", "segmentation"], Query()] = "none",
    ) -> Response:
        """What the camera sees; with `overlay=segmentation`, each enabled class is tinted, surer is
        stronger, and named."""
        picture, beware = newest(), operations.beware.list
        if overlay == "none":
            data = camera.get(picture.serial, lambda: camera_jpg(picture.rgb))
        else:
            data = labelled.get(
                (picture.serial, beware.version), lambda: camera_jpg(with_overlay(picture, beware))
            )
        return Response(data, media_type="image/jpeg")

    @router.get("/runs")
    def get_runs() -> list[dict[str, Any]]:
        """Reports of past missions, newest first, without their series."""
        return [finite(dict(run)) for run in operations.runs()]

    @router.get("/runs/{run_id}", responses=_NOTHING_YET)
    def get_run(run_id: Annotated[str, Path(pattern=RUN_ID)]) -> dict[str, Any]:
        """One mission's whole report."""
        report: dict[str, Any] = finite(dict(operations.run(run_id)))
        return report

    return router


def _person(track: Track) -> PersonOut:
    return PersonOut(
        id=track.id,
        x_m=track.x_m,
        y_m=track.y_m,
        vx_mps=track.vx_mps,
        vy_mps=track.vy_mps,
        radius_m=track.radius_m,
    )


class _Png(Response):
    media_type = "image/png"


class _Jpeg(Response):
    media_type = "image/jpeg"


def _tagged(request: Request, key: tuple[int, int], make: Any, media_type: str) -> Response:
    tag = '"{}-{}"'.format(*key)
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers={"ETag": tag})
    return Response(
        make(), media_type=media_type, headers={"ETag": tag, "Cache-Control": "no-cache"}
    )


def poses_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["map and camera"], default_response_class=JsonResponse)

    @router.get("/map/poses", response_model=PosesOut)
    def get_poses() -> PosesOut:
        """Where the robot was when it saw the map's points; a new ID every so many metres or
        degrees."""
        poses = enumerate(operations.poses())
        return PosesOut(
            poses=[
                NumberedPoseOut(id=i, x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
                for i, pose in poses
            ]
        )

    @router.patch(
        "/map/poses", status_code=204, response_class=Response, responses={422: RESPONSES[422]}
    )
    def correct_poses(body: PosesIn) -> None:
        """Put past poses right: what was seen from them moves along, and the path follows, from the
        next tick on."""
        operations.correct_poses(
            {
                pose.id: Pose2(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
                for pose in body.poses
            }
        )

    return router
