"""A motor with a water jacket and an oil spray, two flows: which channel is which, and every verb that learns from
them.

The truth is integrated here, its equations written out by hand; the file knows the spray's film as half of what it is.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.configurations import network_of
from replay.engine.frame.frame_of import session_frame
from replay.studies.sessions.recorded import test_of as as_test
from twin.motor.features import Monomial

Floats = NDArray[np.float64]

MOTOR = """\
schema = "whyhot.motor/1"
name = "sprayed"
[scale]
speed_rpm = 6000.0
current_A = 20.0
flow_lpm = 5.0
[[node]]
name = "winding"
capacity = 900.0
limit_degC = 180.0
[[node]]
name = "yoke"
capacity = 3500.0
[[node]]
name = "jacket"
capacity = 400.0
region = "fluid"
[[node]]
name = "spray"
capacity = 300.0
region = "fluid"
[[boundary]]
name = "coolant"
[[boundary]]
name = "oil"
[[link]]
between = ["winding", "yoke"]
terms = [{coefficient = 12.0}]
[[link]]
between = ["yoke", "jacket"]
terms = [{coefficient = 30.0, flow_jacket = 0.8}]
[[link]]
between = ["winding", "spray"]
terms = [{coefficient = 8.0, flow_oil = 0.6}]
[[source]]
node = "winding"
terms = [{coefficient = 240.0, current = 2.0, copper = true}]
[[source]]
node = "yoke"
terms = [{coefficient = 90.0, speed = 1.5}]
[[circuit]]
name = "jacket"
inlet = "coolant"
nodes = ["jacket"]
fluid = {density = 1050.0, heat_capacity = 3500.0}
flow = "flow_jacket"
[[circuit]]
name = "oil"
inlet = "oil"
nodes = ["spray"]
fluid = {density = 820.0, heat_capacity = 2000.0}
flow = "flow_oil"
"""

HEAD = """\
schema = "whyhot.bench/1"
motor = "motor.toml"
specimen = "sprayed-01"
[time]
column = "t"
unit = "s"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "I"
quantity = "current"
unit = "A"
"""
TEMPERATURES = "".join(
    f'[[channel]]\nsignal = "T_{node}"\nquantity = "temperature"\nunit = "degC"\nnode = "{node}"\nbias_sd = 0.1\n'
    for node in ("winding", "yoke", "jacket", "spray", "coolant", "oil")
)


def channel(signal: str) -> str:
    return f'[[channel]]\nsignal = "{signal}"\nquantity = "flow"\nunit = "l/min"\n'


def derived(name: str, expression: str) -> str:
    return f'[[derived]]\nname = "{name}"\nquantity = "flow"\nunit = "l/min"\nexpression = "{expression}"\n'


NAMED = HEAD + TEMPERATURES + derived("flow_jacket", "Fj") + derived("flow_oil", "Fo")
SECONDS, PER_SECOND = 600, 10


def _jumping(low: float, high: float, hold_s: int, random: np.random.Generator) -> Floats:
    return np.repeat(random.uniform(low, high, SECONDS // hold_s), hold_s)


def signals(seed: int) -> Mapping[str, Floats]:
    """What the table's columns hold, a row a second: every input is held over its second."""
    random = np.random.default_rng(seed)
    speed, current = (values[::10] for values in can_bench.drive(SECONDS, seed))
    jacket, oil = _jumping(3.0, 6.0, 60, random), _jumping(1.0, 4.0, 50, random)
    coolant, entering = 40.0 + 0.01 * (np.arange(SECONDS) % 7), 35.0 + 0.01 * (np.arange(SECONDS) % 5)
    films = 30.0 * (jacket / 5) ** 0.8, 16.0 * (oil / 5) ** 0.6
    carried = 1050.0 * 3500.0 * jacket / 60_000, 820.0 * 2000.0 * oil / 60_000
    iron, copper = 90.0 * (np.abs(speed) / 6000) ** 1.5, 240.0 * (current / 20) ** 2
    winding, yoke, water, spray = 45.0, 42.0, 40.5, 36.0
    shown = []
    for k in range(SECONDS):
        shown.append((winding, yoke, water, spray))
        for _ in range(PER_SECOND * 2):
            h = 0.5 / PER_SECOND
            to_yoke, to_water, to_oil = (
                12.0 * (winding - yoke),
                films[0][k] * (yoke - water),
                films[1][k] * (winding - spray),
            )
            made = copper[k] * (1 + can_bench.ALPHA * (winding - 20.0))
            winding += h * (made - to_yoke - to_oil) / 900
            yoke += h * (iron[k] + to_yoke - to_water) / 3500
            water += h * (to_water - carried[0][k] * (water - coolant[k])) / 400
            spray += h * (to_oil - carried[1][k] * (spray - entering[k])) / 300
    read = np.array(shown) + random.normal(0.0, 0.05, (SECONDS, 4))
    inputs = {"t": np.arange(SECONDS, dtype=np.float64), "n": speed, "I": current, "Fj": jacket, "Fo": oil}
    nodes = dict(zip(("T_winding", "T_yoke", "T_jacket", "T_spray"), read.T, strict=True))
    return {**inputs, **nodes, "T_coolant": coolant, "T_oil": entering}


def ingested(folder: Path, bench: str, motor: str = MOTOR, kinds: tuple[str, ...] = ("s1",)) -> Path:
    """A store with a session of each kind, named `1_<kind>` and so on."""
    (folder / "motor.toml").write_text(motor, encoding="utf-8")
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    for number, kind in enumerate(kinds, start=1):
        columns = signals(number)
        rows = [",".join(columns), *(",".join(f"{v:.6g}" for v in row) for row in zip(*columns.values(), strict=True))]
        log = folder / f"{number}_{kind}.csv"
        log.write_text("\n".join(rows) + "\n", encoding="utf-8")
        words = ["--bench", str(folder / "bench.toml"), "--kind", kind, "--store", str(folder / "store")]
        assert main(["ingest", str(log), *words]) == 0
    return folder / "store"


# --- The verbs that learn --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ingested(tmp_path_factory.mktemp("flows"), NAMED, kinds=("s1", "s2", "wltp"))


def said(store: Path, *words: str) -> dict[str, Any]:
    target = store.parent / "answer.json"
    assert main([*words, "--json", str(target), "--store", str(store)]) == 0
    answer: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return answer


def test_a_calibration_learns_from_two_flows(store: Path) -> None:
    answer = said(store, "calibrate", "--on", "1_s1", "2_s2")
    found = {one["name"]: one for one in answer["parameters"]}
    spray = found["conductance.winding-spray.flow_oil0.6"]
    assert spray["value"] == pytest.approx(16.0, rel=0.05)


def test_a_protocol_runs_with_two_flows(store: Path) -> None:
    answer = said(store, "protocol", "--on", "1_s1", "2_s2", "3_wltp")
    assert answer["checked"][0]["before_mae_K"]["winding"] > 1.0
    assert answer["checked"][0]["after_mae_K"]["winding"] < 0.3


def test_a_diagnosis_names_which_of_two_flows_is_wrong(tmp_path: Path) -> None:
    bench = HEAD + TEMPERATURES + derived("flow_jacket", "Fj") + derived("flow_oil", "2 * Fo")
    motor = MOTOR.replace("coefficient = 8.0", "coefficient = 16.0")
    store = ingested(tmp_path, bench, motor, ("s1", "s2", "wltp"))
    answer = said(store, "diagnose", "--on", "1_s1", "2_s2", "3_wltp")
    (cause,) = answer["causes"]
    assert cause["id"] == "input.flow_oil.gain"
    assert 0.3 < cause["estimate"] < 1.1  # 1, less what the prior and the film of the spray take


def test_a_test_holds_each_flow_that_the_motor_tells_apart(store: Path) -> None:
    with Store.open(store) as opened:
        known = facts.at(opened.ledger)
        session = known.session("1_s1")
        network = network_of(opened, known, session, next(iter(known.models)))
        test = as_test(opened, known, session, network, [Monomial((("flow_oil", 2.0),))], "testing")
    truth = signals(1)
    assert [name for name in test.inputs if name.startswith("flow")] == ["flow_jacket", "flow_oil"]
    for name, signal in (("flow_jacket", "Fj"), ("flow_oil", "Fo")):
        np.testing.assert_allclose(test.inputs[name], truth[signal][: test.inputs[name].size] / 5.0, rtol=1e-4)


# --- Which channel is which ------------------------------------------------------------------------------------------

ONE_FLOW = MOTOR.replace("flow_jacket", "flow_oil")  # the same oil in both circuits
PLAIN = MOTOR.replace("flow_jacket = 0.8", "flow = 0.8").replace('flow = "flow_jacket"', 'flow = "flow"')


def refused(folder: Path, bench: str, motor: str, capsys: pytest.CaptureFixture[str]) -> str:
    store = ingested(folder, bench, motor)
    capsys.readouterr()
    assert main(["replay", "--store", str(store)]) == 2
    return capsys.readouterr().err.strip()


NOT_CALLED_SO = (
    'session 1_s1: the motor file uses "{feature}", and no channel of this session is called so (of flow there are: '
    "{there}): "
    'add a [[derived]] of that name, or a [[channel]] where a signal has it, with quantity = "flow" to the bench file.'
)


@pytest.mark.parametrize(
    ("flows", "feature", "there"),
    [
        (channel("Fj") + channel("Fo"), "flow_jacket", "Fj, Fo"),
        (channel("Fj"), "flow_jacket", "Fj"),
        (channel("Fj") + derived("flow_jacket", "Fj"), "flow_oil", "Fj, flow_jacket"),
        ("", "flow_jacket", "none"),
    ],
    ids=["two without names", "one for two circuits", "one named", "none"],
)
def test_of_two_flows_none_takes_the_channel_of_the_other(
    flows: str, feature: str, there: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = refused(tmp_path, HEAD + TEMPERATURES + flows, MOTOR, capsys)
    assert found == NOT_CALLED_SO.format(feature=feature, there=there)


def inputs(folder: Path, bench: str, motor: str) -> Mapping[str, Floats]:
    store = ingested(folder, bench, motor)
    with Store.open(store) as opened:
        known = facts.at(opened.ledger)
        session = known.session("1_s1")
        network = network_of(opened, known, session, next(iter(known.models)))
        return as_test(opened, known, session, network, (), "testing").inputs


def test_the_only_flow_of_a_motor_is_the_only_one_that_is_measured(tmp_path: Path) -> None:
    found = inputs(tmp_path, HEAD + TEMPERATURES + channel("Fo"), ONE_FLOW)
    assert [name for name in found if name.startswith("flow")] == ["flow_oil"]
    np.testing.assert_allclose(found["flow_oil"], signals(1)["Fo"][: found["flow_oil"].size] / 5.0, rtol=1e-4)


def test_of_two_channels_the_only_flow_of_a_motor_is_the_one_of_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "named").mkdir()
    (tmp_path / "not").mkdir()
    bench = HEAD + TEMPERATURES + channel("Fj")
    found = inputs(tmp_path / "named", bench + derived("flow_oil", "Fo"), ONE_FLOW)
    np.testing.assert_allclose(found["flow_oil"], signals(1)["Fo"][: found["flow_oil"].size] / 5.0, rtol=1e-4)
    assert refused(tmp_path / "not", bench + channel("Fo"), ONE_FLOW, capsys) == NOT_CALLED_SO.format(
        feature="flow_oil", there="Fj, Fo"
    )


def test_plain_flow_is_the_channel_that_is_not_called_as_another_flow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    bench = HEAD + TEMPERATURES + channel("Fj") + derived("flow_oil", "Fo")
    found = inputs(tmp_path / "one", bench, PLAIN)
    truth = signals(1)
    np.testing.assert_allclose(found["flow"], truth["Fj"][: found["flow"].size] / 5.0, rtol=1e-4)
    np.testing.assert_allclose(found["flow_oil"], truth["Fo"][: found["flow_oil"].size] / 5.0, rtol=1e-4)
    assert refused(tmp_path / "two", bench + channel("Fo"), PLAIN, capsys) == (
        'session 1_s1: 2 channels give flow (Fj, Fo): set role = "ignored" on all but one.'
    )


@pytest.mark.parametrize(
    ("motor", "flows", "columns"),
    [
        (MOTOR, derived("flow_jacket", "Fj") + derived("flow_oil", "Fo"), {"flow_jacket_lpm", "flow_oil_lpm"}),
        (PLAIN, channel("Fj") + derived("flow_oil", "Fo"), {"flow_lpm", "flow_oil_lpm"}),
        (ONE_FLOW, channel("Fo"), {"flow_oil_lpm"}),
        (PLAIN.replace("flow_oil", "flow"), channel("Fo"), {"flow_lpm"}),
    ],
    ids=["two names", "one name", "a name for one", "no name"],
)
def test_an_envelope_finds_every_flow_by_the_name_that_the_motor_has_for_it(
    motor: str, flows: str, columns: set[str], tmp_path: Path
) -> None:
    store = ingested(tmp_path, HEAD + TEMPERATURES + flows, motor)
    with Store.open(store) as opened:
        known = facts.at(opened.ledger)
        session = known.session("1_s1")
        network = network_of(opened, known, session, next(iter(known.models)))
        frame = session_frame(session, load(opened, known, session), network)
    assert {name for name in frame.inputs if name.endswith("_lpm")} == columns
    assert said(store, "envelope", "--on", "1_s1")["schema"] == "whyhot.envelope/1"


def test_flows_that_no_law_of_the_motor_follows_are_no_question(tmp_path: Path) -> None:
    still = MOTOR.split("[[circuit]]")[0].replace(", flow_jacket = 0.8", "").replace(", flow_oil = 0.6", "")
    still += '[[link]]\nbetween = ["jacket", "coolant"]\nterms = [{coefficient = 200.0}]\n'
    still += '[[link]]\nbetween = ["spray", "oil"]\nterms = [{coefficient = 60.0}]\n'
    (tmp_path / "two").mkdir()
    (tmp_path / "one").mkdir()
    two = inputs(tmp_path / "two", HEAD + TEMPERATURES + channel("Fj") + channel("Fo"), still)
    one = inputs(tmp_path / "one", HEAD + TEMPERATURES + channel("Fj"), still)
    assert set(two) == {"speed", "current"}
    assert set(one) == {"speed", "current", "flow"}  # what is wrong may go with it
