"""What a health check looks at: a host, and what its device is."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from typing import Any

from renderer.host import Host
from renderer.twin import open_context
from renderer.twin_host import TwinHost
from server.devices.agent_host import AgentHost
from server.devices.words import plain

Json = dict[str, Any]

DEADLINE_S = 60.0
"""Seconds for each of a check's two commands on a phone; both end within the check's own time."""
_LIMITS = ("SHADER_STORAGE", "COMPUTE_WORK_GROUP_INVOCATIONS", "MAX_TEXTURE_SIZE", "MAX_FRAMEBUFFER_")
"""Of the twin's limits, those that a plan may meet."""
MOST = 64
"""Limits, and figures of a stage, that are kept of a phone's."""
_STAGES = ("compute", "fragment")
_FIGURES = ("cases", "wrong", "max_ulp")
_MESA = re.compile(r"Mesa (\S+)")


@dataclass(frozen=True)
class Examined:
    """A device under examination; `facts` may be asked while its lock is held."""

    host: Host
    facts: Callable[[], Json]


def examined_twin() -> Examined:
    """This host's own GL."""
    return Examined(TwinHost(threads=1), _twin_facts)


def examined_phone(serial: str) -> Examined:
    """A phone; raise PhoneError when the agent is not built."""
    host = AgentHost(serial, deadline_s=DEADLINE_S)
    return Examined(host, lambda: _phone_facts(host))


def _twin_facts() -> Json:
    context = open_context()
    info = context.info
    context.release()
    version = str(info["GL_VERSION"])
    mesa = _MESA.search(version)
    return {
        "name": info["GL_RENDERER"],
        "driver": version,
        "mesa": mesa[1] if mesa else None,
        "gl": {"vendor": info["GL_VENDOR"], "renderer": info["GL_RENDERER"], "version": version},
        "limits": {n.removeprefix("GL_MAX_"): v for n, v in info.items() if any(part in n for part in _LIMITS)},
        "precision": None,
    }


def _phone_facts(host: AgentHost) -> Json:
    device, said = host.device(), host.probe().device
    return {
        "driver": device["driver"],
        "gl": {
            "vendor": device["vendor"],
            "renderer": device["renderer"],
            "version": device["driver"],
            "glsl": device["glsl"],
            "egl": device["egl"],
        },
        "limits": dict(islice(host.limits().items(), MOST)),
        "precision": _precision(said.get("precision")),
        "agent": device["agent"],
    }


def _precision(said: Any) -> Json:
    """By stage and operation: `cases`, `wrong` and `max_ulp`; or by stage an `error`. Nothing else that it said."""
    stages = said if isinstance(said, dict) else {}
    return {stage: _stage(stages[stage]) for stage in _STAGES if isinstance(stages.get(stage), dict)}


def _stage(said: Json) -> Json:
    if "error" in said:
        return {"error": plain(said["error"])}
    operations = {plain(name, 40): found for name, found in islice(said.items(), MOST) if isinstance(found, dict)}
    return {name: {k: found[k] for k in _FIGURES if type(found.get(k)) is int} for name, found in operations.items()}
