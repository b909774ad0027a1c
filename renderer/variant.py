"""The axes of a variant, their values, and the one function that says which combinations are refused and why."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Literal

Structure = Literal["none", "bvh", "kd"]


class VariantError(ValueError):
    """A value or a combination that does not exist; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Traversal:
    """One row of the traversal table: the structure it walks, its node layout in `renderer.pack`, its source.

    `state` is what it keeps for each level of the tree: STACK_SIZE or TRAIL_WORDS is then sized from the depth. A short
    stack has SHORT_STACK entries, and with a trail TRAIL_WORDS beside it.

    `packet` says that an invocation traces the rays of several pixels.

    The GLSL file is `shaders/traversal_NAME.glsl` with `_` for `-`.
    """

    structure: Structure
    nodes: str
    source: str
    paper: bool = False
    state: Literal["none", "stack", "trail", "short stack", "short trail"] = "none"
    packet: bool = False


TRAVERSALS: dict[str, Traversal] = {
    "brute-force": Traversal("none", "none", "every triangle against every ray"),
    "bvh-stack": Traversal("bvh", "box", "both children a visit, while-while (Aila and Laine 2009)", state="stack"),
    "bvh-stack-cull": Traversal("bvh", "box", "bvh-stack, what lies behind a hit by then is not popped", state="stack"),
    "bvh-stack-far": Traversal("bvh", "box", "bvh-stack, any hit is looked for from the ray's far end", state="stack"),
    "bvh-parent-link": Traversal("bvh", "box-parent", "Hapala et al. 2011", paper=True),
    "bvh-restart-trail": Traversal("bvh", "box", "Laine 2010", paper=True, state="trail"),
    "bvh-short-stack": Traversal("bvh", "box", "Laine 2010; Vaidyanathan et al. 2019", state="short trail"),
    "bvh-backtrack": Traversal("bvh", "box-path", "Binder and Keller 2016", state="trail"),
    "bvh-skip-link": Traversal("bvh", "skip", "one order for all rays, no state (Smits 1998)"),
    "bvh-skip-octants": Traversal("bvh", "skip-octants", "an order for each octant of directions, no state"),
    "bvh4-stack": Traversal("bvh", "quad", "four children a visit (Wald et al. 2008)", state="stack"),
    "bvh-packet-2x2": Traversal("bvh", "box", "bvh-stack, 2x2 pixels share fetches", state="stack", packet=True),
    "bvh-packet-4x2": Traversal("bvh", "box", "bvh-stack, 4x2 pixels share fetches", state="stack", packet=True),
    "bvh-packet-skip-2x2": Traversal("bvh", "skip-wide", "bvh-skip-octants, 2x2 pixels share fetches", packet=True),
    "bvh-packet-skip-4x2": Traversal("bvh", "skip-wide", "bvh-skip-octants, 4x2 pixels share fetches", packet=True),
    "bvh-packet-interval": Traversal(
        "bvh", "box", "4x2 pixels share box tests (Boulos et al. 2006)", state="stack", packet=True
    ),
    "kd-push-down": Traversal("kd", "plane", "Horn et al. 2007", paper=True),
    "kd-short-stack": Traversal("kd", "plane", "Horn et al. 2007", state="short stack"),
    "kd-backtrack": Traversal("kd", "plane-box", "Foley and Sugerman 2005", paper=True),
}

AXES: dict[str, tuple[str, ...]] = {
    "traversal": tuple(TRAVERSALS),
    "method": ("fragment", "compute", "hybrid"),
    "layout": ("normal", "compact", "split"),
    "intersector": ("moller-trumbore", "watertight", "baked"),
    "box": ("widened", "williams"),
    "nodes": ("f32", "grid16", "quant8", "half"),
    "precision": ("highp", "mediump"),
    "offset": ("constant", "bounded"),
    "builder": ("sah", "binned", "median", "reinserted", "sbvh", "sbvh-reinserted", "clipped"),
    "fetch": ("storage", "texture", "image"),
}

KD_BUILDERS = ("sah", "clipped")
"""The builders that make KD-trees; all but the last make BVHs."""

CONSERVATIVE_NODES = ("f32", "grid16", "quant8")
"""The node formats whose boxes hold what they should, so that no hit is lost."""

PAPER: dict[str, tuple[str, ...]] = {
    "traversal": tuple(name for name, row in TRAVERSALS.items() if row.paper),
    "method": AXES["method"],
    "layout": AXES["layout"],
    "intersector": ("moller-trumbore",),
    "box": ("williams",),
    "nodes": ("f32",),
    "precision": ("highp",),
    "offset": ("constant",),
    "builder": ("sah",),
    "fetch": ("storage",),
}
"""What the paper measured, on each axis."""


@dataclass(frozen=True)
class Variant:
    """One value on each axis."""

    traversal: str = "bvh-stack"
    method: str = "fragment"
    layout: str = "normal"
    intersector: str = "moller-trumbore"
    box: str = "widened"
    nodes: str = "f32"
    precision: str = "highp"
    offset: str = "constant"
    builder: str = "sah"
    fetch: str = "storage"

    @property
    def structure(self) -> Structure:
        """The kind of structure that the traversal walks."""
        return TRAVERSALS[self.traversal].structure

    @property
    def label(self) -> str:
        """The values that differ from the defaults, traversal and method and layout always."""
        parts = [self.traversal, self.method, self.layout]
        default = Variant()
        for field in fields(self)[3:]:
            value = getattr(self, field.name)
            if value != getattr(default, field.name):
                parts.append(value)
        return " ".join(parts)

    def as_dict(self) -> dict[str, str]:
        """Axis name to value."""
        return asdict(self)


def require_value(axis: str, value: str) -> str:
    """Return `value` if the axis has it; raise VariantError naming the values that exist otherwise."""
    if value not in AXES[axis]:
        raise VariantError(f"Unknown {axis} {value!r}: choose one of {', '.join(AXES[axis])}.")
    return value


def refusal(variant: Variant, rays: str = "both") -> str | None:
    """Say in one sentence why a combination of existing values is not offered; None if it is.

    `rays` is what is to be timed: `primary`, `shadow` or `both`.
    """
    for axis, value in variant.as_dict().items():
        require_value(axis, value)
    structure = variant.structure
    if variant.method == "hybrid" and rays == "primary":
        return "hybrid rasterises what the eye sees and casts no primary rays: time shadow or both."
    if variant.method == "hybrid" and variant.offset == "bounded":
        return "hybrid knows a depth and not the triangle that bounds its error: leave the offset at constant."
    if structure == "kd" and variant.builder not in KD_BUILDERS:
        return f"{variant.builder} is a BVH builder: a KD-tree is built with sah or clipped."
    if structure == "none" and variant.builder != "sah":
        return "brute-force has no structure to build: leave the builder at sah."
    if structure == "none" and variant.box != "widened":
        return "brute-force tests no boxes: leave the box test at widened."
    if structure == "kd" and variant.nodes != "f32":
        return "a KD-tree's planes say which triangles a cell has, so none may be rounded: leave the nodes at f32."
    if structure == "kd" and variant.precision != "highp":
        return "a KD walk tells cells apart by the last bits of t: leave the precision at highp."
    if structure == "none" and variant.nodes != "f32":
        return "brute-force walks no nodes: leave them at f32."
    if variant.nodes == "quant8" and TRAVERSALS[variant.traversal].nodes != "quad":
        return "8-bit faces are counted from a frame, which pays for four boxes and not for one: take bvh4-stack."
    if TRAVERSALS[variant.traversal].packet and variant.method != "compute":
        return "a fragment shades one pixel and a packet traces several: take the method compute."
    if variant.traversal == "bvh-packet-interval" and variant.box != "widened":
        return "the box test of an interval is the widened one, and rays apart must see no less: leave it at widened."
    if variant.intersector == "baked" and variant.layout == "split":
        return (
            "baked keeps its own words in the buffer that split needs for normals: take the layout normal or compact."
        )
    return None


def expand(axis: str, words: str) -> tuple[str, ...]:
    """Turn a comma list of values, `all` and `paper` into values of an axis, the latter two in table order."""
    chosen: list[str] = []
    for word in (part.strip() for part in words.split(",")):
        if word == "all":
            chosen += AXES[axis]
        elif word == "paper":
            chosen += PAPER[axis]
        else:
            chosen.append(require_value(axis, word))
    return tuple(dict.fromkeys(chosen))


@dataclass(frozen=True)
class Refused:
    """A combination left out of a matrix, with the reason."""

    variant: Variant
    reason: str


def matrix(axes: Mapping[str, Sequence[str]], rays: str = "both") -> tuple[list[Variant], list[Refused]]:
    """Every combination of the given axis values, the valid ones and the refused ones apart.

    Axes that are not named keep their default.
    """
    valid: list[Variant] = []
    refused: list[Refused] = []
    for variant in _combinations(axes):
        reason = refusal(variant, rays)
        if reason is None:
            valid.append(variant)
        else:
            refused.append(Refused(variant, reason))
    return valid, refused


def _combinations(axes: Mapping[str, Sequence[str]]) -> Iterator[Variant]:
    names = list(axes)
    for values in itertools.product(*axes.values()):
        yield replace(Variant(), **dict(zip(names, values, strict=True)))
