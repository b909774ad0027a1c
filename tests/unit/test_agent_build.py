"""The phone agent's build: what it makes, and that the desktop's stand-ins for Android's classes have their shape."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from agent_android import build, build_tools

TOOLS = ("javac", "mvn", "enjarify")
APK_TOOLS = ("aapt2", "zipalign", "apksigner")
_METHOD = re.compile(r"public (?:static |final |native |synchronized |abstract )*([\w.<>\[\]]+ \w+\([^)]*\))")

built = pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in TOOLS), reason=f"the agent's build needs {', '.join(TOOLS)}"
)


@pytest.fixture(scope="module")
def facts() -> build.Facts:
    return build.build_desktop()


@pytest.fixture(scope="module")
def android() -> Path:
    return build_tools.fetched()["android-all"]


def made_again(*_: str) -> dict[str, Path]:
    raise RuntimeError("made again")


def sha(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@built
def test_the_facts_describe_the_files(facts: build.Facts) -> None:
    assert json.loads((build_tools.OUT / "agent.json").read_text()) == facts
    assert facts["sha256"] == sha(build_tools.OUT / "agent.jar")
    assert facts["version"] == build.version()
    assert re.fullmatch(r"\d+\.\d+\.\d+\+[0-9a-f]{12}", build.version())


@built
def test_the_jar_is_a_dex_that_knows_its_version(facts: build.Facts) -> None:
    with zipfile.ZipFile(build_tools.OUT / "agent.jar") as jar:
        assert jar.namelist() == ["classes.dex"]
        dex = jar.read("classes.dex")
    # Format 035 is what the first Android with OpenGL ES 3.1 reads.
    assert dex[:8] == b"dex\n035\0"
    assert build.version().encode() in dex
    assert str(facts["version"]) == build.version()


@built
def test_the_same_sources_make_the_same_jar(
    facts: build.Facts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the tools for the APK, too: a sentence says which are missing."""
    monkeypatch.setattr(build, "missing_apk_tools", lambda: ["aapt2"])
    again = build.build_agent(tmp_path)
    assert again == {**facts, "apk_sha256": None}
    assert capsys.readouterr().err == "agent.apk is not made: it needs aapt2 (apt: aapt zipalign apksigner).\n"
    assert not (tmp_path / "agent.apk").exists()
    # What is up to date is not made again.
    when = (tmp_path / "agent.jar").stat().st_mtime_ns
    monkeypatch.setattr(build, "fetched", made_again)
    assert build.build_agent(tmp_path) == again
    assert (tmp_path / "agent.jar").stat().st_mtime_ns == when
    # What is damaged is.
    (tmp_path / "agent.jar").write_bytes(b"torn")
    with pytest.raises(RuntimeError, match="made again"):
        build.build_agent(tmp_path)


def test_the_version_is_that_of_the_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = tmp_path / "agent_android"
    shutil.copytree(build_tools.HERE, here, ignore=shutil.ignore_patterns("build", "desktop", "standin", "__pycache__"))
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "7.8.9"\n')
    first = build.version()
    assert build.version(here) == "7.8.9+" + first.partition("+")[2]
    source = here / "src" / "org" / "rayfarm" / "agent" / "Main.java"
    source.write_text(source.read_text() + "\n")
    changed = build.version(here)
    assert changed != "7.8.9+" + first.partition("+")[2]
    source.rename(source.with_name("Other.java"))
    assert build.version(here) not in (changed, first)


def test_a_missing_tool_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PATH", "")
    assert build.main([]) == 1
    said = capsys.readouterr().err
    assert said == "The agent's build needs javac: install a JDK (default-jdk-headless).\n"


def test_a_failing_tool_says_why() -> None:
    with pytest.raises(build_tools.BuildError, match=r"^ls failed with code 2:\n.*no-such-file"):
        build_tools.run("ls", "no-such-file")


@built
@pytest.mark.skipif(any(shutil.which(tool) is None for tool in APK_TOOLS), reason=f"needs {', '.join(APK_TOOLS)}")
def test_the_apk_holds_the_same_classes_signed(facts: build.Facts) -> None:
    apk = build_tools.OUT / "agent.apk"
    assert facts["apk_sha256"] == sha(apk)
    with zipfile.ZipFile(apk) as packed, zipfile.ZipFile(build_tools.OUT / "agent.jar") as jar:
        assert packed.read("classes.dex") == jar.read("classes.dex")
        assert b"Lorg/rayfarm/agent/AgentActivity;" in packed.read("classes.dex")
    build_tools.run("zipalign", "-c", "4", str(apk))
    build_tools.run("apksigner", "verify", "--min-sdk-version", "21", str(apk))
    shown = output("aapt2", "dump", "badging", str(apk))
    assert "package: name='org.rayfarm.agent'" in shown
    assert build.version() in shown
    assert "sdkVersion:'21'" in shown
    assert "application-debuggable" in shown
    assert "uses-permission" not in shown


@built
def test_the_stand_ins_have_the_methods_of_androids_classes(facts: build.Facts, android: Path) -> None:
    """As compiled against: a name that Android lacks, or another signature, could not be noticed on the desktop."""
    with zipfile.ZipFile(build_tools.OUT / "desktop" / "desktop.jar") as jar:
        names = [n[:-6].replace("/", ".") for n in jar.namelist() if n.startswith("android/")]
    assert {"android.opengl.GLES31", "android.opengl.EGL14", "android.os.Process"} <= set(names)
    desktop = [build_tools.OUT / "desktop" / "desktop.jar", *(build_tools.OUT / "desktop").glob("lwjgl*.jar")]
    ours, theirs = (methods(jars, names) for jars in (desktop, [android]))
    assert sum(map(len, ours.values())) > 75
    for name in names:
        assert ours[name] - theirs[name] == set(), name


@built
def test_json_is_androids_own(facts: build.Facts, android: Path) -> None:
    with zipfile.ZipFile(build_tools.OUT / "desktop" / "json.jar") as ours, zipfile.ZipFile(android) as theirs:
        assert "org/json/JSONObject.class" in ours.namelist()
        assert all(ours.read(name) == theirs.read(name) for name in ours.namelist())


def test_nothing_names_where_packages_come_from() -> None:
    pom = (build_tools.HERE / "pom.xml").read_text()
    assert "repositor" not in pom.lower()
    assert set(re.findall(r"https?://[^\s\"<]*", pom)) == {"http://maven.apache.org/POM/4.0.0"}


def methods(jars: list[Path], names: list[str]) -> dict[str, set[str]]:
    """The public methods by class, with those that they inherit from classes given too."""
    found: dict[str, set[str]] = {}
    shown = output("javap", "-public", "-cp", ":".join(map(str, jars)), *names)
    for block in shown.split("Compiled from")[1:]:
        head = re.search(r"class ([\w.$]+)", block)
        assert head is not None
        found[head[1]] = set(_METHOD.findall(block))
    return found


def output(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout
