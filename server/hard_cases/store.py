"""Stored studies of hard cases."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, undefer

from server.api.views import MAX_ID, iso
from server.hard_cases.document import Document
from server.problems import Problem
from server.store.database import Database
from server.store.models import HardCaseRun
from server.store.records import without_nan

Json = dict[str, Any]


def keep_run(database: Database, document: Document) -> tuple[Json, bool]:
    """Store a study; its line, and whether it is new: the same document again is the run that it was."""
    plain = without_nan(document.model_dump(mode="json"))
    digest = hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()
    known = select(HardCaseRun).where(HardCaseRun.digest == digest)
    with database.reading() as session:
        if (found := session.scalar(known)) is not None:
            return run_line(found), False
    try:
        with database.writing() as session:
            run = HardCaseRun(digest=digest, facts=facts_of(plain), document=plain)
            session.add(run)
            session.flush()
            return run_line(run), True
    except IntegrityError:
        with database.reading() as session:
            return run_line(session.scalars(known).one()), False


def facts_of(document: Json) -> Json:
    """What a list shows of a document."""
    cells = document["cells"]
    told = {name: document[name] for name in ("seed", "share", "started_at", "seconds", "device", "versions")}
    return told | {
        "families": len(document["families"]),
        "variants": len({tuple(cell["variant"].values()) for cell in cells}),
        "outcomes": dict(Counter(cell["outcome"] for cell in cells)),
        "promises": document["promises"],
        "broken": len(document["broken"]),
    }


def list_runs(session: Session, limit: int) -> list[Json]:
    """The latest runs."""
    return [run_line(run) for run in session.scalars(select(HardCaseRun).order_by(HardCaseRun.id.desc()).limit(limit))]


def find_run(session: Session, run_id: str) -> HardCaseRun:
    """A run with its document by the id in a path; raise Problem 404 when there is none."""
    number = int(run_id) if run_id.isascii() and run_id.isdigit() else 0
    found = session.get(HardCaseRun, number, options=[undefer(HardCaseRun.document)]) if number <= MAX_ID else None
    if found is None:
        raise Problem(404, f"There is no hard-case run {run_id}.")
    return found


def run_line(run: HardCaseRun) -> Json:
    """A run in a list."""
    return {
        "id": run.id,
        "recorded_at": iso(run.recorded_at),
        **run.facts,
        "cells": sum(run.facts["outcomes"].values()),
        "url": f"/api/v1/hard-cases/{run.id}",
        "page": f"/hard-cases/{run.id}",
    }
