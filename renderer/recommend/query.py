"""What a recommendation is asked: variants on one scene and the terms to keep to; and its JSON form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from renderer.recommend.halving import ROUNDS, Terms
from renderer.request import Request, RequestError
from renderer.variant import Variant

MOST_VARIANTS = 500
MOST_ROUNDS = 100
LEAST_ROUNDS = 2
ERROR_BUDGET = 1e-3


@dataclass(frozen=True)
class Query:
    """Requests that differ in the variant alone, at least one, and the terms."""

    requests: tuple[Request, ...]
    terms: Terms

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain JSON values that `from_json` reads back."""
        return {
            "request": self.requests[0].to_json(),
            "variants": [request.variant.as_dict() for request in self.requests],
            "terms": asdict(self.terms) | {"size": list(self.terms.size)},
        }

    @staticmethod
    def from_json(data: dict[str, Any]) -> Query:
        """Read what `to_json` wrote; raise RequestError or VariantError for what does not exist."""
        base = Request.from_json(data["request"])
        requests = tuple(replace(base, variant=Variant(**axes)) for axes in data["variants"])
        width, height = data["terms"]["size"]
        return Query(requests, Terms(**data["terms"] | {"size": (width, height)}))


def make_query(
    requests: Sequence[Request],
    *,
    error: float = ERROR_BUDGET,
    memory: int | None = None,
    rounds: int = ROUNDS,
    seed: int = 1,
) -> Query:
    """A query over planned requests; raise RequestError with one sentence for terms that cannot be kept to."""
    if not 0 <= error <= 1:
        raise RequestError(f"The error budget is {error}: give a fraction of rays from 0 to 1.")
    if memory is not None and memory < 1:
        raise RequestError(f"The memory budget is {memory} bytes: give at least 1.")
    if not LEAST_ROUNDS <= rounds <= MOST_ROUNDS:
        raise RequestError(f"The rounds are {rounds}: give a whole number from {LEAST_ROUNDS} to {MOST_ROUNDS}.")
    if not requests:
        raise RequestError("There is no variant to choose from: ask for more values.")
    if len(requests) > MOST_VARIANTS:
        raise RequestError(
            f"There are {len(requests)} variants to choose from, more than {MOST_VARIANTS}: ask for fewer values."
        )
    return Query(tuple(requests), Terms(requests[0].size, error, memory, rounds, seed))


def read_bytes(text: str) -> int:
    """Read a number of bytes as 128M, 1.5G or 1048576 (powers of 1024); raise RequestError for anything else."""
    number, unit = text.strip(), 1
    for suffix, factor in (("K", 1 << 10), ("M", 1 << 20), ("G", 1 << 30)):
        bare = number.upper().removesuffix("IB").removesuffix("B")
        if bare.endswith(suffix):
            number, unit = bare[:-1], factor
    try:
        return int(float(number) * unit)
    except (ValueError, OverflowError):
        raise RequestError(f"The memory budget {text!r} is not understood: write it as 128M or 1.5G.") from None
