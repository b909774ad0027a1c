"""A stand-in phone: a real adbd, on loopback only, over its own root, processes and /data/local/tmp."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from agent_android.standin import loopback, packages, sandbox
from agent_android.standin.errors import StandInError, StandInUnavailableError
from agent_android.standin.persona import Persona

DESKTOP = sandbox.AGENT / "desktop" / "run.sh"
PATIENCE_S = 10.0


@dataclass(frozen=True, slots=True)
class Process:
    """A process on the phone: its id as the phone sees it, and its command line."""

    pid: int
    command: tuple[str, ...]


class StandInPhone:
    """One phone. `persona` changes what it says of itself; `root` holds its files and outlives it if given.

    Everything on the phone ends with `stop`, and with the process that started it, however that ends.
    """

    def __init__(self, root: Path | None = None, *, port: int | None = None, desktop: Path = DESKTOP) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="rayfarm-phone-") if root is None else None
        self.root = Path(self._scratch.name) if self._scratch else (root or Path())
        self.port = port or _free_port()
        self.serial = f"127.0.0.1:{self.port}"
        self.persona = Persona(self.root / "control", self.root / "counters")
        self._desktop = desktop
        self._sandbox: subprocess.Popen[bytes] | None = None
        self._first = self._namespace = 0
        self._own: set[int] = set()
        sandbox.make_folders(self.root)
        self.persona.defaults()

    @property
    def local_tmp(self) -> Path:
        """The phone's /data/local/tmp, from outside."""
        return self.root / "data/local/tmp"

    def start(self) -> StandInPhone:
        """Switches the phone on and plugs it in; returns once adbd listens.

        Raises StandInUnavailableError where this machine cannot have one, StandInError where adbd does not come up.
        """
        if loopback.listeners(self.port):
            raise StandInError(f"Port {self.port} is taken; give the stand-in phone another one.")
        unpacked = packages.ensure()
        preloaded = loopback.library(packages.cache())
        try:
            self._boot(unpacked, preloaded)
            self._plug()
        except BaseException:
            self.stop()
            raise
        return self

    def kill(self) -> None:
        """Unplugs the phone: adbd is killed (SIGKILL), all else on the phone runs on."""
        self._order("unplug")

    def restart(self) -> None:
        """Plugs the phone in again, on the same port over the same root."""
        try:
            self._plug()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Switches the phone off: every process on it ends. Twice is once."""
        if self._sandbox is None:
            return
        # Process 1 of a namespace takes all the others with it; the sandbox, not yet waited for, keeps its id ours.
        if self._first:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._first, signal.SIGKILL)
        for pipe in (self._sandbox.stdin, self._sandbox.stdout, self._sandbox.stderr):
            if pipe is not None:
                pipe.close()
        self._sandbox.wait(PATIENCE_S)
        self._sandbox, self._first = None, 0

    def processes(self) -> list[Process]:
        """What runs on the phone, apart from adbd and what keeps the phone going."""
        found = (_process(entry) for entry in Path("/proc").glob("[0-9]*") if self._runs_here(entry))
        return sorted((one for one in found if one and one.pid not in self._own), key=lambda one: one.pid)

    def setting(self, namespace: str, key: str) -> str | None:
        """What `settings get` says on the phone; None where it is not set."""
        path = self.root / "state/settings" / namespace / key
        return path.read_text().rstrip("\n") if path.exists() else None

    def log(self) -> str:
        """What adbd wrote."""
        path = self.root / "state/adbd.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def __enter__(self) -> StandInPhone:
        """Starts the phone if it is off."""
        return self if self._sandbox else self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stops the phone and removes its files, unless their folder was given."""
        self.stop()
        if self._scratch:
            self._scratch.cleanup()

    def _boot(self, unpacked: Path, preloaded: Path) -> None:
        info, told = os.pipe()
        command = [*sandbox.arguments(self.root, unpacked, self._desktop), "--info-fd", str(told)]
        command += ["--", str(sandbox.STANDIN / "supervise.sh"), *packages.adbd(unpacked, preloaded)]
        self._sandbox = subprocess.Popen(
            command,
            env=sandbox.environment(self.port, unpacked, self._desktop),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=(told,),
            start_new_session=True,
            bufsize=0,
        )
        os.close(told)
        with open(info, "rb") as pipe:
            answer = pipe.read()
        if not answer:
            self._refused()
        facts = json.loads(answer)
        self._first, self._namespace = facts["child-pid"], facts["pid-namespace"]
        self._own = {1, int(self._answer().split()[1])}

    def _plug(self) -> None:
        self._own.add(int(self._order("plug").split()[1]))
        deadline = time.monotonic() + PATIENCE_S
        while not loopback.check(self.port):
            if time.monotonic() > deadline:
                raise StandInError(f"adbd did not listen on port {self.port}: {self.log()[-500:]}")
            time.sleep(0.01)

    def _order(self, order: str) -> str:
        if self._sandbox is None or self._sandbox.stdin is None:
            raise StandInError("The stand-in phone is off; start it first.")
        self._sandbox.stdin.write(f"{order}\n".encode())
        self._sandbox.stdin.flush()
        return self._answer()

    def _answer(self) -> str:
        assert self._sandbox is not None
        assert self._sandbox.stdout is not None
        ready, _, _ = select.select([self._sandbox.stdout], [], [], PATIENCE_S)
        line = self._sandbox.stdout.readline() if ready else b""
        if not line:
            self._refused()
        return line.decode()

    def _refused(self) -> None:
        assert self._sandbox is not None
        self._sandbox.kill()
        _, said = self._sandbox.communicate()
        self._sandbox = None
        raise StandInUnavailableError(
            f"A stand-in phone needs user, mount and process namespaces, as root or as a user who may have them:"
            f" {said.decode(errors='replace').strip()}"
        )

    def _runs_here(self, entry: Path) -> bool:
        try:
            return (entry / "ns/pid").stat().st_ino == self._namespace
        except OSError:
            return False


def _process(entry: Path) -> Process | None:
    """None for a process that is gone or only waits to be reaped."""
    try:
        command = (entry / "cmdline").read_bytes()
        status = dict(line.split(":\t", 1) for line in (entry / "status").read_text().splitlines() if ":\t" in line)
    except OSError:
        return None
    if status["State"].startswith(("Z", "X")):
        return None
    words = command.decode("utf-8", "surrogateescape").rstrip("\0").split("\0")
    return Process(int(status["NSpid"].split()[-1]), tuple(words))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
