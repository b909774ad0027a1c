"""Pruning: the raw frames and the files of old results go, and the results stay, with a note of when that was.

A result's raw frames are in its document and its slices' measurements; its files are blobs, pictures and listings, as
are imported profiles. A blob goes when it is old itself and nothing names it any longer.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from server.comparison.flat import PRUNED, RAW
from server.keeping.errors import KeepingError
from server.pictures.taken import is_name
from server.store.blobs import Blobs
from server.store.database import Database
from server.store.models import Json, Profile, Result, Slice, now

BATCH = 50
_AGE = re.compile(r"([1-9][0-9]{0,4})d")


@dataclass(frozen=True)
class Ages:
    """How old what is to be pruned must be; None prunes none of it."""

    frames: timedelta | None = None
    files: timedelta | None = None


@dataclass
class Pruned:
    """What was pruned: results that lost their frames or files, profiles that lost their text, and the blobs' bytes."""

    frames: int = 0
    frames_bytes: int = 0
    files: int = 0
    profiles: int = 0
    blobs: int = 0
    blobs_bytes: int = 0


def parse_age(text: str) -> timedelta:
    """An age as `90d`; raise KeepingError for anything else."""
    found = _AGE.fullmatch(text)
    if found is None:
        raise KeepingError(f"{text!r} is no age: write it in whole days, as 90d.")
    return timedelta(days=int(found[1]))


def prune(database: Database, blobs: Blobs, ages: Ages, *, dry_run: bool = False) -> Pruned:
    """Prune what is old enough, or only count it; safe beside a running farm."""
    done, time = Pruned(), now()
    if ages.frames is not None:
        for result in _old(database, time - ages.frames, "frames", dry_run):
            size = len(json.dumps([result.document.get(name) for name in RAW]))
            done.frames, done.frames_bytes = done.frames + 1, done.frames_bytes + size
    if ages.files is not None:
        before = time - ages.files
        done.files = sum(1 for _ in _old(database, before, "files", dry_run))
        done.profiles = _forget_profiles(database, before, dry_run)
        _remove_blobs(database, blobs, before, done, dry_run)
    return done


def pruned_at(document: Json, what: str) -> str | None:
    """The day on which a result's `frames` or `files` were pruned; None where they were not."""
    time = (document.get(PRUNED) or {}).get(what)
    return str(time)[:10] if time else None


def _old(database: Database, before: datetime, what: str, dry_run: bool) -> Iterator[Result]:
    """Each result recorded before a time that still has what is to go, as it was; unless `dry_run`, without it now."""
    last = 0
    while True:
        with database.writing() as session:
            older = select(Result).where(Result.recorded_at < before, Result.id > last).order_by(Result.id).limit(BATCH)
            found = session.scalars(older if dry_run else older.with_for_update()).all()
            for result in found:
                if _has(result.document, what):
                    yield result
                    if not dry_run:
                        _strip(session, result, what)
        if not found:
            return
        last = found[-1].id


def _has(document: Json, what: str) -> bool:
    if what == "frames":
        return any(document.get(name) for name in RAW)
    return bool(document.get("pictures") or (document.get("compiled") or {}).get("listing"))


def _strip(session: Session, result: Result, what: str) -> None:
    # Under `pruned`: `frames` and `files`, each with its time.
    document = result.document | {PRUNED: (result.document.get(PRUNED) or {}) | {what: now().isoformat()}}
    if what == "frames":
        document |= {name: [] for name in RAW if name in document}
        session.execute(update(Slice).where(Slice.job_id == result.job_id).values(measurement=None))
    elif document.get("compiled"):
        document["compiled"] = document["compiled"] | {"listing": None}
    if what == "files" and document.get("pictures"):
        document["pictures"] = None
    result.document = document


def _forget_profiles(database: Database, before: datetime, dry_run: bool) -> int:
    """Note that the texts of old profiles go; how many."""
    with database.writing() as session:
        old = select(Profile).where(Profile.imported_at < before, Profile.pruned_at.is_(None))
        found = session.scalars(old).all()
        for profile in () if dry_run else found:
            profile.pruned_at = now()
        return len(found)


def _remove_blobs(database: Database, blobs: Blobs, before: datetime, done: Pruned, dry_run: bool) -> None:
    named = _named(database, before if dry_run else None)
    for name, size in blobs.kept_before(before):
        if name not in named:
            done.blobs, done.blobs_bytes = done.blobs + 1, done.blobs_bytes + size
            if not dry_run:
                blobs.remove(name, before)


def _named(database: Database, except_before: datetime | None) -> set[str]:
    """The blobs that something names; what is older than a time, where one is given, names none."""
    names: set[object] = set()
    results = select(Result.document["pictures"], Result.document["compiled"]["listing"])
    profiles = select(Profile.sha256).where(Profile.pruned_at.is_(None))
    if except_before is not None:
        results = results.where(Result.recorded_at >= except_before)
        profiles = profiles.where(Profile.imported_at >= except_before)
    with database.reading() as session:
        for pictures, listing in session.execute(results.execution_options(yield_per=1000)):
            names |= {listing, *(pictures.values() if isinstance(pictures, dict) else ())}
        names |= set(session.scalars(profiles))
    return {name for name in names if is_name(name)}
