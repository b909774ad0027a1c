"""adb and its server, phones on USB and who may open them, the agent, and the compilers for phone GPUs."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import adbutils
from adbutils import AdbClient, AdbError

from renderer.phone_compile.toolchain import FOLDER_VARIABLE, MissingError, tool_chain
from server.devices.adb import PhoneError, client
from server.devices.agent_package import find_agent
from server.devices.hotplug import ADB_ERRORS
from server.devices.presence import ONLINE, STATES
from server.devices.words import WordError, plain
from server.doctor.finding import Said
from server.settings import settings

TIMEOUT_S = 5.0
RULES = "51-rayfarm-phones.rules"
RULE_FOLDERS = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
MEND_RULES = f"copy deploy/{RULES} to /etc/udev/rules.d, add the worker's user to the group plugdev, plug it in again"
ADB_INTERFACE = ("ff", "42", "01")
"""The class, subclass and protocol by which a phone offers adb on USB (AOSP, packages/modules/adb)."""


def adb() -> Iterator[Said]:
    """Whether adb is here, and what listens where its server should."""
    if not settings().phones:
        yield "good", "No phones are cared for here (RAYFARM_PHONES)."
        return
    try:
        server = client()
    except WordError as error:
        yield "missing", str(error)
        return
    try:
        path = adbutils.adb_path()
        ended = subprocess.run([path, "version"], capture_output=True, text=True, check=True, timeout=TIMEOUT_S)
    except (AdbError, OSError, subprocess.SubprocessError):
        yield "missing", "There is no adb that runs: apt-get install adb, and correct ADBUTILS_ADB_PATH if it is set."
    else:
        yield "good", f"adb {plain(ended.stdout.splitlines()[1].removeprefix('Version '))} at {path}."
    yield from _said_of(server)


def _said_of(server: AdbClient) -> Iterator[Said]:
    where = f"{server.host}:{server.port}"
    if not _listens(server):
        yield from _log_file()
        yield "good", f"No adb server runs at {where} yet: a worker starts it."
        return
    try:
        number = _version(server)
        states = {info.serial: info.state for info in server.list()}
    except ADB_ERRORS:
        yield "missing", f"What listens at {where} is no adb server: end it, or set ANDROID_ADB_SERVER_PORT."
        return
    yield "good", f"The adb server at {where} has version {number}; phones that it lists: {len(states)}."
    for serial, state in states.items():
        advice = STATES.get(state, (None, f"adb calls it {plain(state)}: see `adb devices`."))[1]
        if state != ONLINE and advice is not None:
            yield "missing", f"The phone {plain(serial)} cannot be used. {advice}"


def _listens(server: AdbClient) -> bool:
    """Whether anything does; a client would start a server where nothing did."""
    try:
        socket.create_connection((server.host, server.port), TIMEOUT_S).close()
    except OSError:
        return False
    return True


def _version(server: AdbClient) -> int:
    with server.make_connection(timeout=TIMEOUT_S) as connection:
        connection.send_command("host:version")
        connection.check_okay()
        return int(connection.read_string_block(), 16)


def _log_file() -> Iterator[Said]:
    """adb's server does not start where it cannot open its log."""
    log = Path(os.environ.get("TMPDIR") or tempfile.gettempdir()) / f"adb.{os.getuid()}.log"
    if log.exists() and (not log.is_file() or log.stat().st_uid != os.getuid()):
        yield "missing", f"{log} is not this user's, so that no adb server starts: remove it."


def usb(root: Path = Path("/")) -> Iterator[Said]:
    """Whether this user may open the phones on USB, as `/sys` and `/dev` below `root` show them."""
    ruled = any(list((root / folder).glob(pattern)) for folder in RULE_FOLDERS for pattern in ("*android*", RULES))
    found = list(_phones(root))
    for name, node in found:
        if os.access(node, os.R_OK | os.W_OK, effective_ids=True):
            yield "good", f"The phone {name} on USB may be opened."
        else:
            yield "missing", f"This user may not open the phone {name} on USB ({node}): {MEND_RULES}."
    if not found and not ruled and settings().phones:
        yield "note", f"No phone is on USB, and no udev rule lets this user open one: {MEND_RULES}."
    elif not found:
        yield "good", "No phone is on USB; udev has a rule for phones." if ruled else "No phone is on USB."


def _phones(root: Path) -> Iterator[tuple[str, Path]]:
    """Each phone on USB that offers adb: a name, and its device node."""
    for interface in sorted((root / "sys/bus/usb/devices").glob("*:*")):
        kind = tuple(_line(interface / f"bInterface{part}") for part in ("Class", "SubClass", "Protocol"))
        device = interface.parent / interface.name.partition(":")[0]
        bus, number = _line(device / "busnum"), _line(device / "devnum")
        if kind == ADB_INTERFACE and bus.isdecimal() and number.isdecimal():
            name = plain(" ".join(filter(None, (_line(device / "product"), _line(device / "serial")))))
            yield name or device.name, root / f"dev/bus/usb/{int(bus):03}/{int(number):03}"


def agent() -> Iterator[Said]:
    """Whether the agent that runs on phones is built, of these sources."""
    needed = settings().phones and (any(True for _ in _phones(Path("/"))) or _lists_phones())
    try:
        package = find_agent()
    except PhoneError as error:
        yield ("missing" if needed else "note"), str(error)
        return
    sources = _version_of_sources()
    if package.version != sources:
        yield "missing", f"The agent is {package.version}, its sources {sources}: run `make agent`."
    elif settings().via == "apk" and not package.apk.exists():
        yield "missing", "The agent's APK is not built: apt-get install aapt zipalign apksigner, then run `make agent`."
    else:
        yield "good", f"The agent {package.version} is built."


def _version_of_sources() -> str:
    """As the agent's build tells it, which the server calls and does not load."""
    words = [sys.executable, "-c", "from agent_android.build import version; print(version())"]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=TIMEOUT_S).stdout.strip()


def _lists_phones() -> bool:
    try:
        server = client()
        return _listens(server) and _version(server) > 0 and bool(server.list())
    except ADB_ERRORS:
        return False


def phone_compilers() -> Iterator[Said]:
    """Whether Mesa's compilers for phone GPUs are here; only `rayfarm compile` needs them."""
    try:
        found = tool_chain()
    except MissingError as error:
        yield ("missing" if os.environ.get(FOLDER_VARIABLE) else "note"), str(error)
    else:
        yield "good", f"Mesa {found.version}'s compilers for phone GPUs are in {found.folder}."


def _line(file: Path) -> str:
    try:
        return file.read_text(errors="replace").strip()
    except OSError:
        return ""
