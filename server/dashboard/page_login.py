"""Logging in to the pages with a token, and out."""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.concurrency import run_in_threadpool

from server.access import tokens
from server.access.middleware import COOKIE, session_text
from server.api.state import database_of
from server.dashboard.templates import render
from server.guard import from_own_page
from server.problems import Problem

router = APIRouter(include_in_schema=False)


@router.get("/login")
def login_page(request: Request) -> Response:
    """A form for a token."""
    return _page(request, _own_path(request.query_params.get("next", "/")), None, 200)


@router.post("/login")
async def login(request: Request) -> Response:
    """Begin a session, in a cookie that scripts cannot read and other sites cannot send along with a write."""
    form = await _read_form(request)
    there = _own_path(form.get("next", "/"))
    text = form.get("token", "").strip()
    session = await run_in_threadpool(tokens.begin_session, database_of(request), text)
    if session is None:
        return _page(request, there, "This token is unknown, expired or revoked.", 403)
    answer = RedirectResponse(there, 303)
    answer.set_cookie(
        COOKIE,
        session,
        max_age=int(tokens.SESSION.total_seconds()),
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="lax",
    )
    return answer


@router.post("/logout")
async def logout(request: Request) -> Response:
    """End the session."""
    await _read_form(request)
    text = session_text(request.headers)
    if text is not None:
        await run_in_threadpool(tokens.end_session, database_of(request), text)
    answer = RedirectResponse("/login", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="lax")
    return answer


def _page(request: Request, there: str, refusal: str | None, status: int) -> Response:
    answer = render(request, "login.html", {"next": there, "refusal": refusal})
    answer.status_code = status
    answer.headers["Cache-Control"] = "no-store"
    return answer


async def _read_form(request: Request) -> dict[str, str]:
    if not from_own_page(request.headers):
        raise Problem(403, "This form is good for this service's own pages: open it in a browser.")
    try:
        fields = parse_qs((await request.body()).decode("ascii"), max_num_fields=10)
    except ValueError as error:
        raise Problem(400, "The form cannot be read: send it from the page.") from error
    return {name: values[0] for name, values in fields.items()}


def _own_path(text: str) -> str:
    """A path of this service; the start page for anything that a browser could take for another site's address."""
    parts = urlsplit(text) if text.isascii() and text.isprintable() and "\\" not in text else None
    own = parts is not None and not parts.scheme and not parts.netloc and text.startswith("/")
    return text if own and not text.startswith("//") else "/"
