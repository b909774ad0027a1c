"""The documentation: it builds without a warning, its links lead somewhere, and what it names is there."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import yaml
from typer.core import TyperGroup
from typer.main import get_command

from renderer.pack.schema import NODE_LAYOUTS
from renderer.variant import AXES, Traversal
from server.cli import app as cli
from server.settings import Settings

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md")] + sorted((ROOT / "docs").glob("*.md"))
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)

COMMAND = re.compile(r"(?:^|`)(?:\.venv/bin/)?rayfarm (?P<verb>[a-z][a-z-]*)(?P<rest>[^`\n#]*)", re.MULTILINE)


class Page(HTMLParser):
    """A built page: its anchors, its links, and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors.add(given.get("id", ""))
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(given["href"])
        if "src" in given:
            self.loaded.append(given["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Page]:
    """The built pages by their file."""
    folder = tmp_path_factory.mktemp("site")
    words = ("-W", "-n", "-q", "--keep-going", "-c", "docs", "-d", f"{folder}/trees", ".", f"{folder}/html")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (built.returncode, built.stderr) == (0, "")
    pages = (folder / "html").rglob("*.html")
    return {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in pages}


def test_every_page_is_built(site: dict[Path, Page]) -> None:
    built = {path.stem for path in site}
    assert built >= {page.stem for page in PAGES if page.stem != "README"} | {"ARCHITECTURE", "CHANGELOG"}


def test_links_lead_somewhere(site: dict[Path, Page]) -> None:
    broken = []
    for path, page in site.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (parts.fragment and parts.fragment not in site[target].anchors):
                broken.append((path.name, link))
    assert broken == []
    assert sum(len(page.links) for page in site.values()) > 500


def test_nothing_is_loaded_from_elsewhere(site: dict[Path, Page]) -> None:
    loaded = [address for page in site.values() for address in page.loaded]
    assert [address for address in loaded if urlsplit(address).netloc] == []
    assert len(loaded) > 50


def test_the_api_page_has_every_operation(site: dict[Path, Page]) -> None:
    (page,) = (page for path, page in site.items() if path.stem == "api")
    assert {"get-api-v1-jobs-job-id", "post-api-v1-studies-plan", "jobbody"} <= page.anchors


@each_page
def test_files_that_a_page_links_are_there(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        assert urlsplit(link).scheme or (page.parent / link).exists(), link


@cache
def verbs() -> dict[str, set[str]]:
    """The options of every verb, those of its own verbs among them."""
    group = get_command(cli.app)
    assert isinstance(group, TyperGroup)
    found = {}
    for name, verb in group.commands.items():
        parts = [verb, *(verb.commands.values() if isinstance(verb, TyperGroup) else ())]
        found[name] = {word for part in parts for one in part.params for word in (*one.opts, *one.secondary_opts)}
        found[name] |= {"--help", *(verb.commands if isinstance(verb, TyperGroup) else ())}
    return found


def commands(text: str) -> Iterator[tuple[str, str]]:
    """The verbs that a page gives to the program, each with the rest of its line."""
    for match in COMMAND.finditer(text):
        yield match["verb"], match["rest"]


@each_page
def test_verbs_and_options_that_a_page_names_exist(page: Path) -> None:
    for verb, rest in commands(page.read_text(encoding="utf-8")):
        assert verb in verbs(), f"rayfarm {verb}"
        unknown = set(re.findall(r"(?<!\S)--[a-z][a-z-]*", rest)) - verbs()[verb]
        assert unknown == set(), f"rayfarm {verb} {rest}"


@each_page
def test_options_that_a_page_names_alone_exist(page: Path) -> None:
    measuring = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "benchmarks").glob("*.py"))
    known = set().union(*verbs().values(), re.findall(r"add_argument\(\"(--[a-z-]+)", measuring))
    named = re.findall(r"`(--[a-z][a-z-]*)[ `]", page.read_text(encoding="utf-8"))
    assert set(named) <= known


def test_verbs_are_seen() -> None:
    assert list(commands("`rayfarm serve` or rayfarm in short\nrayfarm bench x --size 3  # rayfarm in short")) == [
        ("serve", ""),
        ("bench", " x --size 3  "),
    ]


def test_every_verb_is_documented() -> None:
    named = {verb for page in PAGES for verb, _ in commands(page.read_text(encoding="utf-8"))}
    assert set(verbs()) - named == {"up"}  # `make run` is its name


@cache
def program() -> str:
    """All texts of the program and of what starts it, its documents and tests left out."""
    left_out = {"docs", "tests", "var", "build", "dist"}
    folders = [one for one in ROOT.iterdir() if one.is_dir() and one.name[0] != "." and one.name not in left_out]
    files = [*ROOT.iterdir(), *(file for folder in folders for file in folder.rglob("*"))]
    built = ROOT / "agent_android/build"
    kinds = {"", ".py", ".java", ".sh", ".yml", ".yaml", ".service", ".env"}
    chosen = (file for file in files if file.is_file() and file.suffix in kinds and built not in file.parents)
    return "\n".join(file.read_text(encoding="utf-8") for file in chosen)


@each_page
def test_variables_and_make_targets_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    settings = {f"RAYFARM_{name.upper()}" for name in Settings.model_fields}
    for name in set(re.findall(r"RAYFARM_[A-Z][A-Z_]*[A-Z]", text)) - settings:
        assert name in program(), name
    targets = set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"(?:`|^)make ([a-z][a-z-]*)", text, re.MULTILINE)) <= targets


def test_every_setting_is_documented() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [name for name in Settings.model_fields if f"RAYFARM_{name.upper()}" not in text] == []


def test_axes_and_layouts_are_told() -> None:
    studies = (ROOT / "docs/studies.md").read_text(encoding="utf-8")
    assert [axis for axis in AXES if f"| `{axis}` |" not in studies] == []
    values = [value for axis, own in AXES.items() if axis != "traversal" for value in own]
    assert [value for value in values if f"`{value}`" not in studies] == []
    adding = (ROOT / "docs/adding_a_traversal.md").read_text(encoding="utf-8")
    assert [name for name in NODE_LAYOUTS if f"`{name}`" not in adding] == []
    assert [field.name for field in fields(Traversal) if f"| `{field.name}` |" not in adding] == []


def test_the_plan_s_page_shows_what_runs(tmp_path: Path) -> None:
    (program,) = re.findall(
        r"```python\n(.*?)```", (ROOT / "docs/plan_format.md").read_text(encoding="utf-8"), re.DOTALL
    )
    ran = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "void trace(const bool any_hit)" in ran.stdout
    assert (tmp_path / "cornell.plan").read_bytes().startswith(b"RAYFARM\0")


def test_the_citation_is_of_this_version() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert cited["version"] == project["version"]
    assert [author["family-names"] for author in cited["references"][0]["authors"]] == [
        "Sousa",
        "Sena",
        "Papadopoulos",
        "Pereira",
    ]
