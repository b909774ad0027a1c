"""A job's life, and a study's, as a trace that Perfetto's interface reads."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from server.series.frames import Frame, Round, Series, read_series
from server.series.life import Phase, Run, read_phases, read_runs, running_starts
from server.series.trace_events import Trace, lanes
from server.store.models import Change, Job
from server.store.states import OPEN

Json = dict[str, Any]

JOB = 1
"""A job's process."""
STEP = 1000
"""Track ids are a multiple of it and a lane's number: phases, their end, slices, frames."""
END, SLICES, FRAMES = (STEP * (len(OPEN) + i) for i in range(1, 4))


def job_trace(job: Job, now: datetime) -> Json:
    """A job's trace: a track for each phase, its slices, its frames, and counters. Zero is its first change."""
    phases, end = read_phases(job.changes, now)
    origin = job.changes[0].at
    trace = Trace(_iso(origin))
    trace.name_process(JOB, f"Job {job.id}: {job.label} on {job.scene}, on {job.device}")
    _add_phases(trace, phases, end, origin)
    _add_slices(trace, list(read_runs(job, phases)), origin)
    if job.result is not None:
        document = job.result.document
        series = read_series(document)
        starts = {one.number: _start(one, running_starts(phases), origin) for one in series.rounds}
        _add_frames(trace, series, starts)
        _add_counters(trace, series, starts)
        _add_load(trace, document, starts)
    return trace.document(job=job.id, frames="laid end to end from the start of their round's run")


def study_trace(study_id: int, name: str, jobs: Sequence[tuple[Job, Sequence[Change]]], now: datetime) -> Json:
    """A study's trace: a process for each device, a track for each job, on it the job and its phases."""
    origin = min((changes[0].at for _, changes in jobs if changes), default=now)
    trace = Trace(_iso(origin))
    devices = list(dict.fromkeys(job.device for job, _ in jobs))
    for pid, device in enumerate(devices, 1):
        trace.name_process(pid, device)
    for job, changes in jobs:
        phases, end = read_phases(changes, now)
        if phases:
            _add_job(trace, devices.index(job.device) + 1, job, phases, end, origin)
    return trace.document(study=study_id, name=name)


def _add_job(trace: Trace, pid: int, job: Job, phases: Sequence[Phase], end: Change | None, origin: datetime) -> None:
    title = f"Job {job.id}: {job.label} on {job.scene}"
    trace.name_track(pid, job.id, title)
    trace.add_span(pid, job.id, title, _ns(phases[0].start, origin), _ns(phases[-1].end, origin), state=job.state)
    for phase in phases:
        trace.add_span(pid, job.id, phase.state, _ns(phase.start, origin), _ns(phase.end, origin), **_about(phase))
    if end is not None:
        trace.add_instant(pid, job.id, end.state, _ns(phases[-1].end, origin), reason=end.reason or "")


def _add_phases(trace: Trace, phases: Sequence[Phase], end: Change | None, origin: datetime) -> None:
    for i, state in enumerate(OPEN, 1):
        trace.name_track(JOB, i * STEP, state)
    for phase in phases:
        name = f"round {phase.round}" if phase.round else phase.state
        tid = STEP * (OPEN.index(phase.state) + 1)
        trace.add_span(JOB, tid, name, _ns(phase.start, origin), _ns(phase.end, origin), **_about(phase))
    trace.name_track(JOB, END, "end")
    if end is not None:
        trace.add_instant(
            JOB, END, end.state, _ns(phases[-1].end if phases else end.at, origin), reason=end.reason or ""
        )


def _add_slices(trace: Trace, runs: Sequence[Run], origin: datetime) -> None:
    spans = [(_ns(run.start, origin), _ns(run.end, origin)) for run in runs]
    chosen = lanes(spans)
    _name_lanes(trace, SLICES, "slices", chosen)
    for run, (start, end), lane in zip(runs, spans, chosen, strict=True):
        name = f"round {run.round}" + (f", attempt {run.attempt}" if run.attempt > 1 else "")
        about = {"round": run.round, "attempt": run.attempt, "worker": run.worker or "not kept"}
        trace.add_span(JOB, SLICES + lane, name, start, end, **about)


def _add_frames(trace: Trace, series: Series, starts: dict[int, int]) -> None:
    """Every round as a span, its frames within it: when a frame began is not recorded, how long it took is."""
    ends = {one.number: starts[one.number] + sum(map(_duration, _frames_of(series, one))) for one in series.rounds}
    spans = [(starts[number], ends[number]) for number in starts]
    chosen = lanes(spans)
    _name_lanes(trace, FRAMES, "frames, laid end to end", chosen)
    for one, (start, end), lane in zip(series.rounds, spans, chosen, strict=True):
        throttled = "not told" if one.throttled is None else one.throttled
        about = {"frames": one.frames, "throttled": throttled}
        trace.add_span(JOB, FRAMES + lane, f"round {one.number}, laid end to end", start, end, **about)
        for frame in _frames_of(series, one):
            times = {clock: value for clock in ("wall_ms", "cpu_ms", "gpu_ms") if (value := getattr(frame, clock))}
            begun, start = start, start + _duration(frame)
            trace.add_span(JOB, FRAMES + lane, f"frame {frame.index}", begun, start, round=frame.round, **times)


def _add_counters(trace: Trace, series: Series, starts: dict[int, int]) -> None:
    """What was read after each frame, at the end of its span; and Android's thermal status around the frames."""
    for one in series.rounds:
        at = starts[one.number]
        if one.thermal_before is not None:
            trace.add_counter(JOB, "Thermal status", at, one.thermal_before)
        for i, frame in enumerate(_frames_of(series, one), one.first):
            at += _duration(frame)
            for reading in series.readings:
                value = reading.values[i]
                if value is not None:
                    trace.add_counter(JOB, f"{reading.kind.label}, {reading.kind.unit}", at, value)
        if one.thermal_after is not None:
            trace.add_counter(JOB, "Thermal status", at, one.thermal_after)


def _add_load(trace: Trace, document: Json, starts: dict[int, int]) -> None:
    load = document.get("load_average")
    for at in starts.values():
        if load is not None:
            trace.add_counter(JOB, "Load average, the highest of all rounds", at, load)


def _name_lanes(trace: Trace, first: int, name: str, chosen: Sequence[int]) -> None:
    for lane in sorted(set(chosen)):
        trace.name_track(JOB, first + lane, f"{name} ({lane + 1})" if lane else name)


def _start(one: Round, running: dict[int, datetime], origin: datetime) -> int:
    """Where a round's frames are laid: from its run's start, else from its own, else from the trace's."""
    if one.number in running:
        return _ns(running[one.number], origin)
    return _ns(datetime.fromisoformat(one.started_at), origin) if one.started_at else 0


def _frames_of(series: Series, one: Round) -> list[Frame]:
    return series.frames[one.first : one.first + one.frames]


def _duration(frame: Frame) -> int:
    return max(0, round((frame.wall_ms or 0) * 1e6))


def _about(phase: Phase) -> Json:
    return {"reason": phase.reason or "", "from": _iso(phase.start)}


def _ns(time: datetime, origin: datetime) -> int:
    return max(0, (time - origin) // timedelta(microseconds=1) * 1000)


def _iso(time: datetime) -> str:
    return time.isoformat(timespec="milliseconds")
