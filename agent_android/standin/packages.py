"""Fetches adbd and what it needs from the machine's own Debian archive into the user's cache, installing nothing."""

from __future__ import annotations

import fcntl
import platform
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from platformdirs import user_cache_path

from agent_android.standin.errors import StandInUnavailableError

VERSION = "34.0.5-12~bpo12+1"
SUITE = "bookworm"
PINNED = {
    "adbd": VERSION,
    "android-libbase": f"1:{VERSION}",
    "android-libcutils": f"1:{VERSION}",
    "android-liblog": f"1:{VERSION}",
    "android-libziparchive": f"1:{VERSION}",
    "android-libboringssl": "14.0.0+r45-2~bpo12+1",
}
STABLE = ("libbrotli1", "liblz4-1", "libprotobuf32", "libsystemd0", "libzstd1", "bubblewrap", "enjarify")
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
PROGRAMS = ("apt-get", "dpkg", "cc")
PATIENCE_S = 180


def cache() -> Path:
    """RayFarm's folder in the user's cache."""
    return user_cache_path("rayfarm")


def ensure() -> Path:
    """The folder with adbd, bwrap and enjarify unpacked; fetched once.

    Raises StandInUnavailableError where they cannot be had.
    """
    unpacked = cache() / f"adbd-{VERSION}"
    if unpacked.is_dir():
        return unpacked
    _check_machine()
    unpacked.parent.mkdir(parents=True, exist_ok=True)
    with (unpacked.parent / "adbd.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not unpacked.is_dir():
            _fetch(unpacked)
    return unpacked


def adbd(unpacked: Path, preloaded: Path) -> list[str]:
    """The command of adbd with its own libraries and `preloaded` before all; it takes no arguments."""
    libraries = next((unpacked / "usr/lib").glob("*-linux-gnu"))
    loader = ["/lib64/ld-linux-x86-64.so.2", "--argv0", "adbd", "--preload", str(preloaded)]
    path = ["--library-path", f"{libraries / 'android'}:{libraries}"]
    return [*loader, *path, str(unpacked / "usr/lib/android-sdk/platform-tools/adbd")]


def _check_machine() -> None:
    missing = [program for program in PROGRAMS if shutil.which(program) is None]
    if missing or platform.machine() != "x86_64":
        raise StandInUnavailableError(
            f"A stand-in phone needs Debian on x86_64 with {', '.join(PROGRAMS)}"
            f"{'; missing: ' + ', '.join(missing) if missing else ''}. Attach a real phone instead."
        )


def _fetch(unpacked: Path) -> None:
    reasons: list[str] = []
    for archive in _archives():
        with tempfile.TemporaryDirectory(dir=unpacked.parent, prefix="adbd-") as folder:
            try:
                tree = _unpack(_download(archive, Path(folder)), Path(folder) / "tree")
            except (subprocess.SubprocessError, OSError) as error:
                reasons.append(_said(error))
                continue
            tree.rename(unpacked)
            return
    raise StandInUnavailableError(
        f"adbd {VERSION} could not be fetched from {SUITE}-backports"
        f" ({'; '.join(reasons) or f'no apt source here has the suite {SUITE}'})."
        f" Name the Debian archive that has {SUITE} and {SUITE}-backports in apt's sources."
    )


def _archives() -> list[str]:
    """Base addresses of the configured archives that hold the suite; apt's own parser reads its sources."""
    printed = _apt(["update", "--print-uris"])
    found = re.findall(rf"^'([^']+)/dists/{SUITE}/InRelease'", printed, re.MULTILINE)
    return list(dict.fromkeys(found))


def _download(archive: str, folder: Path) -> list[Path]:
    """The packages' files. A private apt state keeps the system's lists and sources as they are."""
    debs = folder / "debs"
    for name in ("lists/partial", "archives/partial", "debs"):
        (folder / name).mkdir(parents=True)
    (folder / "status").touch()
    signed = f" [signed-by={KEYRING}]" if KEYRING.exists() else ""
    sources = folder / "sources.list"
    sources.write_text("".join(f"deb{signed} {archive} {suite} main\n" for suite in (SUITE, f"{SUITE}-backports")))
    options = {
        "Dir::State": folder,
        "Dir::State::status": folder / "status",
        "Dir::Cache": folder,
        "Dir::Etc::sourcelist": sources,
        "Dir::Etc::sourceparts": "/dev/null",
        "Dir::Etc::preferences": "/dev/null",
        "Dir::Etc::preferencesparts": "/dev/null",
        "APT::Sandbox::User": "",
        "Acquire::Languages": "none",
        "Acquire::IndexTargets::deb::DEP-11::DefaultEnabled": "false",
    }
    private = [word for key, value in options.items() for word in ("-o", f"{key}={value}")]
    _apt([*private, "-q", "update"], debs)
    _apt([*private, "-q", "download", *(f"{name}={version}" for name, version in PINNED.items()), *STABLE], debs)
    return sorted(debs.glob("*.deb"))


def _unpack(debs: list[Path], tree: Path) -> Path:
    tree.mkdir()
    for deb in debs:
        subprocess.run(["dpkg", "-x", str(deb), str(tree)], check=True, capture_output=True, text=True, timeout=60)
    return tree


def _apt(arguments: list[str], folder: Path | None = None) -> str:
    command = ["apt-get", *arguments]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=PATIENCE_S).stdout


def _said(error: Exception) -> str:
    lines = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
    return lines[-1] if lines else repr(error)
