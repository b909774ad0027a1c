"""The services of docker-compose.yml without an engine: each service's own command, user and environment, one by one.

What an engine would give stands in as: a private host for its network and names, a folder for the volume `data`, this
checkout for the image's, and PostgreSQL's own programs for the database's image.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from compose_file import ROOT, image_environment, read_compose
from postgres_keeper import __file__ as keeper_file
from private_host import PrivateHost, first_child, running_host

VARIABLES = {"RAYFARM_DATABASE_PASSWORD": 'it\'s 100 % "secret"@/:'}
HOME, PROGRAM = "/var/lib/rayfarm", "/rayfarm"
PATIENCE_S = 120.0


@dataclass
class Composed:
    """The services that were started, and what they keep."""

    host: PrivateHost
    folder: Path
    binaries: Path
    file: dict[str, Any] = field(default_factory=lambda: read_compose(VARIABLES))
    running: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    def environment(self, service: str) -> dict[str, str]:
        """The image's and the file's, with the image's folders where they are here."""
        given = image_environment() | self.file["services"][service]["environment"]
        return {name: self._here(str(value)) for name, value in given.items()}

    def user(self, service: str) -> int:
        """The number of the user that the file names."""
        return int(self.file["services"][service]["user"].partition(":")[0])

    def start(self, service: str) -> None:
        """Start its command."""
        words = self.host.command(self.file["services"][service]["command"], self.user(service))
        with (self.folder / f"{service}.log").open("a") as log:
            options: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": log, "text": True}
            self.running[service] = subprocess.Popen(words, env=self.environment(service), **options)

    def stop(self, service: str) -> int:
        """End it as an engine does, and return its exit code."""
        process = self.running.pop(service)
        os.kill(first_child(process.pid), signal.SIGTERM)
        code = process.wait(40)
        assert isinstance(code, int)
        return code

    def run(self, service: str, words: Sequence[str], **more: str) -> subprocess.CompletedProcess[str]:
        """Run another command in a service's place, as `docker compose run` does."""
        return self.host.run(words, self.environment(service) | more, self.user(service))

    def health(self, service: str) -> subprocess.CompletedProcess[str]:
        """Run its health check once."""
        kind, *words = self.file["services"][service]["healthcheck"]["test"]
        assert kind == "CMD"
        if service == "database":
            return self.host.run(words, {"PATH": f"{self.binaries}:{os.environ['PATH']}"}, 65534)
        return self.run(service, words)

    def wait_until_healthy(self, service: str) -> None:
        """Wait; AssertionError with its log if it ends, or does not come."""
        deadline = time.monotonic() + PATIENCE_S
        while (said := self.health(service)).returncode != 0:
            process = self.running.get(service)
            ended = process is not None and process.poll() is not None
            assert not ended, self.log(service)
            assert time.monotonic() < deadline, said.stdout + said.stderr + self.log(service)
            time.sleep(0.5)

    def log(self, service: str) -> str:
        """What it said so far."""
        file = self.folder / f"{service}.log"
        return file.read_text() if file.exists() else ""

    @contextmanager
    def database(self) -> Iterator[None]:
        """PostgreSQL with the user, the password, the database and the port of the file."""
        given = self.file["services"]["database"]["environment"]
        command = self.host.command([sys.executable, str(keeper_file), str(self.binaries), "5432"])
        with (
            (self.folder / "database.log").open("w") as log,
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log, text=True) as keeper,
        ):
            assert keeper.stdin is not None
            keeper.stdin.write(f"{given['POSTGRES_PASSWORD']}\n")
            keeper.stdin.flush()
            self.wait_until_healthy("database")
            login = {"PGPASSWORD": given["POSTGRES_PASSWORD"], "PATH": os.environ["PATH"]}
            words = ["psql", "-h", "database", "-U", given["POSTGRES_USER"], "-d", "postgres"]
            made = self.host.run([*words, "-c", f'CREATE DATABASE "{given["POSTGRES_DB"]}"'], login)
            assert made.returncode == 0, made.stderr
            try:
                yield
            finally:
                keeper.stdin.close()

    def _here(self, value: str) -> str:
        """A value of the file with the image's paths as this machine has them; each is replaced once."""
        paths = {HOME: str(self.folder / "data"), f"{PROGRAM}/.venv/bin": str(Path(sys.executable).parent)}
        paths[PROGRAM] = str(ROOT)
        there = "|".join(map(re.escape, paths))
        return re.sub(rf"(?<![\w/])(?:{there})(?=[/:]|$)", lambda found: paths[found[0]], value)


@contextmanager
def composed(folder: Path, binaries: Path) -> Iterator[Composed]:
    """No service yet but the database; all that runs ends with the block."""
    with running_host(folder, ["database", "server"]) as host:
        farm = Composed(host, folder, binaries)
        (folder / "data").mkdir()
        os.chown(folder / "data", farm.user("server"), farm.user("server"))
        with farm.database():
            try:
                yield farm
            finally:
                for service in list(farm.running):
                    farm.stop(service)
