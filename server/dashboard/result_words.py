"""What a job asks for and what its result was measured with, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from server.dashboard.headline import Line, counted, listed

Json = dict[str, Any]

_ASKED = {
    "both": "primary and shadow rays timed",
    "primary": "primary rays timed",
    "shadow": "shadow rays timed",
}
_CHECKS = {
    "none": "errors not checked",
    "oracle": "checked by Embree",
    "referee": "checked by Embree and an exact referee",
    "image": "checked by Embree and an exact referee, and the picture against the exact one",
}


def asked_words(request: Json) -> str:
    """What a job asks for, in one line."""
    width, height = request["size"]
    frames, rounds, gpus = request["frames"], request["rounds"], request.get("gpus") or ()
    parts = [
        f"{width} × {height} pixels",
        f"compiled for {', '.join(gpus)}" if gpus else f"{counted(frames, 'frame')} in {counted(rounds, 'round')}",
        "" if gpus else _ASKED.get(request["rays"], ""),
        f"SAH costs {request['costs']['traversal']:g} and {request['costs']['intersection']:g}",
        "" if gpus else _CHECKS.get(request["check"], ""),
        "against Embree" if request["vs_embree"] else "",
        "with the models of memory and ALU" if request.get("models") else "",
        "" if request["specialise"] else "not specialised to the scene",
        "from a camera of its own" if request.get("camera") else "",
    ]
    return listed(parts, ", ")


def environment(document: Json) -> list[Line]:
    """What a result was measured on and with; of what its host did not tell, only what every host should tell."""
    device, versions = document.get("device") or {}, document.get("versions") or {}
    cores = f" on {device['cores']} cores" if device.get("cores") else ""
    load = document.get("load_average")
    told: dict[str, Any] = {
        "Device": " ".join(str(device[key]) for key in ("id", "kind") if device.get(key)),
        "Name": device.get("name"),
        "Driver": device.get("driver"),
        "Vendor": device.get("vendor"),
        "GPU": device.get("renderer"),
        "GLSL": device.get("glsl"),
        "Android": device.get("android"),
        "SoC": device.get("soc"),
        "Agent": " by ".join(str(device[key]) for key in ("agent", "via") if device.get(key)),
        "Machine": device.get("machine"),
        "Threads": device.get("threads"),
        "Load average": None if load is None else f"{load:.2f}{cores}, the highest of all rounds",
        "RayFarm": versions.get("rayfarm"),
        "Plan format": versions.get("plan"),
        "Embree": versions.get("embreex"),
        "Shader hash": versions.get("shader_sha"),
        "Started": str(document.get("started_at") or "").replace("T", " "),
    }
    always = ("Device", "Driver", "Load average", "RayFarm", "Shader hash")
    lines = [(name, "" if text is None else str(text)) for name, text in told.items()]
    return [Line(name, text or "not told", measured=bool(text)) for name, text in lines if text or name in always]


def left_out(document: Json) -> tuple[str, Sequence[str]]:
    """One sentence on specialisation, and what it left out of the plan."""
    parts = document.get("specialised")
    if parts is None:
        return "Not specialised: the plan holds the general form, also what this scene does not need.", ()
    if not parts:
        return "Specialised to the scene, which needs all of it: nothing was left out.", ()
    return "Specialised to the scene, so the plan does without:", [str(part) for part in parts]
