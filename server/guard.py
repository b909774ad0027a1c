"""Who may speak to the service, and what its pages may load."""

from __future__ import annotations

import re
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.problems import Problem, problem

PLOTLY_STYLES = (
    "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='",
    "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='",
)
"""The two style elements that plotly.js 7.1 makes: an empty one that it adds rules to, and its maps' sheet."""

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        f"style-src-elem 'self' {' '.join(PLOTLY_STYLES)}",
        "style-src-attr 'unsafe-inline'",  # plotly.js writes style attributes; our own pages do not.
        "img-src 'self' data:",
        "connect-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )
)
CSP = "Content-Security-Policy"
REPORT_POLICY = "; ".join(
    ("default-src 'none'", "style-src 'unsafe-inline'", "img-src data:", "base-uri 'none'", "frame-ancestors 'none'")
)
"""For reports of one file, which carry their style and pictures in themselves and run nothing."""

HEADERS = {
    CSP: POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}
MOST_BODY = 1 << 20
"""Bytes of a body; the routes that take files count for themselves."""
FILES = re.compile(r"/api/v1/(jobs/[^/]+/profiles|hard-cases)")


class Guard:
    """Refuses foreign `Host` names (DNS rebinding) and writes that a page of another origin sends."""

    def __init__(self, app: ASGIApp, allowed_hosts: Iterable[str]) -> None:
        self.app = app
        self.allowed = {host.lower() for host in allowed_hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, with the policy's headers on its answer, or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        refused = self._refusal(scope["method"], Headers(scope=scope))
        if refused is not None:
            await problem(*refused)(scope, receive, send_with_headers)
            return
        counted = receive if FILES.fullmatch(scope["path"]) else _counted(receive)
        await self.app(scope, counted, send_with_headers)

    def _refusal(self, method: str, headers: Headers) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if "*" not in self.allowed and _without_port(host) not in self.allowed:
            return 400, f"This service does not answer as {host!r}: add the name to RAYFARM_ALLOWED_HOSTS."
        if method not in ("GET", "HEAD", "OPTIONS") and "origin" in headers and not from_own_page(headers):
            return 403, "A page of another origin may not write here."
        return None


def from_own_page(headers: Headers) -> bool:
    """Whether a page of this very service sent a request: browsers tell the origin of every write."""
    host, site = headers.get("host", ""), headers.get("sec-fetch-site", "same-origin")
    return urlsplit(headers.get("origin", "")).netloc == host != "" and site == "same-origin"


def _counted(receive: Receive) -> Receive:
    """A body that is refused once it is too large, whatever length it announced."""
    taken = 0

    async def receive_counted() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > MOST_BODY:
            raise Problem(413, f"The body has more than {MOST_BODY >> 20} MiB: ask for less at once.")
        return message

    return receive_counted


def _without_port(host: str) -> str:
    name, colon, port = host.lower().rpartition(":")
    return name if colon and port.isdigit() else host.lower()
