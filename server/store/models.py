"""The tables. Times are UTC with their zone; JSON documents are plain JSON."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import (
    JSON,
    BigInteger,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    String,
    Text,
    TypeDecorator,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship

from renderer.variant import AXES
from server.store.defaults import LLVMPIPE, NORMAL_PRIORITY
from server.store.states import State

Json = dict[str, Any]
Presence = Literal["connecting", "online", "offline", "unauthorized"]


def now() -> datetime:
    """The current time, UTC."""
    return datetime.now(UTC)


class UtcTime(TypeDecorator[datetime]):
    """A time that keeps its zone on databases that have none (SQLite)."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Store UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Read UTC."""
        if value is None or value.tzinfo is not None:
            return value
        return value.replace(tzinfo=UTC)


class Base(DeclarativeBase):
    """The base of every table."""

    type_annotation_map = {  # noqa: RUF012
        datetime: UtcTime,
        Json: JSON(none_as_null=True),
        list[Any]: JSON,
        State: String(16),
        Presence: String(16),
    }


class Study(Base):
    """A matrix of jobs submitted as one; `refused` lists what was left out of it, with reasons."""

    __tablename__ = "studies"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    request: Mapped[Json]
    refused: Mapped[list[Any]]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Job(Base):
    """One variant on one scene on one device; `request` is `renderer.request.Request` as JSON.

    `device` is `llvmpipe` (any host that has it) or a `Device`. Jobs of a smaller `priority` are taken first.
    """

    __tablename__ = "jobs"

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int | None] = mapped_column(ForeignKey("studies.id"), index=True)
    scene: Mapped[str] = mapped_column(String(200))
    label: Mapped[str] = mapped_column(String(300))
    request: Mapped[Json]
    device: Mapped[str] = mapped_column(String(200), default=LLVMPIPE, index=True)
    priority: Mapped[int] = mapped_column(default=NORMAL_PRIORITY)
    state: Mapped[State] = mapped_column(default="queued", index=True)
    reason: Mapped[str | None] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(default=now)
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]

    slices: Mapped[list[Slice]] = relationship(back_populates="job", order_by="Slice.round")
    changes: Mapped[list[Change]] = relationship(order_by="Change.id")
    result: Mapped[Result | None] = relationship(back_populates="job")


class Slice(Base):
    """One round of one job. `workflow` on `queue` is the durable workflow that will run it or runs it.

    `worker` holds it since its last claim, or measured it; a claim counts `attempts` up, and only that attempt's
    outcome is taken. `started_at` is when that claim was, `ended_at` when its outcome was taken.
    """

    __tablename__ = "slices"
    __table_args__ = (UniqueConstraint("job_id", "round"), Index("ix_slices_state_job", "state", "job_id"))

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[int] = mapped_column(ForeignKey("jobs.id"))
    round: Mapped[int]
    state: Mapped[State] = mapped_column(default="queued")
    attempts: Mapped[int] = mapped_column(default=0)
    worker: Mapped[str | None] = mapped_column(String(200), index=True)
    workflow: Mapped[str | None] = mapped_column(String(64))
    queue: Mapped[str | None] = mapped_column(String(200))
    started_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    measurement: Mapped[Json | None] = mapped_column(deferred=True)

    job: Mapped[Job] = relationship(back_populates="slices")


class Worker(Base):
    """A worker process, alive while it gives signs of life (`beat_at`) and is neither ended nor given up.

    `host` names the machine, and the queue of the devices that are attached to it. `reaped_at` is when somebody
    last began to hand its work on: from then on it is given up, whatever it does. `handed_on_at` is when that was done.
    """

    __tablename__ = "workers"

    id: Mapped[str] = mapped_column(String(200), primary_key=True)
    host: Mapped[str] = mapped_column(String(200), index=True)
    started_at: Mapped[datetime] = mapped_column(default=now)
    beat_at: Mapped[datetime] = mapped_column(default=now)
    ended_at: Mapped[datetime | None]
    reaped_at: Mapped[datetime | None]
    handed_on_at: Mapped[datetime | None]


class Device(Base):
    """Something that runs plans: a phone by serial, or one host's llvmpipe (`llvmpipe@HOST`).

    `host` has it attached. `address` (HOST:PORT) is connected to by that host, and again when it is lost. `advice` says
    what to tap or plug while it is not online. `facts` is what it told about itself, `health` its last health job's
    outcome. `set_aside` is the reason for which nothing runs on it until someone clears it.
    """

    __tablename__ = "devices"

    id: Mapped[str] = mapped_column(String(200), primary_key=True)
    kind: Mapped[str] = mapped_column(String(16))
    host: Mapped[str | None] = mapped_column(String(200), index=True)
    address: Mapped[str | None] = mapped_column(String(200))
    presence: Mapped[Presence]
    advice: Mapped[str | None] = mapped_column(Text)
    facts: Mapped[Json] = mapped_column(default=dict)
    health: Mapped[Json | None]
    health_at: Mapped[datetime | None]
    set_aside: Mapped[str | None] = mapped_column(Text)
    first_seen_at: Mapped[datetime] = mapped_column(default=now)
    seen_at: Mapped[datetime] = mapped_column(default=now)


class Change(Base):
    """A job's change of state, with its time and reason."""

    __tablename__ = "changes"

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[int] = mapped_column(ForeignKey("jobs.id"), index=True)
    state: Mapped[State]
    reason: Mapped[str | None] = mapped_column(Text)
    at: Mapped[datetime] = mapped_column(default=now)


class Setup(Base):
    """What a result was measured on and with, in `server.store.setups.FACTS`' names; it is never changed or deleted."""

    __tablename__ = "setups"

    id: Mapped[int] = mapped_column(primary_key=True)
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    facts: Mapped[Json]


class Result(Base):
    """A job's result: the whole document, and the columns that a comparison filters on and groups by.

    Results are only ever added, so the larger of two ids is the later result; old ones lose their raw frames
    where that is asked for (`server.keeping.prune`).
    """

    __tablename__ = "results"
    __table_args__ = (
        Index("ix_results_setup", "setup_id", "study_id", "id"),
        Index("ix_results_study", "study_id", "setup_id", "id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[int] = mapped_column(ForeignKey("jobs.id"), unique=True)
    study_id: Mapped[int | None] = mapped_column(ForeignKey("studies.id"))
    setup_id: Mapped[int] = mapped_column(ForeignKey("setups.id"))
    recorded_at: Mapped[datetime] = mapped_column(default=now, index=True)
    scene: Mapped[str] = mapped_column(String(200), index=True)
    device: Mapped[str] = mapped_column(String(200), index=True)
    traversal: Mapped[str] = mapped_column(String(64))
    method: Mapped[str] = mapped_column(String(64))
    layout: Mapped[str] = mapped_column(String(64))
    intersector: Mapped[str] = mapped_column(String(64))
    box: Mapped[str] = mapped_column(String(64))
    nodes: Mapped[str] = mapped_column(String(64))
    precision: Mapped[str] = mapped_column(String(64))
    offset: Mapped[str] = mapped_column(String(64))
    builder: Mapped[str] = mapped_column(String(64))
    fetch: Mapped[str] = mapped_column(String(64))
    document: Mapped[Json] = mapped_column(deferred=True)

    job: Mapped[Job] = relationship(back_populates="result")


FILTERS = ("scene", "device", *AXES)
"""The columns of `Result` that a comparison filters on."""


class Submitted(Base):
    """A submission that came with an `Idempotency-Key`, and its answer; `digest` tells whether it is the same again."""

    __tablename__ = "submissions"

    key: Mapped[str] = mapped_column(String(200), primary_key=True)
    digest: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    location: Mapped[str] = mapped_column(String(200))
    body: Mapped[Json]
    created_at: Mapped[datetime] = mapped_column(default=now, index=True)


class HardCaseRun(Base):
    """A study of hard cases that was handed in whole; `digest` tells whether it is the same document again.

    `facts` is what a list shows of it (`server.hard_cases.store.facts_of`).
    """

    __tablename__ = "hard_case_runs"

    id: Mapped[int] = mapped_column(primary_key=True)
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    recorded_at: Mapped[datetime] = mapped_column(default=now)
    facts: Mapped[Json]
    document: Mapped[Json] = mapped_column(deferred=True)


class Token(Base):
    """An API token: `digest` is its secret's SHA-256 in hexadecimal; a page's session has the token it came from."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    name: Mapped[str] = mapped_column(String(100))
    digest: Mapped[str] = mapped_column(String(64))
    scopes: Mapped[list[Any]]
    parent: Mapped[str | None] = mapped_column(ForeignKey("tokens.id"), index=True)
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime]
    revoked_at: Mapped[datetime | None]


class Profile(Base):
    """A profiler's file that was imported for a job: what it was, and where its text is (`sha256` in the blob store).

    `column_map` is the map that it was read with, metric or role to column; None where its format needed none.
    Its text is gone since `pruned_at`.
    """

    __tablename__ = "profiles"

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[int] = mapped_column(ForeignKey("jobs.id"), index=True)
    format: Mapped[str] = mapped_column(String(32))
    column_map: Mapped[Json | None]
    file_name: Mapped[str] = mapped_column(String(200))
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    size: Mapped[int] = mapped_column(BigInteger)
    rows: Mapped[int] = mapped_column(BigInteger)
    imported_at: Mapped[datetime] = mapped_column(default=now)
    pruned_at: Mapped[datetime | None]

    metrics: Mapped[list[ProfileMetric]] = relationship(order_by="ProfileMetric.id")


class ProfileMetric(Base):
    """One metric of a profile over all its values; `unit` is its usual spelling, times are texts as the file has them.

    `instance` is the suffix of its name (`[1]`), `source` what else told it apart: a process, a GPU, a capture.
    """

    __tablename__ = "profile_metrics"

    id: Mapped[int] = mapped_column(primary_key=True)
    profile_id: Mapped[int] = mapped_column(ForeignKey("profiles.id"), index=True)
    name: Mapped[str] = mapped_column(String(300))
    instance: Mapped[str | None] = mapped_column(String(100))
    source: Mapped[str | None] = mapped_column(String(300))
    unit: Mapped[str | None] = mapped_column(String(100))
    count: Mapped[int] = mapped_column(BigInteger)
    mean: Mapped[float] = mapped_column(Float(53))
    median: Mapped[float] = mapped_column(Float(53))
    min: Mapped[float] = mapped_column(Float(53))
    max: Mapped[float] = mapped_column(Float(53))
    first_time: Mapped[str | None] = mapped_column(String(100))
    last_time: Mapped[str | None] = mapped_column(String(100))
