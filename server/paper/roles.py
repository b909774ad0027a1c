"""Which scene stands for which of the paper's, and what the catalogue knows of it."""

from __future__ import annotations

from collections.abc import Iterable

from scenes.catalogue import find
from scenes.entry import Entry
from scenes.scene import SceneError

CORNELL = ("cornell-box",)
BUDDHA = ("cornell-buddha", "cornell-buddha-67k", "cornell-statue", "happy-buddha", "happy-buddha-67k")
FAIRY = ("fairy-forest", "forest")
SPONZA = ("crytek-sponza", "dabrovic-sponza")

_ROLES = {
    "Cornell Box": CORNELL,
    "Cornell Buddha": BUDDHA,
    "Fairy Forest": FAIRY,
    "Crytek Sponza": SPONZA,
}
_SAME = {"cornell-box", "fairy-forest", "crytek-sponza"}


def scene_for(names: Iterable[str], wanted: tuple[str, ...]) -> str | None:
    """The scene that stands for one of the paper's, the nearest first; `forest:2000` counts as `forest`."""
    found = {name.partition(":")[0]: name for name in names}
    return next((found[base] for base in wanted if base in found), None)


def role_of(name: str) -> str:
    """Which of the paper's scenes it is or stands for."""
    base = name.partition(":")[0]
    for role, names in _ROLES.items():
        if base in names:
            return f"the paper's {role}" if base in _SAME else f"stands in for the paper's {role}"
    return "not among the paper's scenes"


def entry_of(name: str) -> Entry | None:
    """The catalogue's entry; None for a mesh file or a foreign name."""
    try:
        return find(name)
    except SceneError:
        return None
