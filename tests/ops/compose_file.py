"""docker-compose.yml and the Dockerfile, read as their tools read them, as far as these two files go."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
COMPOSE, DOCKERFILE = ROOT / "docker-compose.yml", ROOT / "Dockerfile"
_VARIABLE = re.compile(r"\$\{(\w+)(?::([-?])([^}]*))?\}")


def read_compose(variables: Mapping[str, str]) -> dict[str, Any]:
    """The compose file with its variables replaced; ValueError where one must be set and is not."""

    def value(found: re.Match[str]) -> str:
        name, mark, word = found.groups()
        given = variables.get(name, "")
        if not given and mark == "?":
            raise ValueError(f"{name}: {word}")
        return given or (word if mark == "-" else "")

    parsed: dict[str, Any] = _replaced(yaml.safe_load(COMPOSE.read_text()), lambda text: _VARIABLE.sub(value, text))
    return parsed


def _replaced(node: Any, replace: Any) -> Any:
    if isinstance(node, dict):
        return {key: _replaced(value, replace) for key, value in node.items()}
    if isinstance(node, list):
        return [_replaced(value, replace) for value in node]
    return replace(node) if isinstance(node, str) else node


def read_dockerfile() -> list[tuple[str, str]]:
    """Its instructions in order: (FROM, ...), (RUN, ...), with continued lines joined."""
    joined = re.sub(r"\\\n\s*", "", DOCKERFILE.read_text())
    lines = [line for line in joined.splitlines() if line and not line.startswith("#")]
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in lines)]


def image_environment() -> dict[str, str]:
    """The environment that the image's last stage gives."""
    instructions = read_dockerfile()
    last = max(at for at, (word, _) in enumerate(instructions) if word == "FROM")
    return dict(rest.split("=", 1) for word, rest in instructions[last:] if word == "ENV")
