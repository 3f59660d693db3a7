"""Held signals over steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.engine.frame.inputs import InputSamples, bridge, held, longest_stretch, pieces

S = 1_000_000_000


def _signal(*samples: tuple[float, float]) -> InputSamples:
    return InputSamples(np.array([round(t * S) for t, _ in samples], dtype=np.int64), np.array([v for _, v in samples]))


def test_the_mean_of_the_square_is_taken_not_the_square_of_the_mean() -> None:
    current = _signal((0.0, 0.0), (0.5, 10.0), (1.0, 0.0), (1.5, 10.0))
    part = pieces({"current": current}, np.array([0, S, 2 * S]))
    assert part.mean(part.values["current"] ** 2).tolist() == [50.0, 50.0]


def test_products_of_signals_of_different_rates_are_exact() -> None:
    speed = _signal((0.0, 2.0), (0.25, 4.0))
    torque = _signal((0.0, 1.0), (0.5, 3.0))
    part = pieces({"speed": speed, "torque": torque}, np.array([0, S]))
    product = part.values["speed"] * part.values["torque"]
    assert part.mean(product)[0] == pytest.approx(0.25 * 2 + 0.25 * 4 + 0.5 * 12)


@given(st.lists(st.tuples(st.integers(0, 20 * S), st.floats(-100, 100)), min_size=1, max_size=40), st.integers(1, 7))
def test_step_means_add_up_to_the_integral_whatever_the_step(samples: list[tuple[int, float]], steps: int) -> None:
    times = sorted({t for t, _ in samples})
    signal = InputSamples(np.array(times, dtype=np.int64), np.array([v for _, v in samples[: len(times)]]))
    end = 20 * S
    fine = pieces({"x": signal}, np.array([0, end]))
    edges = np.arange(steps + 1, dtype=np.int64) * (end // steps)
    coarse = pieces({"x": signal}, edges)
    rest = pieces({"x": signal}, np.array([edges[-1], end])).mean  # the piece that integer division leaves
    whole = coarse.mean(coarse.values["x"]).sum() * (end // steps)
    if edges[-1] < end:
        tail = pieces({"x": signal}, np.array([edges[-1], end]))
        whole += rest(tail.values["x"])[0] * (end - int(edges[-1]))
    assert whole / end == pytest.approx(fine.mean(fine.values["x"])[0], abs=1e-6)


def test_before_its_first_sample_a_signal_has_the_first_value() -> None:
    assert held(_signal((1.0, 5.0), (2.0, 7.0)), np.array([0, S, 3 * S // 2, 2 * S])).tolist() == [5.0, 5.0, 5.0, 7.0]


def test_a_gap_is_bridged_by_a_straight_line_and_marked() -> None:
    t = np.concatenate([np.arange(10), np.arange(20, 30)]) * S
    signal = bridge(t, np.concatenate([np.zeros(10), np.full(10, 11.0)]))
    assert signal.gaps == ((9 * S, 20 * S),)
    assert held(signal, np.array([14 * S]))[0] == pytest.approx(5.0)
    assert np.all(np.diff(signal.t_ns) > 0)


def test_a_silence_of_over_ten_minutes_is_not_bridged() -> None:
    t = np.concatenate([np.arange(10), 700 + np.arange(30)]) * S
    assert bridge(t, np.ones(40)).gaps == ()


def test_the_longest_stretch_lies_between_long_silences() -> None:
    first = InputSamples(np.concatenate([np.arange(10), 1000 + np.arange(30), 2000 + np.arange(5)]) * S, np.ones(45))
    second = InputSamples(np.arange(0, 3000, 5) * S, np.ones(600))
    assert longest_stretch({"a": first, "b": second}) == (1000 * S, 1029 * S)
    assert longest_stretch({"b": second}) == (0, 2995 * S)
