"""Builds the phone agent into `build/`: `python -m agent_android.build` makes agent.jar, agent.apk and agent.json,
`python -m agent_android.build desktop` those and what runs them on this machine.

Python and not a shell script because the version, the digests and the jars' exact bytes come out of it. Maven only
says where it put what pom.xml pins; no Gradle, NDK or Android Studio.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

from agent_android.build_desktop import make_desktop, turn_back
from agent_android.build_tools import (
    HERE,
    OUT,
    BuildError,
    alone,
    compile_java,
    fetched,
    require,
    run,
    sha256,
    sha256_of_all,
    write,
    zip_files,
)

_FIRST_ANDROID = "21"
_LEVEL = ("--release", "8", "-Xlint:all,-options")
_APK_TOOLS = ("aapt2", "zipalign", "apksigner", "keytool")
_KEY = ("-storepass", "rayfarm", "-alias", "debug")

Facts = dict[str, str | None]


def version(here: Path = HERE) -> str:
    """The project's version and twelve digits of the sha256 over the agent's sources and manifest."""
    project = tomllib.loads((here.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    sources = [*sorted((here / "src").rglob("*.java")), here / "AndroidManifest.xml"]
    return f"{project}+{sha256_of_all(sources, here)[:12]}"


def build_agent(out: Path = OUT) -> Facts:
    """Make agent.jar and, where the tools are here, agent.apk; return what agent.json says of them.

    Does nothing where they are up to date; raise BuildError when a tool is missing or fails.
    """
    require("javac", "a JDK (default-jdk-headless)")
    require("mvn", "Maven (maven)")
    with alone(out):
        known = _known(out)
        if known is not None:
            return known
        with tempfile.TemporaryDirectory() as folder:
            _make(Path(folder), out)
        apk = out / "agent.apk"
        apk_sha256 = sha256(apk) if apk.exists() else None
        facts: Facts = {"version": version(), "sha256": sha256(out / "agent.jar"), "apk_sha256": apk_sha256}
        write(out / "agent.json", json.dumps(facts, indent=2).encode() + b"\n")
        return facts


def build_desktop(out: Path = OUT) -> Facts:
    """Make the agent and what runs its DEX on this machine; return what agent.json says."""
    require("enjarify", "enjarify (enjarify)")
    facts = build_agent(out)
    with alone(out):
        make_desktop(out)
        turn_back(out)
    return facts


def missing_apk_tools() -> list[str]:
    """The programs that agent.apk needs and that are not here."""
    return [tool for tool in _APK_TOOLS if shutil.which(tool) is None]


def _known(out: Path) -> Facts | None:
    """What agent.json says if it is of these sources, its files are whole and no APK is owed."""
    try:
        facts: Facts = json.loads((out / "agent.json").read_text())
        whole = sha256(out / "agent.jar") == facts["sha256"]
        apk = facts["apk_sha256"]
        whole &= bool(missing_apk_tools()) if apk is None else sha256(out / "agent.apk") == apk
        return facts if whole and facts["version"] == version() else None
    except (OSError, ValueError, KeyError):
        return None


def _make(work: Path, out: Path) -> None:
    jars = fetched()
    baked = work / "Version.java"
    baked.write_text(
        "package org.rayfarm.agent;\n\nfinal class Version {\n"
        f'    static final String VERSION = "{version()}";\n\n    private Version() {{\n    }}\n}}\n'
    )
    sources = [*sorted((HERE / "src").rglob("*.java")), baked]
    classes = compile_java(sources, [jars["android-all"]], _LEVEL, work / "classes")
    dexer = ["java", "-cp", str(jars["dalvik-dx"]), "com.android.dx.command.Main", "--dex"]
    run(*dexer, f"--min-sdk-version={_FIRST_ANDROID}", f"--output={work / 'classes.dex'}", str(classes))
    zip_files(work / "agent.jar", work, ["classes.dex"])
    (out / "agent.apk").unlink(missing_ok=True)
    write(out / "agent.jar", (work / "agent.jar").read_bytes())
    missing = missing_apk_tools()
    if missing:
        print(f"agent.apk is not made: it needs {', '.join(missing)} (apt: aapt zipalign apksigner).", file=sys.stderr)
        return
    _make_apk(work, jars["android-all"], out)


def _make_apk(work: Path, android: Path, out: Path) -> None:
    bare, aligned = work / "bare.apk", work / "agent.apk"
    _resources_only(android, work / "android.jar")
    manifest = ["--manifest", str(HERE / "AndroidManifest.xml"), "--version-code", "1", "--version-name", version()]
    run("aapt2", "link", "-o", str(bare), "-I", str(work / "android.jar"), *manifest)
    with zipfile.ZipFile(bare, "a") as apk:
        apk.write(work / "classes.dex", "classes.dex")
    run("zipalign", "-f", "4", str(bare), str(aligned))
    key = out / "debug.keystore"
    if not key.exists():
        subject = ("-dname", "CN=RayFarm debug", "-keyalg", "RSA", "-keysize", "2048", "-validity", "10000")
        run("keytool", "-genkeypair", "-keystore", str(key), *_KEY, "-keypass", "rayfarm", *subject)
    signing = ["--ks", str(key), "--ks-pass", "pass:rayfarm", "--min-sdk-version", _FIRST_ANDROID]
    run("apksigner", "sign", *signing, str(aligned))
    write(out / "agent.apk", aligned.read_bytes())


def _resources_only(android: Path, into: Path) -> None:
    """What aapt2 reads of Android's jar: a hundred megabytes of classes need not be walked."""
    with zipfile.ZipFile(android) as full, zipfile.ZipFile(into, "w") as small:
        for name in ("AndroidManifest.xml", "resources.arsc"):
            small.writestr(name, full.read(name))


def main(words: Sequence[str]) -> int:
    """The command line: nothing, or `desktop`."""
    if list(words) not in ([], ["desktop"]):
        print("usage: python -m agent_android.build [desktop]", file=sys.stderr)
        return 2
    try:
        facts = build_desktop() if words else build_agent()
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    print(json.dumps(facts))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
