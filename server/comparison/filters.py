"""A comparison's filters as conditions for stored results: by their own columns, or by their set-ups' facts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sqlalchemy import ColumnElement, and_, or_, select

from renderer.variant import AXES, expand
from server.comparison.derived import DERIVED, SAH, SPECIALISE, read_derived
from server.store.models import FILTERS, Result, Setup

FACTS = {"size": "size", "rays": "rays_kind"}
"""Filters by a set-up's fact, and that fact's name."""
NAMES = (*FILTERS, *FACTS, *DERIVED)
"""What a comparison filters by."""


def read_filter(name: str, values: Sequence[str]) -> tuple[str, ...]:
    """The values of a filter as they stand in results; raise VariantError or DerivedError for one that cannot be."""
    given = [value for value in values if value]
    if name in AXES:
        return expand(name, ",".join(given)) if given else ()
    return tuple(dict.fromkeys(read_derived(name, value) if name in DERIVED else value for value in given))


def selected(filters: Mapping[str, Sequence[str]], study: int | None) -> list[ColumnElement[bool]]:
    """The conditions for results of a study with one of the given values of every filter."""
    conditions = [_condition(name, values) for name, values in filters.items()]
    return conditions if study is None else [*conditions, Result.study_id == study]


def _condition(name: str, values: Sequence[str]) -> ColumnElement[bool]:
    if name in FILTERS:
        known: ColumnElement[bool] = getattr(Result, name).in_(values)
        return known
    return Result.setup_id.in_(select(Setup.id).where(or_(*(_fact_is(name, value) for value in values))))


def _fact_is(name: str, value: str) -> ColumnElement[bool]:
    if name == SAH:
        costs = [None if part == "None" else float(part) for part in value.split(",")]
        stored = [Setup.facts[fact].as_float() for fact in ("sah_traversal", "sah_intersection")]
        return and_(*(fact.is_not_distinct_from(cost) for fact, cost in zip(stored, costs, strict=True)))
    if name == SPECIALISE:
        special = Setup.facts["specialised"].as_string()
        found: ColumnElement[bool] = special.is_(None) if value == "off" else special.is_not(None)
        return found
    known: ColumnElement[bool] = Setup.facts[FACTS[name]].as_string() == value
    return known
