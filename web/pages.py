"""Routes of the operator's page, in the visitor's language. Its files are read once at start: no
path of a request becomes a path on the disk."""

from __future__ import annotations

import hashlib
import mimetypes
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fastapi import APIRouter, HTTPException, Request, Response

from web.auth.roles import CurrentVisitor, Visitor
from web.gateway.etag import unless_known
from web.gateway.problems import JsonResponse
from web.languages.catalog import CATALOGS, ENGLISH, language_of

FOLDER = Path(__file__).with_name("page")
_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".webmanifest": "application/manifest+json",
    ".json": "application/json",
}
_TRANSLATED = ("index.html", "runs.html", "teach.html")


def pages_router(openapi: Callable[[], Mapping[str, Any]]) -> APIRouter:
    """Return the routes of `/`, its files, and the description of the API, `openapi`."""
    router = APIRouter(include_in_schema=False)
    files = {
        path.relative_to(FOLDER).as_posix(): path.read_bytes()
        for path in sorted(FOLDER.rglob("*"))
        if path.suffix in (*_TYPES, ".svg")
    }
    for language, catalog in CATALOGS.items():
        files[f"languages/{language}.json"] = catalog.json()
        for name in _TRANSLATED:
            files[f"{language}/{name}"] = _page_in(language, files[name].decode())
    tags = {name: f'"{hashlib.sha256(data).hexdigest()[:16]}"' for name, data in files.items()}

    def file(request: Request, name: str) -> Response:
        if name not in files:
            raise HTTPException(404, "nothing is here")
        kind = _TYPES.get(Path(name).suffix) or mimetypes.guess_type(name)[0]
        return unless_known(request, tags[name], lambda: files[name], kind)

    def page(request: Request, visitor: Visitor, name: str) -> Response:
        answer = file(request, f"{language_of(request.headers, visitor.language)}/{name}")
        answer.headers["Vary"] = "Accept-Language, Cookie"
        return answer

    @router.get("/")
    async def index(request: Request, visitor: CurrentVisitor) -> Response:
        """Return the operator's page."""
        return page(request, visitor, "index.html")

    @router.get("/runs")
    async def runs(request: Request, visitor: CurrentVisitor) -> Response:
        """Return the page that compares reports of past missions."""
        return page(request, visitor, "runs.html")

    @router.get("/teach")
    async def teach(request: Request, visitor: CurrentVisitor) -> Response:
        """Return the page on which the network is taught a class."""
        return page(request, visitor, "teach.html")

    @router.get("/docs")
    async def docs(request: Request) -> Response:
        """Return the page that shows `/openapi.json`."""
        return file(request, "docs.html")

    @router.get("/openapi.json", response_class=JsonResponse)
    def description() -> Response:
        """Return the description of the API. A plain function, and so in the pool: the first one
        takes seconds to make."""
        return JsonResponse(openapi())

    @router.get("/page/{name:path}")
    async def static(request: Request, name: str) -> Response:
        """Return a script or a style sheet."""
        return file(request, name)

    return router


def _page_in(language: str, source: str) -> bytes:
    """Return a page in a language, with the names of all languages for its switch."""
    marked = f'<html lang="{language}" data-languages="{" ".join(CATALOGS)}">'
    return CATALOGS[language].page(source).replace(f'<html lang="{ENGLISH}">', marked).encode()
