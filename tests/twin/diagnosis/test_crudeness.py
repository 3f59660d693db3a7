"""How crude a file is: a mean square in stated sd over what the data determine, of the numbers that all tests share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.motor import every_law, pulses, recorded
from twin.diagnosis.crudeness import USUAL, crudeness, listed
from twin.differences.everyday import everyday
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
HALF = 0.5  # of each number's prior variance is taken by the data


def _fitted(stated: tuple[Parameter, ...], moved: Floats, wider: float = 1.0) -> Fit:
    """A fit whose numbers went `moved` of their stated sd, where their widths have been learnt as `wider` times it."""
    test = recorded(every_law(), pulses(60.0), INITIAL)
    model = Model(every_law(), [test], [replace(one, sd=wider * one.sd) for one in stated])
    sd = np.array([one.sd for one in stated])
    return Fit(model, moved * sd, 0.0, np.diag(1 / (HALF * model.sd**2)), (), 0.0, True, 1)


@pytest.fixture(scope="module")
def stated() -> tuple[Parameter, ...]:
    return everyday(every_law(), [recorded(every_law(), pulses(60.0), INITIAL)])


def test_numbers_that_are_as_far_off_as_stated_are_usual(stated: tuple[Parameter, ...]) -> None:
    as_stated = np.full(len(stated), HALF**0.5)
    assert crudeness(_fitted(stated, as_stated), stated) == pytest.approx(1.0)
    assert crudeness(_fitted(stated, 3 * as_stated), stated) == pytest.approx(3.0)


def test_a_width_that_was_learnt_does_not_hide_how_far_numbers_went(stated: tuple[Parameter, ...]) -> None:
    """Narrowed, all of it is known; wider than stated, none of a number's spread counts twice."""
    moved = np.full(len(stated), 3.0)
    assert crudeness(_fitted(stated, moved, 1e-3), stated) == pytest.approx(3.0)
    assert crudeness(_fitted(stated, moved, 1.2), stated) > crudeness(_fitted(stated, moved), stated)


def test_what_a_test_brings_along_says_nothing_of_the_file(stated: tuple[Parameter, ...]) -> None:
    of_test = np.array([one.test is not None for one in stated])
    assert of_test.any() and not of_test.all()
    assert crudeness(_fitted(stated, np.where(of_test, 9.0, 0.0)), stated) == 0.0


def test_a_name_says_less_the_cruder_the_file_is() -> None:
    assert listed(0.3) == listed(USUAL) == 1.0
    assert 1.0 > listed(USUAL + 0.5) > listed(USUAL + 1.0) > 0.0
    assert listed(USUAL + 0.25) < 0.5, "seven nodes at the least: a name of it is rather none"
