"""The candidates of a motor: enough of them, each once, each with a size and a column that can be made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.integrator import motor
from twin.diagnosis.evidence import prior_masses
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate, sensor_place
from twin.differences.sizes import Scales, Sigma
from twin.fitting import actions
from twin.motor.causes import groups, parse, says
from twin.motor.features import monomials
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.paths import terms_at
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import Exchange, Lag

NODES = (
    "endwinding_a_inner",
    "endwinding_a_outer",
    "endwinding_b_inner",
    "endwinding_b_outer",
    "teeth",
    "yoke",
    "magnet",
)
CHANNELS = (
    *(Sensor(f"TC_{node}", {node: 1.0}, "can0") for node in NODES),
    Sensor("MAG-2", {"magnet": 1.0}, "can1"),
    Sensor("NTC_1", {"endwinding_a_inner": 0.4, "endwinding_a_outer": 0.6}, "can0"),
)
FLUIDS = ("flow", "coolant", "ambient")
INPUTS = tuple(InputChannel(name, "can0") for name in ("speed", "torque", "current", "flow", "coolant", "ambient"))


@pytest.fixture(scope="module")
def candidates() -> tuple[Candidate, ...]:
    return generate(motor("reference_motor"), CHANNELS, INPUTS)


def _by_id(candidates: Sequence[Candidate]) -> dict[str, Candidate]:
    return {str(c.cause): c for c in candidates}


@pytest.mark.parametrize("channels", [(), CHANNELS])
def test_a_bench_without_inputs_has_no_candidate_of_a_clock(channels: Sequence[Sensor]) -> None:
    kinds = {candidate.cause.kind for candidate in generate(motor("reference_motor"), channels, [])}
    assert "capacity" in kinds and "clock" not in kinds


def test_the_reference_motor_has_hundreds_each_with_an_id_of_its_own(candidates: tuple[Candidate, ...]) -> None:
    assert len(candidates) > 200
    assert len(_by_id(candidates)) == len(candidates)
    for text, candidate in _by_id(candidates).items():
        assert parse(text) == candidate.cause and says(candidate.cause)


@pytest.mark.parametrize(
    "text",
    [
        "loss.magnet.speed2_current2",
        "loss.magnet.scale",
        "loss.magnet.temperature",
        "loss.rotor_surface.speed3",
        "loss.endwinding_b_outer.scale",
        "loss.bearing_a.constant",
        "loss.winding.speed2_current2",
        "conductance.rotor_surface-teeth.speed1.5",
        "conductance.shaft-coolant.constant",
        "conductance.endwinding_a_outer-jacket.constant",
        "conductance.endwinding_outer-jacket.constant",
        "conductance.winding-teeth.scale",
        "conductance.yoke-jacket.session",
        "conductance.jacket-coolant.flow0.8",
        "capacity.endwinding_a_outer.scale",
        "capacity.endwinding_outer.attached",
        "sensor.teeth.lag",
        "sensor.magnet@MAG_2.bias",
        "sensor.endwinding_a_outer@NTC_1.stem",
        "sensor.endwinding_a_outer.gain",
        "sensor.teeth.swap_yoke",
        "clock.can1.offset",
        "input.flow.gain",
        "input.current.bias",
        "boundary.coolant.bias",
        "ageing.winding_a-teeth.hours_above_180degC",
    ],
)
def test_the_causes_that_engineers_look_for_are_among_them(text: str, candidates: tuple[Candidate, ...]) -> None:
    assert text in _by_id(candidates)


def test_no_two_are_made_the_same_way(candidates: tuple[Candidate, ...]) -> None:
    made = [repr(c.action) for c in candidates]
    assert len(set(made)) == len(made)


def test_where_a_loss_or_path_is_one_term_its_scale_stands_for_that_term(candidates: tuple[Candidate, ...]) -> None:
    ids = _by_id(candidates)
    assert "loss.terminal_rack.scale" in ids and "loss.terminal_rack.current2" not in ids
    assert "loss.bearing.scale" in ids and "loss.bearing.speed1.5" not in ids
    assert "conductance.terminal_rack-air_b.constant" not in ids
    assert "loss.magnet.speed2" in ids  # one of two terms


def test_no_path_is_both_there_and_missing(candidates: tuple[Candidate, ...]) -> None:
    network = motor("reference_motor")
    present = {frozenset((link.a, link.b)) for link in network.links}
    missing = [c for c in candidates if c.cause.kind == "conductance" and c.sign == 1]
    assert len(missing) > 50
    for candidate in missing:
        assert isinstance(candidate.action, actions.Added)
        assert all(frozenset(place) not in present for place in candidate.places)


def test_a_group_shares_one_amplitude_between_its_members(candidates: tuple[Candidate, ...]) -> None:
    loss = _by_id(candidates)["loss.winding.speed2_current2"]
    assert loss.members == ("winding_a", "winding_b")
    names = motor("reference_motor").names
    assert isinstance(loss.action, actions.Added)
    assert [names[place.a] for place in loss.action.places] == ["winding_a", "winding_b"]
    path = _by_id(candidates)["conductance.winding-endwinding_inner.scale"]
    assert path.members == ("winding_a-endwinding_a_inner", "winding_b-endwinding_b_inner")
    stems = groups(node.name for node in motor("reference_motor").nodes)
    for candidate in candidates:
        grouped = any(end in stems for end in candidate.cause.ends)
        assert len(candidate.members) == (2 if grouped else 0)


def test_an_added_term_goes_with_copper_as_the_place_s_own_term_does(candidates: tuple[Candidate, ...]) -> None:
    added = _by_id(candidates)["loss.winding_a.speed2_current2"]
    assert isinstance(added.action, actions.Added)
    assert added.action.own == -1
    assert added.added is not None
    assert added.added.exponents == {"speed": 2.0, "current": 2.0}


def test_actions_say_what_is_wrong(candidates: tuple[Candidate, ...]) -> None:
    ids, network = _by_id(candidates), motor("reference_motor")
    air = tuple(network.names.index(name) for name in ("air_a", "air_b"))
    around = [boundary.name for boundary in network.boundaries]
    assert ids["loss.teeth.scale"].action == actions.Scale(terms_at(network, ("teeth",)))
    assert ids["capacity.air.attached"].action == actions.Attached(air, 300.0)
    assert ids["sensor.teeth.swap_yoke"].action == Exchange("TC_teeth", "TC_yoke")
    assert ids["sensor.magnet@MAG_2.lag"].action == Lag("MAG-2")
    assert ids["clock.can1.drift"].action == actions.Late(("MAG-2",), True)
    assert ids["boundary.ambient.bias"].action == actions.BoundaryBias(around.index("ambient"))
    slots = [terms_at(network, place) for place in (("winding_a", "yoke"), ("yoke", "winding_b"))]
    ageing = ids["ageing.winding-yoke.hours_above_180degC"].action
    assert ageing == actions.Course(slots[0] + slots[1], "hours_above_180degC")


def test_only_swaps_are_discrete_and_only_laws_across_sessions_need_a_repeated_kind(
    candidates: tuple[Candidate, ...],
) -> None:
    assert {c.cause.law.startswith("swap_") for c in candidates if c.discrete} == {True}
    assert {c.cause.law for c in candidates if c.repeated} == {"session", "hours_above_180degC"}
    assert any(c.discrete for c in candidates)


def test_sensors_are_exchanged_only_on_one_bus_and_between_places(candidates: tuple[Candidate, ...]) -> None:
    swapped = [c.action for c in candidates if c.discrete]
    assert len(swapped) == 8 * 7 // 2  # MAG-2 is on another bus
    assert all(isinstance(c, Exchange) and "MAG-2" not in (c.channel, c.other) for c in swapped)
    two = (Sensor("A", {"magnet": 1.0}, "can0"), Sensor("B", {"magnet": 1.0}, "can0"))
    assert not any(c.discrete for c in generate(motor("reference_motor"), two, INPUTS))


def test_a_sign_is_known_where_physics_knows_it(candidates: tuple[Candidate, ...]) -> None:
    ids = _by_id(candidates)
    for text in (
        "conductance.shaft-coolant.constant",
        "capacity.magnet.attached",
        "sensor.teeth.lag",
        "loss.housing.constant",
    ):
        assert ids[text].sign == 1
    for text in ("loss.magnet.speed3", "capacity.magnet.scale", "sensor.teeth.bias", "clock.can1.offset"):
        assert ids[text].sign == 0


def _scales(network: Network) -> Scales:
    return Scales(4000.0, {f"{link.a}-{link.b}": sum(t.coefficient for t in link.terms) for link in network.links})


def test_sizes_are_shares_of_the_motor_s_own_scales(candidates: tuple[Candidate, ...]) -> None:
    ids, scales = _by_id(candidates), _scales(motor("reference_motor"))
    expected = {
        "loss.magnet.speed3": 200.0,
        "loss.magnet.scale": np.log(2),
        "conductance.rotor_surface-teeth.speed1.5": 8.3,
        "conductance.teeth-air.speed": 0.8,
        "conductance.shaft-coolant.constant": 0.2 * 18.0,  # of shaft-rotor_core; the coolant's largest is 280
        "capacity.magnet.scale": 0.3,
        "capacity.magnet.attached": 0.3 * 640,
        "sensor.teeth.bias": 3.0,
        "sensor.teeth.stem": 0.05,
        "clock.can1.drift": 100.0,
        "input.speed.gain": 0.05,
        "input.flow.gain": 0.3,
        "input.speed.bias": 320.0,
        "boundary.coolant.bias": 3.0,
        "ageing.winding-teeth.hours_above_180degC": 0.15,
    }
    assert {text: ids[text].sigma.value(scales) for text in expected} == pytest.approx(expected)
    assert all(c.sigma.value(scales) > 0 for c in candidates)


def test_the_rules_travel_with_the_size_of_the_motor(candidates: tuple[Candidate, ...]) -> None:
    ids, scales = _by_id(candidates), _scales(motor("reference_motor"))
    small = Scales(scales.total_loss_W / 30, {place: g / 30 for place, g in scales.conductance_W_per_K.items()})
    for text in ("loss.magnet.speed3", "conductance.rotor_surface-teeth.speed", "conductance.shaft-coolant.constant"):
        assert ids[text].sigma.value(small) == pytest.approx(ids[text].sigma.value(scales) / 30)
    assert ids["sensor.teeth.bias"].sigma.value(small) == 3.0


def test_a_path_to_a_boundary_that_nothing_is_joined_to_is_sized_by_its_node() -> None:
    scales = Scales(100.0, {"rotor-air": 3.0, "air-coolant": 10.0})
    assert Sigma(0.2, "smaller_neighbour", (("rotor", "ambient"),)).value(scales) == pytest.approx(0.6)
    assert Sigma(0.2, "smaller_neighbour", (("rotor", "coolant"),)).value(scales) == pytest.approx(0.6)


def test_the_features_that_added_terms_need_are_listed_once(candidates: tuple[Candidate, ...]) -> None:
    needed = added_monomials(candidates)
    assert len(set(needed)) == len(needed)
    names = {m.name for m in needed}
    assert {"speed3", "speed2_current2", "speed1.5"} <= names and "constant" not in names
    assert set(needed) - set(monomials(motor("reference_motor")))


def test_units_fit_the_kinds(candidates: tuple[Candidate, ...]) -> None:
    ids = _by_id(candidates)
    units = {
        text: ids[text].unit for text in ("loss.magnet.speed3", "loss.magnet.scale", "conductance.air-housing.speed")
    }
    assert units == {
        "loss.magnet.speed3": "W",
        "loss.magnet.scale": "1",
        "conductance.air-housing.speed": "W/K",
    }
    assert (ids["input.speed.bias"].unit, ids["input.flow.bias"].unit) == ("rpm", "lpm")


def test_prior_mass_covers_all_of_them(candidates: tuple[Candidate, ...]) -> None:
    assert prior_masses([c.cause for c in candidates]).sum() == pytest.approx(0.4)


# --- Other motors and benches ----------------------------------------------------------------------------------------


def test_on_one_bus_no_clock_can_be_wrong_and_on_two_only_their_difference_shows() -> None:
    network = motor("reference_motor")
    one = [Sensor(c.name, c.weights, "can0") for c in CHANNELS]
    assert not [c for c in generate(network, one, INPUTS) if c.cause.kind == "clock"]
    two = [Sensor(c.name, c.weights, "logger-3.a") for c in CHANNELS]
    assert [str(c.cause) for c in generate(network, two, INPUTS) if c.cause.kind == "clock"] == [
        "clock.logger_3_a.offset",
        "clock.logger_3_a.drift",
        "clock.logger_3_a.lag",
    ]
    three = [*one, Sensor("X", {"shaft": 1.0}, "can1"), Sensor("Y", {"yoke": 1.0}, "can2")]
    places = {c.cause.place for c in generate(network, three, INPUTS) if c.cause.kind == "clock"}
    assert places == {"can0", "can1", "can2"}


@pytest.mark.parametrize(
    ("sensors", "places"),
    [(("thermo",), {"thermo"}), (("thermo", "telemetry"), {"thermo", "telemetry", "can0"})],
)
def test_a_logger_of_some_inputs_alone_is_no_clock_of_all_of_them(sensors: Sequence[str], places: set[str]) -> None:
    """That all sensors are early is said once, of the logger that drives most; not where one has them all."""
    seen = [Sensor(c.name, c.weights, sensors[i % len(sensors)]) for i, c in enumerate(CHANNELS)]
    given = [InputChannel(name, "cooling" if name in ("flow", "coolant") else "can0") for name in ("speed", *FLUIDS)]
    given += [InputChannel("torque", "can0"), InputChannel("current", "can0")]
    found = [c for c in generate(motor("reference_motor"), seen, given) if c.cause.kind == "clock"]
    assert {c.cause.place for c in found} == places


def test_a_logger_of_one_sensor_has_no_smoothing_of_its_own() -> None:
    some = [*CHANNELS[:2], Sensor("X", {"shaft": 1.0}, "can1")]
    found = {str(c.cause): c for c in generate(motor("reference_motor"), some, INPUTS) if c.cause.kind == "clock"}
    assert found["clock.can0.lag"].action == actions.Slowed(tuple(c.name for c in CHANNELS[:2]))
    assert "clock.can1.lag" not in found


def test_a_boundary_may_be_off_in_one_of_three_sessions_that_have_names_of_their_own() -> None:
    def found(*sessions: str) -> dict[str, int | None]:
        every = generate(motor("reference_motor"), CHANNELS, INPUTS, sessions)
        return {str(c.cause): c.test for c in every if (c.cause.kind, c.cause.place) == ("boundary", "coolant")}

    off = {"boundary.coolant.bias": None}
    assert found("1_s1", "2 s2") == off
    assert found("1_s1", "2 s2", "1_s1") == off | {"boundary.coolant.bias_in_2_s2": 1}
    assert not any(c.sayable for c in generate(motor("reference_motor"), CHANNELS, INPUTS, "abc") if c.test is not None)


def test_what_turns_may_be_read_wrong_with_speed_and_everything_with_current() -> None:
    ids = {str(c.cause) for c in generate(motor("reference_motor"), CHANNELS, INPUTS)}
    assert {"sensor.magnet@MAG_2.speed", "sensor.magnet@MAG_2.current", "sensor.yoke.current"} <= ids
    assert "sensor.yoke.speed" not in ids
    network, still = motor("reference_motor"), [i for i in INPUTS if i.name != "speed"]
    assert not any(c.cause.kind == "sensor" and c.cause.law == "speed" for c in generate(network, CHANNELS, still))


def test_laws_use_only_what_the_bench_measures() -> None:
    without = [i for i in INPUTS if i.name not in ("current", "flow")]
    network = motor("reference_motor")
    for candidate in generate(network, CHANNELS, without):
        if candidate.cause.kind == "loss" and isinstance(candidate.action, actions.Added):
            known = {m for source in network.sources for t in source.terms for m in t.exponents}
            assert set(candidate.cause.exponents) <= {"speed", "torque"} | known


def test_a_bench_that_drives_nothing_has_no_clock_to_be_off() -> None:
    assert not [c for c in generate(motor("reference_motor"), CHANNELS, []) if c.cause.kind == "clock"]
    assert generate(motor("reference_motor"), [], [])


def test_where_no_current_is_known_the_torque_stands_for_it() -> None:
    network = Network(
        "servo",
        (Node("rotor", 100.0, "rotor"), Node("winding", 50.0, "copper")),
        (Boundary("plate"),),
        (Link("winding", "plate", (Term(2.0),)), Link("rotor", "winding", (Term(0.5),))),
        (Source("winding", (Term(40.0, {"torque": 2.0}),)),),
        scale={"speed": 3000.0, "torque": 5.0},
    )
    inputs = [InputChannel(name, "log") for name in ("speed", "torque", "plate")]
    ids = _by_id(generate(network, [Sensor("T", {"winding": 1.0}, "log")], inputs))
    assert "loss.rotor.speed2_torque2" in ids and "loss.winding.scale" in ids
    assert "conductance.rotor-plate.constant" in ids
    assert "loss.winding.torque2" not in ids
    assert not [text for text in ids if "current" in text or "stem" in text or text.startswith("clock")]


def test_the_shipped_public_motor_has_candidates_too() -> None:
    network = motor("hust_motor")
    channels = [Sensor(node, {node: 1.0}, "log") for node in ("winding", "stator", "rotor")]
    inputs = [InputChannel(n, "log") for n in ("speed", "torque", "current", "coolant", "ambient")]
    ids = _by_id(generate(network, channels, inputs))
    assert {"sensor.rotor.swap_rotor", "sensor.winding.swap_stator"} & set(ids) == {"sensor.winding.swap_stator"}
    assert len(ids) > 40


def test_a_sensor_is_named_by_its_node_where_it_is_the_only_one_there() -> None:
    assert [sensor_place(c, CHANNELS) for c in CHANNELS[-3:]] == [
        "magnet@TC_magnet",
        "magnet@MAG_2",
        "endwinding_a_outer@NTC_1",
    ]
    assert sensor_place(CHANNELS[4], CHANNELS) == "teeth"
