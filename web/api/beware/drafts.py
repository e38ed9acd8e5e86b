"""Routes that help to edit the beware list: preview of an edit, colour rules from a click, stored
versions."""

from __future__ import annotations

import base64
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Path, Response

from navcore.mission.beware_changes import changes_between
from web.api.beware.beware import Force
from web.api.router import api_router
from web.auth.roles import CurrentVisitor
from web.gateway.etag import etag
from web.gateway.problems import refusals
from web.images.camera import camera_jpg, mask_png, narrowed
from web.interface.beware import RecentLook
from web.interface.operations import RobotService
from web.schemas.beware import (
    MAX_VERSION,
    BewareDraftIn,
    BewareOut,
    ClickOut,
    ComparisonOut,
    Example,
    ExampleIn,
    ExampleOut,
    ListPreviewOut,
    LookOut,
    LooksOut,
    Rule,
    RuleOut,
    VersionsOut,
)
from web.schemas.drafts import ClickIn

MAX_LOOKS = 7
"""Number of images on which a colour rule is shown, the newest among them."""
THUMBNAIL_PX = 160
"""Largest width of the older images in pixels."""
Version = Annotated[int, Path(ge=0, le=MAX_VERSION)]


def beware_drafts_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("beware list")

    @router.post(
        "/beware/preview", response_model=ListPreviewOut, responses=refusals(404, 409, 422)
    )
    def preview(draft: BewareDraftIn) -> ListPreviewOut:
        """Return what an edit of the list would change on the map and on the path; nothing is
        applied. A colour rule is tried on the images of the last minutes."""
        beware = operations.beware.drafted(draft.draft())
        changes = changes_between(operations.beware.list, beware)
        return ListPreviewOut.of(operations.preview_list(beware), changes)

    @router.post("/beware/colour", response_model=RuleOut, responses=refusals(409, 422))
    def propose_rule(click: ClickIn) -> RuleOut:
        """Return a colour rule for what is at a position in the camera image: the range of the
        connected region of nearly its colour. Nothing is applied."""
        colours = operations.beware.colours
        return RuleOut(rule=colours.proposed(click.right, click.down, frame=click.frame))

    @router.post("/beware/colour/looks", response_model=LooksOut, responses=refusals(422))
    def try_rule(rule: Rule) -> LooksOut:
        """Return what a colour rule takes in the newest image, and in some of the last minutes.
        Nothing is applied."""
        looks = operations.beware.colours.looks(rule, MAX_LOOKS)
        return LooksOut(looks=[_look_of(look, is_newest=i == 0) for i, look in enumerate(looks)])

    @router.post("/beware/example/click", response_model=ClickOut, responses=refusals(409, 422))
    def click_example(click: ClickIn) -> ClickOut:
        """Return what a click on a thing takes: its region, grown by depth and colour. The floor, a
        wall, a place without depth and what the list knows already are refused. Nothing is
        applied."""
        beware = operations.beware
        taken = beware.examples.click(click.right, click.down, beware.list, frame=click.frame)
        mask = _data_url("png", mask_png(taken.mask))
        return ClickOut(key=taken.key, frame=taken.frame, mask=mask)

    @router.post("/beware/example", response_model=ExampleOut, responses=refusals(409, 422))
    def try_example(example: ExampleIn) -> ExampleOut:
        """Return the prototype of clicks on a thing, and what it takes in the newest image and in
        some of the last minutes. Nothing is applied: the prototype belongs into a new entry of the
        list."""
        examples = operations.beware.examples
        prototype = examples.made(example.clicks, example.away)
        looks = examples.looks(prototype, MAX_LOOKS)
        shown = [_look_of(look, is_newest=i == 0) for i, look in enumerate(looks)]
        return ExampleOut(prototype=prototype, looks=shown)

    @router.post("/beware/example/looks", response_model=LooksOut, responses=refusals(409, 422))
    def look_at_example(prototype: Example) -> LooksOut:
        """Return what a prototype takes in the newest image, and in some of the last minutes.
        Nothing is applied."""
        looks = operations.beware.examples.looks(prototype, MAX_LOOKS)
        return LooksOut(looks=[_look_of(look, is_newest=i == 0) for i, look in enumerate(looks)])

    @router.get("/beware/versions", response_model=VersionsOut)
    def list_versions() -> VersionsOut:
        """Return the stored versions of the list: when, who and what."""
        return VersionsOut(versions=operations.beware.versions())

    @router.get("/beware/versions/{version}", response_model=ComparisonOut, responses=refusals(404))
    def get_version(version: Version) -> ComparisonOut:
        """Return a stored version and how it differs from the list in force."""
        stored = operations.beware.version(version).list
        return ComparisonOut(
            version=version,
            classes=stored.classes,
            changes=changes_between(operations.beware.list, stored),
        )

    @router.post(
        "/beware/versions/{version}/restore",
        response_model=BewareOut,
        responses=refusals(404, 409, 422, 503),
    )
    def restore_version(
        version: Version, response: Response, visitor: CurrentVisitor, force: Force = False
    ) -> BewareOut:
        """Bring back a stored version as one edit, which can be undone."""
        beware = operations.beware.restore(version, force=force, by=visitor.signature)
        response.headers.update(etag(beware.version))
        return BewareOut.of(beware, operations.beware)

    return router


def _look_of(look: RecentLook, *, is_newest: bool) -> LookOut:
    """Return a look; older images are sent small with their mask, the newest one has a route of its
    own."""
    width = look.mask.shape[1] if is_newest else THUMBNAIL_PX
    mask = narrowed(look.mask.astype(np.uint8), width) > 0
    picture = "" if is_newest else _data_url("jpeg", camera_jpg(narrowed(look.rgb, width)))
    return LookOut(
        age_s=round(look.age_s, 1),
        share=round(float(look.mask.mean()), 4),
        frame=look.frame,
        mask=_data_url("png", mask_png(mask)),
        picture=picture,
    )


def _data_url(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
