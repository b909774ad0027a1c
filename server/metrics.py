"""`/metrics`: what the farm is doing, in Prometheus' text format; states and devices are labels, jobs are not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import timedelta

from fastapi import APIRouter, Request
from fastapi.responses import Response
from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector
from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import InstrumentedAttribute, Session

from server.api.state import database_of
from server.devices.registry import PAIRING, ready
from server.problems import Problem
from server.store.database import Database
from server.store.models import Device, Job, Result, Slice, Worker, now
from server.store.states import STATES, State

router = APIRouter(include_in_schema=False)


class FarmCollector(Collector):
    """Counts what the database holds, when it is asked."""

    def __init__(self, database: Database, lease_s: float) -> None:
        self._database = database
        self._lease = timedelta(seconds=lease_s)

    def collect(self) -> Iterator[Metric]:
        """The farm's gauges: any server of a farm gives the same, and old jobs may be removed."""
        with self._database.reading() as session:
            jobs = _counts(session, Job.state)
            slices = _counts(session, Slice.state)
            results = session.scalar(select(func.count(Result.id))) or 0
            recent = Worker.beat_at > now() - self._lease
            alive = select(func.count(Worker.id)).where(Worker.ended_at.is_(None), Worker.reaped_at.is_(None), recent)
            workers = session.scalar(alive) or 0
            devices = [
                (device.kind, device.id, ready(device))
                for device in session.scalars(select(Device).where(Device.kind != PAIRING).order_by(Device.id))
            ]
        yield _by_state("rayfarm_jobs", "Jobs by state.", jobs)
        yield _by_state("rayfarm_slices", "Slices by state.", slices)
        yield GaugeMetricFamily("rayfarm_results", "Results stored.", value=results)
        yield GaugeMetricFamily("rayfarm_workers", "Workers that give signs of life.", value=workers)
        gauge = GaugeMetricFamily(
            "rayfarm_device_ready", "Whether jobs may run on a device.", labels=["kind", "device"]
        )
        for kind, name, is_ready in devices:
            gauge.add_metric([kind, name], float(is_ready))
        yield gauge


@router.get("/metrics")
def metrics(request: Request) -> Response:
    """The farm's figures and this process's."""
    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    try:
        registry.register(FarmCollector(database_of(request), float(request.app.state.lease_s)))
        text = generate_latest(registry)
    except SQLAlchemyError as error:
        raise Problem(503, "The database does not answer.") from error
    return Response(text, media_type=CONTENT_TYPE_LATEST)


def _counts(session: Session, state: InstrumentedAttribute[State]) -> dict[State, int]:
    """How many rows are in each state."""
    rows = session.execute(select(state, func.count()).group_by(state))
    return {row[0]: row[1] for row in rows}


def _by_state(name: str, text: str, counts: Mapping[State, int]) -> GaugeMetricFamily:
    gauge = GaugeMetricFamily(name, text, labels=["state"])
    for state in STATES:
        gauge.add_metric([state], counts.get(state, 0))
    return gauge
