"""What is timed shows what the instrumented run found, and a frame that does not is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from running import PACKETS, catalogue_scene, picture, prepared, run

from renderer.host import Timed
from renderer.judge.timed_image import MOST, ApartError, pixels_apart
from renderer.plan import Plan
from renderer.request import Request
from renderer.slice import measure
from renderer.twin_host import TwinHost
from renderer.variant import TRAVERSALS, Variant

SIZE = (64, 48)
PIXELS = SIZE[0] * SIZE[1]
WAYS = [(one, method) for one in TRAVERSALS for method in (("compute",) if one in PACKETS else ("fragment", "compute"))]


@pytest.mark.parametrize("rays", ["primary", "shadow"])
@pytest.mark.parametrize(("traversal", "method"), WAYS)
def test_timed_frames_show_what_was_found(traversal: str, method: str, rays: str) -> None:
    """On a scene with vertex normals; brute force on one that it can afford."""
    scene = catalogue_scene("cornell-box" if traversal == "brute-force" else "crytek-sponza")
    variant = Variant(traversal, method)
    records = run(scene, variant, SIZE).records
    shown = picture(prepared(scene, variant, SIZE, rays=rays).plan(instrument=False))
    assert pixels_apart(scene, records, rays, shown) == 0


@pytest.mark.parametrize("nodes", ["grid16", "half", "quant8"])
@pytest.mark.parametrize("traversal", ["bvh-stack", "bvh-skip-octants", "bvh4-stack", "bvh-packet-4x2"])
def test_so_they_do_in_other_boxes_read_from_images(traversal: str, nodes: str) -> None:
    if (nodes == "quant8") != (traversal == "bvh4-stack"):
        pytest.skip("quant8 is of nodes of four children, whose test this is")
    scene = catalogue_scene("crytek-sponza")
    variant = Variant(traversal, "compute", nodes=nodes, fetch="image")
    records = run(scene, variant, SIZE).records
    shown = picture(prepared(scene, variant, SIZE, rays="both").plan(instrument=False))
    assert pixels_apart(scene, records, "both", shown) == 0


@pytest.mark.parametrize("rays", ["shadow", "both"])
def test_where_a_rasteriser_saw_the_hits_darkness_is_compared(rays: str) -> None:
    scene = catalogue_scene("crytek-sponza")
    variant = Variant("bvh-stack", "hybrid")
    records = run(scene, variant, SIZE).records
    shown = picture(prepared(scene, variant, SIZE, rays=rays).plan(instrument=False))
    assert pixels_apart(scene, records, rays, shown) == 0
    assert pixels_apart(scene, records, rays, np.full_like(shown, 255)) > PIXELS / 10


class Spoiled(TwinHost):
    """Its timed frames are changed by a function."""

    def __init__(self, change: Callable[[np.ndarray], np.ndarray]) -> None:
        """Only the change is kept beside what every twin has."""
        super().__init__(1)
        self._change = change

    def measure(self, plan: Plan, frames: int, between: Callable[[], None]) -> Timed:
        """As the twin does, with the change."""
        timed = super().measure(plan, frames, between)
        return Timed(timed.frames, timed.compile_s, self._change(timed.image.copy()))


def dimmed(pixels: int) -> Callable[[np.ndarray], np.ndarray]:
    """So many pixels of an image without their colours."""

    def change(image: np.ndarray) -> np.ndarray:
        image.reshape(-1, 4)[:pixels, :3] //= 2
        return image

    return change


@pytest.mark.parametrize("rays", ["primary", "shadow", "both"])
def test_a_run_whose_timed_frames_show_something_else_is_refused(rays: str) -> None:
    few = int(MOST * PIXELS)
    request = Request("cornell-box", Variant("bvh-stack"), SIZE, frames=1, rounds=1, rays=rays, check="none")
    measure(request, 0, Spoiled(dimmed(few)))
    with pytest.raises(ApartError, match=f"{few + 1} of {PIXELS} pixels of the timed frames show something else"):
        measure(request, 0, Spoiled(dimmed(few + 1)))
