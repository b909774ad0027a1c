"""Result documents as flat rows, `_` between levels, and as a pandas table."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any, cast

from renderer.phone_compile.gpus import USUAL
from renderer.variant import AXES

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    *("job", "study", "recorded_at", "scene", "family", "triangles"),
    *("device_id", "device_kind", "device_name", "device_driver", "device_threads"),
    *AXES,
    *("sah_traversal", "sah_intersection", "sah_cost", "sah_epo", "size", "frames"),
    *("frame_ms_median", "frame_ms_ci_low", "frame_ms_ci_high", "fps", "mrays_per_s", "mrays_per_cpu_s"),
    *("rays_kind", "rays_timed", "rays_primary", "rays_shadow", "structure_bytes", "primitive_bytes", "build_ms"),
    *("per_ray_nodes", "per_ray_inner", "per_ray_leaves", "per_ray_triangles", "per_ray_bytes", "per_ray_lines"),
    *("model_alu_per_fragment", "model_alu_per_ray"),
    *(
        f"model_compiled_{gpu.replace('-', '_')}_{figure}"
        for gpu in USUAL
        for figure in ("alu_per_fragment", "memory_per_fragment")
    ),
    *("overflows", "error_false_hit", "error_false_miss", "error_edge", "error_wrong_primitive"),
    *("error_t_rel_p99", "error_t_rel_max", "error_t_ulp_max", "error_shadow_mismatch", "error_flip", "error_psnr"),
    *("vs_embree_mrays_per_cpu_s", "vs_embree_ratio"),
    *("profile_sp_memory_read", "profile_sp_memory_read_per_s", "profile_shader_alu_capacity_utilized"),
    *("profile_time_alus_working", "profile_alu_per_fragment", "profile_imported", "profile_ambiguous"),
    *("versions_rayfarm", "versions_shader_sha", "versions_plan", "started_at"),
)
"""The columns that every table has, in their order; further fields of a document follow them."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a text begins with that a spreadsheet takes for a formula (OWASP, CSV Injection)."""

LINES = 100
"""How many lines of a CSV go out at once."""

RAW = ("frames_ms", "frames_cpu_ms", "frames_gpu_ms", "samples")
"""Raw series: a CSV has them, a cell of a comparison leaves them to its job."""

PRUNED = "pruned"
"""Where a document says what of it was pruned: no figure, and no column."""

OBJECTS = (
    *("device", "sah", "frame_ms", "rays", "per_ray", "model", "error", "vs_embree", "profile", "versions"),
    "pictures",
)


@dataclass(frozen=True)
class Stored:
    """A result with what the store knows about it."""

    job: int
    study: int | None
    recorded_at: str
    document: dict[str, Any]


def flatten(stored: Stored, *, lists: bool = False) -> dict[str, Any]:
    """One result as a flat row; `size` becomes `WxH`, and lists become JSON text unless they are kept."""
    known = {"job": stored.job, "study": stored.study, "recorded_at": stored.recorded_at}
    return known | flatten_document(stored.document, lists=lists)


def flatten_document(document: dict[str, Any], *, lists: bool = False) -> dict[str, Any]:
    """A result's document alone as a flat row."""
    row: dict[str, Any] = {}
    _flatten_into(row, "", {key: value for key, value in document.items() if key not in ("size", PRUNED)}, lists)
    row["size"] = "x".join(str(side) for side in document.get("size") or ())
    return row


def without_raw(values: dict[str, Any]) -> dict[str, Any]:
    """A document or a flat row without its raw series."""
    return {key: value for key, value in values.items() if key not in RAW}


def to_frame(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Flat rows as a table with all of COLUMNS, what was not measured empty."""
    import pandas as pd

    extra = dict.fromkeys(key for row in rows for key in row if key not in COLUMNS)
    return pd.DataFrame.from_records(list(rows), columns=[*COLUMNS, *extra])


def to_csv(table: pd.DataFrame, *, index: bool) -> str:
    """A table as CSV that is inert in a spreadsheet: texts that would be formulas get an apostrophe in front.

    Phones name themselves, so any text may be one.
    """
    from pandas.api.types import is_numeric_dtype

    guarded: pd.DataFrame = table.apply(lambda column: column if is_numeric_dtype(column) else column.map(_guarded))
    guarded.columns, guarded.index = table.columns.map(_guarded), table.index.map(_guarded)
    return guarded.to_csv(index=index)


def csv_lines(
    rows: Iterable[dict[str, Any]], fields: Sequence[str] = (), columns: Sequence[str] = COLUMNS
) -> Iterator[str]:
    """Flat rows as CSV, some lines at a time, guarded as by `to_csv`: `columns`, then `fields`.

    Raise ValueError for a row with another column, so that nothing is left out unseen.
    """
    columns = list(dict.fromkeys((*columns, *fields)))
    kept: list[str] = []
    writer = csv.DictWriter(cast(IO[str], _Kept(kept)), columns, lineterminator="\n")
    writer.writerow({name: _guarded(name) for name in columns})
    for row in rows:
        writer.writerow({name: _guarded(value) for name, value in row.items()})
        if len(kept) >= LINES:
            yield "".join(kept)
            kept.clear()
    yield "".join(kept)


class _Kept:
    """A file that is a list of the texts written."""

    def __init__(self, texts: list[str]) -> None:
        self.write = texts.append


def _guarded(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def _flatten_into(row: dict[str, Any], prefix: str, value: dict[str, Any], lists: bool) -> None:
    for key, item in value.items():
        name = f"{prefix}{key}"
        if isinstance(item, dict):
            _flatten_into(row, f"{name}_", item, lists)
        elif isinstance(item, list) and not lists:
            row[name] = json.dumps(item)
        elif item is not None or name not in OBJECTS:
            row[name] = item
