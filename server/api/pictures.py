"""The API of pictures: stored files by their digest, pictures of jobs drawn on request, and how two of them differ."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import chain
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response, StreamingResponse
from sqlalchemy.orm import Session

from renderer.request import MAX_SIDE
from server.api.profiles import blobs_of
from server.api.state import database_of
from server.pictures.colours import shrink
from server.pictures.drawn import compare_pictures, paint, paint_difference
from server.pictures.jobs import Pictured, find_pictured
from server.pictures.stored import MOST_BYTES
from server.pictures.taken import is_name
from server.problems import Problem
from server.store.blobs import BlobError, Blobs

router = APIRouter(prefix="/api/v1")

TYPES = {b"\x89PNG\r\n\x1a\n": "image/png", b"PK\x03\x04": "application/zip"}
"""The first bytes of pictures and of counts (.npz), and their media types."""
DRAWING = "1"
"""Changes where the same request is drawn otherwise."""
FOR_EVER = {"Cache-Control": "public, max-age=31536000, immutable"}

What = Literal["image", "nodes", "triangles", "bytes"]
Top = Annotated[int | None, Query(ge=1, le=2**32 - 1, description="the scale's top; by default 99.5 % fit below it")]
Against = Annotated[str | None, Query(description="another job: its scale is shared, or the difference is shown")]


@router.get("/pictures/compare")
def read_comparison(request: Request, baseline: str, against: str, what: What = "image") -> dict[str, object]:
    """Figures of two jobs' pictures, and of their difference."""
    with database_of(request).reading() as session:
        one, other = find_pictured(session, baseline), find_pictured(session, against)
    try:
        return compare_pictures(blobs_of(request), one, other, what)
    except BlobError as error:
        raise Problem(503, str(error)) from error


@router.get("/pictures/{sha256}")
def read_picture_file(sha256: str, request: Request) -> Response:
    """A stored picture (PNG) or its counts (npz)."""
    if not is_name(sha256):
        raise Problem(404, f"There is no picture {sha256[:80]!r}: give the sha256 that a result names.")
    try:
        kind, content = _typed(blobs_of(request).read(sha256))
    except BlobError as error:
        raise Problem(404, f"There is no picture {sha256} here: {_lower(str(error))}") from error
    if kind is None:
        raise Problem(404, f"There is no picture {sha256}: the file of that digest is none.")
    suffix = "png" if kind == "image/png" else "npz"
    headers = {"Content-Disposition": f'inline; filename="{sha256[:16]}.{suffix}"', "ETag": f'"{sha256}"', **FOR_EVER}
    return StreamingResponse(content, media_type=kind, headers=headers)


@router.get("/jobs/{job_id}/picture")
def read_job_picture(
    job_id: str,
    request: Request,
    what: What = "image",
    top: Top = None,
    against: Against = None,
    view: Literal["picture", "difference"] = "picture",
    width: Annotated[int | None, Query(ge=16, le=MAX_SIDE, description="no wider than this many pixels")] = None,
) -> Response:
    """A job's rendered image or heatmap as a PNG, or with `against` and `view=difference` how that job's differs."""
    with database_of(request).reading() as session:
        shown, other = _pair(session, job_id, against)
    if view == "difference" and other is None:
        raise Problem(422, "A difference is of two jobs: name the other with against=JOB.")
    names = [each.name_of(what) for each in (shown, other) if each is not None]
    asked = "/".join([DRAWING, *names, what, view, str(top), str(width)])
    headers = {"ETag": f'"{hashlib.sha256(asked.encode()).hexdigest()[:32]}"', "Cache-Control": "no-cache"}
    if headers["ETag"] in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    try:
        png = _draw(blobs_of(request), shown, what, top, other, view)
    except BlobError as error:
        raise Problem(503, str(error)) from error
    return Response(png if width is None else shrink(png, width), media_type="image/png", headers=headers)


def _draw(blobs: Blobs, shown: Pictured, what: What, top: int | None, other: Pictured | None, view: str) -> bytes:
    if view == "difference" and other is not None:
        return paint_difference(blobs, shown, other, what, top)
    if what == "image":
        return _whole(blobs, shown.image)
    return paint(blobs, shown, what, top, other)


def _whole(blobs: Blobs, name: str) -> bytes:
    """A stored image as it is; one that is larger than any picture, or none, is refused."""
    content = bytearray()
    for piece in blobs.read(name):
        content += piece
        if len(content) > MOST_BYTES:
            raise BlobError(f"The stored picture {name[:12]} has more than {MOST_BYTES >> 20} MB: it is not shown.")
    if _type_of(content) != "image/png":
        raise BlobError(f"The stored picture {name[:12]} is no PNG: measure again.")
    return bytes(content)


def _pair(session: Session, job_id: str, against: str | None) -> tuple[Pictured, Pictured | None]:
    return find_pictured(session, job_id), None if against is None else find_pictured(session, against)


def _typed(pieces: Iterator[bytes]) -> tuple[str | None, Iterator[bytes]]:
    """A file's media type by its first bytes, and the whole of it."""
    first = next(pieces, b"")
    return _type_of(first), chain((first,), pieces)


def _type_of(content: bytes | bytearray) -> str | None:
    return next((kind for magic, kind in TYPES.items() if content.startswith(magic)), None)


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]
