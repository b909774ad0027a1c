"""Addresses of network phones and pairing codes, as people type them."""

from __future__ import annotations

import re
from ipaddress import AddressValueError, IPv4Address, IPv6Address

from server.devices.registry import DeviceError
from server.devices.words import plain

MAX_HOST = 100
_NAME = re.compile(r"(?!-)[a-z0-9-]{1,63}(?<!-)(\.(?!-)[a-z0-9-]{1,63}(?<!-))*")
_SHAPE = re.compile(r"(?P<host>\[[^\[\]]+\]|[^:\[\]]+):(?P<port>[0-9]{1,5})")
_CODE = re.compile(r"[0-9]{6}")


def read_address(text: str) -> str:
    """HOST:PORT in one form, which is also the phone's serial; raise DeviceError unless it is one."""
    shape = _SHAPE.fullmatch(text.strip().lower())
    host = _host(shape["host"]) if shape and len(shape["host"]) <= MAX_HOST else None
    if shape is None or host is None or not 1 <= int(shape["port"]) <= 65535:
        raise DeviceError(f"{plain(text, 80)!r} is no phone's address: write HOST:PORT, as 192.168.1.20:5555.")
    return f"{host}:{int(shape['port'])}"


def read_code(text: str) -> str:
    """A pairing code; raise DeviceError, without repeating it, unless it is one."""
    if not _CODE.fullmatch(text):
        raise DeviceError("The pairing code has six digits: the phone shows it under Pair device with pairing code.")
    return text


def _host(text: str) -> str | None:
    """A host's name or address in one form; None when it is neither."""
    try:
        if text.startswith("["):
            return None if "%" in text else f"[{IPv6Address(text[1:-1]).compressed}]"
        if re.fullmatch(r"[0-9.]+", text):
            return str(IPv4Address(text))
    except AddressValueError:
        return None
    return text if _NAME.fullmatch(text) else None
