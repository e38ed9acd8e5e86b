"""What helps to draw zones: what a draft would lead to, zones from files and to files, zones from
the camera's picture."""

from __future__ import annotations

import base64
import math

import cv2
import numpy as np
from fastapi import APIRouter, HTTPException, Response

from navcore.errors import BadConfiguration
from navcore.formats.keepout_mask import closed_cells, polygons_of
from navcore.formats.map_image import encode
from navcore.formats.nav2_map import description_of, map_from_cells, read, yaml_text
from navcore.mapping.prior_map import prior_layer
from navcore.perception.region_growing import region_at
from navcore.planning.path import NoPath
from web.gateway.problems import RESPONSES, JsonResponse
from web.images.encode import beware_mask
from web.interface.drafts import PathPreview, Preview, ZoneDraft
from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot
from web.schemas.convert import track, zones_of
from web.schemas.drafts import PixelIn, PreviewIn
from web.schemas.fields import MAX_NAME
from web.schemas.responses import PreviewOut, RegionOut, WayOut, ZonesOut
from web.schemas.zones import MaskImportIn, ZoneImportIn

_BY_STATUS = {status: {status: RESPONSES[status]} for status in RESPONSES}
_IMPORTS = {**_BY_STATUS[409], **_BY_STATUS[422], **_BY_STATUS[503]}


def drawing_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["zones"], default_response_class=JsonResponse)

    def newest() -> TickSnapshot:
        picture = operations.picture()
        if picture is None:
            raise HTTPException(404, "the camera has delivered no picture yet")
        return picture

    @router.post(
        "/preview", response_model=PreviewOut, responses={**_BY_STATUS[409], **_BY_STATUS[422]}
    )
    def preview(draft: PreviewIn) -> PreviewOut:
        """The path from here if the draft zone stood or the draft goal were the present one;
        nothing is applied.

        `present` is the path without the draft zone, `change_m` and `change_s` what the draft would
        cost. Without a path, `cut_by` names the zones that cut the goal off.
        """
        return _preview_of(operations.preview(draft.draft()))

    @router.post("/zones/import", status_code=201, response_model=ZonesOut, responses=_IMPORTS)
    def import_zones(collection: ZoneImportIn) -> ZonesOut:
        """Add the zones of a GeoJSON FeatureCollection in metres of the map frame, all or none, as
        one edit."""
        operations.zones.add_all([feature.draft() for feature in collection.features])
        return zones_of(operations)

    @router.post(
        "/zones/import-mask",
        status_code=201,
        response_model=ZonesOut,
        responses={**_BY_STATUS[404], **_IMPORTS},
    )
    def import_mask(mask: MaskImportIn) -> ZonesOut:
        """Add the occupied parts of a Nav2 keep-out mask as zones, all or none, as one edit."""
        try:
            picture = base64.b64decode(mask.picture, validate=True)
        except ValueError:
            raise BadConfiguration("mask.picture: is not base64") from None
        spec = newest().grid.spec
        cells = prior_layer(read(mask.yaml.encode(errors="replace"), picture, "mask"), spec)
        if not cells.any():
            raise BadConfiguration(
                "the mask keeps nothing out; expected occupied, that is dark, pixels on the map"
            )
        polygons = polygons_of(cells, spec)
        short = mask.name[: MAX_NAME - 5]
        names = (
            [mask.name]
            if len(polygons) == 1
            else [f"{short} {number}" for number in range(1, len(polygons) + 1)]
        )
        operations.zones.add_all(
            [ZoneDraft(name=name, polygon=ring) for name, ring in zip(names, polygons, strict=True)]
        )
        return zones_of(operations)

    @router.get("/zones.pgm", response_class=Response, responses=_BY_STATUS[404])
    def get_mask() -> Response:
        """The keep-outs that are switched on as a Nav2 keep-out mask: 0 kept out, 254 free, row 0
        at the top."""
        spec = newest().grid.spec
        cells = closed_cells(operations.zones.stored, spec)
        image = map_from_cells(occupied=cells, known=np.ones_like(cells), spec=spec).image
        return Response(encode(image), media_type="image/x-portable-graymap")

    @router.get("/zones.yaml", response_class=Response, responses=_BY_STATUS[404])
    def get_mask_yaml() -> Response:
        """Nav2's description of `zones.pgm`."""
        return Response(
            yaml_text(description_of(newest().grid.spec), "zones.pgm"),
            media_type="application/yaml",
        )

    @router.post(
        "/camera/region", response_model=RegionOut, responses={**_BY_STATUS[404], **_BY_STATUS[422]}
    )
    def region(pixel: PixelIn) -> RegionOut:
        """What is seen at a place of the camera's picture, and its outline on the floor, as a zone
        could have it.

        A thing that is recognised is taken by its pixels, any other by what stands connected with
        it in depth.
        """
        picture, beware = newest(), operations.beware.list
        if picture.depth_m is None:
            raise HTTPException(404, "this picture has no distances")
        height, width = picture.labels.shape
        found = region_at(
            min(int(pixel.down * height), height - 1),
            min(int(pixel.right * width), width - 1),
            class_ids=np.where(beware_mask(picture, beware), picture.labels, np.uint8(0)),
            depth_m=picture.depth_m,
            intrinsics=picture.intrinsics,
            T_map_camera=picture.T_map_camera,
        )
        outlines, _ = cv2.findContours(
            found.pixels.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        ring = max(outlines, key=cv2.contourArea).reshape(-1, 2) + 0.5
        name = next(
            (
                entry.label or entry.name
                for entry in beware.classes
                if entry.class_id == found.class_id
            ),
            None,
        )
        return RegionOut(
            name=name,
            footprint=list(found.footprint),
            outline=track(ring / np.array([width, height], dtype=np.float64)),
        )

    return router


def _preview_of(preview: Preview) -> PreviewOut:
    path, present = preview.path, preview.present
    return PreviewOut(
        **_way_of(path).model_dump(),
        reason=str(path.outcome.reason) if isinstance(path.outcome, NoPath) else None,
        cut_by=list(preview.cut_by),
        present=None if present is None else _way_of(present),
        change_m=_less(path.length_m, present.length_m if present else None),
        change_s=_less(path.time_s, present.time_s if present else None),
    )


def _way_of(path: PathPreview) -> WayOut:
    found = not isinstance(path.outcome, NoPath)
    return WayOut(
        found=found,
        length_m=_finite(path.length_m),
        time_s=_finite(path.time_s),
        path=track(path.points),
    )


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _less(new: float | None, old: float | None) -> float | None:
    return None if new is None or old is None else _finite(round(new - old, 3))
