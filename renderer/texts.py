"""The shader texts of a plan: which parts make a program, and what they are specialised on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from renderer.glsl import flatten
from renderer.pack.fetch import reader
from renderer.pack.grid import Grid
from renderer.pack.schema import glsl
from renderer.variant import TRAVERSALS, Variant

STAGES = ("STAGE_PRIMARY", "STAGE_SHADOW", "STATE_HITS", "STATE_HIDDEN", "STATE_OUT")
"""What a trace pass may do; `shaders/render_pixel.glsl` says what each means."""

SHORT_STACK = 8
"""Entries of a short stack, a power of two."""

Stages = dict[str, str]
Casts = Literal["pixel", "rays"]
"""Whether a pixel casts a camera's ray and shadow rays, or one ray of a buffer."""

_RENDER = {
    ("pixel", False): ("render_pixel.glsl", "render_compute.comp"),
    ("pixel", True): ("render_packet.glsl", "render_compute_packet.comp"),
    ("rays", False): ("render_rays.glsl", "render_compute.comp"),
    ("rays", True): ("render_packet_rays.glsl", "render_compute_packet.comp"),
}
"""The parts for what a pixel casts, alone or in packets."""


@dataclass(frozen=True)
class Form:
    """What the texts of one plan are written for.

    `depth` is the levels that a stack or a trail must hold, `tail_at` the chunk at which what follows the nodes begins,
    `grid` the grid of 16-bit boxes, None where it is left to uniforms; `normals` says that the primitives carry vertex
    normals, `shade` that hits are shaded. `instrument` adds counters and records, `reads` the recorded reads.
    """

    variant: Variant
    lights: int
    depth: int
    tail_at: int | None
    grid: Grid | None
    normals: bool
    shade: bool
    instrument: bool
    reads: bool


def trace_texts(form: Form, on: Iterable[str], casts: Casts = "pixel", first: Iterable[str] = ()) -> Stages:
    """The texts of a trace pass with some of STAGES switched on; `casts` says what a pixel casts, after `first`."""
    variant = form.variant
    pixel, compute = _RENDER[casts, TRAVERSALS[variant.traversal].packet]
    defines = {**_defines(form), **dict.fromkeys(STAGES, 0), **dict.fromkeys(on, 1)}
    if TRAVERSALS[variant.traversal].packet:
        defines["PACKET_EYE"] = int(casts == "pixel")
    parts = [
        *first,
        "common_reads.glsl",
        *_readers(form),
        "common_ray.glsl",
        f"layout_{variant.layout if form.normals else 'bare'}.glsl",
        *_tests(variant),
        f"traversal_{variant.traversal}.glsl".replace("-", "_"),
        "common_view.glsl",
        "surface_raster.glsl" if variant.method == "hybrid" else "surface_cast.glsl",
        *_offset_parts(variant),
        *(["common_records.glsl"] if form.instrument else []),
        pixel,
    ]
    if variant.method == "compute":
        return {"compute": flatten(defines, [*parts, compute])}
    return {
        "vertex": flatten({}, ["render_screen.vert"]),
        "fragment": flatten(defines, [*parts, "render_fragment.frag"]),
    }


def _readers(form: Form) -> list[str]:
    """The ways to the buffers that the variant reads."""
    variant = form.variant
    named = ["primitives"]
    named += ["normals"] if form.normals and variant.layout == "split" else []
    named += ["baked"] if variant.intersector == "baked" else []
    found = [reader(name, variant.fetch) for name in named]
    if variant.structure != "none":
        found.append(glsl(TRAVERSALS[variant.traversal].nodes, variant.nodes, form.grid, variant.fetch))
    return found


def _tests(variant: Variant) -> list[str]:
    """The box test and the triangle test, in the variant's precision; all around them stays `highp`."""
    parts = ["common_slab.glsl", f"box_{variant.box}.glsl", f"intersector_{variant.intersector}.glsl".replace("-", "_")]
    if variant.precision == "highp":
        return parts
    return [f"precision {variant.precision} float;\n", *parts, "precision highp float;\n"]


def raster_texts() -> Stages:
    """The hybrid method's first step."""
    return {"vertex": flatten({}, ["render_raster.vert"]), "fragment": flatten({}, ["render_raster.frag"])}


def present_texts() -> Stages:
    """The compute method's second step."""
    return {"vertex": flatten({}, ["render_screen.vert"]), "fragment": flatten({}, ["render_present.frag"])}


def _offset_parts(variant: Variant) -> list[str]:
    """How a shadow ray leaves its surface, and for `bounded` what the intersector needs of that."""
    room = f"offset_room_{variant.intersector}.glsl".replace("-", "_")
    return [*([room] if variant.offset == "bounded" else []), f"offset_{variant.offset}.glsl"]


def _in_cells(variant: Variant) -> bool:
    """Whether boxes are tested in cells of their grid; 16 bits of them are too many for `mediump`."""
    return (variant.nodes, variant.box, variant.precision) == ("grid16", "widened", "highp")


def _defines(form: Form) -> dict[str, int]:
    row = TRAVERSALS[form.variant.traversal]
    # Packets over these nodes walk an octant at a time.
    alike = row.packet and row.nodes == "skip-wide"
    defines = {
        "INSTRUMENT": int(form.instrument),
        "READS": int(form.reads),
        "LIGHTS": form.lights,
        "NORMALS": int(form.normals),
        "SHADE": int(form.shade),
        "SLAB_GROWN": int(form.variant.intersector == "watertight"),
        "SLAB_ALIKE": int(alike),
        "BOX_CELLS": int(_in_cells(form.variant)),
    }
    match row.state:
        case "stack":
            defines["STACK_SIZE"] = max(form.depth, 1)
        case "trail" | "short trail":
            defines["TRAIL_WORDS"] = 1 if form.depth <= 32 else 2
    if row.state.startswith("short"):
        defines["SHORT_STACK"] = SHORT_STACK
    if form.tail_at is not None:
        defines["TAIL_AT"] = form.tail_at
    return defines
