"""Built trees on disk, found again by what they were built from."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from platformdirs import user_cache_dir

from renderer.build.tree import Bvh, Kd, SahCosts, Tree

Kind = Literal["bvh", "kd"]

BUILDER_VERSION = 1
"""Part of every key: raise it with any change to what a builder returns."""


def cache_folder() -> Path:
    """Where trees are kept: $RAYFARM_CACHE/trees, else the user's cache folder for rayfarm."""
    return Path(os.environ.get("RAYFARM_CACHE") or user_cache_dir("rayfarm")) / "trees"


def cached(
    kind: Kind, scene_key: str, costs: SahCosts, method: str, build: Callable[[], tuple[Tree, float]]
) -> tuple[Tree, float]:
    """The tree and the CPU milliseconds of its build, from disk or from `build`, which returns both.

    `scene_key` names the geometry by content. An entry that cannot be read is built again and replaced. Several
    processes may ask at once: each writes a file of its own and renames it into place.
    """
    path = cache_folder() / f"{_key(kind, scene_key, costs, method)}.npz"
    # Damaged bytes make zipfile and numpy raise nearly anything; a flipped bit fails the archive's CRC.
    with contextlib.suppress(Exception):
        return _read(kind, path)
    tree, build_ms = build()
    # A cache that is full or read-only costs the next run a build, not this one its result.
    with contextlib.suppress(OSError):
        _write(path, tree, build_ms)
    return tree, build_ms


def _key(kind: Kind, scene_key: str, costs: SahCosts, method: str) -> str:
    parts = (kind, method, costs.traversal, costs.intersection, scene_key, BUILDER_VERSION)
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _read(kind: Kind, path: Path) -> tuple[Tree, float]:
    tree_type: type[Bvh] | type[Kd] = Bvh if kind == "bvh" else Kd
    with path.open("rb") as file, np.load(file, allow_pickle=False) as entry:
        fields: dict[str, Any] = {field.name: entry[field.name] for field in dataclasses.fields(tree_type)}
        build_ms = float(entry["build_ms"])
    fields["depth"], fields["cost"] = int(fields["depth"]), float(fields["cost"])
    return tree_type(**fields), build_ms


def _write(path: Path, tree: Tree, build_ms: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, build_ms=build_ms, **vars(tree))
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
