"""The rules of ARCHITECTURE.md: which package may import which, and who knows a traversal's name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from renderer.variant import TRAVERSALS

ROOT = Path(__file__).parents[2]

MAY_IMPORT = {
    "scenes": set(),
    "renderer": {"scenes"},
    "agent_android": set(),
    "shaders": set(),
    "server": {"renderer", "scenes"},
}
"""What a package may import of the others. `agent_android` sees plans alone, as files."""

TABLES = {"server/named_studies.py", "server/paper/claims.py"}
"""Where the server may name traversals: what studies measure, and what the paper says of its own."""

HOSTS = ("renderer/host.py", "renderer/twin.py", "renderer/twin_host.py", "renderer/kept_twins.py")
NAME = re.compile("|".join(rf"\b{name}\b" for one in TRAVERSALS for name in (one, one.replace("-", "_"))))


def imported(tree: ast.AST) -> Iterator[str]:
    """The modules that a file imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or "")


def forbidden(package: str, text: str) -> set[str]:
    """The modules that a file of a package imports and must not; relative imports stay within it."""
    others = MAY_IMPORT.keys() - MAY_IMPORT[package] - {package} | {"tests", "benchmarks"}
    return {module for module in imported(ast.parse(text)) if module.split(".")[0] in others}


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_package_imports_only_what_it_may(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    found = {str(file.relative_to(ROOT)): forbidden(package, file.read_text(encoding="utf-8")) for file in files}
    assert {file: modules for file, modules in found.items() if modules} == {}


@pytest.mark.parametrize("text", ["import server.app", "def f():\n    from server import app", "import tests.postgres"])
def test_an_import_against_the_arrow_is_seen(text: str) -> None:
    assert forbidden("renderer", text)


@pytest.mark.parametrize("folder", ["server", "agent_android"])
def test_no_traversal_is_named_outside_tables(folder: str) -> None:
    kinds = {".py", ".java", ".html", ".js", ".css", ".sh", ".c"}
    files = [file for file in sorted((ROOT / folder).rglob("*")) if file.suffix in kinds and "build" not in file.parts]
    assert {file.suffix for file in files} >= {".py", ".html" if folder == "server" else ".java"}
    named = {str(file.relative_to(ROOT)) for file in files if NAME.search(file.read_text(encoding="utf-8"))}
    assert named == (TABLES if folder == "server" else set())


@pytest.mark.parametrize("host", HOSTS)
def test_a_host_knows_no_traversal(host: str) -> None:
    text = (ROOT / host).read_text(encoding="utf-8")
    assert not NAME.search(text)
    assert not any(module in ("renderer.variant", "renderer.texts") for module in imported(ast.parse(text)))
