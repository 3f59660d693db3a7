"""Circuits, laws and configurations in motor files, and sessions on another rig."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import written
from replay.errors import MotorFileError
from twin.motor.network import Configuration, Fluid, FluidCircuit, Link, Network, Property, Source, Term

MOTOR = """\
schema = "whyhot.motor/1"
name = "cooled"
[scale]
flow_lpm = 8.0
speed_rpm = 6000.0
[[node]]
name = "winding"
capacity = 900.0
[[node]]
name = "channel_1"
capacity = 200.0
[[node]]
name = "channel_2"
capacity = 200.0
[[boundary]]
name = "coolant"
[[boundary]]
name = "air"
[[link]]
between = ["winding", "channel_1"]
terms = [{coefficient = 12.0, flow = 0.8}]
[[link]]
between = ["winding", "channel_2"]
terms = [{coefficient = 12.0, flow = 0.8}, {coefficient = 0.2, speed = 1, law = "free_convection"}]
[[source]]
node = "winding"
terms = [{coefficient = 90.0, speed = 2}]
[[circuit]]
name = "jacket"
inlet = "coolant"
nodes = ["channel_1", "channel_2"]
fluid = {density = 1050.0, heat_capacity = {degC = [20, 90], value = [3300, 3700.0]}}
[[configuration]]
name = "dry"
remove = ["channel_1", "channel_2"]
[[configuration.link]]
between = ["winding", "air"]
terms = [{coefficient = 0.5, law = "radiation"}]
[[configuration.source]]
node = "winding"
terms = [{coefficient = 40.0}]
"""


def _read(text: str = MOTOR) -> Network:
    return read_motor(text.encode(), "motor.toml")


def test_circuits_laws_and_configurations_are_read() -> None:
    network = _read()
    fluid = Fluid(Property((20.0,), (1050.0,)), Property((20.0, 90.0), (3300.0, 3700.0)))
    assert network.circuits == (FluidCircuit("jacket", "coolant", ("channel_1", "channel_2"), fluid, "flow"),)
    assert [term.law for term in network.links[1].terms] == [None, "free_convection"]
    assert [node.region for node in network.nodes] == ["copper", "fluid", "fluid"]
    assert network.configurations == (
        Configuration(
            "dry",
            ("channel_1", "channel_2"),
            (Link("winding", "air", (Term(0.5, law="radiation"),)),),
            (Source("winding", (Term(40.0, sd=0.15),)),),
        ),
    )
    named = _read(MOTOR.replace('inlet = "coolant"', 'inlet = "coolant"\nflow = "flow_oil"'))
    assert named.circuits[0].flow == "flow_oil"


REFUSED = {
    "inlet": ('inlet = "coolant"', 'inlet = "channel_1"',
        r'^motor\.toml:28: \[\[circuit\]\] 1 \(name "jacket"\): inlet: there is no boundary "channel_1"'),
    "no inlet": ('inlet = "coolant"\n', "", r'^motor\.toml:28: .*inlet is missing: it must be a text'),
    "node": ('nodes = ["channel_1",', 'nodes = ["chanel_1",',
        r'^motor\.toml:28: .*there is no node "chanel_1": did you mean "channel_1"'),
    "twice": ('nodes = ["channel_1",', 'nodes = ["channel_2",',
        r'the fluid flows through "channel_2" twice: split it into two nodes'),
    "no node": ('nodes = ["channel_1", "channel_2"]', "nodes = []",
        r"it has no nodes: name those that the fluid flows through"),
    "no fluid": ("fluid = {", "fluit = {", r'^motor\.toml:32: .*unknown key "fluit"\. Nearest: fluid'),
    "density": ("density = 1050.0", "density = -1.0",
        r"^motor\.toml:32: .*fluid: density must be a number above 0, or a table"),
    "table": ("[20, 90]", "[90, 20]", r"^motor\.toml:28: .*fluid: heat_capacity: its temperatures do not rise"),
    "short table": ("[20, 90]", "[20]", r"heat_capacity has 1 temperatures and 2 values: give as many of each"),
    "key of a table": ("degC = [20, 90]", "degree = [20, 90]", r'^motor\.toml:32: .*unknown key "degree"'),
    "flow": ('inlet = "coolant"', 'inlet = "coolant"\nflow = "speed"',
        r'flow "speed" is no volume flow: write flow, or flow_<name>'),
    "scale": ("flow_lpm = 8.0\n", "", r'feature "flow" has no scale: say in \[scale\] what 1 means for flow'),
    "law": ('law = "radiation"', 'law = "radiaton"',
        r'^motor\.toml:38: \[\[configuration\]\] 1 .*law "radiaton" is none of radiation, free_con'),
    "removed": ('remove = ["channel_1"', 'remove = ["chanel_1"',
        r'^motor\.toml:33: \[\[configuration\]\] 1 \(name "dry"\): remove: there is no node or boundary'),
    "cut off": ('between = ["winding", "air"]', 'between = ["winding", "coolant"]\nx = 1',
        r'^motor\.toml:38: .*unknown key "x"'),
    "of what is gone": ('between = ["winding", "air"]', 'between = ["channel_1", "air"]',
        r'^motor\.toml:33: .*link "channel_1-air": there is no node or boundary "channel_1"'),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_one_is_refused_by_line_and_entry(case: str) -> None:
    old, new, says = REFUSED[case]
    assert old in MOTOR
    with pytest.raises(MotorFileError, match=says) as caught:
        _read(MOTOR.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_numbers_change_where_circuits_and_configurations_stand() -> None:
    changed = _read(MOTOR.replace("90.0, speed", "95.0, speed").replace("0.5, law", "0.6, law"))
    text = written(MOTOR.encode(), "motor.toml", changed, "fitted").decode()
    assert text.replace("# fitted\n", "") == MOTOR.replace("90.0, speed", "95, speed").replace("0.5, law", "0.6, law")
    assert written(MOTOR.encode(), "motor.toml", _read(), "fitted") == MOTOR.encode()


def test_circuits_and_configurations_are_added_to_a_file() -> None:
    bare = (
        MOTOR[: MOTOR.index("[[circuit]]")] + '[[link]]\nbetween = ["winding", "air"]\nterms = [{coefficient = 1.0}]\n'
    )
    wanted = _read(bare + MOTOR[MOTOR.index("[[circuit]]") :])
    assert _read(written(bare.encode(), "motor.toml", wanted, "added").decode()) == wanted


# --- Sessions on another rig -----------------------------------------------------------------------------------------

HOUSED = (
    can_bench.MOTOR
    + """\
[[node]]
name = "housing"
capacity = 2000.0
[[boundary]]
name = "ambient"
[[link]]
between = ["yoke", "housing"]
terms = [{coefficient = 15.0}]
[[link]]
between = ["housing", "ambient"]
terms = [{coefficient = 3.0}, {coefficient = 1.0, law = "radiation"}]
[[configuration]]
name = "bare"
remove = ["housing"]
"""
)  # without its housing it is the motor that was logged


def _folder(folder: Path, motor: str, bench: str) -> Path:
    can_bench.write_files(folder)
    (folder / "motor.toml").write_text(motor, encoding="utf-8")
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    return folder


def _ingest(folder: Path) -> int:
    words = ["ingest", str(folder / "1.blf"), "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    return main([*words, "--store", str(folder / "store")])


def _replay(folder: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["replay", "1", "--json", "--store", str(folder / "store")]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    found: dict[str, Any] = run
    return found


BARE = can_bench.BENCH.replace('specimen = "servo-01"', 'specimen = "servo-01"\nconfiguration = "bare"')


def test_a_session_is_replayed_in_the_configuration_of_its_bench(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _folder(tmp_path, HOUSED, BARE)
    can_bench.write_log(folder / "1.blf", 300)
    assert _ingest(folder) == 0
    run = _replay(folder, capsys)
    assert set(run["mae_K"]) == {"winding", "yoke", "magnet"}
    assert max(run["mae_K"].values()) < 0.2
    assert main(["report", "1", "--store", str(folder / "store"), "--out", str(folder / "report.html")]) == 0
    assert main(["diagnose", "--on", "1", "--store", str(folder / "store")]) == 2
    said = capsys.readouterr().err
    assert 'session 1: is of configuration "bare", and this asks about the whole motor: leave it out here' in said
    assert "`whyhot calibrate` learns from it together with sessions of the whole motor" in said


@pytest.mark.parametrize(
    ("bench", "says"),
    [
        (BARE.replace('"bare"', '"bar"'), 'bench.toml: configuration = "bar" is not in motor.toml. Nearest: bare'),
        (
            BARE.replace('node = "yoke"', 'node = "housing"'),
            '"housing" of signal "TC_yoke" is not there in configuration "bare": take the channel out',
        ),
    ],
)
def test_a_bench_that_its_configuration_contradicts_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bench: str, says: str
) -> None:
    folder = _folder(tmp_path, HOUSED, bench)
    can_bench.write_log(folder / "1.blf", 20)
    assert _ingest(folder) == 2
    assert says in capsys.readouterr().err


def test_time_outside_a_map_is_said_and_the_map_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    iron = "terms = [{coefficient = 90.0, speed = 1.5}]"
    mapped = can_bench.MOTOR.replace(iron, 'terms = [{coefficient = 1.0, map = "iron.csv"}]')
    folder = _folder(tmp_path, mapped.replace("[scale]", "[scale]\ntorque_Nm = 20.0"), can_bench.BENCH)
    (folder / "iron.csv").write_text("n,0,5\n0,0,0\n3000,30,31\n6000,90,92\n", encoding="utf-8")
    can_bench.write_log(folder / "1.blf", 300)
    assert _ingest(folder) == 0
    (folder / "iron.csv").unlink()
    run = _replay(folder, capsys)
    assert 0.0 < run["mae_K"]["yoke"] < 3.0
    with Store.open(folder / "store") as store:
        facts = ledger_facts.at(store.ledger)
        (done,) = facts.runs.values()
    speed, current = can_bench.drive(300, 1)
    share = 100 * float((0.8 * current > 5.0).mean())
    note = done.summary["note"]
    assert note.endswith("% of the time outside the map of yoke: its edge was taken")
    assert float(note.split(" %")[0]) == pytest.approx(share, abs=2.0)
    assert speed.max() < 6000.0


def test_every_verb_that_learns_or_predicts_says_that_a_map_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    iron = "terms = [{coefficient = 90.0, speed = 1.5}]"
    mapped = can_bench.MOTOR.replace(iron, 'terms = [{coefficient = 1.0, map = "iron.csv"}]')
    limited = mapped.replace('name = "winding"\n', 'name = "winding"\nlimit_degC = 60.0\n')
    folder = _folder(tmp_path, limited.replace("[scale]", "[scale]\ntorque_Nm = 20.0"), can_bench.BENCH)
    (folder / "iron.csv").write_text("n,0,5\n0,0,0\n3000,30,31\n6000,90,92\n", encoding="utf-8")
    can_bench.write_log(folder / "1.blf", 420)
    assert _ingest(folder) == 0
    for verb in ("calibrate", "sensors", "envelope"):
        capsys.readouterr()
        assert main([verb, "--on", "1", "--json", "--store", str(folder / "store")]) == 0
        said = capsys.readouterr()
        (note,) = json.loads(said.out)["notes"]
        assert note.startswith("session 1: ")
        assert note.endswith(" % of the time outside the map of yoke: its edge was taken.")
        assert note in said.err
