"""Size, sign and place of residuals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from replay.engine.results.residuals import channel_errors, largest_by_node, mean_by_node, where
from replay.engine.results.run import Observed


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
