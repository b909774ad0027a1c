"""What Android says of a phone: its model, SoC and version."""

from __future__ import annotations

from server.devices.adb import Phone
from server.devices.words import plain

PROPERTIES = {
    "model": ("ro.product.model",),
    "manufacturer": ("ro.product.manufacturer",),
    "soc": ("ro.soc.model", "ro.board.platform", "ro.hardware"),
    "soc_manufacturer": ("ro.soc.manufacturer",),
    "android": ("ro.build.version.release",),
    "sdk": ("ro.build.version.sdk",),
    "abi": ("ro.product.cpu.abi",),
}
"""Names of our own, and Android's: the first that is set is used."""


def read_properties(phone: Phone) -> dict[str, str | None]:
    """Each of PROPERTIES as one plain line; None where a phone does not say."""
    asked = [name for names in PROPERTIES.values() for name in names]
    # A value holds no NUL, so a model name with line breaks does not shift the others.
    said = phone.run('for name; do printf "%s\\0" "$(getprop "$name")"; done', *asked, doing="asking what it is")
    values = dict(zip(asked, (plain(value) for value in said.stdout.split(b"\0")), strict=False))
    return {name: next((values[one] for one in names if values.get(one)), None) for name, names in PROPERTIES.items()}
