"""Compiles programs with the driver that this process's environment names (`python -m renderer.phone_compile.driver`).

The environment is fixed when a process starts, so each GPU has a process of its own, which may crash or hang without
harm. Standard input is one line of JSON, `{"parent": PID, "programs": [{stage: text}]}`. Standard output is a line of
what the driver says of itself, then one for each program as it is done, or `{"error": SENTENCE}`. Imports nothing
heavy.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import tempfile
from typing import Any

from renderer.process import end_with_parent

SURFACELESS = 0x31DD
ES_API = 0x30A0
CONTEXT = (0x3098, 3, 0x30FB, 1, 0x31B0, 1, 0x3038)
"""Version 3.1, with debug messages."""

STAGES = {"vertex": 0x8B31, "fragment": 0x8B30, "compute": 0x91B9}
COMPILED, LINKED = 0x8B81, 0x8B82
DEBUG_OUTPUT = 0x92E0
VERSION, RENDERER = 0x1F02, 0x1F01

LIMITS = {
    "VERTEX_SHADER_STORAGE_BLOCKS": 0x90D6,
    "FRAGMENT_SHADER_STORAGE_BLOCKS": 0x90DA,
    "COMPUTE_SHADER_STORAGE_BLOCKS": 0x90DB,
    "COMBINED_SHADER_STORAGE_BLOCKS": 0x90DC,
    "SHADER_STORAGE_BUFFER_BINDINGS": 0x90DD,
    "SHADER_STORAGE_BLOCK_SIZE": 0x90DE,
    "COMPUTE_WORK_GROUP_INVOCATIONS": 0x90EB,
    "COMPUTE_SHARED_MEMORY_SIZE": 0x8262,
    "COMPUTE_IMAGE_UNIFORMS": 0x91BD,
    "FRAGMENT_IMAGE_UNIFORMS": 0x90CE,
    "TEXTURE_SIZE": 0x0D33,
    "FRAGMENT_UNIFORM_COMPONENTS": 0x8B49,
    "COMPUTE_UNIFORM_COMPONENTS": 0x8263,
}
"""GL's names without `GL_MAX_`, and their numbers."""

_MESSAGE = ctypes.CFUNCTYPE(
    None,
    ctypes.c_uint,
    ctypes.c_uint,
    ctypes.c_uint,
    ctypes.c_uint,
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.c_void_p,
)


class DriverError(RuntimeError):
    """A driver that gives no context; the message is one sentence."""


class Driver:
    """A GLES 3.1 context on the no-op device."""

    def __init__(self) -> None:
        self.egl, self.gl = ctypes.CDLL("libEGL.so.1"), ctypes.CDLL("libGLESv2.so.2")
        for name in ("eglGetPlatformDisplay", "eglCreateContext", "eglGetProcAddress"):
            getattr(self.egl, name).restype = ctypes.c_void_p
        self.gl.glGetString.restype = ctypes.c_char_p
        self._make_context()
        self.messages: list[str] = []
        self._callback = _MESSAGE(self._hear)
        self._listen()

    def facts(self) -> dict[str, Any]:
        """What the driver says of itself."""
        value = ctypes.c_int64()
        limits = {}
        for name, number in LIMITS.items():
            self.gl.glGetInteger64v(number, ctypes.byref(value))
            limits[name] = value.value
        return {
            "renderer": self.gl.glGetString(RENDERER).decode(),
            "version": self.gl.glGetString(VERSION).decode(),
            "limits": limits,
        }

    def link(self, stages: dict[str, str]) -> str | None:
        """Compile and link; None, or the compiler's first complaint."""
        program = self.gl.glCreateProgram()
        shaders = []
        try:
            for stage, text in stages.items():
                shader = self.gl.glCreateShader(STAGES[stage])
                shaders.append(shader)
                source = ctypes.c_char_p(text.encode())
                self.gl.glShaderSource(shader, 1, ctypes.byref(source), None)
                self.gl.glCompileShader(shader)
                complaint = self._complaint(shader, COMPILED, "Shader")
                if complaint is not None:
                    return f"its {stage} text is refused: {complaint}"
                self.gl.glAttachShader(program, shader)
            self.gl.glLinkProgram(program)
            complaint = self._complaint(program, LINKED, "Program")
            return None if complaint is None else f"it does not link: {complaint}"
        finally:
            for shader in shaders:
                self.gl.glDeleteShader(shader)
            self.gl.glDeleteProgram(program)

    def _make_context(self) -> None:
        display = self.egl.eglGetPlatformDisplay(SURFACELESS, None, None)
        major, minor = ctypes.c_int(), ctypes.c_int()
        handle = ctypes.c_void_p(display)
        if not display or not self.egl.eglInitialize(handle, ctypes.byref(major), ctypes.byref(minor)):
            raise DriverError(f"EGL gives no surfaceless display (error {self.egl.eglGetError():#x})")
        self.egl.eglBindAPI(ES_API)
        wanted = (ctypes.c_int * len(CONTEXT))(*CONTEXT)
        context = self.egl.eglCreateContext(handle, None, None, wanted)
        if not context or not self.egl.eglMakeCurrent(handle, None, None, ctypes.c_void_p(context)):
            raise DriverError(f"the driver makes no GLES 3.1 context (error {self.egl.eglGetError():#x})")

    def _listen(self) -> None:
        self.gl.glEnable(DEBUG_OUTPUT)
        address = self.egl.eglGetProcAddress(b"glDebugMessageCallbackKHR")
        if not address:
            raise DriverError("the driver has no KHR_debug to report statistics through")
        ctypes.CFUNCTYPE(None, _MESSAGE, ctypes.c_void_p)(address)(self._callback, None)

    def _hear(self, _source: int, _type: int, _id: int, _severity: int, length: int, text: int, _user: int) -> None:
        self.messages.append(ctypes.string_at(text, length).decode(errors="replace"))

    def _complaint(self, thing: int, question: int, kind: str) -> str | None:
        done = ctypes.c_int()
        getattr(self.gl, f"glGet{kind}iv")(thing, question, ctypes.byref(done))
        if done.value:
            return None
        log = ctypes.create_string_buffer(4096)
        getattr(self.gl, f"glGet{kind}InfoLog")(thing, len(log), None, log)
        return (log.value.decode(errors="replace").strip().splitlines() or ["no reason given"])[0]


class Printed:
    """What this process's C code prints, by pieces; the true standard output stays open as `answers`."""

    def __init__(self) -> None:
        self.answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  open as long as this process
        for output in (1, 2):
            os.dup2(self._file.fileno(), output)
        self._c = ctypes.CDLL(None)

    def take(self) -> str:
        """What was printed since the last call."""
        self._c.fflush(None)
        end = os.lseek(1, 0, os.SEEK_CUR)
        self._file.seek(0)
        piece = self._file.read(end)
        os.ftruncate(1, 0)
        os.lseek(1, 0, os.SEEK_SET)
        return piece.decode(errors="replace")


def main() -> None:
    """Answer one order."""
    order = json.loads(sys.stdin.readline())
    end_with_parent(order["parent"])
    printed = Printed()

    def say(answer: dict[str, Any]) -> None:
        printed.answers.write(json.dumps(answer) + "\n")
        printed.answers.flush()

    try:
        driver = Driver()
        say(driver.facts())
        for stages in order["programs"]:
            printed.take()
            driver.messages.clear()
            complaint = driver.link(stages)
            say({"complaint": complaint, "messages": [*driver.messages], "listing": printed.take()})
    except (DriverError, OSError, AttributeError) as error:
        say({"error": str(error)})
    # A driver's own clean-up on a device that is none is no part of the answer.
    os._exit(0)


if __name__ == "__main__":
    main()
