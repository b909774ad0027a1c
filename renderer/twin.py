"""The twin: runs plans with moderngl on EGL, as the phone agent does. Holds no traversal and no scene logic."""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from renderer.host import Frames, Tile
from renderer.plan import GROUP, TEXEL_WORDS, Pass, Plan, PlanError, Texture, Uniform, refuse_beyond

_PLACE = re.compile(r"\d+:(\d+)\b")
"""Where a compiler says that its error is: a string of the text, and a line."""

_VECTORS = {"vec2": 2, "vec3": 3, "mat4": 16}


def open_context() -> Any:
    """A moderngl context on EGL without a display; raise PlanError saying what to install when there is none."""
    try:
        settings: dict[str, Any] = {"standalone": True, "backend": "egl", "require": 430}
        return moderngl.create_context(**settings)
    except Exception as error:
        raise PlanError(
            f"No OpenGL 4.3 context could be made through EGL ({error}): install libegl1 and libgl1 (Mesa)."
        ) from error


class Twin:
    """One plan made ready on one context: compiled, uploaded, its setup passes still to run.

    `kept` holds programs by their texts: plans that share it share them, and their owner releases them.
    """

    def __init__(self, context: Any, plan: Plan, kept: dict[str, Any] | None = None) -> None:
        self.context = context
        self._kept = kept
        self.plan = plan
        check_limits(context, plan)
        self._buffers = {b.name: self._upload(b.nbytes, b.data) for b in plan.buffers}
        self._textures = {texture.name: self._texture(texture) for texture in plan.textures}
        self._held = {texture.name for texture in plan.textures if texture.data is not None}
        self._programs = {p.name: self._compile(p.name, p.stages) for p in plan.programs}
        self._vertices = {p.name: self._vertex_array(p) for p in plan.passes if p.kind != "compute"}
        self._targets = {p.name: self._framebuffer(p) for p in plan.passes if p.target}
        self.arm()

    def arm(self) -> None:
        """Set what all passes share; needed again when another plan ran with one of the same programs."""
        for name, program in self._programs.items():
            self._set_uniforms(program, self.plan.uniforms)
            if "present" not in name:
                self._set(program, "tile_size", ("ivec2", list(self.plan.tile)))

    def setup(self) -> None:
        """Run the passes that run once."""
        self._run("setup", None)
        self.context.finish()

    def frame(self) -> None:
        """Run one frame to completion."""
        self._run("frame", None)
        self.context.finish()

    def time_frames(self, count: int, between: Callable[[], None] = lambda: None) -> Frames:
        """Time `count` frames, each to completion, and call `between` after each."""
        frames = Frames()
        for _ in range(count):
            wall, cpu = time.perf_counter(), time.process_time()
            self.frame()
            frames.wall.append(time.perf_counter() - wall)
            frames.cpu.append(time.process_time() - cpu)
            between()
        return frames

    def collect(self) -> list[Tile]:
        """Run one frame and return its collected tiles."""
        collected: list[Tile] = []
        self._run("frame", collected)
        return collected

    def image(self) -> npt.NDArray[np.uint8]:
        """The output, (height, width, 4), row 0 at the bottom."""
        width, height = self.plan.size
        data = self._textures[self.plan.output].read()
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Give the device's memory back."""
        for made in (*self._vertices.values(), *self._targets.values()):
            made.release()
        programs = self._programs.values() if self._kept is None else ()
        for made in (*self._buffers.values(), *self._textures.values(), *programs):
            made.release()

    # Running

    def _run(self, phase: str, collected: list[Tile] | None) -> None:
        for step in self.plan.passes:
            if step.phase != phase:
                continue
            program = self._programs[step.program]
            self._bind(step, program)
            if step.kind == "raster":
                self._raster(step)
                continue
            for tile in self._tiles():
                self._submit(step, program, tile)
                if step.collect is not None and collected is not None:
                    self.context.memory_barrier()
                    words = np.frombuffer(self._buffers[step.collect].read(), np.uint32)
                    collected.append((tile, words))
            self.context.memory_barrier()

    def _tiles(self) -> Iterator[tuple[int, int, int, int]]:
        (width, height), (across, down) = self.plan.size, self.plan.tile
        for y in range(0, height, down):
            for x in range(0, width, across):
                yield x, y, min(across, width - x), min(down, height - y)

    def _submit(self, step: Pass, program: Any, tile: tuple[int, int, int, int]) -> None:
        x, y, width, height = tile
        self._set(program, "tile_origin", ("ivec2", [x, y]))
        if step.kind == "compute":
            self._set(program, "group_origin", ("ivec2", [x, y]))
            program.run(-(-width // GROUP), -(-height // GROUP), 1)
            return
        target = self._targets[step.name]
        target.use()
        target.scissor = tile
        self._vertices[step.name].render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _raster(self, step: Pass) -> None:
        target = self._targets[step.name]
        target.use()
        target.clear(depth=1.0)
        self.context.enable_only(moderngl.DEPTH_TEST)
        self._vertices[step.name].render(moderngl.TRIANGLES)
        self.context.enable_only(moderngl.NOTHING)

    def _bind(self, step: Pass, program: Any) -> None:
        for binding, name in step.storage.items():
            self._buffers[name].bind_to_storage_buffer(int(binding))
        for unit, (sampler, name) in enumerate(step.textures.items()):
            self._textures[name].use(unit)
            self._set(program, sampler, ("int", [unit]))
        for unit_name, name in step.images.items():
            held = name in self._held
            self._textures[name].bind_to_image(int(unit_name), read=held, write=not held)
        self._set_uniforms(program, step.uniforms)

    # Making ready

    def _upload(self, nbytes: int, data: npt.NDArray[np.uint32] | None) -> Any:
        if data is None:
            return self.context.buffer(reserve=max(nbytes, 16))
        return self.context.buffer(np.ascontiguousarray(data) if data.size else bytes(16))

    def _texture(self, texture: Texture) -> Any:
        size = self.plan.size
        if texture.data is not None:
            made = self._filled(texture, texture.data)
        elif texture.format == "depth24":
            made = self.context.depth_texture(size)
            made.compare_func = ""
        else:
            components, dtype = {"rgba8": (4, "f1"), "r32ui": (1, "u4")}[texture.format]
            made = self.context.texture(size, components, dtype=dtype)
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return made

    def _filled(self, texture: Texture, data: npt.NDArray[np.uint32]) -> Any:
        """A texture of words: whole rows first, then what the last one holds."""
        width = texture.width or 1
        rows, rest = divmod(texture.texels, width)
        made = self.context.texture((width, max(rows + (rest > 0), 1)), TEXEL_WORDS, dtype="u4")
        whole = rows * width * TEXEL_WORDS
        if rows:
            made.write(data[:whole].tobytes(), (0, 0, width, rows))
        if rest:
            made.write(data[whole:].tobytes(), (0, rows, rest, 1))
        return made

    def _compile(self, name: str, stages: dict[str, str]) -> Any:
        if self._kept is None:
            return self._compiled(name, stages)
        texts = "".join(stages.values())
        if texts not in self._kept:
            self._kept[texts] = self._compiled(name, stages)
        return self._kept[texts]

    def _compiled(self, name: str, stages: dict[str, str]) -> Any:
        try:
            if "compute" in stages:
                return self.context.compute_shader(stages["compute"])
            return self.context.program(vertex_shader=stages["vertex"], fragment_shader=stages["fragment"])
        except moderngl.Error as error:
            complaint = _complaint(str(error), stages)
            raise PlanError(f"The program {name} does not compile on this device: {complaint}") from error

    def _vertex_array(self, step: Pass) -> Any:
        program = self._programs[step.program]
        if step.vertices is None:
            return self.context.vertex_array(program, [])
        return self.context.vertex_array(program, [(self._buffers[step.vertices], "3f 1u", "position", "normal")])

    def _framebuffer(self, step: Pass) -> Any:
        colour, *depth = (self._textures[name] for name in step.target)
        return self.context.framebuffer([colour], depth[0] if depth else None)

    def _set_uniforms(self, program: Any, uniforms: dict[str, Uniform]) -> None:
        for name, value in uniforms.items():
            self._set(program, name, value)

    def _set(self, program: Any, name: str, uniform: Uniform) -> None:
        """Set a uniform if the program uses it; compilers drop the ones that it does not."""
        member = program.get(name, None)
        if member is None:
            return
        kind, values = uniform
        if kind in ("float", *_VECTORS):
            member.write(struct.pack(f"<{len(values)}f", *values))
        else:
            code = "I" if kind in ("uint", "uvec2") else "i"
            member.write(struct.pack(f"<{len(values)}{code}", *(int(value) for value in values)))


def check_limits(context: Any, plan: Plan) -> None:
    """Raise PlanError naming the limit, what is needed and what the device has."""
    offered = {name.removeprefix("GL_MAX_"): value for name, value in context.info.items()}
    refuse_beyond(offered, plan)


def _complaint(log: str, stages: dict[str, str]) -> str:
    """The first error of a compiler's log, with the line of the flattened text that it is about."""
    first = next((line for line in log.splitlines() if "error" in line and ":" in line), log).strip()
    place = _PLACE.match(first)
    text = next((text for stage, text in stages.items() if f"{stage}_shader" in log), "").splitlines()
    if place is None or not 0 < int(place.group(1)) <= len(text):
        return first
    return f"{first}, in `{text[int(place.group(1)) - 1].strip()}`"
