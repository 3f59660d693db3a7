"""Which candidates an answer lists beside the named ones, and why they were not named."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from replay.studies.diagnosis.answer_parts import OF_FORM, rivals
from twin.diagnosis.evidence import Scores
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Round
from twin.differences.candidates import Candidate
from twin.differences.sizes import Sigma
from twin.fitting.actions import Parameter
from twin.motor import sensor_laws
from twin.motor.causes import Cause


def test_what_moves_too_little_for_a_name_is_listed_with_its_evidence_where_that_is_above_the_threshold() -> None:
    nothing = cast(Any, None)
    ones = np.ones(3)
    candidates = tuple(
        Candidate(Cause("sensor", node, "current"), "K/100 A", Sigma(1.0), 0, sensor_laws.Bias(node)) for node in "abc"
    )
    parameters = tuple(Parameter(str(one.cause), sensor_laws.Bias("T"), 1.0) for one in candidates)
    scores = Scores(ones, ones, ones, 0 * ones, np.array([10.0, 57.0, 30.0]))
    found = Round(nothing, candidates, parameters, scores, nothing, np.array([1.0, 1.0, 9.0]), 3.0, (), ())
    (only,) = rivals(Naming((found,), (), (), nothing, (), 12.0), [])
    assert (only.id, only.log_bayes_factor, only.why_not) == ("sensor.b.current", 57.0, OF_FORM)
    assert found.nameable() == [2] and found.form == 57.0
