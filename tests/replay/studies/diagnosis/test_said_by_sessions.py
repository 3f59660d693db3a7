"""Why sessions left out did not let a candidate in, in the answer's words."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from replay.studies.diagnosis.answer_parts import _said_by_sessions
from twin.diagnosis.left_out import LeftOut
from twin.diagnosis.rounds import Refit, Round
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.motor import sensor_laws

HEAT, GAIN = Parameter("heat", actions.Scale((0,)), 1.0), Parameter("gain", sensor_laws.Gain("T"), 0.05)
BEFORE = LeftOut(np.zeros(4), {"T": np.full(4, 1.0)})


def refit(gained: list[float], error_K: float, parameter: Parameter = HEAT) -> Refit:
    """Above the threshold by evidence; the rest of it is not asked."""
    said = LeftOut(np.array(gained), {"T": np.full(4, error_K)})
    nothing = cast(Any, None)
    return Refit(nothing, parameter, nothing, 20.0, 1.0, 0.1, nothing, 9.0, said)


LET_IN = refit([4.0, 4.0, 4.0, 4.0], 0.5)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (refit([5.0, 5.0, 5.0, 5.0], 1.1), "sessions left out are not clearly nearer with it (1.00 -> 1.10 K)"),
        (
            refit([5.0, 5.0, 5.0, 5.0], 1.1, GAIN),
            "sessions left out are not clearly nearer with it (1.00 -> 1.10 K, against readings as recorded)",
        ),
        (
            refit([9.0, 9.0, 9.0, -3.5], 0.7),
            "sessions left out are nearer with the term that was let in instead (0.50 K, with this one 0.70 K)",
        ),
        (refit([1.0, 1.0, 1.0, 1.0], 0.9), "sessions left out ask for it by 4.0 in ln density, and 6 is needed"),
    ],
)
def test_each_reason_is_said_with_its_figure(other: Refit, why: str) -> None:
    nothing = cast(Any, None)
    one = Round(nothing, (), (), nothing, nothing, nothing, 3.0, (LET_IN, other), (), BEFORE)
    assert one.best is LET_IN
    assert _said_by_sessions(one, other) == why
