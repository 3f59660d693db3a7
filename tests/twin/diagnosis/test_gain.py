"""Gain on kept sessions: the density of what was not used, in blocks, and the error above the floor."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from twin.diagnosis.gain import Kept, excess, held_out_gain, log_scores, removes_excess
from twin.errors import EvidenceError
from twin.fitting.noise import Array


def _kept(seed: int, shift: float = 0.0, rows: int = 200) -> Kept:
    """Two channels of one session whose own bias is unknown; `shift` in the later half is a model's error."""
    rng = np.random.default_rng(seed)
    t = np.tile(np.arange(rows) * 10.0, 2)
    columns = np.repeat(np.eye(2), rows, axis=0)
    e = rng.standard_normal(2 * rows) + columns @ rng.normal(0, 0.5, 2) + shift * (t > t.max() / 2)
    return Kept(t, e, columns, np.full(2, 4.0))


def test_block_scores_sum_to_the_density_of_the_rest_given_the_opening() -> None:
    kept = _kept(0, rows=40)
    covariance = np.eye(80) + (kept.columns / kept.precision) @ kept.columns.T
    opening = kept.t_s <= 0.1 * kept.t_s.max()
    joint = multivariate_normal(cov=covariance).logpdf(kept.e)
    first = multivariate_normal(cov=covariance[np.ix_(opening, opening)]).logpdf(kept.e[opening])
    for block_s in (30.0, 100.0, 1e6):
        assert log_scores(kept, block_s).sum() == pytest.approx(joint - first, abs=1e-8)


def test_blocks_are_as_long_as_asked_and_a_short_last_one_is_joined() -> None:
    assert len(log_scores(_kept(0), 200.0)) == 9  # 1,791 s after the opening
    assert len(log_scores(_kept(0), 1e6)) == 1


def test_a_better_model_gains_beyond_the_choice_of_blocks() -> None:
    gain = held_out_gain([_kept(s, shift=0.5) for s in range(2)], [_kept(s) for s in range(2)], 200.0)
    assert len(gain.blocks) == 18 and not gain.few
    assert gain.total > 0 and gain.positive and gain.lower < gain.total


def test_an_equal_model_gains_nothing() -> None:
    gain = held_out_gain([_kept(0)], [_kept(0)], 200.0)
    assert gain.total == 0 and not gain.positive


def test_a_worse_model_is_not_improved() -> None:
    assert not held_out_gain([_kept(1)], [_kept(1, shift=0.5)], 200.0).positive


def test_under_eight_blocks_every_one_may_be_left_out_and_the_answer_says_few() -> None:
    gain = held_out_gain([_kept(2, shift=1.0)], [_kept(2)], 600.0)
    assert gain.few and len(gain.blocks) == 3
    assert gain.lower == pytest.approx(gain.total - gain.blocks.max())
    alone = held_out_gain([_kept(2, shift=1.0)], [_kept(2)], 1e6)
    assert alone.total > 0 and not alone.positive  # one block proves nothing


def test_the_same_answer_on_every_repetition() -> None:
    first, second = (held_out_gain([_kept(3, 0.3)], [_kept(3)], 200.0).lower for _ in range(2))
    assert first == second


def test_models_scored_on_other_rows_are_refused() -> None:
    with pytest.raises(EvidenceError, match="do not hold the same kept rows"):
        held_out_gain([_kept(0)], [_kept(0, rows=100)], 200.0)
    with pytest.raises(EvidenceError, match="do not hold the same kept rows"):
        held_out_gain([_kept(0)], [], 200.0)


def _residuals(size: float) -> Array:
    return size * np.tile([1.0, -1.0], 50)


def test_excess_is_what_is_left_above_the_floor() -> None:
    assert excess(_residuals(2.0), 1.0) == pytest.approx(3.0)
    assert excess(_residuals(0.5), 1.0) == 0.0


def test_half_of_the_excess_of_the_touched_channels_must_go() -> None:
    floor = {"magnet": 0.04, "teeth": 0.04}
    before = {"magnet": _residuals(2.0), "teeth": _residuals(3.0)}
    # Teeth are not touched.
    assert removes_excess(before, {"magnet": _residuals(1.3), "teeth": _residuals(3.05)}, floor)
    assert not removes_excess(before, {"magnet": _residuals(1.6), "teeth": _residuals(3.0)}, floor)
    assert not removes_excess(before, {"magnet": _residuals(0.5), "teeth": _residuals(4.0)}, floor)  # others got worse


def test_where_nothing_is_touched_or_in_excess_nothing_is_removed() -> None:
    assert not removes_excess({"teeth": _residuals(2.0)}, {"teeth": _residuals(1.95)}, {"teeth": 0.04})
    assert not removes_excess({"teeth": _residuals(0.19)}, {"teeth": _residuals(0.0)}, {"teeth": 0.04})
