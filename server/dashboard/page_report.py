"""The report of a study: the paper's figures and claims from its stored results."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from server.api.claims import study_results
from server.api.profiles import blobs_of
from server.api.state import database_of
from server.guard import CSP, REPORT_POLICY
from server.pictures.taken import is_name
from server.store.blobs import BlobError, Blobs

if TYPE_CHECKING:
    from server.paper.heatmaps import Pictures

router = APIRouter(include_in_schema=False)

MOST_BYTES = 64 << 20
"""A stored picture that is larger is left out."""


@router.get("/studies/{study_id}/report")
def report_page(study_id: str, request: Request, download: bool = False) -> Response:
    """One page that needs no other; with `download` as a file, without links to the service."""
    from server.paper.report import Links, render_report

    name, documents = study_results(database_of(request), study_id)
    here = f"/studies/{int(study_id)}"
    links = None if download else Links(here, f"{here}/report?download=true")
    title = f"The paper's figures and claims: study {int(study_id)}, {name}"
    text, _ = render_report(documents, _reader(blobs_of(request)), links, title)
    headers = {CSP: REPORT_POLICY}
    if download:
        headers["Content-Disposition"] = f'attachment; filename="rayfarm-study-{int(study_id)}.html"'
    return HTMLResponse(text, headers=headers)


def _reader(blobs: Blobs) -> Pictures:
    def read(sha256: str) -> bytes | None:
        content = bytearray()
        try:
            for piece in blobs.read(sha256) if is_name(sha256) else ():
                content += piece
                if len(content) > MOST_BYTES:
                    return None
        except BlobError:
            return None
        return bytes(content) or None

    return read
