"""A job's raw series and its trace: rounds and readings placed, phases and attempts told, the format's rules kept."""

from __future__ import annotations

import csv
import io
import json
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from job_documents import FRAMES, ROUNDS, document_of
from trace_rules import assert_rules, counters, spans

from server.devices.counters import FILES, ZONES
from server.queue import ledger
from server.series.frames import read_series, series_csv
from server.series.life import read_phases
from server.series.readings import KINDS, read_value
from server.series.trace import job_trace, study_trace
from server.series.trace_events import lanes
from server.store.models import Change, Job, Result, Slice
from server.store.states import State

START = datetime(2026, 1, 1, tzinfo=UTC)
Step = tuple[float, State, str | None]


def made_job(*steps: Step, document: dict[str, Any] | None = None, rounds: int = ROUNDS, number: int = 1) -> Job:
    """A job with changes at these seconds."""
    changes = [
        Change(id=i, job_id=number, state=state, reason=reason, at=START + timedelta(seconds=at))
        for i, (at, state, reason) in enumerate(steps)
    ]
    slices = [Slice(id=i, round=i, attempts=1) for i in range(rounds)]
    job = Job(id=number, label="<b>variant</b>", scene="forest", device="P1", changes=changes, slices=slices)
    job.state = steps[-1][1]
    if document is not None:
        job.result = Result(document=document)
    return job


def said(round_index: int, attempt: int = 1) -> str:
    """A worker's reason for a change, as it gives it itself."""
    return ledger._reason(ledger.Claim(1, 1, round_index, ROUNDS, attempt, "w", "Round 7 of 9 on x.", {}))


def measured_job(document: dict[str, Any]) -> Job:
    """A job whose rounds are prepared and run one after the other, ten seconds each."""
    steps: list[Step] = [(0, "queued", None)]
    for i in range(ROUNDS):
        steps += [
            (10 * i + 2, "preparing", said(i)),
            (10 * i + 4, "running", said(i)),
            (10 * i + 9, "judging", said(i)),
        ]
    return made_job(*steps, (40, "done", None), document=document)


def seconds(event: dict[str, Any]) -> tuple[float, float]:
    return event["ts"] / 1e6, (event["ts"] + event["dur"]) / 1e6


def test_every_class_of_counters_has_a_name_and_a_unit() -> None:
    assert set(KINDS) == {*FILES, *ZONES}


@pytest.mark.parametrize(
    ("name", "raw", "value"),
    [
        ("gpu_temp", 44_100, 44.1),
        ("battery_temp", "335", 33.5),
        ("gpu_clock", "585000000", 585.0),
        ("gpu_busy", "12 %", 12.0),
        ("gpu_busy", 7, 7.0),
        ("gpu_busy_ticks", " 250  1000", 25.0),
        ("gpu_busy_ticks", "0 0", None),
        ("gpu_busy_ticks", "250", None),
        ("battery_current", -312_000, -312.0),
        ("gpu_temp", "hot", None),
        ("gpu_temp", "nan", None),
        ("gpu_temp", True, None),
        ("gpu_temp", None, None),
    ],
)
def test_the_kernels_figures_become_units(name: str, raw: object, value: float | None) -> None:
    assert read_value(name, raw) == pytest.approx(value)


def test_a_phones_series_has_its_readings_by_frame() -> None:
    series = read_series(document_of(phone=True))
    share = FRAMES // ROUNDS
    assert [(one.first, one.frames, one.throttled) for one in series.rounds] == [
        (0, share, False),
        (share, share, False),
        (2 * share, share, True),
    ]
    assert [(frame.round, frame.index) for frame in series.frames] == [
        (r, i) for r in range(1, ROUNDS + 1) for i in range(1, share + 1)
    ]
    assert {frame.cpu_ms for frame in series.frames} == {None}
    assert [frame.gpu_ms is None for frame in series.frames] == [i % share == 0 for i in range(FRAMES)]
    readings = {reading.name: reading for reading in series.readings}
    assert list(readings) == ["gpu_temp", "gpu_clock", "gpu_busy"]
    assert readings["gpu_temp"].values[0] == pytest.approx(41.0)
    assert readings["gpu_clock"].values == pytest.approx([585.0] * 16 + [421.0] * 8)
    assert readings["gpu_busy"].values[share - 1] is None
    assert set(series.unavailable) == {"skin_temp"}


def test_the_csv_has_a_line_a_frame_and_empty_fields_for_what_was_not_told() -> None:
    lines = list(csv.DictReader(io.StringIO(series_csv(read_series(document_of(phone=True))))))
    assert list(lines[0]) == [
        *("round", "index", "wall_ms", "cpu_ms", "gpu_ms"),
        *("gpu_temp_c", "gpu_clock_mhz", "gpu_busy_percent"),
    ]
    assert len(lines) == FRAMES
    assert (lines[8]["round"], lines[8]["index"], lines[8]["cpu_ms"], lines[8]["gpu_ms"]) == ("2", "1", "", "")
    assert float(lines[9]["wall_ms"]) == pytest.approx(11.25)


@pytest.mark.parametrize(
    ("changes", "rounds", "gpu", "readings"),
    [
        ({}, [8, 8, 8], True, 3),
        ({"frames_by_round": None}, [24], True, 0),
        ({"frames_by_round": [8, 8]}, [24], True, 0),
        ({"frames_gpu_ms": [1.0]}, [8, 8, 8], False, 3),
        ({"rounds_started_at": []}, [8, 8, 8], True, 3),
        ({"frames_ms": []}, [], False, 0),
        ({"frames_ms": None, "frames_by_round": None}, [], False, 0),
    ],
)
def test_what_cannot_be_placed_is_not_guessed(
    changes: dict[str, Any], rounds: list[int], gpu: bool, readings: int
) -> None:
    series = read_series({**document_of(phone=True), **changes})
    assert [one.frames for one in series.rounds] == rounds
    assert any(frame.gpu_ms is not None for frame in series.frames) == gpu
    assert len(series.readings) == readings


def test_samples_of_some_rounds_are_nobodys() -> None:
    document = document_of(phone=True)
    series = read_series({**document, "samples": document["samples"][:2]})
    assert (series.readings, {one.throttled for one in series.rounds}) == ([], {None})


@pytest.mark.parametrize("seed", range(20))
def test_lanes_hold_no_two_spans_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spans = [(int(a), int(a + b)) for a, b in rng.integers(0, [100, 30], (40, 2))]
    chosen = lanes(spans)
    for lane in set(chosen):
        own = sorted(span for span, its in zip(spans, chosen, strict=True) if its == lane)
        assert all(before[1] <= after[0] for before, after in pairwise(own))
    deepest = max(sum(start <= t < end for start, end in spans) for t in range(130))
    assert len(set(chosen)) == max(1, deepest)


@pytest.mark.parametrize("phone", [False, True])
def test_a_jobs_trace_keeps_the_rules_and_tells_its_life(phone: bool) -> None:
    job = measured_job(document_of(phone=phone))
    trace = json.loads(json.dumps(job_trace(job, START), allow_nan=False))
    assert_rules(trace)
    assert [seconds(event) for event in spans(trace, "queued")] == [(0, 2)]
    assert [seconds(event) for event in spans(trace, "running")] == [(4, 9), (14, 19), (24, 29)]
    assert [seconds(event) for event in spans(trace, "judging")] == [(9, 12), (19, 22), (29, 40)]
    assert [seconds(event) for event in spans(trace, "slices")] == [(2, 12), (12, 22), (22, 40)]
    frames = spans(trace, "frames, laid end to end")
    assert [event["name"] for event in frames].count("frame 1") == ROUNDS
    assert len(frames) == FRAMES + ROUNDS
    rounds = [event for event in frames if "laid end to end" in event["name"]]
    assert [event["ts"] / 1e6 for event in rounds] == [4, 14, 24]
    second = [event for event in frames if event["args"].get("round") == 2]
    assert sum(event["dur"] for event in second) == pytest.approx(rounds[1]["dur"])
    [end] = [event for event in trace["traceEvents"] if event["ph"] == "i"]
    assert (end["name"], end["ts"]) == ("done", 40e6)
    assert counters(trace, "Load average") == [0.75] * ROUNDS
    assert len(counters(trace, "GPU temperature, °C")) == (FRAMES if phone else 0)
    assert len(counters(trace, "GPU busy, %")) == (FRAMES - ROUNDS if phone else 0)
    assert counters(trace, "Thermal status") == ([0, 0, 0, 0, 2, 2] if phone else [])


def test_attempts_are_spans_of_their_own_and_an_open_job_goes_on_until_now() -> None:
    job = made_job(
        (0, "queued", None),
        (1, "preparing", said(0)),
        (2, "running", said(0)),
        (3, "queued", "It went away. Attempt 2 follows."),
        (5, "preparing", said(0, 2)),
    )
    job.slices[0].attempts, job.slices[0].worker = 2, "w"
    trace = job_trace(job, START + timedelta(seconds=9))
    assert_rules(trace)
    found = [(event["name"], seconds(event), event["args"]["worker"]) for event in spans(trace, "slices")]
    assert found == [("round 1", (1, 3), "not kept"), ("round 1, attempt 2", (5, 9), "w")]
    assert [event for event in trace["traceEvents"] if event["ph"] == "i"] == []


def test_a_slices_own_end_is_more_exact_than_the_jobs_next_change() -> None:
    job = measured_job(document_of(phone=False))
    job.slices[0].ended_at, job.slices[1].ended_at = START + timedelta(seconds=11), START + timedelta(seconds=90)
    trace = job_trace(job, START)
    assert_rules(trace)
    assert [seconds(event) for event in spans(trace, "slices")] == [(2, 11), (12, 22), (22, 40)]


def test_rounds_of_several_hosts_overlap_in_lanes() -> None:
    job = made_job(
        (0, "queued", None),
        (1, "preparing", said(0)),
        (2, "preparing", said(1)),
        (3, "running", said(0)),
        (4, "running", said(1)),
        (6, "done", None),
        document=document_of(phone=False),
    )
    trace = job_trace(job, START)
    assert_rules(trace)
    assert [seconds(event) for event in spans(trace, "slices")] == [(1, 4), (2, 6)]
    assert len({event["tid"] for event in spans(trace, "slices")}) == 2


def test_clocks_that_disagree_make_no_phase_of_negative_length() -> None:
    job = made_job((5, "queued", None), (3, "preparing", said(0)), (4, "running", said(0)), (9, "failed", "It broke."))
    phases, end = read_phases(job.changes, START)
    assert [(phase.end - phase.start).total_seconds() for phase in phases] == [0, 0, 4]
    assert end is not None
    trace = job_trace(job, START)
    assert_rules(trace)
    [instant] = [event for event in trace["traceEvents"] if event["ph"] == "i"]
    assert (instant["name"], instant["args"]["reason"]) == ("failed", "It broke.")


def test_a_cancelled_job_that_never_ran_has_a_trace() -> None:
    trace = job_trace(made_job((0, "queued", None), (0, "cancelled", "Cancelled on request.")), START)
    assert_rules(trace)
    assert [seconds(event) for event in spans(trace, "queued")] == [(0, 0)]


def test_a_studys_trace_has_devices_as_processes_and_jobs_as_threads() -> None:
    first = measured_job({})
    second = made_job((1, "queued", None), (2, "waiting", "P2 is not ready."), number=2)
    second.device = "P2"
    lives = [(job, job.changes) for job in (first, second)]
    trace = study_trace(3, "paper", lives, START + timedelta(seconds=60))
    assert_rules(trace)
    names = [event for event in trace["traceEvents"] if event["name"] == "process_name"]
    assert [event["args"]["name"] for event in names] == ["P1", "P2"]
    assert [seconds(event) for event in spans(trace, "Job 2")] == [(1, 60), (1, 2), (2, 60)]
    assert seconds(spans(trace, "Job 1")[0]) == (0, 40)


def test_an_empty_study_has_an_empty_trace() -> None:
    assert study_trace(1, "x", [], START)["traceEvents"] == []
