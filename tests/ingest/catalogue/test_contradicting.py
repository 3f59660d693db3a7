"""Logs of one session that say other things of one channel at the same time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.at_once import counted
from ingest.catalogue.channels import ChannelData
from ingest.catalogue.contradicting import contradicting
from made.channels import channel

Floats = NDArray[np.float64]
T_s = np.arange(1200.0)
NAMES = {"a": "EM7.blf", "b": "EM9.blf"}


def _of_two(one: Floats, other: Floats, t_s: Floats = T_s, other_t_s: Floats = T_s, name: str = "Speed") -> ChannelData:
    """A speed in two logs, with a noise of 1 rpm."""
    random = np.random.default_rng(1)
    stamps, values = np.concatenate([t_s, other_t_s]), np.concatenate([one, other])
    order = np.argsort(stamps, kind="stable")
    whole = channel(name, "speed", (values + random.normal(0, 1, values.size))[order], t_s=stamps[order])
    log = np.repeat([0, 1], [one.size, other.size])[order]
    return replace(whole, raw=log, raws=("a", "b")).with_beside(counted(whole.t_ns, whole.value, log))


def _said(*channels: ChannelData) -> list[str]:
    return [flag.says for flag in contradicting(channels, NAMES.__getitem__)]


def test_two_motors_in_one_session_are_told_with_a_way_out() -> None:
    (says,) = _said(*(_of_two(np.full(1200, 6000.0), np.full(600, 5000.0), T_s, T_s[:600] + 100.5, x) for x in "ABCD"))
    assert says.startswith("EM7.blf and EM9.blf hold other values of the same channels at the same time (in the ")
    assert "A 6000 and 5000 rpm, B 6000 and 5000 rpm, C 6000 and 5000 rpm, and 1 more)" in says
    assert says.endswith("`whyhot correct LOG --specimen S` or `whyhot retract LOG` takes it out of this session")


def test_the_same_speed_logged_twice_is_none() -> None:
    swings = 3000 + 2000 * np.sin(T_s / 30)
    assert _said(_of_two(swings, swings)) == []
    assert _said(_of_two(swings, 3000 + 2000 * np.sin(T_s[::5] / 30 + 0.01), T_s, T_s[::5] + 0.3)) == []


def test_a_log_that_fills_the_pause_of_another_one_contradicts_nothing() -> None:
    away = (T_s >= 400) & (T_s < 800)
    assert _said(_of_two(np.full(800, 6000.0), np.full(400, 1000.0), T_s[~away], T_s[away])) == []
    assert _said(_of_two(np.full(600, 6000.0), np.full(600, 1000.0), T_s[:600], T_s[600:])) == []
