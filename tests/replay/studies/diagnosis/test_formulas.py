from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from replay.studies.diagnosis.answer_parts import _formula
from replay.studies.diagnosis.formulas import formula, text_diff
from twin.calibration.learned import Size
from twin.fitting.actions import Tilt
from twin.motor.causes import parse
from twin.motor.network import Boundary, Copper, Link, Network, Node, Shape, Source, TemperatureFactor, Term

NETWORK = Network(
    name="two",
    nodes=(Node("magnet", 100.0, "magnet"), Node("yoke", 200.0, "iron")),
    boundaries=(Boundary("coolant"),),
    links=(Link("magnet", "yoke", (Term(1.0),)), Link("yoke", "coolant", (Term(5.0),))),
    sources=(Source("magnet", (Term(9.0),)),),
    copper=Copper(0.0039, 25.0),
    scale={"speed": 16000.0, "current": 450.0, "flow": 10.0, "torque": 220.0},
)


@pytest.mark.parametrize(
    ("term", "place", "says"),
    [
        (
            Term(96.0, {"current": 2.0, "speed": 2.0}),
            "magnet",
            "loss of magnet [W] += 96 (n/16000 rpm)^2 (I/450 A)^2",
        ),
        (Term(-3.25, {"torque": 1.0, "speed": 0.0}), "yoke", "loss of yoke [W] -= 3.25 (M/220 Nm)"),
        (Term(2.0), "magnet-yoke", "conductance magnet to yoke [W/K] += 2"),
        (
            Term(8.0, {"flow_jacket": 0.8, "hours_above_180degC": 1.0}),
            "yoke-coolant",
            "conductance yoke to coolant [W/K] += 8 (V_jacket/10 l/min)^0.8 (hours above 180 degC/1 h)",
        ),
        (Term(5.0, {"flow": 0.8}), "yoke-coolant", "conductance yoke to coolant [W/K] += 5 (V/10 l/min)^0.8"),
        (
            Term(7.0, {"current": 2.0}, copper=True),
            "yoke",
            "loss of yoke [W] += 7 (I/450 A)^2 (1 + 0.0039/K (T_yoke - 25 degC))",
        ),
        (
            Term(7.0, {"current_q": 2.0}, resistance=-1, temperature=TemperatureFactor("magnet", -0.001, 20.0)),
            "yoke",
            (
                "loss of yoke [W] += 7 (I_q/450 A)^2 / (1 + 0.0039/K (T_yoke - 25 degC)) "
                "(1 - 0.001/K (T_magnet - 20 degC))"
            ),
        ),
        (
            Term(9.1, {"speed": 1.6}, shape=Shape((0.0, 0.5), (-0.1, 0.25), (0.0, 0.0))),
            "yoke",
            "loss of yoke [W] += 9.1 (n/16000 rpm)^1.6 f(n), f = 0.9 at 0, 1.25 at 8000 rpm, linear between",
        ),
        (
            Term(9.1, shape=Shape((0.0, 0.5), (0.0, 0.25), (0.0, -0.03))),
            "yoke",
            "loss of yoke [W] += 9.1 f(n, I), f = 1 at 0, 1.25 - 0.03 I/450 A at 8000 rpm, linear between",
        ),
    ],
)
def test_a_term_is_a_formula_with_numbers_and_units(term: Term, place: str, says: str) -> None:
    assert formula(term, place, NETWORK) == says


def test_a_diff_shows_what_changed_with_one_line_around_it() -> None:
    before = b"\xef\xbb\xbfa = 1\r\nb = 2\r\nc = 3\r\nd = 4\r\n"
    assert text_diff(before, b"a = 1\nb = 2\nc = 5\nd = 4\n") == "@@ -2,3 +2,3 @@\n b = 2\n-c = 3\n+c = 5\n d = 4"


def test_equal_texts_have_no_diff() -> None:
    assert text_diff(b"a = 1\n", b"a = 1\r\n") == ""


def test_a_change_with_temperature_has_the_unit_of_its_size() -> None:
    candidate = SimpleNamespace(cause=parse("loss.stator.temperature"), action=Tilt((), (), ()), added=None, unit="W")
    refit: Any = SimpleNamespace(candidate=candidate)
    said = _formula(refit, Size(-0.0895, -0.11, -0.07, "1/K", None), NETWORK)
    assert said == "loss.stator.temperature = -0.0895 1/K"
