"""Flat rows as Parquet, some at a time; values keep their types."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import IO, TYPE_CHECKING, Any, cast

from renderer.variant import AXES
from server.comparison.flat import COLUMNS

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 1000
"""How many rows a group has; a writer holds one group."""

TEXTS = (
    *("recorded_at", "scene", "family", "device_id", "device_kind", "device_name", "device_driver", *AXES),
    *("size", "rays_kind", "profile_imported", "profile_ambiguous", "versions_rayfarm", "versions_shader_sha"),
    "started_at",
)
WHOLE = (
    *("job", "study", "triangles", "device_threads", "frames", "rays_timed", "rays_primary", "rays_shadow"),
    *("structure_bytes", "primitive_bytes", "overflows", "versions_plan", "depth"),
)
MORE = (
    *("compile_ms", "load_average", "error_shadow_edge", "error_shadow_self_hit", "error_shadow_leak"),
    "error_raster_mismatch",
)
SERIES = ("frames_ms", "frames_cpu_ms", "frames_gpu_ms")


def parquet_pieces(rows: Iterable[dict[str, Any]], fields: Sequence[str] = ()) -> Iterator[bytes]:
    """Rows with lists as they are, as the pieces of one file: COLUMNS, then `fields`, whose types their names give.

    Figures are doubles, counts integers, frame times lists of doubles; any other field is text, as JSON where it was
    none. A value that its column cannot hold is null.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = list(dict.fromkeys((*COLUMNS, *fields)))
    schema = pa.schema([pa.field(name, _type(name)) for name in columns])
    sink, source = _Sink(), iter(rows)
    with pq.ParquetWriter(cast(IO[Any], sink), schema, compression="zstd") as writer:
        while group := list(islice(source, ROWS)):
            arrays = [_array(field.name, [row.get(field.name) for row in group], field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            yield sink.taken()
    yield sink.taken()


class _Sink(io.RawIOBase):
    """A file whose bytes are taken away as they come."""

    def __init__(self) -> None:
        super().__init__()
        self._pieces: list[bytes] = []
        self._size = 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        piece = bytes(data)
        self._pieces.append(piece)
        self._size += len(piece)
        return len(piece)

    def tell(self) -> int:
        return self._size

    def taken(self) -> bytes:
        """What was written since it was last asked."""
        found = b"".join(self._pieces)
        self._pieces.clear()
        return found


def _kind(name: str) -> str:
    if name in SERIES:
        return "series"
    if name in WHOLE or name.startswith("error_counts_"):
        return "whole"
    if name == "frames_by_round":
        return "counts"
    return "figure" if name in MORE or (name in COLUMNS and name not in TEXTS) else "text"


def _type(name: str) -> pa.DataType:
    import pyarrow as pa

    types: dict[str, pa.DataType] = {
        "series": pa.list_(pa.float64()),
        "counts": pa.list_(pa.int64()),
        "whole": pa.int64(),
        "text": pa.string(),
    }
    return types.get(_kind(name), pa.float64())


def _array(name: str, values: list[Any], kind: pa.DataType) -> pa.Array[Any]:
    import pyarrow as pa

    read = _READERS[_kind(name)]
    return pa.array([None if value is None else read(value) for value in values], kind)


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _integer(value: Any) -> int | None:
    whole = isinstance(value, int | float) and value == int(value) and abs(value) < 2**63
    return int(value) if whole else None


_READERS: dict[str, Callable[[Any], Any]] = {
    "series": lambda value: [_number(item) for item in value] if isinstance(value, list) else None,
    "counts": lambda value: [_integer(item) for item in value] if isinstance(value, list) else None,
    "whole": _integer,
    "figure": _number,
    "text": lambda value: value if isinstance(value, str) else json.dumps(value),
}
