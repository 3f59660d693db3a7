from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from twin import errors
from twin.motor.check import check
from twin.motor.network import Boundary, Link, Network, Node, Shape, Source, TemperatureFactor, Term

NETWORK = Network(
    name="two",
    nodes=(Node("winding", 100.0, "copper"), Node("yoke", 200.0, "iron")),
    boundaries=(Boundary("coolant"),),
    links=(Link("winding", "yoke", (Term(1.0),)), Link("yoke", "coolant", (Term(5.0, {"speed": 0.8}),))),
    sources=(Source("winding", (Term(9.0, {"current": 2.0}, copper=True),)),),
    scale={"speed": 1000.0, "current": 100.0},
)

Change = Callable[[Network], Network]


def _link(a: str = "winding", b: str = "coolant", **term: object) -> Change:
    added = Link(a, b, (Term(**{"coefficient": 1.0, **term}),))  # type: ignore[arg-type]
    return lambda n: replace(n, links=(*n.links, added))


def _source(node: str = "yoke", **term: object) -> Change:
    added = Source(node, (Term(**{"coefficient": 1.0, **term}),))  # type: ignore[arg-type]
    return lambda n: replace(n, sources=(*n.sources, added))


def _node(name: str = "shaft", capacity: float = 10.0) -> Change:
    return lambda n: replace(n, nodes=(*n.nodes, Node(name, capacity, "other")))


REFUSED: dict[str, tuple[Change, type[errors.NetworkError], str]] = {
    "name": (_node("Shaft"), errors.BadNameError, 'node "Shaft": a name begins with a-z'),
    "twice": (_node("yoke"), errors.DuplicateError, 'node "yoke": this name is already taken'),
    "boundary": (
        lambda n: replace(n, boundaries=(Boundary("yoke"),)),
        errors.DuplicateError,
        'boundary "yoke": this name is already taken',
    ),
    "cut off": (_node(), errors.CutOffError, 'node "shaft": no path of links or circuits leads to a boundary'),
    "capacity": (_node(capacity=-3.0), errors.BadValueError, 'node "shaft": capacity -3 is not above 0'),
    "capacity denormal": (_node(capacity=1e-320), errors.BadValueError, "is beyond any motor (1e-30 to 1e+30): give"),
    "capacity huge": (_node(capacity=1e308), errors.BadValueError, "capacity 1e+308 is beyond any motor"),
    "coefficient huge": (_link(coefficient=1e308), errors.BadValueError, "1e+308"),
    "capacity nan": (_node(capacity=float("nan")), errors.BadValueError, "capacity nan is not above 0"),
    "scale": (
        lambda n: replace(n, scale={"speed": 0.0}),
        errors.BadValueError,
        'scale "speed": scale 0 is not above 0',
    ),
    "end": (
        _link("windin", "coolant"),
        errors.UnknownNodeError,
        'no node or boundary "windin": did you mean "winding"?',
    ),
    "unlike any": (
        _link("d", "coolant"),
        errors.UnknownNodeError,
        'link "d-coolant": there is no node or boundary "d": known are winding, yoke, coolant',
    ),
    "itself": (_link("yoke", "yoke"), errors.LinkError, 'link "yoke-yoke": both ends are the same'),
    "outside": (
        lambda n: _link("coolant", "air")(replace(n, boundaries=(*n.boundaries, Boundary("air")))),
        errors.LinkError,
        'link "coolant-air": both ends are boundaries',
    ),
    "again": (
        _link("yoke", "winding"),
        errors.DuplicateError,
        'link "yoke-winding": these two are linked above already',
    ),
    "no terms": (
        lambda n: replace(n, links=(*n.links, Link("winding", "coolant", ()))),
        errors.LinkError,
        'link "winding-coolant": it has no terms',
    ),
    "conductance": (_link(coefficient=-1.0), errors.BadValueError, "term 1: coefficient -1 is negative"),
    "zero": (_source(coefficient=0.0), errors.BadValueError, "term 1: coefficient 0 is not a number other than 0"),
    "sd": (_source(sd=0.0), errors.BadValueError, "term 1: sd 0 is not above 0"),
    "source": (_source("yok"), errors.UnknownNodeError, 'source "yok": there is no node "yok": did you mean "yoke"?'),
    "source twice": (
        _source("winding"),
        errors.DuplicateError,
        'source "winding": this node has a source above already',
    ),
    "copper link": (_link(copper=True), errors.FactorError, "copper and resistance belong to losses"),
    "resistance": (_source(resistance=2), errors.FactorError, "resistance 2 is not -1"),
    "both": (_source(resistance=-1, copper=True), errors.FactorError, "copper times resistance -1 is 1"),
    "factor": (
        _source(temperature=TemperatureFactor("magnt", 0.1, 20.0)),
        errors.UnknownNodeError,
        'temperature: there is no node "magnt"',
    ),
    "slope": (
        _source(temperature=TemperatureFactor("yoke", float("inf"), 20.0)),
        errors.BadValueError,
        "slope_per_K and reference_degC must be finite",
    ),
    "feature": (
        _link(exponents={"sped": 1}),
        errors.FeatureError,
        'feature "sped" is not known: did you mean "speed"?',
    ),
    "feature unlike any": (
        _link(exponents={"x": 1}),
        errors.FeatureError,
        'feature "x" is not known: known are speed, current,',
    ),
    "no scale": (
        _source(exponents={"torque": 1}),
        errors.FeatureError,
        'feature "torque" has no scale: say in [scale]',
    ),
    "shape of a link": (
        _link(shape=Shape((0.0, 1.0), (0.1, 0.1), (0.0, 0.0))),
        errors.FactorError,
        "term 1: shape belongs to losses",
    ),
    "shape lengths": (
        _source(shape=Shape((0.0, 1.0), (0.1,), (0.0, 0.0))),
        errors.BadValueError,
        "term 1: shape has 2 speeds, 1 factors and 2 current slopes: give as many of each, at least 2",
    ),
    "shape of one knot": (
        _source(shape=Shape((0.0,), (0.1,), (0.0,))),
        errors.BadValueError,
        "shape has 1 speeds, 1 factors and 1 current slopes",
    ),
    "shape falling": (
        _source(shape=Shape((0.0, 0.5, 0.5), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))),
        errors.BadValueError,
        "term 1: shape: its speeds do not rise from 0 or above",
    ),
    "shape below 0 rpm": (
        _source(shape=Shape((-0.5, 0.5), (0.1, 0.0), (0.0, 0.0))),
        errors.BadValueError,
        "its speeds do not rise from 0 or above",
    ),
    "shape nan": (
        _source(shape=Shape((0.0, 0.5), (0.1, float("nan")), (0.0, 0.0))),
        errors.BadValueError,
        "term 1: shape holds a number that is not finite",
    ),
    "shape without speed": (
        lambda n: _source(shape=Shape((0.0, 1.0), (0.1, 0.1), (0.0, 0.0)))(
            replace(
                n,
                links=(Link("winding", "yoke", (Term(1.0),)), Link("yoke", "coolant", (Term(5.0),))),
                scale={"current": 1.0},
            )
        ),
        errors.FeatureError,
        'term 1: shape: feature "speed" has no scale: say in [scale] what 1 means for speed',
    ),
    "shape without current": (
        lambda n: _source(shape=Shape((0.0, 1.0), (0.1, 0.1), (0.0, 0.1)))(
            replace(n, sources=(), scale={"speed": 1000.0})
        ),
        errors.FeatureError,
        'term 1: shape: feature "current" has no scale',
    ),
    "shape to nothing": (
        _source(shape=Shape((0.0, 0.5), (0.1, -1.0), (0.0, 0.0))),
        errors.BadValueError,
        "term 1: shape makes the loss 0 times itself at 500 rpm and a current of 0: keep it above 0",
    ),
    "shape to nothing by current": (
        _source(shape=Shape((0.0, 0.5), (0.1, 0.2), (-0.8, 0.0))),
        errors.BadValueError,
        "term 1: shape makes the loss -0.1 times itself at 0 rpm and a current of 1.5: keep it above 0",
    ),
    "exponent": (_link(exponents={"speed": -1.0}), errors.FeatureError, "exponent -1: at 0 it would be infinite"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_network_that_cannot_be_a_motor_is_refused_by_its_entry(case: str) -> None:
    change, kind, says = REFUSED[case]
    with pytest.raises(kind) as caught:
        check(change(NETWORK))
    assert says in str(caught.value)


def test_a_sound_network_passes_and_a_loss_may_be_negative() -> None:
    check(NETWORK)
    check(_source(coefficient=-4.0, exponents={"speed": 2.0})(NETWORK))


def test_a_shape_passes_that_leaves_the_loss_its_sign_and_needs_current_only_for_a_slope() -> None:
    flat = Shape((0.25, 0.5, 1.0), (-0.9, 0.0, 4.0), (0.0, 0.0, 0.0))
    without_current = replace(NETWORK, sources=(), scale={"speed": 1000.0})
    check(_source(shape=flat)(without_current))
    check(_source(shape=replace(flat, current_slope=(0.5, -0.6, 0.0)))(NETWORK))
