"""Listings of bvh-stack's primary rays on the Cornell box at 64x64, as this project's own runs of Mesa 25.0.7 printed
them: plain, and with each site that ran marked (`tests/unit/listings`)."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from renderer.phone_compile.compiled import Compiled
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import GPUS
from renderer.phone_compile.listing import Listing
from renderer.phone_compile.places import find_places
from renderer.phone_compile.read import read_listing
from renderer.phone_compile.sites import Where
from renderer.phone_compile.weights import per_run, weigh

RECORDED = ("adreno-540", "adreno-740", "mali-g72", "mali-g57")
RUNS = 64 * 64
ROOT = {"adreno-740": 0}
"""Loads of the root by each run; Adreno 740 reads it once for a whole draw, before (`shps` to `shpe`)."""


def recorded(gpu: str) -> dict[str, Any]:
    path = Path(__file__).parent / "listings" / f"{gpu}.json.gz"
    read: dict[str, Any] = json.loads(gzip.decompress(path.read_bytes()))
    return read


def listing_of(gpu: str, entry: dict[str, Any]) -> Listing:
    return read_listing(GPUS[gpu], Compiled(None, tuple(entry["messages"]), entry["listing"]), "fragment")


@pytest.mark.parametrize("gpu", RECORDED)
def test_a_listing_has_what_its_driver_counted(gpu: str) -> None:
    listing = listing_of(gpu, recorded(gpu)["plain"])
    kinds = listing.kinds
    assert sum(block.units["inst"] for block in listing.blocks if block.units) == listing.instructions
    # Bifrost's empty slots are no instructions.
    assert sum(kinds.values()) - (kinds["nop"] if gpu == "mali-g72" else 0) == listing.instructions
    assert kinds["memory"] == ROOT.get(gpu, 2) + 4 + 3  # the root, both children of a step, a triangle
    assert listing.loops == 4
    assert len([block for block in listing.blocks if not block.successors]) == 1


@pytest.mark.parametrize("gpu", RECORDED)
def test_a_listing_that_lacks_a_line_is_refused(gpu: str) -> None:
    entry = recorded(gpu)["plain"]
    lines = entry["listing"].splitlines()
    at = next(i for i, line in enumerate(lines) if "FMA" in line or "mul.f" in line)
    with pytest.raises(CompileError, match="is misread"):
        listing_of(gpu, entry | {"listing": "\n".join([*lines[:at], *lines[at + 1 :]])})


@pytest.mark.parametrize("gpu", RECORDED)
def test_blocks_weigh_what_the_counts_say(gpu: str) -> None:
    """Loads a run are known: 3 a triangle tested, 4 a step, 2 of the root."""
    read = recorded(gpu)
    plain = listing_of(gpu, read["plain"])
    executions = {Where(site["index"], False): site["runs"] for site in read["sites"]}
    marked = [([Where(site["index"], False)], listing_of(gpu, site)) for site in read["sites"]]
    weights = weigh(plain, marked, executions, RUNS)
    triangles, _, steps, _ = executions.values()
    loads = per_run(plain, weights, ["memory"], "kinds")["memory"]
    assert loads == pytest.approx((3 * triangles + 4 * steps) / RUNS + ROOT.get(gpu, 2))
    assert weights.residual < 1e-9
    assert weights.lost == 0


@pytest.mark.parametrize("gpu", RECORDED)
def test_a_mark_is_in_one_place(gpu: str) -> None:
    read = recorded(gpu)
    plain = listing_of(gpu, read["plain"])
    places = [find_places(plain, listing_of(gpu, site)) for site in read["sites"]]
    assert [list(found.values()) for found in places] == [[1]] * len(places)
    assert len({next(iter(found)) for found in places}) == len(places)


def test_counts_that_contradict_each_other_give_no_figure() -> None:
    read = recorded("adreno-540")
    plain = listing_of("adreno-540", read["plain"])
    wheres = [Where(site["index"], False) for site in read["sites"]]
    marked = [([where], listing_of("adreno-540", site)) for where, site in zip(wheres, read["sites"], strict=True)]
    executions = {where: site["runs"] for where, site in zip(wheres, read["sites"], strict=True)}
    with pytest.raises(CompileError, match="do not fit the flow"):
        weigh(plain, [*marked, ([Where(99, False)], marked[0][1])], executions | {Where(99, False): 1}, RUNS)


def test_a_listing_without_its_marks_gives_no_figure() -> None:
    read = recorded("adreno-540")
    plain = listing_of("adreno-540", read["plain"])
    wheres = [Where(k, False) for k in range(4)]
    with pytest.raises(CompileError, match="Only 0 of the text's 4 branches and loops"):
        weigh(plain, [([where], None) for where in wheres], dict.fromkeys(wheres, 7), RUNS)
