from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from twin.errors import BadValueError
from twin.motor.check import check
from twin.motor.features import monomials
from twin.motor.network import Configuration, Link, Network, Source, Term
from twin.motor.scaling import SCALE, scaled
from twin.run.initial import conductances

REFERENCE = EXAMPLES / "reference_motor" / "motor.toml"


@pytest.fixture(scope="module")
def reference() -> Network:
    return read_motor(REFERENCE.read_bytes(), "motor.toml")


def _ratio(before: Network, after: Network, a: str, b: str) -> list[float]:
    old = next(link for link in before.links if (link.a, link.b) == (a, b))
    new = next(link for link in after.links if (link.a, link.b) == (a, b))
    return [n.coefficient / o.coefficient for n, o in zip(new.terms, old.terms, strict=True)]


def test_capacities_grow_with_volume_conduction_with_length_and_films_with_area(reference: Network) -> None:
    small = scaled(reference, 0.5)
    check(small)
    capacities = [new.capacity / old.capacity for new, old in zip(small.nodes, reference.nodes, strict=True)]
    assert capacities == pytest.approx([0.125] * 21)
    assert _ratio(reference, small, "teeth", "yoke") == pytest.approx([0.5])
    assert _ratio(reference, small, "jacket", "coolant") == pytest.approx([0.25, 0.25])
    assert _ratio(reference, small, "air_a", "housing") == pytest.approx([0.25, 0.25])
    assert _ratio(reference, small, "rotor_surface", "teeth") == pytest.approx([0.5, 0.25]), "still air, then vortices"


def test_losses_follow_what_makes_them(reference: Network) -> None:
    small = scaled(reference, 0.5)
    ratios = {
        new.node: [n.coefficient / o.coefficient for n, o in zip(new.terms, old.terms, strict=True)]
        for new, old in zip(small.sources, reference.sources, strict=True)
    }
    assert ratios["winding_a"] == pytest.approx([0.5, 0.5**5])
    assert ratios["teeth"] == pytest.approx([0.125, 0.125])
    assert ratios["magnet"] == pytest.approx([0.5**5, 0.5**5])
    assert ratios["bearing_a"] == pytest.approx([0.125])


def test_copper_loss_is_that_of_a_resistance_that_grows_as_the_motor_shrinks(reference: Network) -> None:
    """3 R I^2 at one current in ampere: half the size, twice the resistance."""
    small = scaled(reference, 0.5)
    watt_per_A2 = [m.sources[0].terms[0].coefficient / m.scale["current"] ** 2 for m in (reference, small)]
    assert watt_per_A2[1] / watt_per_A2[0] == pytest.approx(2.0)
    assert small.scale == pytest.approx({"speed": 16000.0, "current": 225.0, "flow": 2.5})
    assert set(reference.scale) <= set(SCALE)


def test_priors_widen_with_the_distance_from_the_known_motor(reference: Network) -> None:
    near, far = scaled(reference, 0.9), scaled(reference, 0.5)
    for i, node in enumerate(reference.nodes):
        assert node.sd < near.nodes[i].sd < far.nodes[i].sd
    assert far.nodes[0].sd == pytest.approx(math.hypot(0.15, 0.2 * math.log(2)), abs=1e-3)
    assert far.links[0].terms[0].sd == pytest.approx(math.hypot(0.4, 0.5 * math.log(2)), abs=1e-3)


def test_there_and_back_gives_the_same_values(reference: Network) -> None:
    back = scaled(scaled(reference, 0.5), 2.0)
    phi = np.ones(len(monomials(reference)))
    np.testing.assert_allclose(conductances(back, phi), conductances(reference, phi), rtol=1e-12)
    assert back.scale == pytest.approx(dict(reference.scale))


def test_copper_without_flags_is_copper_by_its_region(reference: Network) -> None:
    polynomial = replace(
        reference,
        sources=(replace(reference.sources[0], terms=(Term(100.0, {"current": 2.0}), Term(10.0, {"speed": 1.0}))),),
    )
    terms = scaled(polynomial, 0.5).sources[0].terms
    assert [term.coefficient for term in terms] == pytest.approx([50.0, 10.0 / 32])


def test_a_law_of_its_own_is_a_film_and_configurations_scale_along(reference: Network) -> None:
    radiates = Link("endwinding_a_outer", "yoke", (Term(0.3, law="radiation"),))
    free = Configuration("stator_in_air", ("magnet",), (radiates,), (Source("yoke", (Term(8.0),)),))
    (small,) = scaled(replace(reference, configurations=(free,)), 0.5).configurations
    assert small.remove == ("magnet",)
    assert small.links[0].terms[0].coefficient == pytest.approx(0.3 / 4)
    assert small.sources[0].terms[0].coefficient == pytest.approx(1.0)


@pytest.mark.parametrize("length", [0.0, -1.0, 0.05, 20.0, math.inf, math.nan])
def test_a_length_that_leaves_no_similarity_is_refused(reference: Network, length: float) -> None:
    with pytest.raises(BadValueError, match=r'^motor "reference-150kW": length .* give a number from 0\.1 to 10$'):
        scaled(reference, length)
