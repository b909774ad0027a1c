"""adbd asks nobody who they are, so it must be out of every other machine's reach."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agent_android.standin import loopback
from agent_android.standin.errors import StandInError
from agent_android.standin.phone import StandInPhone

HEAD = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"


def test_adbd_listens_on_loopback_only(phone: StandInPhone, other_phone: StandInPhone) -> None:
    for one in (phone, other_phone):
        assert [str(address) for address in loopback.listeners(one.port)] == ["127.0.0.1"]


def test_it_still_does_when_plugged_in_again(phone: StandInPhone) -> None:
    phone.kill()
    assert loopback.listeners(phone.port) == []
    phone.restart()
    assert [str(address) for address in loopback.listeners(phone.port)] == ["127.0.0.1"]


def test_adbd_has_no_other_socket_that_listens(phone: StandInPhone) -> None:
    """Neither vsock nor a named socket that two phones would fight over."""
    names = [row.split()[-1] for row in Path("/proc/net/unix").read_text().splitlines()]
    assert not [name for name in names if re.fullmatch(r"@jdwp-control", name)]
    vsock = Path("/proc/net/vsock")
    assert not vsock.exists() or str(phone.port) not in vsock.read_text()


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("00000000", "0.0.0.0"),
        ("0100000A", "10.0.0.1"),
        ("00000000000000000000000000000000", "::"),
        ("0000000000000000FFFF00000100000A", "10.0.0.1"),
    ],
)
def test_listening_beyond_loopback_is_refused(tmp_path: Path, address: str, said: str) -> None:
    table = tmp_path / "tcp"
    table.write_text(HEAD + f"   0: {address}:3CC3 00000000:0000 0A 00000000:00000000 00:00000000 00000000\n")
    with pytest.raises(StandInError, match=f"listens on {said}.*beyond loopback"):
        loopback.check(0x3CC3, (table,))
    assert not loopback.check(0x3CC4, (table,))


@pytest.mark.parametrize(
    "address", ["0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000"]
)
def test_listening_on_loopback_is_allowed(tmp_path: Path, address: str) -> None:
    table = tmp_path / "tcp"
    table.write_text(HEAD + f"   0: {address}:3CC3 00000000:0000 0A 00000000:00000000 00:00000000 00000000\n")
    assert loopback.check(0x3CC3, (table,))


def test_a_taken_port_is_refused(phone: StandInPhone, tmp_path: Path) -> None:
    with pytest.raises(StandInError, match=f"Port {phone.port} is taken"):
        StandInPhone(tmp_path / "third", port=phone.port).start()
