"""Cause ids: they round-trip, are written in one way only, and say themselves in words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import CauseError
from twin.motor.causes import BEYOND_FEATURES, FIXED_LAWS, Cause, groups, law, link_place, mirrored, parse, says, spelt
from twin.motor.features import QUANTITY
from twin.motor.network import Boundary, Link, Network, Node, Term

EXAMPLES = (
    "loss.magnet.speed2_current2",
    "loss.magnet.scale",
    "conductance.rotor_surface-teeth.speed1.5",
    "conductance.shaft-coolant.constant",
    "conductance.jacket-coolant.flow0.8",
    "conductance.jacket_1-coolant.flow_jacket_1_temperature",
    "capacity.endwinding_a_outer.scale",
    "sensor.magnet.lag",
    "sensor.magnet@MAG_1.swap_magnet@MAG_2",
    "clock.can2.offset",
    "clock.1_s1.drift",
    "input.flow.gain",
    "boundary.coolant.bias",
    "ageing.winding_a-teeth.hours_above_180degC",
    "loss.bearing_a.session_time",
    "conductance.yoke-jacket.session",
)

names = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
features = st.sampled_from([*QUANTITY, *BEYOND_FEATURES, "hours_above_180degC", "hours_above_155.5degC"])
exponents = st.one_of(st.integers(1, 9).map(float), st.integers(1, 999).map(lambda n: n / 100))
products = st.dictionaries(features, exponents, min_size=1, max_size=4)
sensors = st.one_of(names, st.tuples(names, st.from_regex(r"\w{1,8}", fullmatch=True)).map("@".join))
links = st.lists(names, min_size=2, max_size=2, unique=True).map("-".join)


@st.composite
def causes(draw: st.DrawFn) -> Cause:
    kind = draw(st.sampled_from(sorted(FIXED_LAWS)))
    places = {"conductance": links, "ageing": st.one_of(names, links), "sensor": sensors}
    place = draw(places.get(kind, names))
    laws = [st.sampled_from(FIXED_LAWS[kind])] if FIXED_LAWS[kind] else []
    if kind in ("loss", "conductance"):
        laws.append(products.map(lambda p: law(p.items())))
    if kind == "ageing":
        laws.append(products.map(lambda p: law({**p, "hours_above_180degC": 1.0}.items())))
    if kind == "sensor":
        laws.append(sensors.filter(lambda other: other != place).map(lambda other: f"swap_{other}"))
    return Cause(kind, place, draw(st.one_of(laws)))


@given(causes())
def test_every_cause_comes_back_from_its_id(cause: Cause) -> None:
    assert parse(str(cause)) == cause
    assert says(cause)


@given(products)
def test_a_law_comes_back_as_its_features_and_exponents(product: dict[str, float]) -> None:
    assert parse(f"loss.magnet.{law(product.items())}").exponents == pytest.approx(product)


@given(st.text(max_size=30))
def test_any_text_is_a_cause_that_prints_the_same_or_is_refused_in_one_line(text: str) -> None:
    for candidate in (text, f"loss.magnet.{text}", f"sensor.{text}.lag"):
        try:
            assert str(parse(candidate)) == candidate
        except CauseError as error:
            assert str(error).startswith("cause ") and "\n" not in str(error)


@pytest.mark.parametrize("text", EXAMPLES)
def test_the_ids_of_the_interface_round_trip(text: str) -> None:
    assert str(parse(text)) == text


def test_the_kind_ends_at_the_first_dot_and_the_place_at_the_second() -> None:
    cause = parse("conductance.rotor_surface-teeth.speed1.5")
    assert (cause.kind, cause.place, cause.law) == ("conductance", "rotor_surface-teeth", "speed1.5")
    assert cause.ends == ("rotor_surface", "teeth")
    assert cause.exponents == {"speed": 1.5}


@pytest.mark.parametrize(
    ("text", "says_what"),
    [
        ("loss.magnet", "write kind.place.law, such as loss.magnet.speed2_current2"),
        ("los.magnet.scale", '"los" is no kind; the nearest is loss'),
        ("loss.Magnet.scale", '"Magnet" is no place of a loss: give a node'),
        ("loss.magnet.spede2", '"spede2" is no law of a loss; the nearest is speed'),
        ("loss.magnet.", '"" is no law of a loss; there are scale, constant'),
        ("loss.magnet.current2_speed2", 'the law "current2_speed2" is written speed2_current2'),
        ("loss.magnet.speed1", 'the law "speed1" is written speed'),
        ("loss.magnet.speed2.0", 'the law "speed2.0" is written speed2'),
        ("loss.magnet.speed_speed", 'the law "speed_speed" is written speed2'),
        ("loss.magnet.speed0", '"speed0" is no law of a loss'),
        ("loss.magnet.bias", '"bias" is no law of a loss'),
        ("conductance.teeth.scale", '"teeth" is no place of a conductance: give a link such as rotor_surface-teeth'),
        ("conductance.teeth-teeth.scale", '"teeth-teeth" is no place of a conductance'),
        ("sensor.magnet.flux2", '"flux2" is no law of a sensor; there are bias, gain, lag'),
        ("sensor.magnet.swap_magnet", '"magnet" is no other sensor: give a node, or node@signal'),
        ("sensor.magnet.swap_", '"" is no other sensor'),
        ("ageing.winding_a.speed", "ageing follows a dose: write a law such as hours_above_180degC"),
        ("capacity.magnet.speed", '"speed" is no law of a capacity; there are scale, attached'),
    ],
)
def test_what_cannot_be_a_cause_is_refused_with_what_could_be(text: str, says_what: str) -> None:
    with pytest.raises(CauseError) as refusal:
        parse(text)
    assert str(refusal.value).startswith(f'cause "{text}": ')
    assert says_what in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("loss.magnet.speed2_current2", "magnet loss grows with speed squared and current squared"),
        ("loss.rotor_surface.speed3", "rotor surface loss grows with speed cubed"),
        ("loss.magnet.temperature", "magnet loss changes with its own temperature"),
        ("loss.teeth.scale", "teeth loss is off by one factor at every operating point"),
        (
            "conductance.rotor_surface-teeth.speed1.5",
            "the heat path between rotor surface and teeth grows with speed to the power 1.5",
        ),
        (
            "conductance.shaft-coolant.constant",
            "the heat path between shaft and coolant has a constant part that the model lacks",
        ),
        ("sensor.magnet@MAG_1.lag", "the sensor at magnet (MAG_1) follows more slowly than stated"),
        ("sensor.teeth.swap_yoke", "the sensors at teeth and yoke are exchanged"),
        ("clock.can2.offset", "the stamps of can2 are shifted in time"),
        (
            "ageing.winding_a-teeth.hours_above_180degC",
            "the heat path between winding a and teeth changes with hours above 180 degC",
        ),
    ],
)
def test_a_cause_says_itself_in_plain_words(text: str, words: str) -> None:
    assert says(parse(text)) == words


def test_characters_of_signals_that_ids_cannot_hold_become_underscores() -> None:
    assert spelt("MAG-1.raw value") == "MAG_1_raw_value"


def _network() -> Network:
    nodes = tuple(Node(name, 1.0, "other") for name in ("shaft", "teeth", "rotor"))
    links = (Link("teeth", "shaft", (Term(1.0),)), Link("coolant", "teeth", (Term(1.0),)))
    return Network("small", nodes, (Boundary("coolant"),), links, ())


def test_a_link_is_spelt_as_the_motor_file_writes_it() -> None:
    assert link_place(_network(), "shaft", "teeth") == "teeth-shaft"
    assert link_place(_network(), "teeth", "coolant") == "coolant-teeth"


def test_a_missing_link_is_in_the_order_of_the_nodes_with_boundaries_last() -> None:
    assert link_place(_network(), "rotor", "shaft") == "shaft-rotor"
    assert link_place(_network(), "coolant", "rotor") == "rotor-coolant"


def test_nodes_that_differ_only_in_a_and_b_or_1_and_2_form_a_group_under_their_stem() -> None:
    given_names = ["winding_a", "winding_b", "end_a_inner", "end_b_inner", "jacket_1", "jacket_2", "slot_a"]
    assert groups(given_names) == {
        "winding": ("winding_a", "winding_b"),
        "end_inner": ("end_a_inner", "end_b_inner"),
        "jacket": ("jacket_1", "jacket_2"),
    }
    assert mirrored("jacket_2") == {"jacket": "jacket_1"}


def test_a_stem_that_is_itself_a_node_names_no_group() -> None:
    assert groups(["winding", "winding_a", "winding_b"]) == {}
