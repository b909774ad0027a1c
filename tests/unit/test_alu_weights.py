"""Operations of small programs, counted by hand, from the SPIR-V that the reference compiler makes of them."""

from __future__ import annotations

import shutil
import struct
from functools import cache

import pytest

from renderer.alu.compiler import COMPILER, compile_spirv
from renderer.alu.errors import ModelError
from renderer.alu.marks import marked_text, read_marks
from renderer.alu.model import read_program
from renderer.alu.spirv import MAGIC, Module, read_module
from renderer.alu.weights import operations
from renderer.glsl import flatten

EXPRESSIONS = {
    "a.x + b.x": ("float", 1),
    "a * b": ("vec3", 3),
    "a * b + a": ("vec3", 6),
    "a * a.x": ("vec3", 3),
    "-a": ("vec3", 3),
    "a / b": ("vec3", 6),
    "1.0 / a": ("vec3", 6),
    "dot(a, b)": ("float", 5),
    "cross(a, b)": ("vec3", 9),
    "length(a)": ("float", 6),
    "distance(a, b)": ("float", 9),
    "normalize(a)": ("vec3", 9),
    "inversesqrt(a.x)": ("float", 1),
    "sqrt(a)": ("vec3", 3),
    "reflect(a, b)": ("vec3", 12),
    "mix(a, b, a.x)": ("vec3", 9),
    "mix(a, b, lessThan(a, b))": ("vec3", 6),
    "clamp(a, 0.0, 1.0)": ("vec3", 6),
    "min(a, b)": ("vec3", 3),
    "abs(a)": ("vec3", 3),
    "floor(a.xy)": ("vec2", 2),
    "floatBitsToInt(a)": ("ivec3", 0),
    "a.zyx": ("vec3", 0),
    "vec3(i)": ("vec3", 1),
    "i + 1": ("int", 1),
    "i * 3 + 1": ("int", 2),
    "(i >> 2) & 3": ("int", 2),
    "~u": ("uint", 1),
    "findLSB(u)": ("int", 1),
    "uint(i > 3)": ("uint", 2),
    "i > 3 ? 1.0 : 2.0": ("float", 2),
    "i > 3 && u == 2u": ("bool", 3),
    "!(i > 3)": ("bool", 2),
    "any(lessThan(a, b))": ("bool", 5),
    "all(lessThan(a.xy, b.xy))": ("bool", 3),
    "packSnorm2x16(a.xy)": ("uint", 11),
    "unpackSnorm2x16(u)": ("vec2", 10),
    "m * vec4(a, 1.0)": ("vec4", 28),
    "vec4(a, 1.0) * m": ("vec4", 28),
    "m * m": ("mat4", 112),
    "m * 2.0": ("mat4", 16),
    "a[i]": ("float", 0),
    "table[i]": ("float", 0),
}


@pytest.fixture(autouse=True)
def _compiler() -> None:
    if shutil.which(COMPILER) is None:
        pytest.skip(f"{COMPILER} is not here: install glslang-tools")


def text(body: str, before: str = "") -> str:
    inputs = "uniform vec3 a; uniform vec3 b; uniform int i; uniform uint u; uniform mat4 m; uniform float table[4];\n"
    return flatten({}, [f"layout(local_size_x = 64) in;\n{inputs}{before}\nvoid main() {{\n{body}\n}}\n"])


def module_of(shown: str) -> Module:
    return read_module(compile_spirv(shown, "compute"))


@cache
def expressions() -> Module:
    """A function for each expression, f0() and on."""
    made = [f"{kind} f{i}() {{ return {shown}; }}" for i, (shown, (kind, _)) in enumerate(EXPRESSIONS.items())]
    return module_of(text("", "\n".join(made)))


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_an_expression_has_the_operations_counted_by_hand(expression: str) -> None:
    module = expressions()
    (block,) = module.functions[f"f{list(EXPRESSIONS).index(expression)}("]
    assert sum(operations(module, block).values()) == EXPRESSIONS[expression][1]


def test_a_whole_product_is_two_operations() -> None:
    shown = "uint f0() { uint high, low; umulExtended(u, u, high, low); return high; }"
    (block,) = module_of(text("", shown)).functions["f0("]
    assert sum(operations(module_of(text("", shown)), block).values()) == 2


def test_kinds_are_told_apart() -> None:
    module = module_of(text("float x = a.x * 2.0 + sqrt(a.y); uint y = uint(x < 1.0 ? 3.5 : x) << 2;"))
    found = operations(module, module.functions["main"][0])
    assert found == {"arithmetic": 2, "special": 1, "compare": 1, "select": 1, "logic": 0, "bits": 1, "convert": 1}


def test_what_has_no_weight_is_refused_by_its_number() -> None:
    module = module_of(text("int x = i / 3;"))
    with pytest.raises(ModelError, match="no weight for SPIR-V's instruction 135"):
        operations(module, module.functions["main"][0])


def test_blocks_and_calls_are_read() -> None:
    shown = text(
        "float x = a.x;\nif (x > 1.0) { x = f(x); } else { x = f(x) + f(a.y); }\nwhile (x < 9.0) { x = f(x); }",
        "float f(float x) { return x * 2.0; }",
    )
    module = module_of(shown)
    main = module.functions["main"]
    assert sorted(len(block.calls) for block in main if block.calls) == [1, 1, 2]
    assert {call for block in main for call in block.calls} == {"f(f1;"}
    assert [block.successors for block in module.functions["f(f1;"]] == [()]
    assert all(0 <= after < len(main) for block in main for after in block.successors)


def test_a_torn_binary_is_refused() -> None:
    binary = compile_spirv(text("float x = a.x;"), "compute")
    for torn in (b"", binary[:18], binary[:-3], struct.pack("<5I", MAGIC + 1, 0, 0, 0, 0), binary[:-8] + b"\0" * 8):
        with pytest.raises(ModelError, match="SPIR-V"):
            read_module(torn)


def test_a_text_that_does_not_compile_is_refused_with_the_compilers_reason() -> None:
    with pytest.raises(ModelError, match=r"refuses the text: ERROR.*nothing"):
        compile_spirv(text("float x = nothing;"), "compute")


COUNTING = """
#define COUNT_NODE(words)
#define COUNT_INNER
#define COUNT_LEAF
#define COUNT_VISIT(inner, triangles)
#define COUNT_TRIANGLE(words)
#define COUNT_WORDS(words)
const int TRIANGLE_WORDS = 10;
"""
STEPS = """
COUNT_NODE(8);
uint count = u + 1u;
bool down = i > 3;
while (count > 0u) {
    COUNT_NODE(7);
    COUNT_NODE(7);
    COUNT_VISIT(true, 0u);
    COUNT_TRIANGLE(TRIANGLE_WORDS);
    count -= 1u;
}
COUNT_VISIT(down, count);
COUNT_INNER;
COUNT_LEAF;
COUNT_WORDS(1);
"""


def test_marks_are_read_where_they_stand() -> None:
    marks = read_marks(module_of(marked_text(text(STEPS, COUNTING))))
    found = {name: {site[1]: (mark.least, mark.most) for site, mark in sites.items()} for name, sites in marks.items()}
    body = next(iter(found["triangles"]))
    end = next(iter(found["leaves"].keys() - {body}))
    assert found["nodes"] == {0: (1, 1), body: (2, 2)}
    assert found["words"] == {0: (8, 8), body: (24, 24), end: (1, 1)}
    assert found["triangles"] == {body: (1, 1)}
    assert found["inner"] == {body: (1, 1), end: (1, 2)}
    assert found["leaves"] == {body: (0, 0), end: (1, 2)}


def test_marks_are_no_work_and_leave_the_flow_as_it_was() -> None:
    program = read_program(text(STEPS, COUNTING), "compute")
    marked = module_of(marked_text(text(STEPS, COUNTING)))
    assert [operations(marked, block) for block in marked.functions["main"]] == program.costs["main"]


def test_a_macro_without_a_mark_is_refused() -> None:
    with pytest.raises(ModelError, match="no mark for COUNT_NOTHING"):
        marked_text("#define COUNT_NOTHING(a, b)\n")


def test_a_mark_that_computes_a_branch_is_refused() -> None:
    with pytest.raises(ModelError, match="changed its control flow"):
        read_program(text("COUNT_VISIT(i > 3 && table[i] > 1.0, 0u);", COUNTING), "compute")
