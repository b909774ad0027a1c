"""Runs a throw-away PostgreSQL server for as long as its own standard input is open; a program of its own.

`postgres_keeper.py BIN PORT [NAME=VALUE...]`, settings beside the usual; the superuser's password as the first line of
standard input. However the process that holds the other end of that pipe ends, by SIGKILL too, the kernel closes it:
then the server ends and its folder goes. The lines `stop` and `start` stop the server and start it again.
"""

from __future__ import annotations

import os
import pwd
import select
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

USER = "rayfarm"
STOP, START = b"stop\n", b"start\n"
SETTINGS = {
    "listen_addresses": "127.0.0.1",
    "unix_socket_directories": "",
    "max_connections": "300",
    "shared_buffers": "32MB",
    "fsync": "off",
    "full_page_writes": "off",
    "synchronous_commit": "off",
    # A zone that is not UTC and not a whole number of hours away: times must survive the server's taste.
    "timezone": "Asia/Kolkata",
}


def main(binaries: Path, port: str, settings: list[str]) -> None:
    """Make a cluster, serve it at 127.0.0.1:`port` until standard input ends, remove it."""
    folder = Path(tempfile.mkdtemp(prefix="rayfarm-postgres-"))
    try:
        (folder / "password").write_bytes(os.read(sys.stdin.fileno(), 4096))
        user = _unprivileged()
        if user is not None:
            for path in (folder, folder / "password"):
                os.chown(path, user.pw_uid, user.pw_gid)
        _serve(_prefix(user), binaries, port, folder, settings)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _serve(prefix: list[str], binaries: Path, port: str, folder: Path, others: list[str]) -> None:
    data = str(folder / "data")
    initdb = [str(binaries / "initdb"), "-D", data, "-U", USER, "--auth=scram-sha-256", "--no-sync"]
    initdb += [f"--pwfile={folder / 'password'}", "--encoding=UTF8", "--locale=C"]
    subprocess.run([*prefix, *initdb], cwd=folder, stdin=subprocess.DEVNULL, check=True)
    settings = [f"-c{name}={value}" for name, value in SETTINGS.items()] + [f"-c{other}" for other in others]
    command = [*prefix, str(binaries / "postgres"), "-D", data, "-p", port, *settings]
    told = START
    while told == START:
        with subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL) as server:
            select.select([sys.stdin, os.pidfd_open(server.pid)], [], [])
            server.send_signal(signal.SIGQUIT)  # PostgreSQL's immediate shutdown: its next start recovers from it.
        told = os.read(sys.stdin.fileno(), 4096)
        if told == STOP:
            told = os.read(sys.stdin.fileno(), 4096)


def _unprivileged() -> pwd.struct_passwd | None:
    """Whom to run as, since PostgreSQL refuses root; None where this process is not root."""
    if os.geteuid() != 0:
        return None
    names = {user.pw_name: user for user in pwd.getpwall()}
    return names.get("postgres") or names["nobody"]


def _prefix(user: pwd.struct_passwd | None) -> list[str]:
    """`setpriv`, which also ends the server when this keeper is killed."""
    change = [] if user is None else [f"--reuid={user.pw_uid}", f"--regid={user.pw_gid}", "--clear-groups"]
    return ["setpriv", *change, "--pdeathsig=QUIT", "--"]


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
