"""What a study of hard cases was run with."""

from __future__ import annotations

import hashlib
from importlib import resources
from importlib.metadata import version

from renderer.plan import VERSION


def versions() -> dict[str, str | int]:
    """RayFarm's version, the plan's, and one digest of all shader sources: a study runs most of them."""
    digest = hashlib.sha256()
    for file in sorted(resources.files("shaders").iterdir(), key=lambda file: file.name):
        if file.is_file():
            digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return {"rayfarm": version("rayfarm"), "plan": VERSION, "shader_sha": digest.hexdigest()}
