"""The benchmark of plans: a long run goes in pieces, and its tables are of all that was asked."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import numpy as np

from benchmarks.plan_power import Kept, Trial, table

ASKED = {"first": 4000, "hours": 4.0, "minutes": np.inf, "hide": None, "quick": False}
HID = Trial(
    seed=4007,
    cause="loss.yoke.scale",
    size=1.3,
    promised=(1.0, 7.5),
    came=None,
    said=("silent", "class"),
    false=(0, 1),
    stated=((0.97, True), (0.6, False)),
)


def test_a_finished_trial_is_read_back_where_the_same_is_asked_again(tmp_path: Path) -> None:
    asked = Namespace(**ASKED, cache=tmp_path)
    assert Kept.of(asked, tmp_path).trial(7) is None
    Kept.of(asked, tmp_path).added(HID)
    again = Kept.of(asked, tmp_path)
    assert again.trial(7) == HID
    assert again.trial(6) is None
    assert Kept.of(Namespace(**{**ASKED, "hours": 1.5}, cache=tmp_path), tmp_path).trial(7) is None


def test_what_was_promised_stands_beside_the_share_that_was_named_at_the_nearest_promise() -> None:
    rows = {row.split()[0]: row.split() for row in table([HID])[1:5]}
    assert rows["8"] == ["8", "1", "-", "100%", "0%", "0%"]
    assert rows["5"][1] == "0"
