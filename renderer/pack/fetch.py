"""How shaders read the scene: from storage buffers, or from integer textures whose texels are the buffers' chunks.

ES 3.1 has no buffer textures, so chunk i is texel (i mod WIDTH, i / WIDTH) of a texture with two dimensions. It
promises textures of 2048 texels a side, but no storage blocks in fragment shaders.
"""

from __future__ import annotations

from typing import Literal

Fetch = Literal["storage", "texture"]

_WIDTH_BITS = 11
WIDTH = 1 << _WIDTH_BITS
"""Texels in a row."""

BINDINGS = {"nodes": 0, "primitives": 1, "normals": 2, "baked": 2}
"""The buffers that both ways fetch from, and where storage buffers are bound; textures go by the same names."""


def rows(words: int, vector: int) -> int:
    """The rows that a buffer of that many words takes, chunks of `vector` words each; at least one."""
    return max(-(-words // (vector * WIDTH)), 1)


def reader(name: str, fetch: str, vector: int = 4) -> str:
    """The GLSL that declares a buffer of BINDINGS; `NAME_at(i)` is its chunk i, `vector` words."""
    if fetch == "storage":
        declared = f"readonly restrict buffer {name.capitalize()} {{ uvec{vector} {name}[]; }};"
        return f"layout(std430, binding = {BINDINGS[name]}) {declared}\n#define {name}_at(i) {name}[i]\n"
    texel = f"texelFetch({name}, ivec2(i & {WIDTH - 1}u, i >> {_WIDTH_BITS}), 0){'.xy' if vector == 2 else ''}"
    return f"uniform highp usampler2D {name};\nuvec{vector} {name}_at(uint i) {{ return {texel}; }}\n"
