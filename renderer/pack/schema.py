"""Node layouts: one table that gives the GLSL accessors, the packing, and the sizes.

A node is a few 32-bit words, fetched in chunks of two (`uvec2`) or four (`uvec4`). Inner nodes and leaves may use the
same words for different fields. BVH traversals fetch a node's box and its link word by the generated `fetch_node`,
whatever the node format, and read the link word's fields by `node_NAME(link)`; KD traversals read `node_NAME(chunk)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from renderer.pack.fetch import reader
from renderer.pack.grid import Grid

LEAF = 0
"""The `axis` of a leaf in every layout; inner nodes have 1, 2 or 3. Pixels that a draw does not cover run along in
their neighbours' loops and read zeros: an empty leaf, at which every traversal ends."""

TAIL = -1
"""The `word` of a field that lies behind the nodes, one word a node."""

PACKED: tuple[Literal["grid16", "half"], ...] = ("grid16", "half")
"""The node formats that hold a box in three words."""

Owner = Literal["all", "inner", "leaf"]
Tail = Literal["none", "triangles", "links", "paths"]
Order = Literal["siblings", "depth-first", "octants", "quads"]


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
class Pruning:
    """Which nodes of a tree are worth their test, as `renderer.build.pruned` takes it."""

    width: int
    triangle: float
    spread: float


@dataclass(frozen=True)
class NodeLayout:
    """How one structure's nodes lie in the storage buffer: `words` a node, `vector` words a chunk.

    `order` says how nodes follow one another: siblings beside each other at an even and an odd index, the root at 0; or
    depth first, ending with a node of zeros. In `octants` there is such an order for each octant of ray directions,
    one after the other; its boxes have their near faces where others have their lower ones. One more node of zeros
    follows all, so that every node has a next one. Depth first, only those nodes are there that are worth their
    test, as `pruning` has it. In `quads` a node's four children lie beside each other, in the order of a wide BVH's
    nodes.
    `tail` says what follows the nodes in the same buffer: the list through which leaves name `triangles`, or the
    nodes' `links`, a word each, where they have no room for them, or the table of `paths`.
    """

    words: int
    vector: Literal[2, 4]
    fields: tuple[Field, ...]
    tail: Tail = "none"
    order: Order = "siblings"
    pruning: Pruning | None = None

    def field(self, name: str) -> Field | None:
        """The field of that name, None where the layout has none."""
        return next((field for field in self.fields if field.name == name), None)

    def named(self, name: str) -> Field:
        """The field of that name, which the layout has."""
        return next(field for field in self.fields if field.name == name)


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


def _boxes(
    inner: str = "child", order: Order = "siblings", tail: Tail = "none", pruning: Pruning | None = None
) -> dict[str, NodeLayout]:
    """A box and a link word in every node format; a parent's word (`links`) has room beside a box of floats alone."""
    parents = tail == "links"
    floats = (Field("lower", 0, "vec3"), *_link(inner), Field("upper", 4, "vec3"), *(_parent(7) if parents else ()))
    behind = _parent(TAIL) if parents else ()
    formats = {"f32": NodeLayout(8, 4, floats, "none" if parents else tail, order, pruning)}
    for kind in PACKED:
        formats[kind] = NodeLayout(4, 4, (Field("box", 0, kind), *_link(inner), *behind), tail, order, pruning)
    return formats


def _framed() -> NodeLayout:
    """Four boxes in a frame: 8 bits a face counted in cells of 2^(exponent - 127), the four children's in one word."""
    exponents = (Field(f"exponent_{axis}", word, shift=24, bits=8) for axis, word in (("x", 3), ("y", 10), ("z", 11)))
    faces = (
        Field(f"{side}_{axis}", 4 + 2 * k + upper)
        for k, axis in enumerate("xyz")
        for upper, side in enumerate(("lower", "upper"))
    )
    whole = (Field("base", 3, bits=24), Field("slots", 10, bits=24), Field("counts", 11, bits=24))
    return NodeLayout(12, 4, (Field("origin", 0, "vec3"), *whole, *exponents, *faces), order="quads")


# As llvmpipe was fastest (docs/figures.md). A single ray's step tests the next node too: entered boxes make use of it.
_ALONE = Pruning(width=2, triangle=1.0, spread=1.0)
_TOGETHER = Pruning(width=4, triangle=2.0, spread=2.0)

NODE_LAYOUTS: dict[str, dict[str, NodeLayout]] = {
    "box": _boxes(),
    "box-parent": _boxes(tail="links"),
    "box-path": _boxes(tail="paths"),
    "skip": _boxes("skip", "depth-first", pruning=_ALONE),
    "skip-octants": _boxes("skip", "octants", pruning=_ALONE),
    "skip-wide": _boxes("skip", "octants", pruning=_TOGETHER),
    "quad": _boxes(order="quads") | {"quant8": _framed()},
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


def glsl(name: str, node_format: str = "f32", grid: Grid | None = None, fetch: str = "storage") -> str:
    """The GLSL that declares the node buffer of a layout and reads its chunks and fields, fetched as `fetch` says.

    A grid that is given is written into the text; else it is read from uniforms, which Mesa loads again in every step.
    Faces of `grid16` are given as the box test takes them (BOX_CELLS): in cells, or as points of the scene.
    Every read is noted for `shaders/common_reads.glsl`, which comes before it; a chunk counts as read whole.
    """
    layout = NODE_LAYOUTS[name][node_format]
    chunk = f"uvec{layout.vector}"
    chunks = layout.words // layout.vector
    at = f"node * {chunks}u + chunk" if chunks > 1 else "node + chunk"
    lines = [
        f"// Node layout `{name}`, format `{node_format}`: {layout.words} words a node.",
        f"const uint LEAF = {LEAF}u;",
        reader("nodes", fetch, layout.vector),
        _reader(
            f"{chunk} node_chunk(uint node, uint chunk)", f"nodes_at({at})", layout.vector, f"{layout.vector}u * ({at})"
        ),
    ]
    lines += _tail_readers(layout)
    if layout.tail == "triangles":
        lines += _accessors(layout, sorted({chunk, "uvec2"}))
    elif node_format == "quant8":
        lines += [*_accessors(NODE_LAYOUTS[name]["f32"], ["uint"]), *_accessors(layout, [chunk]), *_FRAMED_QUAD]
    else:
        lines += [*_accessors(layout, ["uint"]), *_fetch_node(layout, grid, fetch)]
        lines += _QUAD if layout.order == "quads" else ()
    return "\n".join(lines) + "\n"


def _accessors(layout: NodeLayout, types: list[str]) -> list[str]:
    return [_accessor(layout, field, of) for field in layout.fields for of in types if _fits(layout, field, of)]


def _tail_readers(layout: NodeLayout) -> list[str]:
    """What reads a node's parent by itself, and an entry of a KD-tree's list."""
    shift, mask = (1, 1) if layout.vector == 2 else (2, 3)
    lines = []
    parent = layout.field("parent")
    if parent is not None and parent.word == TAIL:
        value = f"nodes_at(uint(TAIL_AT) + (node >> {shift}))[node & {mask}u]"
        lines.append(_reader("uint node_links(uint node)", value, 1, f"uint(TAIL_AT) * {layout.vector}u + node"))
    elif parent is not None:
        nth, component = divmod(parent.word, layout.vector)
        value = f"nodes_at(node * {layout.words // layout.vector}u + {nth}u).{'xyzw'[component]}"
        lines.append(_reader("uint node_links(uint node)", value, 1, f"node * {layout.words}u + {parent.word}u"))
    if layout.tail in ("triangles", "paths"):
        value = f"nodes_at(uint(TAIL_AT) + (i >> {shift}))[i & {mask}u]"
        name = "node_ref" if layout.tail == "triangles" else "node_path_word"
        lines.append(_reader(f"uint {name}(uint i)", value, 1, f"uint(TAIL_AT) * {layout.vector}u + i"))
    if layout.tail == "paths":
        # As `renderer.pack.paths` counts them; of the nodes, with the unused one, half but one are inner ones.
        inner = f"(uint(TAIL_AT) / {2 * layout.words // layout.vector}u - 1u)"
        lines.append(f"#define PATH_BUCKETS (({inner} >> 3) * 2u + 2u)")
        lines.append(f"#define PATH_ENTRIES ({inner} + ({inner} >> 2) + 1u)")
    return lines


_BOXES = {
    "grid16": (
        "vec3 grid_point(uvec3 cells) { PRECISE vec3 p = grid_origin + vec3(cells) * grid_cell; return p; }",
        "#if BOX_CELLS",
        "#define grid_face vec3",
        "#else",
        "#define grid_face grid_point",
        "#endif",
        "void node_box(uvec4 c, out vec3 lower, out vec3 upper) {",
        "    lower = grid_face(c.xyz & 0xffffu);",
        "    upper = grid_face(c.xyz >> 16);",
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


_QUAD = (
    "const int QUAD_WORDS = 4 * NODE_WORDS;",
    "uint quad_node;",
    "void fetch_quad(uint node) { quad_node = node; }",
    "bool quad_child(int i, out vec3 lower, out vec3 upper, out uint link) {",
    "    fetch_node(quad_node + uint(i), lower, upper, link);",
    "    return link != 0u;",
    "}",
)
_FRAMED_QUAD = (
    "const int QUAD_WORDS = 12;",
    "uvec4 quad_frame, quad_xy, quad_z;",
    "uint quad_inner, quad_slot;",
    "void fetch_quad(uint node) {",
    "    quad_frame = node_chunk(node, 0u);",
    "    quad_xy = node_chunk(node, 1u);",
    "    quad_z = node_chunk(node, 2u);",
    "    quad_inner = node_base(quad_frame);",
    "    quad_slot = node_slots(quad_z);",
    "}",
    "bool quad_child(int i, out vec3 lower, out vec3 upper, out uint link) {",
    "    uvec3 exponents = uvec3(node_exponent_x(quad_frame), node_exponent_y(quad_z), node_exponent_z(quad_z));",
    "    vec3 cell = uintBitsToFloat(exponents << 23);",
    "    uvec3 low = uvec3(node_lower_x(quad_xy), node_lower_y(quad_xy), node_lower_z(quad_z)) >> (8 * i) & 255u;",
    "    uvec3 high = uvec3(node_upper_x(quad_xy), node_upper_y(quad_xy), node_upper_z(quad_z)) >> (8 * i) & 255u;",
    "    PRECISE vec3 near = node_origin(quad_frame) + vec3(low) * cell;",
    "    PRECISE vec3 far = node_origin(quad_frame) + vec3(high) * cell;",
    "    lower = near;",
    "    upper = far;",
    "    uint count = node_counts(quad_z) >> (6 * i) & 63u;",
    "    link = count == 0u ? quad_inner << 2 | 1u : quad_slot << 8 | count << 2;",
    "    quad_inner += uint(count == 0u);",
    "    quad_slot += count;",
    "    return low.x < high.x;",
    "}",
)
"""The wide traversals' way to a node's four children, fetched as one and asked for from 0 to 3; whether each is there.
Of zeros, which pixels read that a draw does not cover, none is."""


def _grid(grid: Grid | None) -> list[str]:
    if grid is None:
        return ["uniform vec3 grid_origin;", "uniform vec3 grid_cell;"]
    lines = []
    for name, values in (("origin", grid.origin), ("cell", grid.cell)):
        words = ", ".join(f"{word}u" for word in values.astype(np.float32).view(np.uint32))
        lines.append(f"#define grid_{name} uintBitsToFloat(uvec3({words}))")
    return lines


def _fetch_node(layout: NodeLayout, grid: Grid | None, fetch: str) -> list[str]:
    """The BVH traversals' way to a node: its box and link word, and its parent's word where the layout has one."""
    parent = layout.field("parent")
    packed = layout.field("box")
    lines = _grid(grid) if packed is not None and packed.kind == "grid16" else []
    lines += _BOXES[packed.kind] if packed is not None else ()
    lines += [f"const int NODE_WORDS = {(4 if packed is not None else 7) + (parent is not None)};"]
    if layout.order == "octants":
        shift = 4 if layout.words == 8 else 3
        lines += ["uniform uint nodes_chunks;"] if fetch != "storage" else []
        chunks = "nodes_chunks" if fetch != "storage" else "uint(nodes.length())"
        lines.append(f"uint node_copy(uint octant) {{ return octant * ({chunks} >> {shift}); }}")
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
