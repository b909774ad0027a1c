"""Recorded reads are what the timed program reads: addresses worked out from the layouts, and the counters' sums."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from hand_made import SCENES
from running import WALKS, catalogue_scene, context, picture, prepared, run

from renderer.bench import combine, run_slice
from renderer.memory.blocks import LANES, SIDE, choose_blocks, grid_of
from renderer.memory.lines import lines_of, model_lines
from renderer.memory.reads import RAY, Streams, record_reads
from renderer.planner import LOOP_BUDGET, Reads
from renderer.prepare import Prepared
from renderer.records import COUNTERS, Records
from renderer.request import Request
from renderer.twin_host import TwinHost
from renderer.variant import AXES, TRAVERSALS, Variant, matrix

SIZE = (44, 27)
SCENE = "cornell-statue:2000"
PRIMITIVES, NORMALS = 1, 2
Words = npt.NDArray[np.int64]

TRIANGLE = {
    "bare": [(PRIMITIVES, 3, 0, 4), (PRIMITIVES, 3, 4, 3), (PRIMITIVES, 3, 8, 3)],
    "normal": [(PRIMITIVES, 6, 0, 4), (PRIMITIVES, 6, 4, 3), (PRIMITIVES, 6, 8, 3)],
    "compact": [(PRIMITIVES, 5, 0, 3), (PRIMITIVES, 5, 4, 3), (PRIMITIVES, 5, 8, 3), (PRIMITIVES, 5, 15, 1)],
    "split": [(PRIMITIVES, 3, 0, 4), (PRIMITIVES, 3, 4, 3), (PRIMITIVES, 3, 8, 3)],
}
"""What fetching a triangle reads (paper, section 3.1): buffer, chunks a triangle, first word, words."""

CORNER_NORMALS = {
    "bare": [],
    "normal": [(PRIMITIVES, 6, 12, 3), (PRIMITIVES, 6, 16, 3), (PRIMITIVES, 6, 20, 3)],
    "compact": [(PRIMITIVES, 5, at, 1) for at in (3, 7, 11)] + [(PRIMITIVES, 5, at, 3) for at in (12, 16)],
    "split": [(NORMALS, 3, 0, 3), (NORMALS, 3, 4, 3), (NORMALS, 3, 8, 3)],
}


class Here(TwinHost):
    """The twin on the session's one context."""

    def __init__(self) -> None:
        super().__init__(1)
        self._made = context()


def recorded(ready: Prepared, most_blocks: int = 256, most_bytes: int = 128 << 20) -> Streams:
    found = record_reads(ready, Here(), most_blocks, most_bytes)
    assert found is not None
    return found


def by_pixel(streams: Streams, size: tuple[int, int]) -> dict[tuple[int, int], Words]:
    """What each pixel of the blocks made; nothing outside of the image."""
    columns, _ = grid_of(size)
    found = {}
    for block, begins, ends in zip(streams.blocks.index, streams.begin, streams.end, strict=True):
        for lane in range(LANES):
            x, y = block % columns * SIDE + lane % SIDE, block // columns * SIDE + lane // SIDE
            words = streams.words[begins[lane] : ends[lane]].astype(np.int64)
            if x < size[0] and y < size[1]:
                found[int(x), int(y)] = words
            else:
                assert len(words) == 0
    return found


def noted(slot: int, parts: list[tuple[int, int, int, int]]) -> list[int]:
    """The words that reading these parts of a triangle makes."""
    return [source << 30 | words - 1 << 28 | slot * chunks * 4 + at for source, chunks, at, words in parts]


def words_of(streams: Streams, size: tuple[int, int]) -> int:
    """The words of the buffers that all reads asked for."""
    return sum(int(((w[w < RAY] >> 28 & 3) + 1).sum()) for w in by_pixel(streams, size).values())


def total(counts: npt.NDArray[np.uint32]) -> dict[str, int]:
    return dict(zip(COUNTERS, counts.sum(axis=0, dtype=np.int64).tolist(), strict=True))


def whole_chunks(traversal: str, counts: npt.NDArray[np.uint32]) -> int:
    """The words by which reads of whole chunks exceed what `words` counts of them (docs/method.md, Work)."""
    sums = total(counts)
    match TRAVERSALS[traversal].nodes:
        case "box" | "box-path" | "skip" | "skip-octants" | "skip-wide":
            return sums["nodes"]
        case "quad":
            return 4 * sums["nodes"]
        case "plane-box":
            walked = sums["inner"] + sums["leaves"]
            return 2 * walked + (sums["nodes"] - walked)
        case _:
            return 0


def timed_words(traversal: str, records: Records, rays: str, surface: int) -> int:
    """What the reads of the timed program must sum to: `surface` words shade one hit."""
    hits = 0 if records.rasterised else int((records.hits.primitive >= 0).sum())
    primary, shadow = records.primary_counts, records.shadow_counts
    cast = total(primary)["words"] - hits * surface + whole_chunks(traversal, primary)
    hidden = total(shadow)["words"] + whole_chunks(traversal, shadow)
    return {"primary": cast, "shadow": hits * surface + hidden, "both": cast + hits * surface + hidden}[rays]


@cache
def counted(scene: str, variant: Variant) -> Records:
    return run(catalogue_scene(scene), variant, SIZE).records


VARIANTS = [
    (name, variant, rays)
    for name, rays in ((SCENE, "primary"), (SCENE, "shadow"), (SCENE, "both"), ("cornell-box", "both"))
    for variant in matrix({"traversal": ("brute-force", *WALKS), "method": AXES["method"]}, rays)[0]
]


@pytest.mark.parametrize(("name", "variant", "rays"), VARIANTS, ids=lambda v: v if isinstance(v, str) else v.label)
def test_reads_sum_to_what_is_counted(name: str, variant: Variant, rays: str) -> None:
    scene = catalogue_scene(name)
    records = counted(name, variant)
    streams = recorded(prepared(scene, variant, SIZE, rays=rays))
    surface = 10 if scene.normals is None or variant.method == "hybrid" else 19
    assert words_of(streams, SIZE) == timed_words(variant.traversal, records, rays, surface)
    lines = lines_of(streams)
    primary = 0 if records.rasterised else len(records.primary)
    assert (
        lines.rays == {"primary": primary, "shadow": len(records.shadow), "both": primary + len(records.shadow)}[rays]
    )


BRUTE = [(layout, method) for layout in TRIANGLE for method in AXES["method"] if layout == "bare" or method != "hybrid"]


@pytest.mark.parametrize(("layout", "method"), BRUTE)
def test_brute_force_reads_these_very_addresses(layout: str, method: str) -> None:
    """Every triangle in turn, the hit's triangle and normals, then up to the first that hides the light."""
    scene = catalogue_scene(SCENE if layout != "bare" else "cornell-box")
    variant = Variant("brute-force", method, "normal" if layout == "bare" else layout)
    size = (12, 9)
    records = run(scene, variant, size).records
    tests = np.array([noted(slot, TRIANGLE[layout]) for slot in range(len(scene.faces))])
    assert len(scene.lights) == 1
    tested = {int(p): int(c[3]) for p, c in zip(records.shadow_pixel, records.shadow_counts, strict=True)}
    for (x, y), words in by_pixel(recorded(prepared(scene, variant, size)), size).items():
        pixel = y * size[0] + x
        hit = int(records.hits.primitive[pixel])
        expected = [] if method == "hybrid" else [RAY, *tests.ravel()]
        if hit >= 0:
            expected += noted(hit, TRIANGLE[layout] + CORNER_NORMALS[layout])
        if pixel in tested:
            expected += [RAY, *tests[: tested[pixel]].ravel()]
        np.testing.assert_array_equal(words, expected, err_msg=f"pixel {x}, {y}")


def test_lines_of_a_small_buffer_are_each_fetched_once() -> None:
    """36 triangles of 48 bytes are 27 lines, all of which every block needs and none of which its cache gives up."""
    scene = catalogue_scene("cornell-box")
    for size in ((8, 8), (24, 16)):
        lines = lines_of(recorded(prepared(scene, Variant("brute-force"), size, rays="primary")))
        assert lines.per_ray == pytest.approx(36 * 48 / 64 / 64)


def test_layouts_read_as_much_and_fetch_other_lines() -> None:
    """As the paper saw: what differs is the waste within lines, and split wastes least."""
    scene = catalogue_scene(SCENE)
    streams = {name: recorded(prepared(scene, Variant(layout=name), (64, 64))) for name in AXES["layout"]}
    assert len({words_of(one, (64, 64)) for one in streams.values()}) == 1
    figures = {name: lines_of(one).per_ray or 0.0 for name, one in streams.items()}
    assert len(set(figures.values())) == 3
    assert figures["split"] == min(figures.values())


@pytest.mark.parametrize("rays", ["shadow", "both"])
@pytest.mark.parametrize("traversal", ["bvh-stack", "kd-backtrack", "brute-force"])
@pytest.mark.parametrize("method", AXES["method"])
def test_recording_changes_no_pixel(method: str, traversal: str, rays: str) -> None:
    ready = prepared(catalogue_scene(SCENE), Variant(traversal, method), SIZE, rays=rays)
    columns, rows = grid_of(SIZE)
    table = columns * rows
    places = np.concatenate([table + LANES * np.arange(table), np.arange(table * LANES + 1)]).astype(np.uint32)
    recording = picture(ready.recording_plan(Reads(places, table * LANES)))
    np.testing.assert_array_equal(recording, picture(ready.plan(instrument=False)))


def test_a_sample_s_streams_are_those_of_the_whole_image() -> None:
    size = (90, 70)
    ready = prepared(SCENES["deep"](), Variant("bvh-restart-trail", "compute"), size)
    everything, sample = (by_pixel(recorded(ready, most), size) for most in (10_000, 9))
    assert len(choose_blocks(size, 10_000)) == 12 * 9
    assert len(everything) == 90 * 70
    assert 0 < len(sample) <= 9 * LANES
    for pixel, words in sample.items():
        np.testing.assert_array_equal(words, everything[pixel])


def test_fewer_blocks_are_taken_where_reads_do_not_fit() -> None:
    ready = prepared(catalogue_scene(SCENE), Variant(), (128, 128))
    need = len(recorded(ready).words) * 4
    fewer = recorded(ready, most_bytes=need // 5)
    assert 0 < len(fewer.blocks) < 256 // 4
    assert len(fewer.words) * 4 <= need // 5
    assert fewer.blocks.weight.sum() == 256
    assert record_reads(ready, Here(), most_bytes=1000) is None


@pytest.mark.parametrize("traversal", WALKS)
def test_several_lights(traversal: str) -> None:
    scene = SCENES["light on the surface"]()
    variant = Variant(traversal)
    records = run(scene, variant, SIZE).records
    streams = recorded(prepared(scene, variant, SIZE))
    assert words_of(streams, SIZE) == timed_words(traversal, records, "both", 10)
    assert lines_of(streams).rays == len(records.primary) + len(records.shadow)


def test_a_slice_has_the_models_where_they_are_asked_for() -> None:
    request = Request(SCENE, size=(32, 24), frames=1, rounds=1, check="none", models=True)
    result = combine(request, [run_slice(request, 0)])
    expected = lines_of(recorded(prepared(catalogue_scene(SCENE), Variant(), (32, 24))))
    assert result["per_ray"]["lines"] == pytest.approx(expected.per_ray)
    assert result["model"]["lines"] == expected.as_dict()
    assert result["model"]["alu_per_fragment"] > result["model"]["alu_per_ray"] > 0
    assert result["model"]["alu_text"]


def test_without_being_asked_there_are_no_models() -> None:
    request = Request("cornell-box", size=(16, 16), frames=1, rounds=1, check="none")
    result = combine(request, [run_slice(request, 0)])
    assert (result["model"], result["per_ray"]["lines"]) == (None, None)


class Phone(Here):
    """A host that says it is a phone."""

    def device(self) -> dict[str, object]:
        """As the agent says."""
        return {"kind": "agent"}


def test_what_is_not_modelled_says_why() -> None:
    phone = model_lines(prepared(catalogue_scene("cornell-box"), Variant(), (8, 8)), Phone())
    assert (phone.per_ray, phone.rays) == (None, 0)
    assert phone.text.startswith("Not modelled: reads are recorded on llvmpipe only")
    large = prepared(catalogue_scene(f"forest:{LOOP_BUDGET}"), Variant("brute-force"), (8, 8))
    assert model_lines(large, Here()).text.startswith("Not modelled: brute force runs in passes")


def test_timed_and_instrumented_plans_record_nothing() -> None:
    for traversal in WALKS:
        ready = prepared(catalogue_scene("cornell-box"), Variant(traversal), SIZE)
        for plan in (ready.plan(instrument=False), ready.plan(instrument=True)):
            assert "reads" not in {buffer.name for buffer in plan.buffers}
            assert all("#define READS 0\n" in p.stages["fragment"] for p in plan.programs)
