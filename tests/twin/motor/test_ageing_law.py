"""The law of deterioration: what a dose multiplies a coefficient by, and the network as a specimen has it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from twin.motor.ageing_law import Ageing, AgeingPlace, AgeingTerm, aged, ageing_places, insulation_law, with_ageing
from twin.motor.configured import configured
from twin.motor.network import Boundary, Configuration, Link, Network, Node, Source, Term

LAW = Ageing(above_degC=180.0, percent_per_100h=-3.0, sd=1.0)
LOSS = Ageing(above_degC=155.0, percent_per_100h=20.0, sd=5.0)
SLOT = AgeingTerm(12.0, {"speed": 0.5}, sd=0.3, law="radiation", ageing=LAW)
MOTOR = Network(
    "motor",
    (Node("winding", 900.0, "copper"), Node("teeth", 500.0, "iron"), Node("housing", 2000.0, "housing")),
    (Boundary("air"),),
    (
        Link("teeth", "winding", (SLOT, Term(3.0))),
        Link("teeth", "housing", (Term(40.0),)),
        Link("winding", "housing", (Term(0.2),)),
        Link("housing", "air", (Term(5.0),)),
    ),
    (Source("winding", (AgeingTerm(100.0, ageing=LOSS),)),),
    configurations=(Configuration("bare", links=(Link("winding", "teeth", (Term(11.0),)),)),),
)
SLOT_PLACE, LOSS_PLACE = AgeingPlace("teeth-winding", True, LAW), AgeingPlace("winding", False, LOSS)


def after(dose_h: float, law: Ageing) -> float:
    return math.exp(law.rate * law.counting_100h(0.0, dose_h))


def test_a_dose_of_100_h_changes_a_coefficient_by_the_percentage_and_200_h_twice() -> None:
    assert after(0.0, LAW) == 1.0
    assert after(100.0, LAW) == pytest.approx(0.97)
    assert after(200.0, LAW) == pytest.approx(0.97**2)
    assert after(100_000.0, Ageing(180.0, -90.0, 1.0)) >= 0.0


def test_nothing_changes_before_the_dose_at_which_the_change_begins() -> None:
    late = replace(LAW, from_h=60.0)
    assert after(60.0, late) == 1.0
    assert after(160.0, late) == pytest.approx(0.97)
    assert late.counting_100h(30.0, 110.0) == 0.5
    assert late.counting_100h(70.0, 110.0) == pytest.approx(0.4)


def test_the_sd_of_the_rate_is_what_the_sd_in_percent_does_to_its_logarithm() -> None:
    above = Ageing(180.0, LAW.percent_per_100h + 1e-4, 1.0)
    assert LAW.rate_sd == pytest.approx((above.rate - LAW.rate) / 1e-4 * LAW.sd, rel=1e-4)


def test_the_law_of_a_conductance_is_that_of_its_resistance_the_other_way_round() -> None:
    law = Ageing.of_resistance(180.0, 3.0, 0.5, 40.0)
    assert law.rate == pytest.approx(-0.03)
    assert law.rate_sd == pytest.approx(0.005)
    assert (law.above_degC, law.from_h) == (180.0, 40.0)
    assert law.percent_per_100h == pytest.approx(100 * (math.exp(-0.03) - 1))


def test_where_a_motor_has_no_law_for_a_temperature_nothing_is_known_of_the_rate() -> None:
    assert insulation_law(MOTOR, 180.0) == LAW
    for network, degC in ((MOTOR, 155.0), (None, 155.0)):
        assert insulation_law(network, degC) == Ageing(155.0, 0.0, 5.0)


def test_insulation_is_a_link_of_copper_and_iron_whichever_way_round() -> None:
    assert ageing_places(MOTOR) == (SLOT_PLACE, LOSS_PLACE)


def test_an_aged_network_has_other_coefficients_and_no_law_left() -> None:
    found = aged(MOTOR, {SLOT_PLACE: 0.9, LOSS_PLACE: 1.5})
    assert found.links[0].terms == (Term(12.0 * 0.9, {"speed": 0.5}, sd=0.3, law="radiation"), Term(3.0))
    assert found.sources[0].terms == (Term(150.0),)
    assert found.links[1:] == MOTOR.links[1:]
    assert ageing_places(found) == ()
    assert found.configurations == MOTOR.configurations


def test_a_network_without_ageing_stays_as_it_is() -> None:
    plain = replace(MOTOR, links=MOTOR.links[1:], sources=())
    assert aged(plain, {}) is plain


def test_the_insulation_of_every_rig_gets_the_law_and_nothing_else_does() -> None:
    plain = aged(MOTOR, {SLOT_PLACE: 1.0, LOSS_PLACE: 1.0})
    given = with_ageing(plain, LAW)
    assert ageing_places(given) == (SLOT_PLACE,)
    assert [isinstance(term, AgeingTerm) for term in given.links[0].terms] == [True, True]
    assert ageing_places(configured(given, "bare")) == (AgeingPlace("winding-teeth", True, LAW),)
    assert aged(given, {SLOT_PLACE: 1.0}).links == plain.links
