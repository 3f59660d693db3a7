"""Readings that jump away and come back are left out of a calibration; pulses and steps are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from made.motor import every_law, pulses, recorded
from twin.calibration.calibrate import calibrate
from twin.calibration.outliers import jumping
from twin.fitting.recorded import Test
from twin.motor.network import Source, Term

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
NOISE = np.full(60, 0.05)


def _tests(spikes: bool) -> list[Test]:
    """The magnets lose twice what the file says; the winding's contact opens for 2 s twice."""
    network = every_law()
    sources = tuple(
        Source(s.node, (Term(160.0, {"speed": 2.0}),)) if s.node == "magnet" else s for s in network.sources
    )
    true = replace(network, name="lossy", sources=sources)
    found = [recorded(network, pulses(900.0, seed=i), INITIAL, true=true, seed=i) for i in range(2)]
    if not spikes:
        return found
    measured = found[0].channels[0].measured.copy()
    measured[[100, 300]] -= 400.0
    return [
        replace(found[0], channels=(replace(found[0].channels[0], measured=measured), *found[0].channels[1:])),
        found[1],
    ]


def test_a_block_that_jumps_and_comes_back_is_one() -> None:
    y = np.sin(np.arange(60) / 10)
    y[20] += 8.0
    assert np.flatnonzero(jumping(y, NOISE)).tolist() == [20]


def test_a_step_that_stays_a_small_jump_and_a_restless_channel_are_none() -> None:
    step = np.where(np.arange(60) < 30, 0.0, 20.0)
    assert not jumping(step, NOISE).any()
    small = np.zeros(60)
    small[20] = 4.0
    assert not jumping(small, NOISE).any()
    restless = np.random.default_rng(1).normal(0, 4.0, 60)
    assert not jumping(restless, NOISE).any()


def test_a_calibration_leaves_them_out_counts_them_and_ends_where_it_would_without() -> None:
    clean, spoilt = calibrate(every_law(), _tests(False)), calibrate(every_law(), _tests(True))
    assert clean.outliers_s == {}
    assert spoilt.outliers_s == {(0, "W_1"): 20.0}
    for one, other in zip(clean.estimates, spoilt.estimates, strict=True):
        assert abs(one.log_change - other.log_change) < 0.5 * one.sd
    magnet = next(e for e in spoilt.estimates if e.name == "loss.magnet.speed2")
    assert abs(magnet.log_change - np.log(2.0)) < 3 * magnet.sd
