"""Pictures taken up, read again, drawn and compared, against the arrays that they were made of."""

from __future__ import annotations

import asyncio
import hashlib
import io
import logging
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import Normalize
from pictured import add_job, counts, image, keep
from PIL import Image

from renderer.pictures.counts import METRICS
from renderer.pictures.files import PictureError, counts_bytes, png_bytes, write_pictures
from renderer.pictures.heatmap import summarise
from renderer.pictures.heatmap_picture import ABOVE, COLOURS, common_scale
from renderer.request import Request
from server.pictures import colours
from server.pictures.choice import choose, read_asked
from server.pictures.drawn import amplification
from server.pictures.figures import count_figures, count_pair, image_pair, scale_top
from server.pictures.jobs import find_pictured, list_pictured
from server.pictures.stored import read_counts, read_image
from server.pictures.taken import take_up
from server.problems import Problem
from server.queue.ledger import Claim
from server.settings import Settings
from server.slices import SliceRunner
from server.store.blobs import BlobError, Blobs
from server.store.database import Database

SEEDS = (11, 12)
SIZES = ((64, 48), (7, 300), (1, 1))


@pytest.fixture
def blobs(tmp_path: Path) -> Blobs:
    return Blobs(tmp_path / "blobs")


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    database = Database(database_url)
    yield database
    database.close()


def stored(blobs: Blobs, content: bytes) -> str:
    with blobs.receiving() as incoming:
        incoming.write(content)
        return blobs.keep(incoming)


def pixels_of(png: bytes) -> np.ndarray[Any, Any]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


@pytest.mark.parametrize("size", SIZES)
def test_pictures_are_read_as_they_were_measured(blobs: Blobs, tmp_path: Path, size: tuple[int, int]) -> None:
    pixels, counted = image(SEEDS[0], size), counts(SEEDS[0], size)
    named = keep(tmp_path / "round", blobs, pixels, counted)
    assert (read_image(blobs, named["image"]) == pixels[::-1]).all()
    for metric, expected in counted.items():
        assert (read_counts(blobs, named["counts"], metric) == expected[::-1]).all()
        found, summary = count_figures(blobs, named["counts"], metric), summarise(expected)
        assert found.size == size
        assert (found.mean, found.p50, found.p99, found.max) == pytest.approx(
            (summary.mean, summary.p50, summary.p99, summary.max)
        )


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("top", [1, 37, 199, 5000])
def test_a_heatmap_has_the_projects_colours(size: tuple[int, int], top: int) -> None:
    counted = counts(SEEDS[0], size)["nodes"]
    expected = colormaps[COLOURS].with_extremes(over=ABOVE)(Normalize(0, top)(counted), bytes=True)[..., :3]
    drawn = pixels_of(colours.paint_counts(counted.astype(np.uint32), top))
    # matplotlib has 256 steps, a palette with a colour for what is above them 255.
    assert np.abs(drawn.astype(int) - expected).max() <= 8
    above = counted > top
    assert (drawn[above] == expected[above]).all()
    assert not (drawn[~above] == (0x35, 0xE0, 0xFF)).all(axis=-1).any()


def test_scales_are_those_of_the_command(blobs: Blobs) -> None:
    maps = [counts(seed, most=most)["nodes"] for seed, most in zip(SEEDS, (200, 31_000), strict=True)]
    highs = [float(np.percentile(each, 99.5)) for each in maps]
    assert scale_top(*highs) == common_scale(maps)
    assert scale_top(0.0) == common_scale([np.zeros((4, 4), np.int64)])


def test_a_change_is_signed_around_the_middle() -> None:
    one, other = np.array([[0, 10, 30, 0]], np.uint32), np.array([[10, 0, 30, 4_000_000_000]], np.uint32)
    more, less, same, beyond = pixels_of(colours.paint_change(one, other, 10))[0].astype(int)
    assert more[0] > more[2]
    assert less[2] > less[0]
    assert np.ptp(same) < 8
    assert (beyond == more).all()


@pytest.mark.parametrize("size", SIZES)
def test_images_are_compared_pixel_by_pixel(blobs: Blobs, tmp_path: Path, size: tuple[int, int]) -> None:
    one, other = image(SEEDS[0], size), image(SEEDS[1], size)
    other[0] = one[0]
    names = [keep(tmp_path / "round", blobs, each, None)["image"] for each in (one, other)]
    found = image_pair(blobs, *names)
    apart = np.abs(one.astype(int) - other)
    assert (found.size, found.largest) == (size, apart.max())
    assert found.differing == pytest.approx((apart.max(axis=-1) > 0).mean())
    if apart.any():
        assert found.psnr_db == pytest.approx(10 * math.log10(255**2 / np.square(apart).mean()))
    same = image_pair(blobs, names[0], names[0])
    assert (same.differing, same.largest, same.psnr_db) == (0.0, 0, None)
    drawn = pixels_of(colours.paint_image_change(one[::-1], other[::-1], 3))
    assert (drawn == np.minimum(apart * 3, 255)[::-1]).all()


def test_counts_are_compared_pixel_by_pixel(blobs: Blobs, tmp_path: Path) -> None:
    one, other = counts(SEEDS[0]), counts(SEEDS[1])
    names = [keep(tmp_path / "round", blobs, image(SEEDS[0]), each)["counts"] for each in (one, other)]
    for metric in one:
        found, change = count_pair(blobs, *names, metric), other[metric] - one[metric]
        assert found.differing == pytest.approx((change != 0).mean())
        assert found.largest == np.abs(change).max()
        assert found.ratio == pytest.approx(other[metric].mean() / one[metric].mean())
        assert found.high == pytest.approx(np.percentile(np.abs(change), 99.5))


def test_pictures_of_different_sizes_are_refused_in_one_sentence(blobs: Blobs, tmp_path: Path) -> None:
    made = [keep(tmp_path / "round", blobs, image(1, size), counts(1, size)) for size in SIZES[:2]]
    with pytest.raises(PictureError, match="The pictures are of 64x48 and 7x300 pixels: choose two of one size"):
        image_pair(blobs, made[0]["image"], made[1]["image"])
    with pytest.raises(PictureError, match="64x48 and 7x300"):
        count_pair(blobs, made[0]["counts"], made[1]["counts"], "nodes")


@pytest.mark.parametrize(("largest", "factor"), [(0, 1), (1, 255), (3, 85), (128, 1), (255, 1)])
def test_a_difference_is_amplified_to_white_at_most(largest: int, factor: int) -> None:
    assert amplification(largest) == factor


def _claims(shape: tuple[int, ...]) -> bytes:
    """A numpy file whose header claims a shape that its few bytes do not have."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"descr": "<u4", "fortran_order": False, "shape": shape})
    return out.getvalue() + b"\0" * 16


def _zipped(member: bytes) -> bytes:
    import zipfile

    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as held:
        held.writestr("nodes.npy", member)
    return out.getvalue()


def _pickled() -> bytes:
    out = io.BytesIO()
    np.save(out, np.array([[{}]], object), allow_pickle=True)
    return out.getvalue()


def _torn() -> bytes:
    """Counts with zeros in their middle: what unpacks is then no header, and numpy cannot even parse it."""
    random = np.random.default_rng(21)
    data = bytearray(counts_bytes({name: random.integers(0, 1 << 20, (64, 64)) for name in METRICS}))
    data[200:260] = bytes(60)
    return bytes(data)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (_torn(), "cannot be read"),
        (b"", "cannot be read"),
        (b"no zip at all", "cannot be read"),
        (counts_bytes(counts(1))[:-40], "cannot be read"),
        (_zipped(b"short"), "cannot be read"),
        (_zipped(_claims((4096, 4096))), "they end too soon"),
        (_zipped(_claims((5000, 5000))), "not of this program"),
        (_zipped(_claims((1 << 40, 1 << 20))), "not of this program"),
        (_zipped(_claims((0, 4))), "not of this program"),
        (_zipped(_pickled()), "not of this program"),
        (png_bytes(image(1)), "cannot be read"),
    ],
    ids=["torn", "empty", "text", "cut", "short", "less", "large", "huge", "none", "pickle", "image"],
)
def test_foreign_counts_are_refused_in_one_sentence(blobs: Blobs, content: bytes, said: str) -> None:
    with pytest.raises(PictureError, match=said) as told:
        read_counts(blobs, stored(blobs, content), "nodes")
    assert str(told.value).endswith(": measure again.")


@pytest.mark.parametrize("content", [b"", b"GIF89a", png_bytes(image(1))[:200], counts_bytes(counts(1))])
def test_foreign_images_are_refused_in_one_sentence(blobs: Blobs, content: bytes) -> None:
    with pytest.raises(PictureError, match=r"The stored image .* cannot be read"):
        read_image(blobs, stored(blobs, content))


def test_an_image_that_is_too_large_is_refused(blobs: Blobs) -> None:
    out = io.BytesIO()
    Image.new("RGB", (4097, 1)).save(out, "png")
    with pytest.raises(PictureError, match="larger than 4096x4096"):
        read_image(blobs, stored(blobs, out.getvalue()))


def _wrong_name(folder: Path, named: dict[str, Any]) -> None:
    named["image"] = "../" + named["image"]


def _other_content(folder: Path, named: dict[str, Any]) -> None:
    (folder / f"{named['counts']}.npz").write_bytes(b"other")


def _no_file(folder: Path, named: dict[str, Any]) -> None:
    (folder / f"{named['image']}.png").unlink()


def _no_names(folder: Path, named: dict[str, Any]) -> None:
    named.clear()


def _a_file_for_a_folder(folder: Path, named: dict[str, Any]) -> None:
    (folder.parent / "blobs").write_text("")


@pytest.mark.parametrize("spoil", [_wrong_name, _other_content, _no_file, _no_names, _a_file_for_a_folder])
def test_a_measurement_is_not_lost_with_its_pictures(
    tmp_path: Path, spoil: Callable[[Path, dict[str, Any]], None], caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "round"
    folder.mkdir()
    named: dict[str, Any] = dict(write_pictures(folder, image(1), counts(1)))
    spoil(folder, named)
    with caplog.at_level(logging.WARNING):
        taken = take_up({"round": 0, "pictures": named}, folder, Blobs(tmp_path / "blobs"))
    assert taken == {"round": 0, "pictures": None}
    assert "without its pictures" in caplog.text


def test_a_measurement_without_pictures_stays_as_it_is(tmp_path: Path) -> None:
    for measurement in ({"round": 1}, {"round": 0, "pictures": None}):
        assert take_up(measurement, tmp_path, Blobs(tmp_path / "blobs")) is measurement
    assert not (tmp_path / "blobs").exists()


@pytest.mark.parametrize("round_index", [0, 1])
def test_the_first_round_alone_has_a_folder_that_is_gone_afterwards(
    tmp_path: Path, database: Database, monkeypatch: pytest.MonkeyPatch, round_index: int
) -> None:
    seen: list[Path] = []

    async def child(module: str, task: dict[str, Any], *_: Any, **__: Any) -> dict[str, Any]:
        assert module == "renderer.slice"
        if "pictures" not in task:
            return {"round": round_index}
        seen.append(Path(task["pictures"]))
        return {"round": round_index, "pictures": dict(write_pictures(seen[0], image(1), counts(1)))}

    async def say(_: str) -> None: ...

    monkeypatch.setattr("server.slices.run_child_async", child)
    runner = SliceRunner(database, Settings(blobs=str(tmp_path / "blobs")), lambda: True)
    held = Claim(1, 1, round_index, 2, 1, "worker", "llvmpipe", Request("forest").to_json())
    measurement = asyncio.run(runner(held, say))
    if round_index == 1:
        assert (measurement, seen) == ({"round": 1}, [])
        return
    assert [path.exists() for path in seen] == [False]
    for name in measurement["pictures"].values():
        assert hashlib.sha256(b"".join(Blobs(tmp_path / "blobs").read(name))).hexdigest() == name


IMAGE, COUNTS = "1" * 64, "2" * 64
WITH = {"image": IMAGE, "counts": COUNTS}


def add(database: Database, pictures: Any = WITH, **more: Any) -> int:
    return add_job(database, {"device": {"id": "llvmpipe"}}, pictures, **more)


def chosen(database: Database, **params: str) -> tuple[str | None, int | None, int | None]:
    with database.reading() as session:
        choice = choose(session, read_asked(params))
    jobs = (choice.baseline, choice.against)
    return choice.scene, *(job and job.job for job in jobs)  # type: ignore[return-value]


@pytest.mark.parametrize(
    "pictures", [None, {}, {"image": None, "counts": None}, {"image": "../x"}, {"image": 3}, "x", []]
)
def test_results_that_name_no_picture_have_none(database: Database, pictures: Any) -> None:
    job = add(database, pictures)
    with database.reading() as session:
        assert list_pictured(session) == []
        with pytest.raises(Problem, match=f"Job {job} has no picture") as refused:
            find_pictured(session, str(job))
    assert refused.value.status_code == 404
    assert chosen(database) == (None, None, None)


def test_an_image_without_counts_is_a_picture(database: Database) -> None:
    job = add(database, {"image": IMAGE, "counts": None})
    with database.reading() as session:
        found = find_pictured(session, str(job))
    assert found.name_of("image") == IMAGE
    with pytest.raises(Problem, match="has no counts"):
        found.name_of("nodes")


def test_the_newest_two_of_one_scene_and_size_are_chosen(database: Database) -> None:
    first, second = add(database), add(database)
    third = add(database, size=(32, 32))
    fourth = add(database, scene="cornell-box")
    add(database, None, scene="cornell-box")
    assert chosen(database) == ("forest", first, second)
    assert chosen(database, scene="cornell-box") == ("cornell-box", fourth, None)
    assert chosen(database, baseline=str(third)) == ("forest", third, second)
    assert chosen(database, against=str(first)) == ("forest", second, first)
    assert chosen(database, baseline=str(fourth), against=str(first)) == ("cornell-box", fourth, first)
    # A form whose scene was changed still names the jobs of the other one.
    assert chosen(database, scene="cornell-box", baseline=str(first), against=str(second)) == (
        "cornell-box",
        fourth,
        None,
    )
    assert chosen(database, scene="nothing") == ("nothing", None, None)


def test_all_of_a_scene_are_the_latest_of_each_variant_in_order(database: Database) -> None:
    for traversal in ("kd-backtrack", "bvh-stack", "bvh-parent-link"):
        add(database, traversal=traversal)
    latest = add(database, traversal="bvh-stack")
    with database.reading() as session:
        choice = choose(session, read_asked({"view": "all"}))
    labels = [job.label.split()[0] for job in choice.all_of_scene]
    assert sorted(labels) == ["bvh-parent-link", "bvh-stack", "kd-backtrack"]
    assert labels.index("bvh-parent-link") < labels.index("kd-backtrack")
    assert latest in [job.job for job in choice.all_of_scene]


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"what": "depth"}, "Unknown what 'depth': choose one of image, nodes, triangles, bytes"),
        ({"view": "<b>"}, "Unknown view"),
        ({"study": "x"}, "The study 'x' is not understood"),
        ({"study": "9" * 30}, "not understood"),
        ({"cut": "101"}, "give a number up to 100"),
        ({"colour": "red"}, "Unknown parameter 'colour'"),
    ],
)
def test_an_address_that_is_wrong_is_refused_in_one_sentence(params: dict[str, str], said: str) -> None:
    with pytest.raises(PictureError, match=said):
        read_asked(params)


def test_a_blob_that_is_not_here_is_told(blobs: Blobs) -> None:
    with pytest.raises(BlobError, match="set RAYFARM_BLOBS"):
        read_image(blobs, IMAGE)
