"""Node layouts: one table that gives the GLSL accessors, the packing, and the sizes.

A node is a few 32-bit words, fetched in chunks of two (`uvec2`) or four (`uvec4`). Inner nodes and leaves may use the
same words for different fields. BVH traversals fetch a node's box and its link word by the generated `fetch_node`,
whatever the node format, and read the link word's fields by `node_NAME(link)`; KD traversals read `node_NAME(chunk)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from renderer.pack.grid import Grid

LEAF = 0
"""The `axis` of a leaf in every layout; inner nodes have 1, 2 or 3. Pixels that a draw does not cover run along in
their neighbours' loops and read zeros: an empty leaf, at which every traversal ends."""

TAIL = -1
"""The `word` of a field that lies behind the nodes, one word a node."""

PACKED: tuple[Literal["grid16", "half"], ...] = ("grid16", "half")
"""The node formats that hold a box in three words."""

Owner = Literal["all", "inner", "leaf"]
Tail = Literal["none", "triangles", "links"]
Order = Literal["siblings", "depth-first", "octants"]


@dataclass(frozen=True)
class Field:
    """One field: its name, first word, bits within that word, and which nodes have it.

    `kind` is `uint` (with `shift` and `bits`), `float` (one word), `vec3` (three words of one chunk), or `grid16` and
    `half`: a box in three words of one chunk, one an axis, its lower face in the low half. `grid16` counts cells of the
    grid that the packed nodes carry, `half` is a half-precision float.
    """

    name: str
    word: int
    kind: Literal["uint", "float", "vec3", "grid16", "half"] = "uint"
    shift: int = 0
    bits: int = 32
    owner: Owner = "all"


@dataclass(frozen=True)
class NodeLayout:
    """How one structure's nodes lie in the storage buffer: `words` a node, `vector` words a chunk.

    `order` says how nodes follow one another: siblings beside each other at an even and an odd index, the root at 0; or
    depth first, ending with a node of zeros. In `octants` there is such an order for each octant of ray directions,
    one after the other; its boxes have their near faces where others have their lower ones.
    `tail` says what follows the nodes in the same buffer: the list through which leaves name `triangles`, or the
    nodes' `links`, a word each, where they have no room for them.
    """

    words: int
    vector: Literal[2, 4]
    fields: tuple[Field, ...]
    tail: Tail = "none"
    order: Order = "siblings"

    def field(self, name: str) -> Field | None:
        """The field of that name, None where the layout has none."""
        return next((field for field in self.fields if field.name == name), None)


_PLANE = (
    Field("split", 0, "float", owner="inner"),
    Field("first", 0, owner="leaf"),
    Field("axis", 1, shift=0, bits=2),
    Field("child", 1, shift=2, bits=30, owner="inner"),
    Field("count", 1, shift=2, bits=30, owner="leaf"),
)


def _link(inner: str) -> tuple[Field, ...]:
    """The link word of a box's node: an inner one's field is `inner`."""
    return (
        Field("axis", 3, shift=0, bits=2),
        Field(inner, 3, shift=2, bits=30, owner="inner"),
        Field("count", 3, shift=2, bits=6, owner="leaf"),
        Field("first", 3, shift=8, bits=24, owner="leaf"),
    )


def _parent(word: int) -> tuple[Field, Field]:
    return Field("parent_axis", word, shift=0, bits=2), Field("parent", word, shift=2, bits=30)


def _boxes(inner: str = "child", order: Order = "siblings", *, parents: bool = False) -> dict[str, NodeLayout]:
    """A box and a link word in every node format; a parent's word has room beside a box of floats alone."""
    floats = (Field("lower", 0, "vec3"), *_link(inner), Field("upper", 4, "vec3"), *(_parent(7) if parents else ()))
    tail: Tail = "links" if parents else "none"
    behind = _parent(TAIL) if parents else ()
    formats = {"f32": NodeLayout(8, 4, floats, order=order)}
    for kind in PACKED:
        formats[kind] = NodeLayout(4, 4, (Field("box", 0, kind), *_link(inner), *behind), tail, order)
    return formats


NODE_LAYOUTS: dict[str, dict[str, NodeLayout]] = {
    "box": _boxes(),
    "box-parent": _boxes(parents=True),
    "skip": _boxes("skip", "depth-first"),
    "skip-octants": _boxes("skip", "octants"),
    "plane": {"f32": NodeLayout(2, 2, _PLANE, tail="triangles")},
    "plane-box": {
        "f32": NodeLayout(
            12,
            4,
            (*_PLANE, Field("lower", 4, "vec3"), Field("parent", 7), Field("upper", 8, "vec3")),
            tail="triangles",
        )
    },
}
"""By what a traversal reads of a node, then by node format."""


def glsl(name: str, node_format: str = "f32", grid: Grid | None = None) -> str:
    """The GLSL that declares the node buffer of a layout and reads its chunks and fields.

    A grid that is given is written into the text; else it is read from uniforms, which Mesa loads again in every step.
    Every read is noted for `shaders/common_reads.glsl`, which comes before it; a chunk counts as read whole.
    """
    layout = NODE_LAYOUTS[name][node_format]
    chunk = f"uvec{layout.vector}"
    chunks = layout.words // layout.vector
    at = f"node * {chunks}u + chunk" if chunks > 1 else "node + chunk"
    lines = [
        f"// Node layout `{name}`, format `{node_format}`: {layout.words} words a node.",
        f"const uint LEAF = {LEAF}u;",
        f"layout(std430, binding = 0) readonly restrict buffer Nodes {{ {chunk} nodes[]; }};",
        _reader(
            f"{chunk} node_chunk(uint node, uint chunk)", f"nodes[{at}]", layout.vector, f"{layout.vector}u * ({at})"
        ),
    ]
    lines += _tail_readers(layout)
    is_bvh = layout.tail != "triangles"
    types = ["uint"] if is_bvh else sorted({chunk, "uvec2"})
    for field in layout.fields:
        lines += [_accessor(layout, field, of) for of in types if _fits(layout, field, of)]
    return "\n".join(lines + (_fetch_node(layout, grid) if is_bvh else [])) + "\n"


def _tail_readers(layout: NodeLayout) -> list[str]:
    """What reads a node's parent by itself, and an entry of a KD-tree's list."""
    shift, mask = (1, 1) if layout.vector == 2 else (2, 3)
    lines = []
    parent = layout.field("parent")
    if parent is not None and parent.word == TAIL:
        value = f"nodes[uint(TAIL_AT) + (node >> {shift})][node & {mask}u]"
        lines.append(_reader("uint node_links(uint node)", value, 1, f"uint(TAIL_AT) * {layout.vector}u + node"))
    elif parent is not None:
        nth, component = divmod(parent.word, layout.vector)
        value = f"nodes[node * {layout.words // layout.vector}u + {nth}u].{'xyzw'[component]}"
        lines.append(_reader("uint node_links(uint node)", value, 1, f"node * {layout.words}u + {parent.word}u"))
    if layout.tail == "triangles":
        value = f"nodes[uint(TAIL_AT) + (i >> {shift})][i & {mask}u]"
        lines.append(_reader("uint node_ref(uint i)", value, 1, f"uint(TAIL_AT) * {layout.vector}u + i"))
    return lines


_BOXES = {
    "grid16": (
        "vec3 grid_point(uvec3 cells) { PRECISE vec3 p = grid_origin + vec3(cells) * grid_cell; return p; }",
        "void node_box(uvec4 c, out vec3 lower, out vec3 upper) {",
        "    lower = grid_point(c.xyz & 0xffffu);",
        "    upper = grid_point(c.xyz >> 16);",
        "}",
    ),
    "half": (
        "void node_box(uvec4 c, out vec3 lower, out vec3 upper) {",
        "    vec2 x = unpackHalf2x16(c.x);",
        "    vec2 y = unpackHalf2x16(c.y);",
        "    vec2 z = unpackHalf2x16(c.z);",
        "    lower = vec3(x.x, y.x, z.x);",
        "    upper = vec3(x.y, y.y, z.y);",
        "}",
    ),
}


def _grid(grid: Grid | None) -> list[str]:
    if grid is None:
        return ["uniform vec3 grid_origin;", "uniform vec3 grid_cell;"]
    lines = []
    for name, values in (("origin", grid.origin), ("cell", grid.cell)):
        words = ", ".join(f"{word}u" for word in values.astype(np.float32).view(np.uint32))
        lines.append(f"#define grid_{name} uintBitsToFloat(uvec3({words}))")
    return lines


def _fetch_node(layout: NodeLayout, grid: Grid | None) -> list[str]:
    """The BVH traversals' way to a node: its box and link word, and its parent's word where the layout has one."""
    parent = layout.field("parent")
    packed = layout.field("box")
    lines = _grid(grid) if packed is not None and packed.kind == "grid16" else []
    lines += _BOXES[packed.kind] if packed is not None else ()
    lines += [f"const int NODE_WORDS = {(4 if packed is not None else 7) + (parent is not None)};"]
    if layout.order == "octants":
        shift = 4 if layout.words == 8 else 3
        lines.append(f"uint node_copy(uint octant) {{ return octant * (uint(nodes.length()) >> {shift}); }}")
    head = "void fetch_node(uint node, out vec3 lower, out vec3 upper, out uint link"
    lines += [f"{head}{', out uint links' if parent is not None else ''}) {{", "    uvec4 low = node_chunk(node, 0u);"]
    if packed is not None:
        lines += ["    node_box(low, lower, upper);"]
    else:
        lines += ["    uvec4 high = node_chunk(node, 1u);"]
        lines += ["    lower = uintBitsToFloat(low.xyz);", "    upper = uintBitsToFloat(high.xyz);"]
    if parent is not None:
        lines += [f"    links = {'node_links(node)' if packed is not None else 'high.w'};"]
    return [*lines, "    link = low.w;", "}"]


def _reader(head: str, value: str, words: int, first: str) -> str:
    """A function that reads the buffer: `words` words from the word `first` on."""
    return f"{head} {{ NOTE_READ(READ_NODES, {words}u, {first}); return {value}; }}"


def _fits(layout: NodeLayout, field: Field, chunk: str) -> bool:
    """Whether a shorter vector keeps the first words of the chunk, with the field; a single word holds a `uint`."""
    if chunk == "uint":
        return field.kind == "uint"
    return field.word % layout.vector < int(chunk[-1]) and (field.kind != "vec3" or chunk == "uvec4")


def _accessor(layout: NodeLayout, field: Field, chunk: str) -> str:
    component = "xyzw"[field.word % layout.vector]
    if field.kind == "vec3":
        return f"vec3 node_{field.name}({chunk} c) {{ return uintBitsToFloat(c.xyz); }}"
    if field.kind == "float":
        return f"float node_{field.name}({chunk} c) {{ return uintBitsToFloat(c.{component}); }}"
    value = "c" if chunk == "uint" else f"c.{component}"
    if field.shift:
        value = f"{value} >> {field.shift}"
    if field.shift + field.bits < 32:
        value = f"({value}) & {(1 << field.bits) - 1}u"
    return f"uint node_{field.name}({chunk} c) {{ return {value}; }}"
