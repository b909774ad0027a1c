"""Built trees on disk, found again by what they were built from."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, BinaryIO, Literal

import numpy as np

from renderer.build.tree import Bvh, Kd, SahCosts, Tree
from scenes.kept import cache_folder, kept, key_of
from scenes.kept_arrays import map_arrays, write_arrays

Kind = Literal["bvh", "kd"]

BUILDER_VERSIONS: dict[Kind, int] = {"bvh": 6, "kd": 5}
"""Part of every key: raise one with any change to what its builder returns."""


def cached(
    kind: Kind, scene_key: str, costs: SahCosts, method: str, build: Callable[[], tuple[Tree, float]]
) -> tuple[Tree, float]:
    """The tree and the CPU milliseconds of its build, from disk or from `build`, which returns both.

    `scene_key` names the geometry by content.
    """

    def read(file: BinaryIO) -> tuple[Tree, float]:
        return _read(kind, file)

    key = key_of(kind, method, costs.traversal, costs.intersection, scene_key, BUILDER_VERSIONS[kind])
    return kept(cache_folder("trees") / f"{key}.npz", read, build, _write)


def _read(kind: Kind, file: BinaryIO) -> tuple[Tree, float]:
    tree_type: type[Bvh] | type[Kd] = Bvh if kind == "bvh" else Kd
    entry = map_arrays(file)
    fields: dict[str, Any] = {field.name: entry[field.name] for field in dataclasses.fields(tree_type)}
    build_ms = float(entry["build_ms"])
    fields["depth"], fields["cost"] = int(fields["depth"]), float(fields["cost"])
    fields["epo"] = float(fields["epo"])
    return tree_type(**fields), build_ms


def _write(file: BinaryIO, made: tuple[Tree, float]) -> None:
    tree, build_ms = made
    fields = {"build_ms": build_ms, **vars(tree)}
    write_arrays(file, {name: np.asarray(value) for name, value in fields.items()})
