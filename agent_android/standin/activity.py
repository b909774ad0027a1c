"""As much of Android's Java as an activity needs, compiled once, so that the agent's APK runs on a stand-in phone."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from agent_android.standin.errors import StandInUnavailableError

SOURCES = Path(__file__).with_name("activity")


def classes(folder: Path) -> Path:
    """The folder of compiled classes below `folder`. Raises StandInUnavailableError without a Java compiler."""
    sources = sorted(SOURCES.rglob("*.java"))
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    built = folder / f"activity-{digest[:16]}"
    if not built.is_dir():
        _compile(sources, built)
    return built


def _compile(sources: list[Path], built: Path) -> None:
    if shutil.which("javac") is None:
        raise StandInUnavailableError("A stand-in phone needs a Java compiler (default-jdk-headless).")
    built.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=built.parent) as scratch:
        fresh = Path(scratch, "classes")
        command = ["javac", "--release", "8", "-Xlint:-options", "-d", str(fresh), *map(str, sources)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise StandInUnavailableError(f"The stand-in phone's Java classes do not compile: {done.stderr}")
        try:
            os.rename(fresh, built)
        except OSError:
            if not built.is_dir():
                raise
