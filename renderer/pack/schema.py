"""Node layouts: one table that gives the GLSL accessors, the packing, and the sizes.

A node is a few 32-bit words, fetched in chunks of two (`uvec2`) or four (`uvec4`). Inner nodes and leaves may use the
same words for different fields. Traversals read fields by the generated `node_NAME(chunk)` functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LEAF = 0
"""The `axis` of a leaf in every layout; inner nodes have 1, 2 or 3. Pixels that a draw does not cover run along in
their neighbours' loops and read zeros: an empty leaf, at which every traversal ends."""

Owner = Literal["all", "inner", "leaf"]


@dataclass(frozen=True)
class Field:
    """One field: its name, first word, bits within that word, and which nodes have it.

    `kind` is `uint` (with `shift` and `bits`), `float` (one word) or `vec3` (three words of one chunk).
    """

    name: str
    word: int
    kind: Literal["uint", "float", "vec3"] = "uint"
    shift: int = 0
    bits: int = 32
    owner: Owner = "all"


@dataclass(frozen=True)
class NodeLayout:
    """How one structure's nodes lie in the storage buffer: `words` a node, `vector` words a chunk.

    `refs` says that leaves name triangles through a list that follows the nodes in the same buffer.
    """

    words: int
    vector: Literal[2, 4]
    fields: tuple[Field, ...]
    refs: bool = False

    def field(self, name: str) -> Field | None:
        """The field of that name, None where the layout has none."""
        return next((field for field in self.fields if field.name == name), None)


_BOX = (
    Field("lower", 0, "vec3"),
    Field("axis", 3, shift=0, bits=2),
    Field("child", 3, shift=2, bits=30, owner="inner"),
    Field("count", 3, shift=2, bits=6, owner="leaf"),
    Field("first", 3, shift=8, bits=24, owner="leaf"),
    Field("upper", 4, "vec3"),
)
_PLANE = (
    Field("split", 0, "float", owner="inner"),
    Field("first", 0, owner="leaf"),
    Field("axis", 1, shift=0, bits=2),
    Field("child", 1, shift=2, bits=30, owner="inner"),
    Field("count", 1, shift=2, bits=30, owner="leaf"),
)

NODE_LAYOUTS: dict[str, NodeLayout] = {
    "box": NodeLayout(8, 4, _BOX),
    "box-parent": NodeLayout(
        8, 4, (*_BOX, Field("parent_axis", 7, shift=0, bits=2), Field("parent", 7, shift=2, bits=30))
    ),
    "plane": NodeLayout(2, 2, _PLANE, refs=True),
    "plane-box": NodeLayout(
        12, 4, (*_PLANE, Field("lower", 4, "vec3"), Field("parent", 7), Field("upper", 8, "vec3")), refs=True
    ),
}


def glsl(name: str) -> str:
    """The GLSL that declares the node buffer of a layout and reads its chunks and fields.

    Every read is noted for `shaders/common_reads.glsl`, which comes before it; a chunk counts as read whole.
    """
    layout = NODE_LAYOUTS[name]
    chunk = f"uvec{layout.vector}"
    chunks = layout.words // layout.vector
    at = f"node * {chunks}u + chunk"
    lines = [
        f"// Node layout `{name}`: {layout.words} words a node.",
        f"const uint LEAF = {LEAF}u;",
        f"layout(std430, binding = 0) readonly restrict buffer Nodes {{ {chunk} nodes[]; }};",
        _reader(
            f"{chunk} node_chunk(uint node, uint chunk)", f"nodes[{at}]", layout.vector, f"{layout.vector}u * ({at})"
        ),
    ]
    types = {chunk, "uvec2"} if layout.refs else {chunk}
    for field in layout.fields:
        lines += [_accessor(layout, field, of) for of in sorted(types) if _fits(layout, field, of)]
    parent = layout.field("parent")
    if parent is not None:
        nth, component = divmod(parent.word, layout.vector)
        value = f"nodes[node * {chunks}u + {nth}u].{'xyzw'[component]}"
        lines.append(_reader("uint node_links(uint node)", value, 1, f"node * {layout.words}u + {parent.word}u"))
    if layout.refs:
        shift, mask = (1, 1) if layout.vector == 2 else (2, 3)
        value = f"nodes[uint(REFS_AT) + (i >> {shift})][i & {mask}u]"
        lines.append(_reader("uint node_ref(uint i)", value, 1, f"uint(REFS_AT) * {layout.vector}u + i"))
    return "\n".join(lines) + "\n"


def _reader(head: str, value: str, words: int, first: str) -> str:
    """A function that reads the buffer: `words` words from the word `first` on."""
    return f"{head} {{ NOTE_READ(READ_NODES, {words}u, {first}); return {value}; }}"


def _fits(layout: NodeLayout, field: Field, chunk: str) -> bool:
    """Whether the field lies in the first words of its chunk that a shorter vector keeps."""
    return field.word % layout.vector < int(chunk[-1]) and (field.kind != "vec3" or chunk == "uvec4")


def _accessor(layout: NodeLayout, field: Field, chunk: str) -> str:
    component = "xyzw"[field.word % layout.vector]
    if field.kind == "vec3":
        return f"vec3 node_{field.name}({chunk} c) {{ return uintBitsToFloat(c.xyz); }}"
    if field.kind == "float":
        return f"float node_{field.name}({chunk} c) {{ return uintBitsToFloat(c.{component}); }}"
    value = f"c.{component}"
    if field.shift:
        value = f"{value} >> {field.shift}"
    if field.shift + field.bits < 32:
        value = f"({value}) & {(1 << field.bits) - 1}u"
    return f"uint node_{field.name}({chunk} c) {{ return {value}; }}"
