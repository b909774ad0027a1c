"""Holds adbd to loopback: it asks nobody who they are, so no other machine may reach it."""

from __future__ import annotations

import ctypes
import hashlib
import ipaddress
import os
import socket
import subprocess
import tempfile
from pathlib import Path

from agent_android.standin.errors import StandInError, StandInUnavailableError

SOURCE = Path(__file__).with_name("loopback.c")
TABLES = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
LISTEN = "0A"

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


def library(folder: Path) -> Path:
    """The preloaded `bind`, compiled into `folder` once for its source, and proven to give loopback."""
    built = folder / f"loopback-{hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]}.so"
    if not built.exists():
        _compile(built)
    _prove(built)
    return built


def listeners(port: int, tables: tuple[Path, ...] = TABLES) -> list[Address]:
    """The addresses on which this machine listens at a TCP port."""
    found: list[Address] = []
    for table in tables:
        rows = table.read_text().splitlines()[1:] if table.exists() else []
        for row in rows:
            _, local, _, state = row.split()[:4]
            address, _, number = local.partition(":")
            if state == LISTEN and int(number, 16) == port:
                found.append(_address(address))
    return found


def check(port: int, tables: tuple[Path, ...] = TABLES) -> bool:
    """Whether the port is listened on; raises StandInError where that is on more than loopback."""
    found = listeners(port, tables)
    beyond = [address for address in found if not address.is_loopback]
    if beyond:
        raise StandInError(f"adbd listens on {', '.join(map(str, beyond))}, beyond loopback, so it was ended.")
    return bool(found)


def _compile(built: Path) -> None:
    built.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=built.parent) as folder:
        fresh = Path(folder) / built.name
        command = ["cc", "-shared", "-fPIC", "-O2", "-Wall", "-Werror", "-o", str(fresh), str(SOURCE), "-ldl"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise StandInUnavailableError(f"A stand-in phone needs a C compiler that builds loopback.c: {done.stderr}")
        os.replace(fresh, built)


def _prove(built: Path) -> None:
    """The loader starts a program even when it could not preload, so the library is tried before adbd is."""
    bind = ctypes.CDLL(str(built), use_errno=True).bind
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        any_address = socket.AF_INET.to_bytes(2, "little") + bytes(14)
        bound = bind(probe.fileno(), any_address, len(any_address)) == 0
        if not bound or probe.getsockname()[0] != "127.0.0.1":
            raise StandInError(f"{built} does not hold a socket to loopback; remove it and try again.")


def _address(text: str) -> Address:
    """From the kernel's table: 32-bit words in the machine's byte order. A mapped address is its IPv4 one."""
    words = bytes.fromhex(text)
    address = ipaddress.ip_address(b"".join(words[at : at + 4][::-1] for at in range(0, len(words), 4)))
    return (address.ipv4_mapped or address) if isinstance(address, ipaddress.IPv6Address) else address
