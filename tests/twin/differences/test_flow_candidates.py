"""A motor that tells its flows apart has candidates of each: of what it cools, and of its meter."""

from __future__ import annotations

from twin.differences.candidates import InputChannel, added_monomials, generate
from twin.fitting.actions import InputBias, InputGain
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor

CHANNELS = [Sensor("T", {"winding": 1.0}, "can0"), Sensor("Y", {"yoke": 1.0}, "can1")]
INPUTS = [InputChannel(name, "can0") for name in ("current", "flow", "coolant", "oil")]


def cooled(of_yoke: str, of_winding: str) -> Network:
    """A yoke that a jacket cools and a winding that oil cools, each with the flow of that name."""
    return Network(
        "cooled",
        (Node("winding", 900.0, "copper"), Node("yoke", 3500.0, "iron")),
        (Boundary("coolant"), Boundary("oil")),
        (
            Link("winding", "yoke", (Term(12.0),)),
            Link("yoke", "coolant", (Term(25.0), Term(5.0, {of_yoke: 0.8}))),
            Link("winding", "oil", (Term(8.0, {of_winding: 0.6}), Term(1.0))),
        ),
        (Source("winding", (Term(240.0, {"current": 2.0}),)),),
        scale={"current": 20.0, "flow": 5.0},
    )


def following(network: Network) -> set[str]:
    """Ids of the candidates that follow a flow or are an error of one."""
    ids = {str(c.cause) for c in generate(network, CHANNELS, INPUTS)}
    return {one for one in ids if "flow" in one}


def test_each_of_two_flows_has_its_own_laws_and_its_own_meter() -> None:
    assert following(cooled("flow_jacket", "flow_oil")) == {
        *(f"conductance.yoke-coolant.flow_jacket{exponent}" for exponent in ("", "0.5", "0.8")),
        *(f"conductance.winding-oil.flow_oil{exponent}" for exponent in ("", "0.5", "0.6")),
        *(f"conductance.winding-coolant.flow_jacket{exponent}" for exponent in ("", "0.5")),
        *(f"conductance.yoke-oil.flow_oil{exponent}" for exponent in ("", "0.5")),
        *(f"input.{flow}.{law}" for flow in ("flow_jacket", "flow_oil") for law in ("gain", "bias")),
    }


def test_a_motor_of_one_flow_has_it_by_the_name_that_its_laws_use() -> None:
    one = following(cooled("flow_oil", "flow_oil"))
    assert one == {text.replace("flow", "flow_oil") for text in following(cooled("flow", "flow"))}
    assert {"input.flow.gain", "conductance.yoke-coolant.flow0.5"} <= following(cooled("flow", "flow"))


def test_a_flow_whose_name_ends_like_an_exponent_has_no_laws_that_an_id_would_misread() -> None:
    assert following(cooled("flow_jacket_1", "flow_loop1")) == {
        *(f"conductance.yoke-coolant.flow_jacket_1{exponent}" for exponent in ("", "0.5", "0.8")),
        *(f"conductance.winding-coolant.flow_jacket_1{exponent}" for exponent in ("", "0.5")),
        "conductance.winding-oil.flow_loop10.6",
        *(f"input.{flow}.{law}" for flow in ("flow_jacket_1", "flow_loop1") for law in ("gain", "bias")),
    }


def test_what_candidates_of_flows_need_is_made_of_the_motors_own_flows() -> None:
    found = generate(cooled("flow_jacket", "flow_oil"), CHANNELS, INPUTS)
    used = {feature for m in added_monomials(found) for feature in m.features}
    assert {f for f in used if f.startswith("flow")} == {"flow_jacket", "flow_oil"}
    wrong = {c.action.name for c in found if isinstance(c.action, InputGain | InputBias)}
    assert wrong == {"current", "flow_jacket", "flow_oil"}
