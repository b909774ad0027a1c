"""Smooth vertex normals."""

from __future__ import annotations

import numpy as np

from scenes.scene import Floats, Ints


def smooth_normals(vertices: Floats, faces: Ints) -> Floats:
    """Area-weighted unit normals, (n, 3) float32; +y where no triangle with an area uses the vertex."""
    corners = vertices.astype(np.float64)[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    index = faces.ravel()
    spread = np.repeat(weighted, 3, axis=0)
    summed = np.stack([np.bincount(index, spread[:, k], len(vertices)) for k in range(3)], axis=1)
    length = np.linalg.norm(summed, axis=1)
    usable = length > np.finfo(np.float64).tiny
    normals = np.tile(np.array([0.0, 1.0, 0.0]), (len(vertices), 1))
    normals[usable] = summed[usable] / length[usable, None]
    return normals.astype(np.float32)
