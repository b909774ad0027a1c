"""Results with pictures for tests, stored as a worker stores them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.pictures.counts import METRICS
from renderer.pictures.files import write_pictures
from renderer.request import Request
from renderer.variant import Variant
from server.pictures.taken import take_up
from server.store.blobs import Blobs
from server.store.database import Database
from server.store.models import Job
from server.store.records import Order, add_jobs, add_result

Image = npt.NDArray[np.uint8]


def image(seed: int, size: tuple[int, int] = (64, 48)) -> Image:
    """A random image (h, w, 3), row 0 at the bottom."""
    return np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), np.uint8)


def counts(seed: int, size: tuple[int, int] = (64, 48), most: int = 200) -> dict[str, npt.NDArray[np.int64]]:
    """Random counts (h, w) of every metric, row 0 at the bottom."""
    rng = np.random.default_rng(seed)
    return {name: rng.integers(0, most, (size[1], size[0])) for name in METRICS}


def keep(folder: Path, blobs: Blobs, pixels: Image, counted: dict[str, npt.NDArray[np.int64]] | None) -> dict[str, Any]:
    """Write pictures as a round does, take them up as a worker does; what the measurement then names."""
    folder.mkdir(parents=True, exist_ok=True)
    named = dict(write_pictures(folder, pixels, counted))
    taken = take_up({"pictures": named}, folder, blobs)["pictures"]
    assert taken == named
    return named


def add_job(
    database: Database,
    document: dict[str, Any],
    pictures: Any,
    *,
    scene: str = "forest",
    traversal: str = "bvh-stack",
    size: tuple[int, int] = (64, 48),
    study: int | None = None,
) -> int:
    """A job that is done, with its result; its id."""
    request = Request("forest", Variant(traversal), frames=1, rounds=1, size=size)
    with database.writing() as session:
        [part] = add_jobs(session, [Order(request)], study_id=study)
        job: Job = part.job
        part.state = job.state = "done"
        job.scene = scene
        whole = document | {"scene": scene, "size": list(size), **request.variant.as_dict(), "pictures": pictures}
        add_result(session, job, whole)
        session.flush()
        return job.id
