"""Flattens shader texts: defines, then files with their includes in place, each once. Hosts see only the result."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib import resources

_INCLUDE = "#include "

_HEADER = """#version 310 es
#extension GL_EXT_gpu_shader5 : enable
precision highp float;
precision highp int;
#ifdef GL_EXT_gpu_shader5
#define PRECISE precise
#else
#define PRECISE
#endif
"""


def flatten(defines: Mapping[str, int], parts: Sequence[str]) -> str:
    """Join shader parts under the defines; a part is a file name in `shaders/` or GLSL text (with a newline)."""
    seen: set[str] = set()
    lines = [f"#define {name} {value}" for name, value in defines.items()]
    body = [part if "\n" in part else _read(part, seen) for part in parts]
    return _HEADER + "\n".join(lines) + "\n" + "\n".join(body)


def digest(text: str) -> str:
    """The sha256 of a flattened text, as results carry it."""
    return hashlib.sha256(text.encode()).hexdigest()


def _read(name: str, seen: set[str]) -> str:
    if name in seen:
        return ""
    seen.add(name)
    text = resources.files("shaders").joinpath(name).read_text(encoding="utf-8")
    out: list[str] = []
    for line in text.splitlines():
        if line.startswith(_INCLUDE):
            out.append(_read(line[len(_INCLUDE) :].strip().strip('"'), seen))
        else:
            out.append(line)
    return "\n".join(out) + "\n"
