"""A private adb server: its own port, its own keys, its own log; it sees no USB, no emulator, no mDNS."""

from __future__ import annotations

import socket
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType

import adbutils
from platformdirs import user_cache_path

from agent_android.standin.errors import StandInError

PATIENCE_S = 10.0


class AdbServer:
    """The adb server of a test, ended with it. Its user's keys, port 5037 and /tmp/adb.*.log stay untouched."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="rayfarm-adb-")
        self._server: subprocess.Popen[bytes] | None = None
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])

    @property
    def environment(self) -> dict[str, str]:
        """What an adb program or adbutils needs to use this server and no other, and to leave the user's keys be.

        The user's cache stays where it is, for what else a program started so may need.
        """
        folder = self._folder.name
        kept = {"XDG_CACHE_HOME": str(user_cache_path())}
        return {"ANDROID_ADB_SERVER_PORT": str(self.port), "HOME": folder, "TMPDIR": folder, **kept}

    @property
    def log(self) -> Path:
        """What the server wrote."""
        return Path(self._folder.name, "adb.log")

    def start(self) -> AdbServer:
        """Starts the server, or starts it again on its port; raises StandInError where it does not come up."""
        quiet = {"ADB_USB": "0", "ADB_EMU": "0", "ADB_MDNS": "0", "PATH": "/usr/bin:/bin"}
        # With its starter's thread the kernel ends it too, so no server is left behind by a killed test.
        command = ["setpriv", "--pdeathsig", "KILL", adbutils.adb_path(), "-P", str(self.port), "server", "nodaemon"]
        with self.log.open("ab") as log:
            self._server = subprocess.Popen(
                command, env={**self.environment, **quiet}, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        deadline = time.monotonic() + PATIENCE_S
        while not self._answers():
            if self._server.poll() is not None or time.monotonic() > deadline:
                self.kill()
                raise StandInError(f"The private adb server did not come up: {self.log.read_text(errors='replace')}")
            time.sleep(0.01)
        return self

    def client(self, timeout_s: float | None = None) -> adbutils.AdbClient:
        """A client of this server."""
        return adbutils.AdbClient("127.0.0.1", self.port, timeout_s)

    def kill(self) -> None:
        """Ends the server (SIGKILL), as a crash would. Twice is once."""
        if self._server is not None:
            self._server.kill()
            self._server.wait()
            self._server = None

    def __enter__(self) -> AdbServer:
        """Starts the server if it is not running."""
        return self if self._server else self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Ends the server and removes its folder."""
        self.kill()
        self._folder.cleanup()

    def _answers(self) -> bool:
        with socket.socket() as probe:
            probe.settimeout(1.0)
            return probe.connect_ex(("127.0.0.1", self.port)) == 0
