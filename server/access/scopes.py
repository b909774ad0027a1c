"""What a token may do, and which of it a request needs. A write that is not stated here is for `admin` alone."""

from __future__ import annotations

import re
from typing import Literal, get_args

Scope = Literal["submit", "read", "worker", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
IMPLIED: dict[Scope, tuple[Scope, ...]] = {
    "read": ("read",),
    "submit": ("submit", "read"),
    "worker": ("worker", "read"),
    "admin": SCOPES,
}
"""What each scope includes: who submits or cares for devices also reads."""

SAFE = ("GET", "HEAD", "OPTIONS")
PUBLIC = ("/livez", "/readyz", "/login", "/logout", "/static/")
"""Paths that need no token; one that ends in a slash stands for all below it."""

WRITES: dict[tuple[str, str], Scope] = {
    ("POST", "/api/v1/jobs"): "submit",
    ("POST", "/api/v1/jobs/{job_id}/cancel"): "submit",
    ("POST", "/api/v1/jobs/{job_id}/profiles"): "submit",
    ("POST", "/api/v1/studies"): "submit",
    ("POST", "/api/v1/studies/plan"): "read",
    ("POST", "/api/v1/studies/{study_id}/cancel"): "submit",
    ("POST", "/api/v1/recommendations"): "submit",
    ("POST", "/api/v1/hard-cases"): "submit",
    ("POST", "/api/v1/devices"): "worker",
    ("POST", "/api/v1/devices/pair"): "worker",
    ("POST", "/api/v1/devices/{device_id}/clear"): "worker",
    ("DELETE", "/api/v1/devices/{device_id}"): "admin",
}
"""The scope of each route that changes something, by method and path as the router has them."""

_PATTERNS = [
    (method, re.compile(re.sub(r"\{[a-z_]+\}", "[^/]+", path)), scope) for (method, path), scope in WRITES.items()
]


def needed(method: str, path: str) -> Scope | None:
    """The scope that a request needs, None where it needs none."""
    if is_public(path):
        return None
    if method in SAFE:
        return "read"
    stated = (scope for verb, pattern, scope in _PATTERNS if verb == method and pattern.fullmatch(path))
    return next(stated, "admin")


def is_public(path: str) -> bool:
    """Whether a path needs no token."""
    return any(path.startswith(each) if each.endswith("/") else path == each for each in PUBLIC)


def includes(scopes: tuple[Scope, ...], wanted: Scope) -> bool:
    """Whether a token of `scopes` may do what needs `wanted`."""
    return any(wanted in IMPLIED[scope] for scope in scopes)
