"""Makes plans: picks the shader parts, the buffers and the passes that one request on one scene needs, and no more."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Kd, Tree
from renderer.pack.api import Packed
from renderer.pack.fetch import BINDINGS, WIDTH, image_unit, rows
from renderer.pack.primitives import pack_raster
from renderer.plan import TEXEL_WORDS, Buffer, Pass, Plan, Program, Texture, Uniform
from renderer.request import Request
from renderer.texts import Form, present_texts, raster_texts, trace_texts
from renderer.variant import TRAVERSALS
from renderer.view import View, view_of
from scenes.scene import Scene

TILE = 512
"""No submission covers more than this many pixels a side, so that a phone's GPU watchdog is not tripped."""

LOOP_BUDGET = 60_000
"""Loop iterations that a brute-force pass may take: Mesa 22 stops an invocation after 65,535 in all."""

SHADOW_OFFSET = 1e-4
"""How far along the normal a shadow ray starts, as a fraction of the scene's diagonal (`--offset constant`)."""

BASE_RECORD_BYTES = 64
"""Bytes a pixel of an instrumented plan's records, and as many again for each light."""


@dataclass(frozen=True, eq=False)
class Reads:
    """Buffers that record reads (`shaders/common_reads.glsl`): `places`, and `words` words for what is read."""

    places: npt.NDArray[np.uint32]
    words: int


def make_plan(
    scene: Scene,
    tree: Tree | None,
    packed: Packed,
    request: Request,
    *,
    instrument: bool = False,
    reads: Reads | None = None,
) -> Plan:
    """The plan of a request.

    `instrument` adds counters, hit records and the rays as cast. `reads` makes the timed plan record what it reads of
    nodes and primitives, collected as the buffer `reads` from one tile that covers the image. Neither must be timed.
    """
    return _Planner(scene, tree, packed, request, instrument, reads).plan()


def in_passes(scene: Scene, tree: Tree | None) -> bool:
    """Whether a traversal without a tree is cut into passes; their counters are not carried along."""
    return tree is None and len(scene.faces) > pass_triangles(scene)


def pass_triangles(scene: Scene) -> int:
    """The triangles of one brute-force pass: an invocation may trace a primary ray and one to each light."""
    return LOOP_BUDGET // (1 + len(scene.lights))


class _Planner:
    """The parts of one plan, gathered; every method gives one part."""

    def __init__(
        self,
        scene: Scene,
        tree: Tree | None,
        packed: Packed,
        request: Request,
        instrument: bool,
        reads: Reads | None,
    ) -> None:
        self.scene = scene
        self.tree = tree
        self.packed = packed
        self.request = request
        self.instrument = instrument
        self.reads = reads
        self.variant = request.variant
        self.hybrid = self.variant.method == "hybrid"
        self.kind = "compute" if self.variant.method == "compute" else "draw"
        # Instrumented plans report the whole image whatever is to be timed.
        self.rays = "both" if instrument else request.rays
        self.fetched = _fetched(packed)
        self.view = view_of(scene, request.camera or scene.camera, request.size)

    def plan(self) -> Plan:
        passes, programs = self._passes()
        stateful = any("state" in step.storage.values() for step in passes)
        buffers = self._buffers(stateful)
        return Plan(
            size=self.request.size,
            tile=self._tile(),
            buffers=tuple(buffers),
            textures=tuple(self._textures()),
            programs=tuple(programs),
            passes=tuple(passes),
            uniforms=self._uniforms(),
            output="image",
            needs=self._needs(stateful, buffers),
            left_out=tuple(self._left_out()),
        )

    def _tile(self) -> tuple[int, int]:
        width, height = self.request.size
        return (width, height) if self.reads is not None else (min(width, TILE), min(height, TILE))

    # Passes

    def _passes(self) -> tuple[list[Pass], list[Program]]:
        steps: list[Pass] = []
        programs: dict[str, Program] = {}
        for name, stages in self._steps():
            program = "trace-" + "-".join(stages.on).lower().replace("_", "-")
            programs[program] = Program(program, trace_texts(self._form(), stages.on))
            steps.append(self._trace_pass(name, program, stages))
        before, after = self._raster_pass(programs), self._present_pass(programs)
        return [*before, *steps, *after], list(programs.values())

    def _steps(self) -> list[tuple[str, _Stages]]:
        """The trace passes in order: one where the work fits in one, else by range and through the state buffer."""
        primary = not self.hybrid
        shadow = self.rays != "primary"
        if in_passes(self.scene, self.tree):
            return self._ranged_steps(primary, shadow)
        full = (0, len(self.scene.faces))
        if self.rays == "shadow" and primary:
            return [
                ("primary", _Stages(("STAGE_PRIMARY", "STATE_OUT"), "setup", full)),
                ("shadow", _Stages(("STAGE_SHADOW", "STATE_HITS"), "frame", full, last=True)),
            ]
        on = (("STAGE_PRIMARY",) if primary else ()) + (("STAGE_SHADOW",) if shadow else ())
        return [("trace", _Stages(on, "frame", full, last=True))]

    def _ranged_steps(self, primary: bool, shadow: bool) -> list[tuple[str, _Stages]]:
        count, span = len(self.scene.faces), pass_triangles(self.scene)
        ranges = [(at, min(at + span, count)) for at in range(0, count, span)]
        steps: list[tuple[str, _Stages]] = []
        carried: tuple[str, ...]
        phase = "setup" if self.rays == "shadow" else "frame"
        for i, part in enumerate(ranges if primary else []):
            carried = ("STATE_HITS",) if i else ()
            steps.append((f"primary-{i}", _Stages(("STAGE_PRIMARY", "STATE_OUT", *carried), phase, part)))
        for i, part in enumerate(ranges if shadow else []):
            carried = (("STATE_HITS",) if primary else ()) + (("STATE_HIDDEN",) if i else ())
            steps.append((f"shadow-{i}", _Stages(("STAGE_SHADOW", "STATE_OUT", *carried), "frame", part)))
        kept = (("STATE_HITS",) if primary else ()) + (("STATE_HIDDEN",) if shadow else ())
        return [*steps, ("shade", _Stages(kept, "frame", (0, 0), last=True))]

    def _trace_pass(self, name: str, program: str, stages: _Stages) -> Pass:
        fetch = self.variant.fetch
        storage = {str(BINDINGS[name]): name for name in self.fetched if fetch == "storage"}
        textures = {name: name for name in self.fetched if fetch == "texture"}
        images = {str(image_unit(name)): name for name in self.fetched if fetch == "image"}
        if any(stage.startswith("STATE_") for stage in stages.on):
            storage["3"] = "state"
        collect = None
        if self.instrument:
            storage["4"] = "records"
            collect = "records" if stages.last else None
        if self.reads is not None:
            storage |= {"5": "places", "6": "reads"}
            collect = "reads" if stages.last else None
        first, last = stages.triangles
        uniforms: dict[str, Uniform] = {}
        if self.tree is None:
            uniforms = {"range_first": ("uint", [first]), "range_last": ("uint", [last])}
        step = Pass(
            name, self.kind, program, stages.phase, storage, textures, images, uniforms=uniforms, collect=collect
        )
        if self.hybrid:
            raster = {"raster_depth": "depth", "raster_normal": "normal"}
            return replace(step, textures=textures | raster, target=["image"])
        if self.kind == "compute":
            return replace(step, images={"0": "canvas"} | images)
        return replace(step, target=["image"])

    def _raster_pass(self, programs: dict[str, Program]) -> list[Pass]:
        if not self.hybrid:
            return []
        programs["raster"] = Program("raster", raster_texts())
        phase = "setup" if self.rays == "shadow" else "frame"
        return [Pass("raster", "raster", "raster", phase, target=["normal", "depth"], vertices="corners")]

    def _present_pass(self, programs: dict[str, Program]) -> list[Pass]:
        if self.kind != "compute":
            return []
        programs["present"] = Program("present", present_texts())
        return [Pass("present", "draw", "present", textures={"canvas": "canvas"}, target=["image"])]

    def _form(self) -> Form:
        """What the texts of this plan are specialised on."""
        nodes = self.packed.nodes
        return Form(
            variant=self.variant,
            lights=len(self.scene.lights),
            depth=self.packed.levels if self.request.specialise else self.packed.most_levels,
            tail_at=None if nodes is None else nodes.tail_at,
            grid=nodes.grid if nodes is not None and self.request.specialise else None,
            normals=self.packed.normals,
            shade=self.rays != "primary",
            instrument=self.instrument,
            reads=self.reads is not None,
        )

    # Data

    def _buffers(self, stateful: bool) -> list[Buffer]:
        width, height = self.request.size
        data = dict(self.fetched) if self.variant.fetch == "storage" else {}
        if self.hybrid:
            normals = None if self.scene.normals is None else self.scene.normals[self.scene.faces]
            data["corners"] = pack_raster(self.scene.triangles, normals)
        buffers = [Buffer(name, words.nbytes, words) for name, words in data.items()]
        if stateful:
            buffers.append(Buffer("state", width * height * 16))
        if self.instrument:
            tile_width, tile_height = self._tile()
            pixel = BASE_RECORD_BYTES * (1 + len(self.scene.lights))
            buffers.append(Buffer("records", tile_width * tile_height * pixel))
        if self.reads is not None:
            # Zeros, so that what no pixel writes is told from what one does.
            zeros = np.zeros(self.reads.words, np.uint32)
            buffers += [Buffer(n, d.nbytes, d) for n, d in (("places", self.reads.places), ("reads", zeros))]
        return buffers

    def _textures(self) -> list[Texture]:
        textures = [Texture("image", "rgba8")]
        if self.kind == "compute":
            textures.append(Texture("canvas", "rgba8"))
        if self.hybrid:
            textures += [Texture("normal", "r32ui"), Texture("depth", "depth24")]
        if self.variant.fetch != "storage":
            textures += [Texture(name, "rgba32ui", WIDTH, _whole_texels(words)) for name, words in self.fetched.items()]
        return textures

    def _uniforms(self) -> dict[str, Uniform]:
        width, height = self.request.size
        view: View = self.view
        uniforms: dict[str, Uniform] = {
            "image_size": ("ivec2", [width, height]),
            "pixel_step": ("vec2", [2.0 / width, 2.0 / height]),
            "eye": ("vec3", view.eye.tolist()),
            "view_forward": ("vec3", view.forward.tolist()),
            "view_right": ("vec3", view.right.tolist()),
            "view_up": ("vec3", view.up.tolist()),
            "lights": ("vec3", [value for light in self.scene.lights for value in light]),
            "budget_turns": ("uvec2", [2, 2]),
            "scene_size": ("float", [self.scene.diagonal]),
        }
        if self.variant.offset == "constant":
            uniforms["shadow_offset"] = ("float", [self.scene.diagonal * SHADOW_OFFSET])
        if self.hybrid:
            uniforms["depth_planes"] = ("vec2", [view.near, view.far])
            uniforms["projection_view"] = ("mat4", view.projection_view.T.ravel().tolist())
        if self.variant.intersector == "watertight":
            uniforms["scene_lower"], uniforms["scene_upper"] = (
                ("vec3", corner.astype(float).tolist()) for corner in self.scene.bounds
            )
        grid = None if self.packed.nodes is None else self.packed.nodes.grid
        if grid is not None:
            # Also where the text has it: a uniform that no program names is let be.
            uniforms["grid_origin"] = ("vec3", grid.origin.tolist())
            uniforms["grid_cell"] = ("vec3", grid.cell.tolist())
        if self.variant.fetch != "storage" and self.variant.structure == "bvh":
            uniforms["nodes_chunks"] = ("uint", [len(self.fetched["nodes"]) // TEXEL_WORDS])
        if isinstance(self.tree, Kd):
            uniforms["root_lower"] = ("vec3", (self.tree.lower[0].astype(float) + 0.0).tolist())
            uniforms["root_upper"] = ("vec3", (self.tree.upper[0].astype(float) + 0.0).tolist())
        return uniforms

    def _needs(self, stateful: bool, buffers: list[Buffer]) -> dict[str, int]:
        """Device limits by GL name, without the `GL_MAX_`."""
        fetch = self.variant.fetch
        blocks = len(self.fetched) if fetch == "storage" else 0
        blocks += stateful + self.instrument + 2 * (self.reads is not None)
        stage = "COMPUTE" if self.kind == "compute" else "FRAGMENT"
        largest = max((buffer.nbytes for buffer in buffers), default=0)
        needs = {f"{stage}_SHADER_STORAGE_BLOCKS": blocks, "SHADER_STORAGE_BLOCK_SIZE": largest}
        if fetch != "storage":
            needs["TEXTURE_SIZE"] = max(WIDTH, *(rows(len(words)) for words in self.fetched.values()))
        if fetch == "image":
            needs[f"{stage}_IMAGE_UNIFORMS"] = len(self.fetched) + (self.kind == "compute")
        return needs

    def _left_out(self) -> list[str]:
        """What the general form has and this scene does not need."""
        if not self.request.specialise:
            return []
        out = [] if self.packed.normals else ["vertex normals in the primitive buffers"]
        if self.packed.nodes is not None and self.packed.nodes.grid is not None:
            out.append("uniforms of the node grid")
        state = TRAVERSALS[self.variant.traversal].state
        if state == "stack" and self.tree is not None:
            most = self.packed.most_levels
            out.append(f"{most - max(self.packed.levels, 1)} of {most} stack entries")
        if state in ("trail", "short trail") and self.tree is not None and self.packed.levels <= 32:
            out.append("the trail's second word")
        return out


def _fetched(packed: Packed) -> dict[str, npt.NDArray[np.uint32]]:
    """The buffers that traversals and shading fetch from."""
    primitives = packed.primitives
    words = {"primitives": primitives.vertices, "normals": primitives.normals, "baked": primitives.baked}
    words["nodes"] = None if packed.nodes is None else packed.nodes.words
    return {name: held for name, held in words.items() if held is not None}


def _whole_texels(words: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    rest = -len(words) % TEXEL_WORDS
    return np.concatenate([words, np.zeros(rest, np.uint32)]) if rest else words


@dataclass(frozen=True)
class _Stages:
    """What one trace pass does: the stages switched on, when, over which triangles, and whether it ends the image."""

    on: tuple[str, ...]
    phase: str
    triangles: tuple[int, int]
    last: bool = False
