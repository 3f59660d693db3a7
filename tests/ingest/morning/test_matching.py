"""Two runs laid beside each other by where they were driven."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ingest.morning.matching import Matched, blocks, driven_by, match
from made.channels import channel

HOLDS = [(0, 0, 120), (3000, 20, 300), (5000, 10, 300), (0, 0, 120)]  # rpm, Nm, s


def _matched(first: ArrayLike, second: ArrayLike) -> Matched:
    runs = []
    for holds in (first, second):
        n, m, seconds = np.array(holds).T
        runs.append([channel("n", "speed", np.repeat(n, seconds)), channel("M", "torque", np.repeat(m, seconds))])
    by = driven_by(*runs)
    assert by == ("speed", "torque")
    return match(blocks(runs[0], 1, by), blocks(runs[1], 1, by), by)


def test_the_same_run_matches_itself_second_by_second() -> None:
    found = _matched(HOLDS, HOLDS)
    assert (found.first == found.second).all()
    assert found.matched_s == 840
    assert set(found.stretch) == {0}


def test_a_longer_rest_is_left_out_and_what_follows_is_another_stretch() -> None:
    found = _matched(HOLDS, [(0, 0, 720), *HOLDS[1:]])
    assert found.matched_s == 840
    assert (found.second[120:] - found.first[120:] == 600).all()
    assert found.stretch.tolist() == [0] * 120 + [1] * 720
    assert found.since_s[120] == 0.0


def test_of_a_longer_hold_the_beginning_is_taken() -> None:
    found = _matched(HOLDS, [HOLDS[0], (3000, 20, 400), *HOLDS[2:]])
    assert (found.second[:420] == found.first[:420]).all()
    assert (found.second[420:] - found.first[420:] == 100).all()


def test_a_hold_at_another_load_is_no_match() -> None:
    found = _matched(HOLDS, [*HOLDS[:1], (3000, 22, 300), *HOLDS[2:]])
    assert found.matched_s == 540


def test_less_than_a_minute_in_common_is_chance() -> None:
    assert not len(_matched([(3000, 20, 50), (1000, 5, 300)], [(3000, 20, 50), (2000, 5, 300)]).first)
