"""Routes that help to draw zones: preview of a draft, import and export, regions of the camera
image."""

from __future__ import annotations

from typing import Annotated

import cv2
import numpy as np
from fastapi import APIRouter, HTTPException, Query, Response

from navcore.errors import BadConfiguration
from navcore.formats.keepout_mask import closed_cells, mask_spec, polygons_of
from navcore.formats.map_image import encode
from navcore.formats.nav2_map import State, description_of, map_from_cells, read, yaml_text
from navcore.grid.growth import cells_of
from navcore.mapping.storage.prior_map import prior_layer
from navcore.perception.region_growing import region_at
from navcore.planning.path import NoPath
from web.api.nav2_files import OfGrid, on_grid
from web.api.newest_tick import newest_tick
from web.api.router import api_router
from web.gateway.problems import refusals
from web.images.shown_images import ShownImage, ShownImages
from web.interface.drafts import Preview, ZoneDraft
from web.interface.operations import Existing, RobotService
from web.interface.wire import polyline
from web.schemas.drafts import (
    ClickIn,
    PathPreviewOut,
    PreviewIn,
    PreviewOut,
    RegionOut,
    difference,
)
from web.schemas.fields import MAX_NAME
from web.schemas.zones import MaskImportIn, ZoneImportIn, ZonesOut

ExistingQuery = Annotated[
    Existing,
    Query(
        description="Zones with the outline of a stored one: `replace` its properties, `keep` "
        "both, `skip` them, or `ask`, which refuses the import."
    ),
]


def drawing_router(operations: RobotService, shown: ShownImages) -> APIRouter:
    """Return the routes below `/api/v1`; `shown` are the images that a click may be made on."""
    router = api_router("zones")

    def all_zones() -> ZonesOut:
        return ZonesOut.of(operations.zones.stored, operations.zones.history)

    @router.post("/preview", response_model=PreviewOut, responses=refusals(409, 422))
    def preview(draft: PreviewIn) -> PreviewOut:
        """Plan the path with a draft zone or to a draft goal; nothing is applied.

        `present` is the path without the draft zone, `change_m` and `change_s` are the cost of the
        draft. Without a path, `cut_by` names the zones that cut the goal off.
        """
        return _preview_of(operations.preview(draft.draft()))

    @router.post(
        "/zones/import", status_code=201, response_model=ZonesOut, responses=refusals(409, 422, 503)
    )
    def import_zones(collection: ZoneImportIn, existing: ExistingQuery = "ask") -> ZonesOut:
        """Add the zones of a GeoJSON FeatureCollection in metres of the map frame, all or none, as
        one edit.

        Where some have the outline of a stored zone the import is refused with 409, which names
        them in `there`, unless `existing` says what to do.
        """
        operations.zones.add_all([feature.draft() for feature in collection.features], existing)
        return all_zones()

    @router.post(
        "/zones/import-mask",
        status_code=201,
        response_model=ZonesOut,
        responses=refusals(404, 409, 422, 503),
    )
    def import_mask(mask: MaskImportIn, existing: ExistingQuery = "ask") -> ZonesOut:
        """Add the occupied parts of a Nav2 keep-out mask as zones, all or none, as one edit: on its
        own grid, which may reach beyond the map, or in the map's cells where its own are finer."""
        files = mask.files()
        nav2_map = read(files.yaml, files.image, "mask")
        spec, present = nav2_map.spec, newest_tick(operations).grid_spec
        cells = nav2_map.cells(State.OCCUPIED)
        if spec.resolution_m < present.resolution_m:
            # Else each staircase and speck of a fine mask would be one of a zone.
            spec = present.part(*cells_of(present, spec))
            cells = prior_layer(nav2_map, spec)
        if not cells.any():
            raise BadConfiguration(
                "the mask keeps nothing out; expected occupied, that is dark, pixels"
            )
        polygons = polygons_of(cells, spec)
        short = mask.name[: MAX_NAME - 5]
        names = (
            [mask.name]
            if len(polygons) == 1
            else [f"{short} {number}" for number in range(1, len(polygons) + 1)]
        )
        operations.zones.add_all(
            [
                ZoneDraft(name=name, polygon=ring)
                for name, ring in zip(names, polygons, strict=True)
            ],
            existing,
        )
        return all_zones()

    @router.get("/zones.pgm", response_class=Response, responses=refusals(404, 409, 422))
    def get_mask(grid: OfGrid = None) -> Response:
        """Return the enabled keep-out zones as a Nav2 keep-out mask: 0 closed, 254 free, row 0 at
        the top. It covers the map and all of these zones."""
        zones = operations.zones.stored
        spec = mask_spec(zones, newest_tick(operations).grid_spec)
        headers, cells = on_grid(spec, grid), closed_cells(zones, spec)
        image = map_from_cells(occupied=cells, known=np.ones_like(cells), spec=spec).image
        return Response(encode(image), media_type="image/x-portable-graymap", headers=headers)

    @router.get("/zones.yaml", response_class=Response, responses=refusals(404, 409, 422))
    def get_mask_yaml(grid: OfGrid = None) -> Response:
        """Return Nav2's description of `zones.pgm`."""
        spec = mask_spec(operations.zones.stored, newest_tick(operations).grid_spec)
        headers, text = on_grid(spec, grid), yaml_text(description_of(spec), "zones.pgm")
        return Response(text, media_type="application/yaml", headers=headers)

    @router.post("/camera/region", response_model=RegionOut, responses=refusals(404, 409, 422))
    def region(click: ClickIn) -> RegionOut:
        """Return the object at a click into the camera image with its outline on the floor, which
        can become a zone. A click that names its image (`frame`) is refused once newer ones of 5 s
        have been given out, of large images a little sooner.

        A labelled object is found by its pixels, any other by its connected region in the depth
        image.
        """
        beware = operations.beware.list
        image = (
            ShownImage.of(newest_tick(operations), beware)
            if click.frame is None
            else shown.named(click.frame)
        )
        if image.depth_m is None:
            raise HTTPException(404, "this picture has no distances")
        height, width = image.class_ids.shape
        found = region_at(
            min(int(click.down * height), height - 1),
            min(int(click.right * width), width - 1),
            class_ids=image.class_ids,
            depth_m=image.depth_m,
            intrinsics=image.intrinsics,
            T_map_camera=image.T_map_camera,
        )
        outlines, _ = cv2.findContours(
            found.pixels.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        ring = max(outlines, key=cv2.contourArea).reshape(-1, 2) + 0.5
        name = next(
            (entry.title for entry in beware.classes if entry.class_id == found.class_id),
            None,
        )
        return RegionOut(
            name=name,
            footprint=found.footprint,
            outline=polyline(ring / np.array([width, height], dtype=np.float64)),
        )

    return router


def _preview_of(preview: Preview) -> PreviewOut:
    path, present = preview.path, preview.present
    return PreviewOut(
        **dict(PathPreviewOut.of(path)),
        reason=str(path.outcome.reason) if isinstance(path.outcome, NoPath) else None,
        cut_by=preview.cut_by,
        present=None if present is None else PathPreviewOut.of(present),
        change_m=difference(path.length_m, present.length_m if present else None),
        change_s=difference(path.time_s, present.time_s if present else None),
    )
