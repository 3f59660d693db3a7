"""Kept sessions: the error is told apart by whether training visited that speed and current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.motor import CHANNELS, Drive, every_law, recorded, smooth
from replay.studies.diagnosis.answer import KeptGain
from replay.studies.diagnosis.as_recorded import AsRecorded, measured_as_recorded
from replay.studies.diagnosis.kept_sessions import Measured, measured
from twin.diagnosis.swaps import exchanged
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor import sensor_laws
from twin.motor.features import terms

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
QUIET = {channel: ChannelNoise(0.05, 60.0, 0.01, 600.0) for channel in CHANNELS}
LONG_S = 1600.0


def _test(current: float, late: float) -> Test:
    """A motor with more copper loss than its file says; `current` from the start, `late` in the second half."""
    drive: Drive = {**smooth(LONG_S), "speed": np.full_like(smooth(LONG_S)["speed"], 0.5)}
    half = np.arange(len(drive["speed"])) < len(drive["speed"]) // 2
    drive = {**drive, "current": np.where(half, current, late)}
    network = every_law()
    copper = network.sources[0]
    more = replace(copper, terms=(replace(copper.terms[0], coefficient=560.0), *copper.terms[1:]))
    true = replace(network, sources=(more, *network.sources[1:]))
    return recorded(network, drive, INITIAL, true=true, seed=1)


def _fitted(train: Test, *parameters: Parameter) -> Fit:
    own = [*(Parameter(f"bias.{c}", sensor_laws.Bias(c), 0.3, 0) for c in CHANNELS), *parameters]
    return fit(Model(every_law(), [train], own, QUIET), np.zeros(len(own)))


def _gain(kept: Test) -> KeptGain:
    train = _test(0.5, 0.5)
    copper = [term.coefficient for term in terms(every_law())].index(500.0)
    before, after = _fitted(train), _fitted(train, Parameter("copper", actions.Scale((copper,)), 0.3))
    (found,) = [g for g in measured(before, after, [train], [kept], named=False).gain if g.node == "winding"]
    return found


def test_errors_where_training_was_and_where_it_was_not_are_told_apart() -> None:
    gain = _gain(_test(0.5, 0.95))
    assert gain.outside_trained_share == pytest.approx(0.5)
    inside, outside = gain.rms_inside_K, gain.rms_outside_K
    assert len(inside) == len(outside) == 2
    assert outside[0] > 2 * inside[0] > 0.2, "copper loss grows with the square of a current that training never saw"
    assert inside[1] < 0.2 and outside[1] < 0.2, "and is known once its coefficient is"


def test_where_no_kept_time_was_there_is_no_error() -> None:
    assert _gain(_test(0.5, 0.5)).rms_outside_K == []
    assert _gain(_test(0.95, 0.95)).rms_inside_K == []


def test_exchanged_channels_of_a_kept_session_may_have_gaps_and_stamps_of_their_own() -> None:
    """One of them was open for ten minutes, and is logged by another logger; nothing counts that only one can say."""
    train, kept = _test(0.5, 0.5), _test(0.5, 0.95)
    winding, yoke, *others = kept.channels
    samples = np.where(np.arange(len(yoke.samples)) < 400, yoke.samples, 0.0)
    yoke = replace(yoke, samples=samples, place=np.full(len(samples), 0.2))
    kept = replace(kept, channels=(winding, yoke, *others))
    right = exchanged([kept], winding.name, yoke.name)
    found = measured(_fitted(train), _fitted(train), [train], [kept], True, right)
    gain = {one.node: one for one in found.gain}
    assert found.log_score_gain is not None and found.log_score_gain < 0, "they were not exchanged"
    assert gain["winding"].mae_after_K > gain["winding"].mae_before_K
    assert gain["magnet"].mae_after_K == pytest.approx(gain["magnet"].mae_before_K, abs=1.0)


def _gained(**residual_K: float) -> tuple[Measured, dict[str, AsRecorded]]:
    """A gain at all nodes that improved, and replays that are off by so much at the winding; W_1 reads 0.5 K less."""
    train = _test(0.5, 0.5)
    kept = replace(measured(_fitted(train), _fitted(train), [train], [train], named=False), improved=True)
    runs = {when: AsRecorded({"W_1": np.full(10, off)}, {"W_1": -0.5}) for when, off in residual_K.items()}
    return kept, runs


def test_a_gain_that_readings_as_recorded_do_not_show_is_none() -> None:
    kept, runs = _gained(published=3.0, before=1.0, after=-1.2)
    found = measured_as_recorded(kept, [_test(0.5, 0.5)], runs, ())
    (winding,) = [gain for gain in found.gain if gain.node == "winding"]
    assert winding.mae_recorded_K == pytest.approx({"published": 3.0, "before": 1.0, "after": 1.2})
    assert winding.reading_moved_K == -0.5
    assert not found.improved and "1.00 -> 1.20 K" in str(found.why)
    kept, runs = _gained(published=3.0, before=1.0, after=-1.002)
    why = measured_as_recorded(kept, [_test(0.5, 0.5)], runs, ()).why
    assert "1.000 -> 1.002 K" in str(why), "as many digits as tell them apart"
    assert all(gain.mae_recorded_K == {} for gain in found.gain if gain.node != "winding"), "nothing was read there"
    assert measured_as_recorded(kept, [_test(0.5, 0.5)], runs, {"W_1"}).improved, "a reading that is known to be wrong"
    assert measured_as_recorded(kept, [_test(0.5, 0.5)], {}, ()).improved, "no file, no replay"
