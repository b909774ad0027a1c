"""The GPUs that plans are compiled for, and what Mesa's driver of each must be told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from renderer.phone_compile.errors import CompileError

Family = Literal["ir3", "bifrost", "valhall"]
"""Which instruction set a listing is in: Adreno's, or one of Mali's two."""


@dataclass(frozen=True)
class Gpu:
    """One GPU: its family, the number under which Mesa's no-op device is made, and limits that the vendor's driver
    states and Mesa's does not share, by GL name without `GL_MAX_`."""

    name: str
    family: Family
    number: str
    vendor_limits: Mapping[str, int] = field(default_factory=dict)

    @property
    def model(self) -> str:
        """The model, as it stands in the name that Mesa's driver gives itself (`FD540`, `Mali-G72 (Panfrost)`)."""
        return self.name.split("-")[1]

    @property
    def compiler(self) -> str:
        """Mesa's name of the compiler."""
        return "ir3" if self.family == "ir3" else "panfrost"

    @property
    def label(self) -> str:
        """What stands beside every figure."""
        return f"Mesa {self.compiler} estimate"


# A comment in Mesa's freedreno_screen.c says what Qualcomm's driver advertises on Adreno 5xx.
_QUALCOMM_5XX = {
    "VERTEX_SHADER_STORAGE_BLOCKS": 4,
    "FRAGMENT_SHADER_STORAGE_BLOCKS": 4,
    "COMPUTE_SHADER_STORAGE_BLOCKS": 24,
    "COMBINED_SHADER_STORAGE_BLOCKS": 24,
}

GPUS: dict[str, Gpu] = {
    gpu.name: gpu
    for gpu in (
        *(Gpu(f"adreno-{number}", "ir3", number, _QUALCOMM_5XX) for number in ("510", "530", "540")),
        *(Gpu(f"adreno-{number}", "ir3", number) for number in ("618", "630", "660", "730", "740", "750")),
        Gpu("mali-g71", "bifrost", "6000"),
        Gpu("mali-g72", "bifrost", "6221"),
        Gpu("mali-g31", "bifrost", "7093"),
        Gpu("mali-g51", "bifrost", "7090"),
        Gpu("mali-g52", "bifrost", "7402"),
        Gpu("mali-g76", "bifrost", "7211"),
        Gpu("mali-g57", "valhall", "9093"),
        Gpu("mali-g610", "valhall", "a867"),
    )
}

USUAL = ("adreno-540", "adreno-630", "adreno-740", "mali-g72", "mali-g57")
"""The GPUs that are meant where none is named: the paper's own, and one of each later kind."""


def require_gpus(words: str) -> tuple[Gpu, ...]:
    """The GPUs of a comma list, or `all`; raise CompileError naming those that exist."""
    names = dict.fromkeys(word.strip().lower() for word in words.split(",") if word.strip())
    if "all" in names:
        return tuple(GPUS.values())
    for name in names:
        if name not in GPUS:
            raise CompileError(f"Unknown GPU {name!r}: choose of {', '.join(GPUS)}, or all.")
    if not names:
        raise CompileError(f"No GPU is named: choose of {', '.join(GPUS)}, or all.")
    return tuple(GPUS[name] for name in names)
