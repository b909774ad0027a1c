"""Flattening: the header first, then defines, then every file once."""

from __future__ import annotations

import hashlib
from importlib import resources

import pytest

from renderer.glsl import digest, flatten

FILES = sorted(path.name for path in resources.files("shaders").iterdir() if path.name.endswith((".glsl", ".frag")))


def test_the_version_is_the_first_line_and_defines_come_before_the_body() -> None:
    lines = flatten({"WIDTH": 3, "HEIGHT": 0}, ["void main() { }\n"]).splitlines()
    assert lines[0] == "#version 310 es"
    assert lines.index("#define WIDTH 3") < lines.index("#define HEIGHT 0") < lines.index("void main() { }")
    assert lines.index("precision highp float;") < lines.index("void main() { }")


@pytest.mark.parametrize("name", FILES)
def test_no_include_is_left(name: str) -> None:
    assert "#include" not in flatten({}, [name])


def test_a_file_comes_once_however_often_it_is_named() -> None:
    text = flatten({}, ["common_leaf.glsl", "traversal_bvh_stack.glsl", "common_leaf.glsl"])
    assert text.count("void intersect_slots(") == 1


def test_an_include_lies_before_what_uses_it() -> None:
    text = flatten({}, ["traversal_kd_backtrack.glsl"])
    assert text.index("float plane_t(") < text.index("void trace(")


def test_a_missing_part_is_an_error() -> None:
    with pytest.raises(FileNotFoundError):
        flatten({}, ["traversal_none.glsl"])


def test_the_digest_is_the_sha256_of_the_text() -> None:
    assert digest("void") == hashlib.sha256(b"void").hexdigest()
    assert digest("void") != digest("void ")
