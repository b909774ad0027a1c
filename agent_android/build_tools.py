"""What the agent's build is made of: the folders, running tools, pinned jars, jars with the same bytes every time."""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent
OUT = HERE / "build"
_NATIVES = {"x86_64": "natives-linux", "aarch64": "natives-linux-arm64"}


class BuildError(RuntimeError):
    """A build that cannot be; the message is one sentence that says what to do, and what a tool said."""


def require(program: str, package: str) -> str:
    """Where a program is; raise BuildError unless it is here."""
    found = shutil.which(program)
    if found is None:
        raise BuildError(f"The agent's build needs {program}: install {package}.")
    return found


def run(*command: str, more: dict[str, str] | None = None) -> None:
    """Run a program with `more` in its environment; raise BuildError with what it said when it fails."""
    environment = {**os.environ, **(more or {})}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        said = (done.stdout + done.stderr).strip()
        raise BuildError(f"{command[0]} failed with code {done.returncode}:\n{said}")


def fetched(*profile: str) -> dict[str, Path]:
    """The jars of pom.xml, and those of a profile of it, by artifact (natives by file name), where Maven keeps them."""
    natives = _NATIVES.get(platform.machine(), "natives-linux")
    with tempfile.TemporaryDirectory() as folder:
        listed = Path(folder) / "classpath"
        options = ["-B", "-q", "-C", *profile, f"-Dlwjgl.natives={natives}", f"-Dmdep.outputFile={listed}"]
        run("mvn", "-f", str(HERE / "pom.xml"), *options, "dependency:build-classpath")
        jars = [Path(entry) for entry in listed.read_text().split(os.pathsep)]
    return {jar.stem if "natives" in jar.name else jar.parent.parent.name: jar for jar in jars}


def compile_java(sources: Iterable[Path], jars: Iterable[Path], level: Iterable[str], into: Path) -> Path:
    """Compile for Java 8 as `level` says, warnings being errors; return the folder of classes."""
    classpath = os.pathsep.join(map(str, jars))
    run("javac", *level, "-Werror", "-encoding", "UTF-8", "-cp", classpath, "-d", str(into), *map(str, sources))
    return into


def zip_files(jar: Path, folder: Path, names: Iterable[str]) -> None:
    """Make a jar whose bytes depend on the files' names and bytes alone."""
    with zipfile.ZipFile(jar, "w", zipfile.ZIP_DEFLATED) as out:
        for name in names:
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            out.writestr(entry, (folder / name).read_bytes())


def write(file: Path, data: bytes) -> None:
    """Write a file so that nobody sees half of it."""
    part = file.with_name(file.name + ".part")
    part.write_bytes(data)
    part.replace(file)


def sha256(file: Path) -> str:
    """The digest of a file's bytes."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def sha256_of_all(files: Iterable[Path], root: Path) -> str:
    """One digest over files and their names below `root`."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.relative_to(root).as_posix()}\n{sha256(file)}\n".encode())
    return digest.hexdigest()


@contextmanager
def alone(out: Path) -> Iterator[None]:
    """Hold a build folder, made if need be: one build at a time."""
    out.mkdir(parents=True, exist_ok=True)
    handle = os.open(out / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
