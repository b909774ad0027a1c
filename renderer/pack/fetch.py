"""How shaders read the scene: from storage buffers, or from textures of four words a texel, sampled or as images.

ES 3.1 has no buffer textures, so texel i lies in column i mod WIDTH of row i / WIDTH of a texture with two dimensions.
It promises textures of 2048 texels a side, and images in compute shaders, but no storage blocks or images in fragment
shaders.
"""

from __future__ import annotations

from typing import Literal

from renderer.plan import TEXEL_WORDS

Fetch = Literal["storage", "texture", "image"]

_WIDTH_BITS = 11
WIDTH = 1 << _WIDTH_BITS
"""Texels in a row."""

BINDINGS = {"nodes": 0, "primitives": 1, "normals": 2, "baked": 2}
"""The buffers that are fetched from, and where storage buffers are bound; images are one further on, textures go by
name."""


def rows(words: int) -> int:
    """The rows of a texture of that many words; at least one."""
    return max(-(-words // (TEXEL_WORDS * WIDTH)), 1)


def reader(name: str, fetch: str, vector: int = 4) -> str:
    """The GLSL that declares a buffer of BINDINGS; `NAME_at(i)` is its chunk i, `vector` words."""
    if fetch == "storage":
        declared = f"readonly restrict buffer {name.capitalize()} {{ uvec{vector} {name}[]; }};"
        return f"layout(std430, binding = {BINDINGS[name]}) {declared}\n#define {name}_at(i) {name}[i]\n"
    texel = "i" if vector == TEXEL_WORDS else "(i >> 1)"
    place = f"ivec2({texel} & {WIDTH - 1}u, {texel} >> {_WIDTH_BITS})"
    if fetch == "texture":
        declared, read = f"uniform highp usampler2D {name};", f"texelFetch({name}, {place}, 0)"
    else:
        declared = f"layout(rgba32ui, binding = {image_unit(name)}) readonly restrict uniform highp uimage2D {name};"
        read = f"imageLoad({name}, {place})"
    if vector == TEXEL_WORDS:
        return f"{declared}\nuvec4 {name}_at(uint i) {{ return {read}; }}\n"
    return f"{declared}\nuvec2 {name}_at(uint i) {{ uvec4 two = {read}; return (i & 1u) == 0u ? two.xy : two.zw; }}\n"


def image_unit(name: str) -> int:
    """Where an image of a buffer is bound; unit 0 has the canvas."""
    return BINDINGS[name] + 1
