"""What is packed on the host is what the shaders' accessors read on the device, field by field."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
import pytest
from running import context

from renderer.build.tree import MAX_BVH_LEAF, Bvh, Kd, Tree
from renderer.glsl import flatten
from renderer.pack.fetch import reader
from renderer.pack.grid import CELLS, grid_over
from renderer.pack.nodes import pack_nodes
from renderer.pack.primitives import Corners, pack_primitives
from renderer.pack.schema import LEAF, NODE_LAYOUTS, Field, NodeLayout, glsl

Words = npt.NDArray[np.uint32]

NODES = 999
TRIANGLES = 20_000  # more than are laid out at once
SEED = 41
EVERY = [
    (name, node_format)
    for name, formats in NODE_LAYOUTS.items()
    for node_format, layout in formats.items()
    if layout.order == "siblings" and layout.tail != "paths"
]


def random_floats(rng: np.random.Generator, *shape: int) -> npt.NDArray[np.float32]:
    """Floats of all signs and sizes."""
    return (rng.standard_normal(shape) * 10.0 ** rng.integers(-30, 30, shape)).astype(np.float32)


def random_bvh(seed: int) -> Bvh:
    """Nodes whose values use every bit that their fields have; they make no tree."""
    rng = np.random.default_rng(seed)
    leaf = rng.random(NODES) < 0.5
    faces = np.sort(random_floats(rng, 2, NODES, 3), axis=0)
    faces[:, 0] = faces[0].min(axis=0), faces[1].max(axis=0)
    return Bvh(
        lower=faces[0],
        upper=faces[1],
        child=np.where(leaf, rng.integers(0, 1 << 24, NODES), rng.integers(1, (1 << 30) - 1, NODES)).astype(np.int32),
        count=np.where(leaf, rng.integers(1, MAX_BVH_LEAF + 1, NODES), 0).astype(np.int32),
        axis=rng.integers(0, 3, NODES).astype(np.uint8),
        parent=np.append(-1, rng.integers(0, NODES, NODES - 1)).astype(np.int32),
        order=np.arange(9, dtype=np.int32),
        depth=1,
        cost=0.0,
    )


def random_kd(seed: int) -> Kd:
    """As `random_bvh`, with a list of triangles."""
    rng = np.random.default_rng(seed)
    axis = rng.integers(0, 4, NODES).astype(np.uint8)
    leaf = axis == 3
    child = np.where(leaf, rng.integers(0, (1 << 31) - 1, NODES), rng.integers(1, (1 << 30) - 1, NODES))
    return Kd(
        lower=random_floats(rng, NODES, 3),
        upper=random_floats(rng, NODES, 3),
        split=random_floats(rng, NODES),
        axis=axis,
        child=child.astype(np.int32),
        count=np.where(leaf, rng.integers(0, 1 << 30, NODES), 0).astype(np.int32),
        parent=np.append(-1, rng.integers(0, NODES, NODES - 1)).astype(np.int32),
        refs=rng.integers(0, (1 << 31) - 1, 1013).astype(np.int32),
        depth=1,
        cost=0.0,
    )


def device_reads(
    text: str,
    storage: list[Words],
    threads: int,
    words: int,
    vectors: Mapping[str, npt.NDArray[np.floating]] = MappingProxyType({}),
) -> Words:
    """What `main` of a shader of 64 invocations a group leaves in its buffer `found`, (threads, words)."""
    made = context()
    program = made.compute_shader(text)
    buffers = [made.buffer(part.tobytes()) for part in storage]
    found = made.buffer(reserve=threads * words * 4)
    for binding, buffer in enumerate([*buffers, found]):
        buffer.bind_to_storage_buffer(binding)
    program["threads"].write(struct.pack("<I", threads))
    for name, vector in vectors.items():
        program[name].write(vector.astype(np.float32).tobytes())
    program.run(-(-threads // 64))
    made.finish()
    answer = np.frombuffer(found.read(), np.uint32).reshape(threads, words)
    for one in (program, found, *buffers):
        one.release()
    return answer


def shader(defines: dict[str, int], parts: list[str], binding: int, statements: list[str]) -> str:
    """A compute shader that runs the statements for each `i` below `threads`."""
    lines = [
        "layout(local_size_x = 64) in;",
        "uniform uint threads;",
        f"layout(std430, binding = {binding}) writeonly restrict buffer Found {{ uint found[]; }};",
        "void main() {",
        "    uint i = gl_GlobalInvocationID.x;",
        "    if (i >= threads) { return; }",
        *(f"    {statement}" for statement in statements),
        "}",
    ]
    return flatten({"READS": 0, "BOX_CELLS": 0, **defines}, ["common_reads.glsl", *parts, "\n".join(lines) + "\n"])


def bits(values: npt.NDArray[np.generic]) -> Words:
    return np.ascontiguousarray(values, np.float32).view(np.uint32)


@dataclass(frozen=True)
class Read:
    """One accessor called on one chunk: the words that it gives."""

    expression: str
    field: Field

    def statements(self, at: int, stride: int) -> list[str]:
        where = [f"found[i * {stride}u + {at + k}u] = " for k in range(3 if self.field.kind == "vec3" else 1)]
        if self.field.kind == "vec3":
            return [f"{w}floatBitsToUint({self.expression}).{'xyz'[k]};" for k, w in enumerate(where)]
        value = f"floatBitsToUint({self.expression})" if self.field.kind == "float" else self.expression
        return [f"{where[0]}{value};"]


FETCHED = {"axis": "link", "child": "link", "count": "link", "first": "link", "parent": "links", "parent_axis": "links"}


def bvh_accessors(layout: NodeLayout) -> list[Read]:
    """What `fetch_node` gives of every field, and the parents read by themselves."""
    reads = []
    for field in layout.fields:
        if field.name in FETCHED:
            reads.append(Read(f"node_{field.name}({FETCHED[field.name]})", field))
        elif field.kind != "vec3":
            reads += [Read(side, replace(field, name=side, kind="vec3")) for side in ("lower", "upper")]
        else:
            reads.append(Read(field.name, field))
    parent = layout.field("parent")
    return reads if parent is None else [*reads, Read("node_parent(node_links(node))", parent)]


def accessors(layout: NodeLayout) -> list[Read]:
    """Every accessor of every field, on a whole chunk and on the half chunk that KD leaves are read by."""
    if layout.tail != "triangles":
        return bvh_accessors(layout)
    reads = []
    for field in layout.fields:
        chunk = f"node_chunk(node, {field.word // layout.vector}u)"
        reads.append(Read(f"node_{field.name}({chunk})", field))
        if layout.vector == 4 and field.word % 4 < 2 and field.kind != "vec3":
            reads.append(Read(f"node_{field.name}({chunk}.xy)", field))
    parent = layout.field("parent")
    if parent is not None:
        reads.append(Read("node_links(node)", parent))
    return reads


def boxes(tree: Tree, node_format: str) -> dict[str, npt.NDArray[np.floating]]:
    """The faces of each node as the shaders are to see them: in half precision rounded, on a grid rounded outward."""
    given = {"lower": tree.lower, "upper": tree.upper}
    if node_format == "f32":
        return given
    if node_format == "half":
        with np.errstate(over="ignore"):
            return {side: values.astype(np.float16) + np.float16(0) for side, values in given.items()}
    grid = grid_over(tree.lower[0], tree.upper[0])
    shown: dict[str, npt.NDArray[np.floating]] = {}
    for side, rounded in (("lower", np.floor), ("upper", np.ceil)):
        cells = rounded(given[side].astype(np.float64) / grid.cell) - grid.origin / grid.cell
        assert (cells >= 0).all()
        assert (cells <= CELLS).all()
        shown[side] = grid.origin + cells * grid.cell
    assert (shown["lower"] <= tree.lower).all()
    assert (shown["upper"] >= tree.upper).all()
    return shown


def expected(tree: Tree, field: Field, node_format: str) -> Words:
    """The field's words of each node as the shaders are to see them: node 1 is unused, axes count from 1."""
    slot = np.where(np.arange(NODES) > 0, np.arange(NODES) + 1, 0)
    leaf = tree.count > 0 if isinstance(tree, Bvh) else tree.axis == 3
    axis = np.where(leaf, LEAF, tree.axis + 1)
    match field.name:
        case "lower" | "upper":
            return bits(boxes(tree, node_format)[field.name]).reshape(NODES, 3)
        case "split":
            assert isinstance(tree, Kd)
            return bits(tree.split).reshape(NODES, 1)
        case "axis":
            values = axis
        case "child":
            values = tree.child + 1
        case "first":
            values = tree.child
        case "count":
            values = tree.count
        case "parent":
            values = np.where(tree.parent >= 0, slot[tree.parent], 0)
        case "parent_axis":
            values = np.where(tree.parent >= 0, axis[tree.parent], 0)
        case other:
            raise AssertionError(f"the field {other} is not tested")
    return values.astype(np.uint32).reshape(NODES, 1)


@pytest.mark.parametrize("seed", [SEED, SEED + 1])
@pytest.mark.parametrize(("name", "node_format"), EVERY)
def test_every_field_of_every_node_is_read_back(name: str, node_format: str, seed: int) -> None:
    layout = NODE_LAYOUTS[name][node_format]
    tree: Tree = random_kd(seed) if layout.tail == "triangles" else random_bvh(seed)
    packed = pack_nodes(tree, name, node_format)
    reads = accessors(layout)
    named = {field.name for field in layout.fields}
    assert {read.field.name for read in reads} == (named - {"box"} | {"lower", "upper"} if "box" in named else named)
    widths = [3 if read.field.kind == "vec3" else 1 for read in reads]
    starts, stride = np.cumsum([0, *widths[:-1]]), sum(widths)
    statements = ["uint node = i == 0u ? 0u : i + 1u;"]
    if isinstance(tree, Bvh):
        links = ", links" if layout.field("parent") else ""
        statements += ["vec3 lower, upper;", f"uint link{links};", f"fetch_node(node, lower, upper, link{links});"]
    for read, start in zip(reads, starts, strict=True):
        statements += read.statements(int(start), stride)
    text = shader({"TAIL_AT": packed.tail_at or 0}, [glsl(name, node_format)], 1, statements)
    grid = {} if packed.grid is None else {"grid_origin": packed.grid.origin, "grid_cell": packed.grid.cell}
    found = device_reads(text, [packed.words], NODES, stride, grid)
    leaf = tree.count > 0 if isinstance(tree, Bvh) else tree.axis == 3
    for read, start, width in zip(reads, starts, widths, strict=True):
        rows = {"all": np.full(NODES, True), "inner": ~leaf, "leaf": leaf}[read.field.owner]
        given, got = expected(tree, read.field, node_format)[rows], found[rows, start : start + width]
        np.testing.assert_array_equal(got, given, err_msg=read.expression)


@pytest.mark.parametrize("name", ["plane", "plane-box"])
def test_every_entry_of_a_kd_tree_s_list_is_read_back(name: str) -> None:
    tree = random_kd(SEED)
    packed = pack_nodes(tree, name)
    text = shader({"TAIL_AT": packed.tail_at or 0}, [glsl(name)], 1, ["found[i] = node_ref(i);"])
    found = device_reads(text, [packed.words], len(tree.refs), 1)
    np.testing.assert_array_equal(found[:, 0], tree.refs)


@pytest.mark.parametrize("layout", ["bare", "normal", "compact", "split"])
def test_every_vertex_normal_and_id_is_read_back(layout: str) -> None:
    rng = np.random.default_rng(SEED)
    places, normals = (
        Corners(random_floats(rng, 500, 3), rng.integers(0, 500, (TRIANGLES, 3)).astype(np.int32)) for _ in range(2)
    )
    shading = None if layout == "bare" else normals
    order = rng.permutation(TRIANGLES).astype(np.int32)
    packed = pack_primitives(places, shading, order, "normal" if layout == "bare" else layout)
    statements = ["vec3 a, b, c;", "uint id;", "fetch_triangle(i, a, b, c, id);", "found[i * 19u + 18u] = id;"]
    statements += [
        f"found[i * 19u + {3 * k + j}u] = floatBitsToUint({'abc'[k]}[{j}]);" for k in range(3) for j in range(3)
    ]
    if shading is not None:
        statements.append("fetch_normals(i, a, b, c);")
        statements += [
            f"found[i * 19u + {9 + 3 * k + j}u] = floatBitsToUint({'abc'[k]}[{j}]);" for k in range(3) for j in range(3)
        ]
    # The layouts have their buffers at bindings 1 and 2.
    buffers = [np.zeros(4, np.uint32), packed.vertices, np.zeros(4, np.uint32)]
    if packed.normals is not None:
        buffers[2] = packed.normals
    parts = [reader(name, "storage") for name in ("primitives", "normals")]
    text = shader({}, [*parts, f"layout_{layout}.glsl"], 3, statements)
    found = device_reads(text, buffers, TRIANGLES, 19)
    np.testing.assert_array_equal(found[:, :9], bits(places.values[places.rows[order]]).reshape(-1, 9))
    np.testing.assert_array_equal(found[:, 18], order)
    if shading is not None:
        np.testing.assert_array_equal(found[:, 9:18], bits(normals.values[normals.rows[order]]).reshape(-1, 9))
