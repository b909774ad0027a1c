"""The built agent: what is pushed, which version it is, and what it hashes to."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from server.devices.adb import PhoneError

BUILD = Path(__file__).resolve().parents[2] / "agent_android" / "build"
MAIN = "org.rayfarm.agent.Main"
PACKAGE = "org.rayfarm.agent"


@dataclass(frozen=True)
class AgentPackage:
    """The agent's jar, and its APK where one was built; `sha256` is the jar's."""

    version: str
    jar: Path
    sha256: str
    apk: Path


def find_agent(build: Path = BUILD) -> AgentPackage:
    """The agent in a build folder; raise PhoneError when it is not built, or is not what was built."""
    jar, facts_file = build / "agent.jar", build / "agent.json"
    try:
        facts = json.loads(facts_file.read_text())
        version, sha256 = str(facts["version"]), str(facts["sha256"])
        found = hashlib.sha256(jar.read_bytes()).hexdigest()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PhoneError("The phone's agent is not built: run `make agent`.") from error
    if found != sha256:
        raise PhoneError("agent.jar is not the one that agent.json describes: run `make agent` again.")
    return AgentPackage(version, jar, sha256, build / "agent.apk")
