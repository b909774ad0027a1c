"""A device in few words, from its view in the API; for the page and the terminal."""

from __future__ import annotations

from typing import Any

Json = dict[str, Any]


def describe_state(device: Json) -> str:
    """Whether jobs may run on it: `ready`, or why not."""
    if device["set_aside"] is not None:
        return "set aside"
    if device["presence"] == "online" and not device["ready"]:
        return "being checked"
    return "ready" if device["ready"] else str(device["presence"])


def describe_gpu(device: Json) -> str:
    """GPU and driver; empty while they are not known."""
    gl = device["facts"].get("gl") or {}
    return ", ".join(word for word in (gl.get("renderer"), gl.get("version")) if word)


def describe_running(device: Json) -> str:
    """What runs on it now, and what else waits."""
    jobs = [f"job {part['job']} ({part['state']})" for part in device["running"]]
    waiting = device["open_jobs"] - len(device["running"])
    return ", ".join([*jobs, *([f"{waiting} waiting"] if waiting > 0 else [])])


def describe_facts(device: Json) -> list[tuple[str, str]]:
    """What it told about itself, as (name, text), in the order shown."""
    facts = device["facts"]
    told = {
        "SoC": _joined(facts.get("soc_manufacturer"), facts.get("soc")),
        "Android": _android(facts),
        "Processor": _cores(facts),
        "GPU": (facts.get("gl") or {}).get("renderer"),
        "Driver": (facts.get("gl") or {}).get("version"),
        "Storage blocks": _blocks(facts.get("limits") or {}),
        "Battery": _battery(facts.get("battery") or {}),
        "Thermal status": (facts.get("thermal") or {}).get("name"),
    }
    return [(name, text) for name, text in told.items() if text]


def describe_health(device: Json) -> str:
    """The outcome of its last health check."""
    health = device["health"]
    if health is None or device["health_at"] is None:
        return "not checked yet"
    said = "passed" if health.get("passed") else "failed, cleared" if health.get("cleared") else "failed"
    identical = health.get("identical")
    if identical is not None:
        said += ", as the twin bit for bit" if all(identical.values()) else ", not the twin's bits"
    return f"{said} ({device['health_at'][:16].replace('T', ' ')} UTC)"


def _joined(*words: Any) -> str:
    return " ".join(str(word) for word in words if word)


def _android(facts: Json) -> str:
    release, sdk = facts.get("android"), facts.get("sdk")
    return f"{release or 'unknown'}{f' (API {sdk})' if sdk else ''}" if release or sdk else ""


def _cores(facts: Json) -> str:
    if not facts.get("cores"):
        return ""
    memory = f", {facts['memory_bytes'] / 2**30:.0f} GiB" if facts.get("memory_bytes") else ""
    return f"{_joined(facts.get('cpu'))}, {facts['cores']} cores{memory}"


def _blocks(limits: Json) -> str:
    """The limit that decides on methods, by stage."""
    stages = {stage: limits.get(f"{stage.upper()}_SHADER_STORAGE_BLOCKS") for stage in ("compute", "fragment")}
    return ", ".join(f"{count} {stage}" for stage, count in stages.items() if count is not None)


def _battery(battery: Json) -> str:
    level, celsius, status = (battery.get(name) for name in ("level", "celsius", "status"))
    figures = [f"{level} %" if level is not None else "", f"{celsius:.1f} °C" if celsius is not None else "", status]
    return ", ".join(word for word in figures if word)
