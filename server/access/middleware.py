"""The middleware that finds out who sends a request and whether they may, before any of its body is read."""

from __future__ import annotations

import logging
import math
from http.cookies import CookieError, SimpleCookie
from urllib.parse import quote

from anyio import to_thread
from starlette.datastructures import Headers
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from server.access import tokens
from server.access.limits import Limit
from server.access.scopes import SAFE, includes, needed
from server.access.scopes import Scope as Wanted
from server.access.tokens import Holder
from server.guard import from_own_page
from server.logs import facts
from server.problems import AGAIN_S, problem
from server.store.errors import AWAY, sentence

log = logging.getLogger("rayfarm.access")

COOKIE = "rayfarm_session"
HOLDER = "holder"
"""Where in a request's scope its holder is, None for nobody."""


class Access:
    """Asks for tokens where they are `required`; a token that is sent is checked in any case."""

    def __init__(self, app: ASGIApp, required: bool, limit: Limit) -> None:
        self.app = app
        self.required = required
        self.limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with its holder, or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        scope[HOLDER] = None
        wanted = needed(scope["method"], scope["path"])
        if wanted is not None:
            try:
                refused = await self._refusal(scope, wanted)
            except AWAY as error:
                refused = problem(503, sentence(error), {"Retry-After": str(AGAIN_S)})
            if refused is not None:
                await refused(scope, receive, send)
                return
        await self.app(scope, receive, send)

    async def _refusal(self, scope: Scope, wanted: Wanted) -> Response | None:
        headers = Headers(scope=scope)
        scheme, _, sent = headers.get("authorization", "").partition(" ")
        cookie = None if scheme else session_text(headers)
        text = sent.strip() if scheme.lower() == "bearer" else cookie
        holder = await to_thread.run_sync(tokens.find, scope["app"].state.database, text) if text else None
        if scheme and holder is None:
            log.warning("a token was refused", extra=facts(client=(scope.get("client") or [None])[0]))
            return _unauthorized("This token is unknown, expired or revoked: ask for another.")
        if holder is None and self.required:
            return _ask(scope, headers)
        if holder is not None and holder.session and scope["method"] not in SAFE and not from_own_page(headers):
            return problem(403, "A session is good for this service's own pages: send a token instead.")
        if holder is not None and not includes(holder.scopes, wanted):
            return problem(403, f"This needs a token with the scope {wanted}: make one with `rayfarm tokens create`.")
        scope[HOLDER] = holder
        return self._wait(scope, holder) if wanted == "submit" else None

    def _wait(self, scope: Scope, holder: Holder | None) -> Response | None:
        # Without tokens everybody is the same user of this machine, whom nothing is gained by limiting.
        seconds = self.limit.wait_s(holder.id) if holder else 0.0
        if not seconds:
            return None
        after = math.ceil(seconds)
        said = f"These are too many submissions: wait {after} s, or put the work into one study."
        return problem(429, said, {"Retry-After": str(after)})


def session_text(headers: Headers) -> str | None:
    """The session that a page sent."""
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return None
    return found.value if found else None


def _ask(scope: Scope, headers: Headers) -> Response:
    """Where to log in, for a page; for anything else that a token is needed."""
    path = scope["path"]
    page = scope["method"] == "GET" and "text/html" in headers.get("accept", "") and not path.startswith("/api/")
    if not page:
        return _unauthorized("This service needs a token: send Authorization: Bearer ID.SECRET (RAYFARM_TOKEN).")
    query = scope["query_string"].decode("latin-1")
    return RedirectResponse(f"/login?next={quote(path + ('?' + query if query else ''), safe='')}", 303)


def _unauthorized(sentence: str) -> Response:
    return problem(401, sentence, {"WWW-Authenticate": "Bearer"})
