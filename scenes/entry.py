"""What the catalogue says about one scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from scenes.mesh import Mesh
from scenes.scene import Camera, Point

Normals = Literal["file", "smooth", "flat"]
Maker = Callable[[int], Mesh]
"""Makes a scene's geometry of about so many triangles; SceneError for a count that it cannot make."""


@dataclass(frozen=True)
class SourceFile:
    """One form in which a scene's geometry may lie on disk.

    `name` may be a pattern where people name the file as they like; then `size` (bytes) and `sha256` tell it.
    """

    name: str
    sha256: str | None = None
    size: int | None = None


@dataclass(frozen=True)
class Download:
    """An archive at its canonical public address, and the geometry inside it.

    `sha256` covers the extracted `member`; where it is None, the triangle count is checked instead. Someone
    who downloads by hand saves the member as `saved_as`; fetching keeps it as binary PLY, which loads faster.
    """

    url: str
    member: str
    saved_as: str
    sha256: str | None = None

    @property
    def kept_as(self) -> str:
        """The name under which fetching keeps the checked geometry."""
        return f"fetched_{self.saved_as.rpartition('.')[0]}.ply"


@dataclass(frozen=True)
class Entry:
    """One named scene; `triangles` is what the loaded scene has.

    Without a `camera` or `lights` automatic ones are used. A scene that is `made` needs no file, and one that is
    `sized` may have another number of triangles: its name is then followed by `:N`. Any other scene is the first
    of `forms` that is here. One that is `boxed` stands in the empty Cornell box. `drop` names OBJ objects that
    are left out. `get` says how to come by the geometry.
    """

    name: str
    title: str
    source: str
    page: str
    licence: str
    triangles: int
    camera: Camera | None = None
    lights: tuple[Point, ...] = ()
    normals: Normals = "flat"
    note: str = ""
    get: str = "needs no download"
    files: tuple[SourceFile, ...] = ()
    download: Download | None = None
    made: Maker | None = None
    sized: bool = False
    boxed: bool = False
    drop: tuple[str, ...] = ()

    @property
    def forms(self) -> tuple[SourceFile, ...]:
        """`files`, and what fetching keeps; that one was checked when it was fetched."""
        return self.files + ((SourceFile(self.download.kept_as),) if self.download else ())
