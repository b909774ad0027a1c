"""The namespaces that a stand-in phone lives in: its own root, processes and user, over the machine's programs."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from agent_android.standin import activity, packages
from agent_android.standin.errors import StandInUnavailableError

AGENT = Path(__file__).parent.parent
STANDIN = Path(__file__).parent
SHELL_UID = "2000"
ROOT_LINKS = ("bin", "lib", "lib64", "sbin")
# Not the whole of /etc: whoever reaches adbd on this machine reads what is here.
ETC = ("alternatives", "fonts", "glvnd", "group", "java*", "ld.so.c*", "localtime", "passwd")
FOLDERS = ("data/local/tmp", "control/properties", "control/dumpsys", "counters", "state/settings")


def arguments(root: Path, unpacked: Path, desktop: Path) -> list[str]:
    """The bwrap command, up to the program to run, for a phone whose files lie below `root`."""
    kinds = ["--unshare-user", "--unshare-pid", "--unshare-ipc", "--unshare-uts", "--hostname", "localhost"]
    identity = ["--uid", SHELL_UID, "--gid", SHELL_UID]
    mounts = [*_system(), *_programs(desktop), *_phone(root)]
    return [str(unpacked / "usr/bin/bwrap"), *kinds, *identity, *mounts]


def environment(port: int, unpacked: Path, desktop: Path) -> dict[str, str]:
    """The phone's whole environment; nothing of the owner's."""
    return {
        "PATH": "/system/bin:/usr/bin:/bin",
        "HOME": "/",
        "LANG": "C.UTF-8",
        "ANDROID_ROOT": "/system",
        "ANDROID_DATA": "/data",
        "TMPDIR": "/data/local/tmp",
        "ADBD_PORT": str(port),
        "RAYFARM_PYTHON": _python(),
        "RAYFARM_ENJARIFY": str(unpacked / "usr/lib/python3/dist-packages"),
        "RAYFARM_DEX_CACHE": str(dex_cache()),
        "RAYFARM_DESKTOP": str(desktop),
        "RAYFARM_ACTIVITY": str(activity.classes(packages.cache())),
    }


def dex_cache() -> Path:
    """Where DEX files that were turned into jars are kept."""
    return packages.cache() / "dex"


def make_folders(root: Path) -> None:
    """The folders of a phone that was never on."""
    for name in FOLDERS:
        (root / name).mkdir(parents=True, exist_ok=True)
    for namespace in ("system", "secure", "global"):
        (root / "state/settings" / namespace).mkdir(exist_ok=True)
    wakefulness = root / "state/wakefulness"
    if not wakefulness.exists():
        wakefulness.write_text("Asleep\n")
    dex_cache().mkdir(parents=True, exist_ok=True)


def _system() -> list[str]:
    mounts = ["--tmpfs", "/", "--proc", "/proc", "--dev", "/dev", "--tmpfs", "/tmp", *_read_only(Path("/usr"))]
    for name in ROOT_LINKS:
        path = Path("/", name)
        if path.is_symlink():
            mounts += ["--symlink", os.readlink(path), str(path)]
        elif path.exists():
            mounts += _read_only(path)
    found = sorted(path for pattern in ETC for path in Path("/etc").glob(pattern))
    return [*mounts, *(word for path in found for word in _read_only(path))]


def _programs(desktop: Path) -> list[str]:
    """What the stand-ins run, at the paths that it has outside."""
    wanted = [AGENT, desktop.parent, packages.cache(), Path(sys.base_prefix), _java()]
    outside = [path for path in dict.fromkeys(wanted) if not path.is_relative_to("/usr")]
    read = [word for path in outside for word in _read_only(path)]
    return [*read, "--bind", str(dex_cache()), str(dex_cache())]


def _phone(root: Path) -> list[str]:
    mounts = [
        ("--ro-bind", Path("/sys"), "/sys"),
        ("--ro-bind", root / "counters", "/sys/class"),
        ("--bind", root / "data", "/data"),
        ("--bind", root / "state", "/standin/state"),
        ("--ro-bind", root / "control", "/standin/control"),
        ("--ro-bind", STANDIN / "bin", "/system/bin"),
        ("--ro-bind", STANDIN / "jvm", "/standin/jvm"),
    ]
    return [str(word) for mount in mounts for word in mount]


def _read_only(path: Path) -> list[str]:
    return ["--ro-bind-try", str(path), str(path)]


def _python() -> str:
    return str(Path(sys.base_prefix, "bin", f"python3.{sys.version_info.minor}"))


def _java() -> Path:
    program = shutil.which("java")
    if program is None:
        raise StandInUnavailableError("A stand-in phone needs a Java runtime, Java 17 say, on the PATH.")
    return Path(program).resolve().parent.parent
