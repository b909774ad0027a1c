"""Figures for people, and metrics from flat results."""

from __future__ import annotations

import pytest

from server.comparison.figures import NOT_MEASURED, write_figure, write_interval, write_value
from server.comparison.metrics import METRICS, Figure, MetricError, read_figure, require_metric

SPEED, SIZE, ERROR = METRICS["mrays_per_s"], METRICS["structure_bytes"], METRICS["error_total"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (12.345, "12.3"),
        (1.0, "1.00"),
        (123.4, "123"),
        (12345.6, "12,346"),
        (0.0123, "0.0123"),
        (2e-4, "2.0×10⁻⁴"),
    ],
)
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert write_value(SPEED, value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0 B"), (448, "448 B"), (999.5, "1,000 B"), (65_536, "65.5 KB"), (43_000_000, "43.0 MB"), (5e15, "5,000 TB")],
)
def test_bytes_have_a_unit(value: float, text: str) -> None:
    assert write_value(SIZE, value) == text


@pytest.mark.parametrize(("value", "text"), [(0.0, "0"), (1e-5, "1.0×10⁻⁵"), (0.25, "0.250"), (None, NOT_MEASURED)])
def test_fractions_tell_nothing_from_zero(value: float | None, text: str) -> None:
    assert write_value(ERROR, value) == text


def test_a_figure_without_a_value_has_no_unit() -> None:
    assert write_figure(SPEED, Figure(None)) == NOT_MEASURED
    assert write_figure(SPEED, Figure(2.0)) == "2.00 Mray/s"
    assert write_interval(SPEED, Figure(2.0, 1.5, 2.5)) == "1.50–2.50"
    assert write_interval(SPEED, Figure(2.0)) == ""


def test_the_interval_of_a_rate_is_turned_round() -> None:
    flat = {"mrays_per_s": 10.0, "frame_ms_median": 4.0, "frame_ms_ci_low": 2.0, "frame_ms_ci_high": 5.0}
    assert read_figure(SPEED, flat) == Figure(10.0, 8.0, 20.0)
    assert read_figure(METRICS["frame_ms_median"], flat) == Figure(4.0, 2.0, 5.0)
    assert read_figure(SPEED, flat | {"frame_ms_ci_low": None}) == Figure(10.0)


def test_an_error_is_whole_or_not_measured() -> None:
    flat = {"error_false_hit": 0.0, "error_false_miss": 1e-5, "error_wrong_primitive": 2e-5}
    assert read_figure(ERROR, flat).value == pytest.approx(3e-5)
    assert read_figure(ERROR, flat | {"error_false_miss": None}).value is None
    assert read_figure(ERROR, flat | {"error_false_miss": float("nan")}).value is None


def test_a_metric_is_found_by_its_dotted_name() -> None:
    assert require_metric("per_ray.nodes").key == "per_ray_nodes"
    assert require_metric("error").key == "error_total"
    with pytest.raises(MetricError, match="choose one of mrays_per_s"):
        require_metric("beauty")
