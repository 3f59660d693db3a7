"""Which candidates an answer lists beside the named ones, and why they were not named; when a file counts as crude."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from replay.studies.diagnosis.answer_parts import OF_FORM, doubtful, rivals
from replay.studies.diagnosis.kept_sessions import Measured
from twin.diagnosis.evidence import Scores
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Round
from twin.diagnosis.unknown import FreeHeat
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


@pytest.mark.parametrize(
    ("crude", "named", "improved", "said"),
    [
        (3.0, True, None, 3.0),
        (3.0, True, False, 3.0),
        (3.0, True, True, None),
        (3.0, False, None, None),
        (0.9, True, None, None),
    ],
)
def test_a_file_is_called_crude_where_that_may_be_what_is_named_and_kept_sessions_do_not_confirm_it(
    crude: float, named: bool, improved: bool | None, said: float | None
) -> None:
    nothing = cast(Any, None)
    ones = np.ones(0)
    found = Round(nothing, (), (), Scores(ones, ones, ones, ones, ones), nothing, ones, 3.0, (), ())
    heat = cast(FreeHeat, SimpleNamespace(log_bayes_factor=0.0))
    naming = Naming((found,), (nothing,) * named, (), nothing, (heat,), 12.0)
    naming.__dict__["crudeness"] = crude
    kept = None if improved is None else Measured((), 1.0, 0.5, False, improved, None, False, {})
    assert doubtful(naming, kept) == said
