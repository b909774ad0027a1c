"""What is shown of a job or of two: a picture as PNG, and the figures beside it."""

from __future__ import annotations

import threading
from typing import Any

from server.pictures import colours
from server.pictures.figures import CountFigures, count_figures, count_pair, image_pair, scale_top
from server.pictures.jobs import WHATS, Pictured
from server.pictures.stored import read_counts, read_image
from server.store.blobs import Blobs

_ONE = threading.Lock()
"""One picture is worked on at a time: those of the largest size take some hundred megabytes."""


def paint(blobs: Blobs, shown: Pictured, what: str, top: int | None, against: Pictured | None) -> bytes:
    """A heatmap of a job, from 0 to `top`, which is by default that of the scale it shares with `against`."""
    name = shown.name_of(what)
    with _ONE:
        chosen = top or _shared_top(blobs, what, [shown, *([against] if against else [])])
        return colours.paint_counts(read_counts(blobs, name, what), chosen)


def paint_difference(blobs: Blobs, baseline: Pictured, against: Pictured, what: str, top: int | None) -> bytes:
    """How two jobs differ: images per channel, amplified; counts signed, from -`top` to `top`."""
    names = baseline.name_of(what), against.name_of(what)
    with _ONE:
        if what == "image":
            factor = amplification(image_pair(blobs, *names).largest)
            return colours.paint_image_change(read_image(blobs, names[0]), read_image(blobs, names[1]), factor)
        chosen = top or scale_top(count_pair(blobs, *names, what).high)
        one, other = (read_counts(blobs, name, what) for name in names)
        return colours.paint_change(one, other, chosen)


def amplification(largest: int) -> int:
    """How many times as bright a difference of images is shown, whose largest is given: up to white at most."""
    return 255 // largest if largest else 1


def figures_of(blobs: Blobs, shown: Pictured, what: str) -> CountFigures | None:
    """The figures of a job's counts; None for an image, which has none."""
    if what == "image":
        return None
    with _ONE:
        return count_figures(blobs, shown.name_of(what), what)


def scale_of(blobs: Blobs, what: str, shown: list[Pictured]) -> dict[str, Any] | None:
    """The scale that pictures of counts share, and whether any has counts above it; None for images."""
    if what == "image":
        return None
    found = [figures for each in shown if (figures := figures_of(blobs, each, what)) is not None]
    top = scale_top(*(each.high for each in found))
    return {"top": top, "label": f"{WHATS[what]} per pixel", "above": any(each.max > top for each in found)}


def compare_pictures(blobs: Blobs, baseline: Pictured, against: Pictured, what: str) -> dict[str, Any]:
    """The figures of two jobs' pictures and of their difference; raise PictureError when their sizes differ."""
    names = baseline.name_of(what), against.name_of(what)
    with _ONE:
        difference = _image_change(blobs, *names) if what == "image" else _count_change(blobs, *names, what)
    return {
        "what": what,
        "label": WHATS[what],
        "baseline": _side(blobs, baseline, what),
        "against": _side(blobs, against, what),
        "scale": scale_of(blobs, what, [baseline, against]),
        "difference": difference,
    }


def _shared_top(blobs: Blobs, what: str, shown: list[Pictured]) -> int:
    return scale_top(*(count_figures(blobs, each.name_of(what), what).high for each in shown))


def _image_change(blobs: Blobs, baseline: str, against: str) -> dict[str, Any]:
    pair = image_pair(blobs, baseline, against)
    return {
        "identical": pair.largest == 0,
        "differing_share": pair.differing,
        "largest": pair.largest,
        "psnr_db": pair.psnr_db,
        "flip": None,
        "amplified": amplification(pair.largest),
        "mean_ratio": None,
        "top": None,
        "beyond": False,
    }


def _count_change(blobs: Blobs, baseline: str, against: str, what: str) -> dict[str, Any]:
    pair = count_pair(blobs, baseline, against, what)
    top = scale_top(pair.high)
    return {
        "identical": pair.largest == 0,
        "differing_share": pair.differing,
        "largest": pair.largest,
        "psnr_db": None,
        "flip": None,
        "amplified": None,
        "mean_ratio": pair.ratio,
        "top": top,
        "beyond": pair.largest > top,
    }


def _side(blobs: Blobs, shown: Pictured, what: str) -> dict[str, Any]:
    figures = figures_of(blobs, shown, what)
    return {
        "job": shown.job,
        "scene": shown.scene,
        "variant": shown.label,
        "device": shown.device,
        "size": list(shown.size),
        "file": f"/api/v1/pictures/{shown.name_of(what)}",
        "picture": f"/api/v1/jobs/{shown.job}/picture?what={what}",
        "mean": figures and figures.mean,
        "p50": figures and figures.p50,
        "p99": figures and figures.p99,
        "max": figures and figures.max,
    }
