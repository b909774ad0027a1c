"""Addresses and pairing codes: one form of each good one, one sentence for each bad one."""

from __future__ import annotations

import pytest

from server.devices.address import read_address, read_code
from server.devices.registry import DeviceError
from server.devices.words import require_serial

GOOD = {
    "192.168.1.20:5555": "192.168.1.20:5555",
    " 10.0.0.7:37123 ": "10.0.0.7:37123",
    "Phone-3.Lab.example:05555": "phone-3.lab.example:5555",
    "localhost:65535": "localhost:65535",
    "[FE80:0::1]:5555": "[fe80::1]:5555",
}
BAD = (
    "", "phone", ":5555", "phone:", "phone:0", "phone:65536", "phone:-1", "phone:5555:1", "phone:５５５５",
    "1.2.3:5555", "1.2.3.256:5555", "-phone:5555", "phone-:5555", "a..b:5555", "fe80::1:5555", "[fe80::1%eth0]:5555",
    "[phone]:5555", "phone;reboot:5555", "$(reboot):5555", "phone\n:5555", "a" * 120 + ":5555", "http://phone:5555",
    "user@phone:5555",
)  # fmt: skip


@pytest.mark.parametrize("text", GOOD)
def test_an_address_has_one_form_which_is_a_serial(text: str) -> None:
    assert read_address(text) == GOOD[text]
    assert require_serial(read_address(text)) == read_address(read_address(text))


@pytest.mark.parametrize("text", BAD)
def test_anything_else_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(DeviceError, match="write HOST:PORT") as error:
        read_address(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("code", ["", "12345", "1234567", "12345a", "１２３４５６", "123456\n", "12 456"])
def test_a_code_has_six_digits_and_is_not_repeated(code: str) -> None:
    with pytest.raises(DeviceError, match="six digits") as error:
        read_code(code)
    assert not code or code not in str(error.value)
    assert read_code("012345") == "012345"
