"""Plans whose rays come from a buffer instead of a camera: what hard cases cast (`shaders/render_rays.glsl`)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Tree
from renderer.host import Tile
from renderer.pack.api import Packed
from renderer.plan import Buffer, Pass, Plan, PlanError, Program, Uniform
from renderer.planner import BASE_RECORD_BYTES, LOOP_BUDGET, TILE, make_plan
from renderer.records import Flags, Hits, Ints, Rays, Words
from renderer.request import MAX_SIDE, Request
from renderer.texts import Form, trace_texts
from scenes.scene import Scene

ROW = 256
"""Rays in a row of a ray plan's image."""

_LARGEST = float(np.finfo(np.float32).max)
_MISS = 0xFFFFFFFF
_GENERAL = "#define ANY_HIT ((way.w & 1u) != 0u)\nuniform uint tail_at;\n#define TAIL_AT tail_at\n"


@dataclass(frozen=True, eq=False)
class Question:
    """n rays and what is asked of them: the closest hit, or with `any_hit` whether there is one.

    With `start` each ray is spawned: its `rays` are those that found the hits `start` in the primitive buffer's `slot`
    (n,) int32, and `spawned` gives the directions and reaches; their origins are found on the device.
    """

    rays: Rays
    any_hit: bool = False
    start: Hits | None = None
    slot: Ints | None = None
    spawned: Rays | None = None


@dataclass(frozen=True, eq=False)
class Answer:
    """What came of n rays: the `rays` as cast, their `hits` and where those lie in the primitive buffer, `slot` (n,).

    `counts` (n, 5) uint32 in the order of COUNTERS; `cut` (n,) bool marks rays whose loops were ended.
    """

    rays: Rays
    hits: Hits
    slot: Ints
    counts: Words
    cut: Flags


def make_ray_plan(
    scene: Scene, tree: Tree | None, packed: Packed, request: Request, question: Question, *, instrument: bool = True
) -> Plan:
    """The plan that asks a question of a scene; its method is compute or fragment.

    In the general form (`request.specialise` off) the text depends on the variant alone: one program serves every
    scene and question. Raise PlanError for more rays than an image holds, or triangles than one brute-force pass.
    """
    size = (ROW, max(-(-len(question.rays) // ROW), 1))
    if size[1] > MAX_SIDE:
        raise PlanError(f"{len(question.rays)} rays do not fit one plan: ask for at most {MAX_SIDE * ROW}.")
    if tree is None and len(scene.faces) > LOOP_BUDGET:
        raise PlanError(f"Brute force takes at most {LOOP_BUDGET} triangles in one pass: walk a tree instead.")
    with np.errstate(over="ignore", invalid="ignore"):
        camera = make_plan(scene, tree, packed, replace(request, size=size), instrument=True)
    tile = (ROW, min(size[1], TILE))
    data = _words(question)
    buffers = [buffer for buffer in camera.buffers if buffer.name not in ("records", "state")]
    buffers.append(Buffer("rays", data.nbytes, data))
    if instrument:
        buffers.append(Buffer("records", tile[0] * tile[1] * BASE_RECORD_BYTES))
    return replace(
        camera,
        size=size,
        tile=tile,
        buffers=tuple(buffers),
        programs=(Program("rays", _texts(packed, request, question, instrument)),),
        passes=(_pass(camera, instrument),),
        uniforms=_uniforms(camera, packed, question),
        output="canvas" if request.variant.method == "compute" else "image",
    )


def read_answer(plan: Plan, count: int, tiles: Iterable[Tile]) -> Answer:
    """The answer of a plan's first `count` rays from its tiles."""
    width, height = plan.size
    image = np.zeros((height, width, 4, 4), np.uint32)
    for (x, y, across, down), words in tiles:
        part = words.reshape(plan.tile[1], plan.tile[0], 4, 4)
        image[y : y + down, x : x + across] = part[:down, :across]
    chunks = image.reshape(-1, 4, 4)[:count]
    missed = chunks[:, 1, 3] == _MISS
    floats = np.ascontiguousarray(chunks[:, :2]).view(np.float32)
    return Answer(
        rays=Rays(floats[:, 0, :3].copy(), floats[:, 1, :3].copy(), np.full(count, _LARGEST, np.float32)),
        hits=Hits(
            np.where(missed, np.float32(np.inf), floats[:, 0, 3]),
            np.where(missed, -1, chunks[:, 1, 3].astype(np.int64)).astype(np.int32),
        ),
        slot=chunks[:, 3, 2].astype(np.int32),
        counts=np.concatenate([chunks[:, 2], chunks[:, 3, :1]], axis=1),
        cut=chunks[:, 3, 1] != 0,
    )


def _texts(packed: Packed, request: Request, question: Question, instrument: bool) -> dict[str, str]:
    general = not request.specialise
    nodes = None if general else packed.nodes
    form = Form(
        variant=request.variant,
        lights=0,
        depth=packed.most_levels if general else packed.levels,
        tail_at=None if nodes is None else nodes.tail_at,
        grid=None if nodes is None else nodes.grid,
        normals=packed.normals,
        shade=True,
        instrument=instrument,
        reads=False,
    )
    fitted = f"#define ANY_HIT {str(question.any_hit).lower()}\n"
    return trace_texts(form, ("STAGE_PRIMARY",), "rays", (_GENERAL if general else fitted,))


def _pass(camera: Plan, instrument: bool) -> Pass:
    step = next(step for step in camera.passes if step.name == "trace")
    storage = {binding: name for binding, name in step.storage.items() if name not in ("state", "records")}
    storage["5"] = "rays"
    if instrument:
        storage["4"] = "records"
    return replace(step, name="rays", program="rays", storage=storage, collect="records" if instrument else None)


def _uniforms(camera: Plan, packed: Packed, question: Question) -> dict[str, Uniform]:
    added: dict[str, Uniform] = {"ray_count": ("uint", [len(question.rays)])}
    if packed.nodes is not None and packed.nodes.tail_at is not None:
        added["tail_at"] = ("uint", [packed.nodes.tail_at])
    held = {name: (kind, [_held(value) for value in values]) for name, (kind, values) in camera.uniforms.items()}
    return held | added


def _held(value: float) -> float:
    """A figure of a scene that is wider than float32 goes, in its range."""
    return value if isinstance(value, int) or np.isnan(value) else min(max(value, -_LARGEST), _LARGEST)


def _words(question: Question) -> Words:
    words = np.zeros((max(len(question.rays), 1), 4, 4), np.uint32)
    rays = question.rays
    if len(rays):
        words[:, 0, :3], words[:, 0, 3] = _bits(rays.origin), _bits(rays.reach)
        words[:, 1, :3], words[:, 1, 3] = _bits(rays.direction), int(question.any_hit)
    if question.start is not None and question.slot is not None and question.spawned is not None:
        words[:, 1, 3] |= 2
        words[:, 2, 0] = _bits(question.start.t)
        words[:, 2, 1] = question.slot.astype(np.uint32)
        words[:, 2, 2] = question.start.primitive.astype(np.int64) & 0xFFFFFFFF
        words[:, 3, :3], words[:, 3, 3] = _bits(question.spawned.direction), _bits(question.spawned.reach)
    return words.ravel()


def _bits(values: npt.NDArray[np.float32]) -> Words:
    return np.ascontiguousarray(values, np.float32).view(np.uint32)
