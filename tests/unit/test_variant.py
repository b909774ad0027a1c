"""The axes, what is refused and why, and the words that choose values."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

import pytest

from renderer.pack.schema import NODE_LAYOUTS
from renderer.variant import (
    AXES,
    CONSERVATIVE_NODES,
    TRAVERSALS,
    Variant,
    VariantError,
    expand,
    matrix,
    refusal,
    require_value,
)

PAPER = ("bvh-parent-link", "bvh-restart-trail", "kd-push-down", "kd-backtrack")


def test_every_traversal_has_its_text_and_its_nodes() -> None:
    for name, row in TRAVERSALS.items():
        assert resources.files("shaders").joinpath(f"traversal_{name.replace('-', '_')}.glsl").is_file()
        assert (row.nodes in NODE_LAYOUTS) == (row.structure != "none")
    formats = {node_format for formats in NODE_LAYOUTS.values() for node_format in formats}
    assert formats == set(AXES["nodes"])
    assert set(CONSERVATIVE_NODES) < formats


def test_a_node_format_is_offered_where_a_layout_has_it() -> None:
    for name, row in TRAVERSALS.items():
        offered = {one for one in AXES["nodes"] if refusal(Variant(name, "compute", nodes=one)) is None}
        assert offered == set(NODE_LAYOUTS.get(row.nodes, {"f32"}))


def test_the_paper_s_matrix_is_all_valid() -> None:
    axes = {axis: expand(axis, "paper") for axis in ("traversal", "method", "layout")}
    valid, refused = matrix(axes)
    assert axes["traversal"] == PAPER
    assert (len(valid), refused) == (36, [])
    assert len(set(valid)) == 36


def test_hybrid_has_no_primary_rays_to_time() -> None:
    valid, refused = matrix({"method": AXES["method"]}, "primary")
    assert [variant.method for variant in valid] == ["fragment", "compute"]
    assert [(one.variant.method, one.reason) for one in refused] == [
        ("hybrid", "hybrid rasterises what the eye sees and casts no primary rays: time shadow or both.")
    ]
    assert matrix({"method": AXES["method"]}, "shadow")[1] == []


@pytest.mark.parametrize(
    ("variant", "reason"),
    [
        (Variant("kd-push-down", builder="median"), "median is a BVH builder: a KD-tree is built with sah or clipped."),
        (Variant("kd-backtrack", builder="median"), "median is a BVH builder: a KD-tree is built with sah or clipped."),
        (Variant("brute-force", builder="median"), "brute-force has no structure to build: leave the builder at sah."),
        (
            Variant("kd-backtrack", precision="mediump"),
            "a KD walk tells cells apart by the last bits of t: leave the precision at highp.",
        ),
        (Variant("brute-force", nodes="half"), "brute-force walks no nodes: leave them at f32."),
        (
            Variant("kd-push-down", nodes="grid16"),
            "a KD-tree's planes say which triangles a cell has, so none may be rounded: leave the nodes at f32.",
        ),
        (Variant("brute-force", box="williams"), "brute-force tests no boxes: leave the box test at widened."),
    ],
    ids=lambda value: value.label if isinstance(value, Variant) else "",
)
def test_refused_combinations_say_why(variant: Variant, reason: str) -> None:
    assert refusal(variant) == reason


def test_every_combination_is_valid_or_refused_with_one_sentence() -> None:
    valid, refused = matrix(AXES)
    combinations = 1
    for values in AXES.values():
        combinations *= len(values)
    assert len(valid) + len(refused) == combinations
    assert valid
    for one in refused:
        assert one.reason.endswith(".")
        assert one.reason.count(". ") == 0


def test_median_is_valid_where_there_is_a_bvh() -> None:
    valid, _ = matrix({"traversal": AXES["traversal"], "builder": ("median",)})
    assert {variant.structure for variant in valid} == {"bvh"}


@pytest.mark.parametrize("axis", AXES)
def test_an_unknown_value_is_an_error_that_lists_the_values(axis: str) -> None:
    expected = f"Unknown {axis} 'best': choose one of {', '.join(AXES[axis])}."
    with pytest.raises(VariantError) as raised:
        require_value(axis, "best")
    assert str(raised.value) == expected
    with pytest.raises(VariantError):
        refusal(replace(Variant(), **{axis: "best"}))


@pytest.mark.parametrize(
    ("axis", "words", "values"),
    [
        ("traversal", "paper", PAPER),
        ("traversal", "all", AXES["traversal"]),
        ("traversal", "bvh-stack, paper,bvh-stack", ("bvh-stack", *PAPER)),
        ("layout", "split,normal", ("split", "normal")),
        ("method", "paper", AXES["method"]),
        ("box", "all", ("widened", "williams")),
    ],
)
def test_words_choose_values_each_once(axis: str, words: str, values: tuple[str, ...]) -> None:
    assert expand(axis, words) == values


@pytest.mark.parametrize("words", ["", "bvh-stack,", "best", "Paper"])
def test_words_that_are_no_values_are_errors(words: str) -> None:
    with pytest.raises(VariantError, match="Unknown traversal"):
        expand("traversal", words)


def test_labels_name_what_differs() -> None:
    assert Variant("kd-backtrack", "compute", "split").label == "kd-backtrack compute split"
    assert Variant(box="williams", builder="median").label == "bvh-stack fragment normal williams median"
