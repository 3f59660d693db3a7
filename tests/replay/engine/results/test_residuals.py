"""Size, sign and place of residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.channels import channel
from made.runs import made_summary
from replay.engine.results.as_json import to_json
from replay.engine.results.residuals import (
    channel_errors,
    largest_by_node,
    mean_by_node,
    where,
    with_errors_as_recorded,
)
from replay.engine.results.run import Observed
from replay.show.words.findings import answer, mean_error


def _observed(residual: NDArray[np.float64], used: NDArray[np.bool_] | None = None) -> Observed:
    n = residual.size
    return Observed(
        channel="MAG",
        node="magnet",
        t_ns=np.arange(n, dtype=np.int64) * 10**9,
        measured=50.0 + residual,
        modelled=np.full(n, 50.0),
        sd_K=0.3,
        bias_sd_K=0.4,
        used=np.ones(n, dtype=np.bool_) if used is None else used,
        first_record=np.arange(n),
        last_record=np.arange(n),
        raw=np.zeros(n, dtype=np.int64),
    )


def test_a_channel_is_summed_up_over_what_may_be_used() -> None:
    residual = np.array([1.0, -2.0, 3.0, 100.0])
    errors = channel_errors(_observed(residual, np.array([True, True, True, False])), {}, 0)
    assert errors is not None
    assert errors.mae_K == pytest.approx(2.0)
    assert errors.max_K == 3.0
    assert errors.bias_K == pytest.approx(2.0 / 3.0)
    assert errors.max_at_s == 2.0
    assert (errors.measured_max_degC, errors.measured_max_at_s) == (53.0, 2.0)
    assert errors.masked == 1
    assert errors.floor_K == pytest.approx(0.5)


def test_a_channel_without_usable_samples_has_no_summary() -> None:
    assert channel_errors(_observed(np.ones(3), np.zeros(3, dtype=np.bool_)), {}, 0) is None


def test_error_at_high_speed_is_found_there() -> None:
    speed = np.linspace(0.0, 16000.0, 2000)
    low, high = where(speed, np.where(speed > 12000.0, 5.0, 0.2)) or (0.0, 0.0)
    assert low == pytest.approx(12000.0, abs=2000.0)
    assert high == 16000.0


def test_error_that_is_everywhere_has_no_place() -> None:
    speed = np.linspace(0.0, 16000.0, 2000)
    assert where(speed, np.ones(2000)) is None
    assert where(np.full(2000, 4000.0), np.linspace(0, 1, 2000)) is None


def test_channels_of_one_node_are_joined_by_their_samples() -> None:
    errors = (
        channel_errors(_observed(np.ones(30)), {}, 0),
        channel_errors(_observed(np.array([3.0] * 9 + [4.0])), {}, 0),
    )
    both = [one for one in errors if one is not None]
    assert mean_by_node(both, lambda one: one.mae_K) == {"magnet": pytest.approx((30 * 1.0 + 10 * 3.1) / 40)}
    assert largest_by_node(both) == {"magnet": 4.0}


def test_a_corrected_reading_has_its_error_as_recorded_beside_it() -> None:
    """The reading is 3.0 K too high and corrected by that; the model is 1 K too cold of the truth."""
    observed = _observed(np.ones(20))
    t_ns = np.arange(-1, 21, dtype=np.int64) * 10**9
    made = channel("MAG", "temperature", np.full(22, 51.0), t_s=t_ns / 1e9)
    corrected = replace(made, read=np.full(22, 54.0))
    other = channel("TEETH", "temperature", np.full(22, 51.0), t_s=t_ns / 1e9)
    errors = channel_errors(observed, {}, 0)
    assert errors is not None
    (one,) = with_errors_as_recorded([errors], [observed], [corrected, other])
    assert (one.mae_K, one.mae_recorded_K, one.reading_moved_K) == pytest.approx((1.0, 4.0, -3.0))
    assert mean_error(one) == "1.0 K (reading corrected by −3.0 K; as recorded 4.0 K)"
    assert mean_error(errors) == "1.0 K"
    within = made_summary(channels=[to_json(replace(one, mae_K=0.2))])
    assert answer([within]).endswith("(0.5 K), 1 reading as the bench file corrects it.")
