"""A machine of a test's own: a network with loopback alone, names, and processes that end with it. For root only.

As a program (`private_host.py HOSTS`, in namespaces of its own) it is that machine's first process, which lays the file
HOSTS over /etc/hosts and lives until its standard input ends.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import socket
import stat
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SPACES = ("unshare", "--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc")
NEEDED = ("unshare", "nsenter", "setpriv", "mount")
SIOCSIFFLAGS, IFF_UP, IFF_RUNNING = 0x8914, 0x1, 0x40
# A test's user may read what root can, since an interpreter may lie in root's home; it writes only what is its own.
READING = "-all,+dac_read_search"


@dataclass(frozen=True)
class PrivateHost:
    """A running one; `pid` is its first process."""

    pid: int

    def command(self, words: Sequence[str], user: int | None = None) -> list[str]:
        """`words` as a command in it, as root or as a user without any right of root's but to read."""
        entered = ["nsenter", f"--target={self.pid}", "--net", "--mount", "--pid", "--wdns=/", "--"]
        if user is None:
            return [*entered, *words]
        rights = [f"--inh-caps={READING}", f"--ambient-caps={READING}", f"--bounding-set={READING}", "--no-new-privs"]
        return [*entered, "setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups", *rights, "--", *words]

    def run(
        self, words: Sequence[str], environment: Mapping[str, str], user: int | None = None, **options: Any
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        command = self.command(words, user)
        options = {"capture_output": True, "text": True, "check": False, "timeout": 300, **options}
        ran: subprocess.CompletedProcess[str] = subprocess.run(command, env=dict(environment), **options)
        return ran


def first_child(pid: int) -> int:
    """The first child of a process: what `unshare` and `nsenter` started, which must enter new process ids."""
    return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])


def refusal() -> str | None:
    """Why there can be none here."""
    if os.geteuid() != 0:
        return "a network of its own needs root"
    absent = [name for name in NEEDED if shutil.which(name) is None]
    if absent:
        return f"{', '.join(absent)} missing: apt install util-linux"
    tried = subprocess.run([*SPACES, "true"], capture_output=True, text=True, check=False)
    if tried.returncode:
        return f"this machine gives no namespaces ({tried.stderr.strip()})"
    closed = next((folder for folder in ROOT.parents if not folder.stat().st_mode & stat.S_IXOTH), None)
    return f"the image's user could not read what lies below {closed}" if closed else None


@contextmanager
def running_host(folder: Path, names: Sequence[str]) -> Iterator[PrivateHost]:
    """A machine with names of its own; what runs on it ends with the block. Raise RuntimeError if it does not start."""
    hosts = folder / "hosts"
    hosts.write_text(f"127.0.0.1 localhost {' '.join(names)}\n")
    command = [*SPACES, sys.executable, __file__, str(hosts)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True) as holder:
        assert holder.stdin is not None
        assert holder.stdout is not None
        try:
            if holder.stdout.readline() != b"ready\n":
                raise RuntimeError("the machine of its own does not start")
            yield PrivateHost(first_child(holder.pid))
        finally:
            holder.stdin.close()


def _main(hosts: str) -> None:
    subprocess.run(["mount", "--bind", hosts, "/etc/hosts"], check=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        fcntl.ioctl(sock, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", IFF_UP | IFF_RUNNING))
    print("ready", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    _main(sys.argv[1])
