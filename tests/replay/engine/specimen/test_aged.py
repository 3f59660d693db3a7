"""Sessions of an ageing specimen: what it went through before changes its network, by the law or as its checks say."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from ingest.catalogue.channels import load
from ingest.facts import facts as ledger_facts
from ingest.facts.events import AgeingAssessed, ReplayCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from plant import insulation_campaign
from plant.bare_stator_motor import CONFIGURATION
from plant.tables import STYLES, Column, write_table
from plant.timeline import Plan
from replay.cli import main
from replay.engine.files.configurations import network_of
from replay.engine.files.models import publish_model
from replay.engine.frame.frame_of import as_fed, session_frame
from replay.engine.results.artefacts import read_parquet, to_parquet
from replay.engine.results.as_json import to_json
from replay.engine.runs.runs import replay
from replay.engine.specimen.aged import OfSpecimen, ageing_left_out, hours_of, law_of, of_specimen, states_left
from replay.errors import ReplayDataError
from twin.compiled.integrators import DEFAULT
from twin.insulation.ageing_state import Check, State, by_law, filtered, onwards
from twin.motor.ageing_law import Ageing

STYLE = STYLES["english"]
MONDAY = datetime.fromisoformat("2026-03-02T08:00:00+00:00")
SLOT_W_per_K, HEAT_W = 12.0, 90.0
LAW = Ageing(above_degC=180.0, percent_per_100h=-30.0, sd=2.0)
PLAIN = f"""\
schema = "whyhot.motor/1"
name = "stator"
[scale]
current_A = 10.0
speed_rpm = 1000.0
[[node]]
name = "winding"
capacity = 900.0
[[node]]
name = "teeth"
capacity = 300.0
[[boundary]]
name = "air"
[[link]]
between = ["winding", "teeth"]
terms = [{{coefficient = {SLOT_W_per_K}}}]
[[link]]
between = ["teeth", "air"]
terms = [{{coefficient = 5.0}}]
[[source]]
node = "winding"
terms = [{{coefficient = {HEAT_W}, current = 2}}]
"""
AGEING = "ageing = {above_degC = 180, percent_per_100h = -30, sd = 2}"
AGED = PLAIN.replace(f"= {SLOT_W_per_K}}}", f"= {SLOT_W_per_K}, {AGEING}}}")
COUNTED = PLAIN.replace(f"= {SLOT_W_per_K}}}]", f"= {SLOT_W_per_K}}}, {{coefficient = 0.1, hours_above_180degC = 1}}]")
TURNING = PLAIN.replace("current = 2}", "current = 2}, {coefficient = 500.0, speed = 1}")
BOTH_WAYS_h, SOAK_h = 2.0, 12.0
DOSE_h = SOAK_h + 2 * BOTH_WAYS_h * 50.0 / 205.0  # from 25 to 230 degC and back


def bench(kind: str, channels: Mapping[str, str], motor: bool = True) -> str:
    text = f'schema = "whyhot.bench/1"\nkind = "{kind}"\n{STYLE.toml}'
    text = text.replace(f'kind = "{kind}"\n', f'kind = "{kind}"\n' + 'motor = "motor.toml"\n' * motor)
    for signal, rest in channels.items():
        text += f'\n[[channel]]\nsignal = "{signal}"\n{rest}\n'
    return text


def place(node: str) -> str:
    return f'quantity = "temperature"\nunit = "degC"\nnode = "{node}"\nnoise = 0.1'


LOAD = {
    "I": 'quantity = "current"\nunit = "A"',
    "T_winding": place("winding"),
    "T_teeth": place("teeth"),
    "T_air": place("air"),
}
CHECK = {**LOAD, "I": 'quantity = "current_dc"\nunit = "A"'}


def loaded(path: Path, start: datetime) -> None:
    """An hour at full current, from equilibrium: the model alone says what becomes of it."""
    t_s = np.arange(0.0, 3601.0, 2.0)
    still = np.full(t_s.size, 25.0)
    columns = [Column("I", "A", np.full(t_s.size, 10.0), 1)]
    write_table(path, STYLE, start, t_s, [*columns, *(Column(name, "degC", still, 1) for name in list(LOAD)[1:])])


def baked(path: Path, start: datetime, signal: str = "T_winding") -> None:
    knots_s = np.array([0.0, BOTH_WAYS_h, BOTH_WAYS_h + SOAK_h, 2 * BOTH_WAYS_h + SOAK_h]) * 3600.0
    t_s = np.arange(0.0, knots_s[-1] + 1.0, 60.0)
    degC = np.interp(t_s, knots_s, [25.0, 230.0, 230.0, 25.0])
    write_table(path, STYLE, start, t_s, [Column(signal, "degC", degC, 2)])


def taken_in(folder: Path, log: str, bench_file: str, specimen: str | None) -> None:
    words = ["ingest", str(folder / log), "--bench", str(folder / bench_file), "--store", str(folder / "store")]
    assert main([*words, *(["--specimen", specimen] if specimen else [])]) == 0


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Specimen S1: an hour of load, an oven cycle, the same load again, another cycle. S2: an oven cycle without a
    temperature, load. A load without a specimen, and a DC check."""
    folder = tmp_path_factory.mktemp("aged")
    (folder / "motor.toml").write_text(PLAIN, encoding="utf-8")
    for name, text in (("aged", AGED), ("counted", COUNTED), ("turning", TURNING)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    room = {"T_oven": 'quantity = "temperature"\nunit = "degC"\nnode = "air"'}
    for name, text in (
        ("load", bench("s1", LOAD)),
        ("oven", bench("ageing", {"T_winding": place("winding")})),
        ("room", bench("ageing", room)),
        ("check", bench("dc_check", CHECK)),
    ):
        (folder / f"bench_{name}.toml").write_text(text, encoding="utf-8")
    for log, after_h in (("new", 0.0), ("old", 30.0), ("unnamed", 200.0), ("S2_load", 330.0), ("dc", 400.0)):
        loaded(folder / f"{log}.csv", MONDAY + timedelta(hours=after_h))
    baked(folder / "oven_1.csv", MONDAY + timedelta(hours=5.0))
    baked(folder / "oven_2.csv", MONDAY + timedelta(hours=40.0))
    baked(folder / "S2_oven.csv", MONDAY + timedelta(hours=300.0), "T_oven")
    for log, rig, specimen in (
        ("new", "load", "S1"),
        ("oven_1", "oven", "S1"),
        ("old", "load", "S1"),
        ("oven_2", "oven", "S1"),
        ("unnamed", "load", None),
        ("S2_oven", "room", "S2"),
        ("S2_load", "load", "S2"),
        ("dc", "check", "S3"),
    ):
        taken_in(folder, f"{log}.csv", f"bench_{rig}.toml", specimen)
    return folder


@dataclass(frozen=True)
class Opened:
    """The store of the campaign, and its facts as a test wants them."""

    folder: Path
    store: Store
    facts: Facts
    work: Path

    def model(self, motor: str) -> str:
        return publish_model(self.store, self.folder / f"{motor}.toml")

    def of(self, session: str, motor: str) -> OfSpecimen:
        model, now = self.model(motor), ledger_facts.at(self.store.ledger)
        one = now.session(session)
        return of_specimen(self.store, self.facts, one, network_of(self.store, now, one, model))

    def run(self, session: str, motor: str) -> ReplayCompleted:
        model, now = self.model(motor), ledger_facts.at(self.store.ledger)
        known = replace(now, assessments=self.facts.assessments)
        event = replay(self.store, known, now.session(session), model, "testing", DEFAULT.name, self.work).event
        assert isinstance(event, ReplayCompleted)
        return event

    def with_states(self, *left: tuple[str, float, State | None], degC: float = 180.0) -> Opened:
        """An assessment of S1 beside those known: (session, hours from Monday, the state left) of each check."""
        checks = [
            {
                "session": session,
                "start_ns": round((MONDAY + timedelta(hours=h)).timestamp() * 1e9),
                "left": state and asdict(state),
            }
            for session, h, state in left
        ]
        answer = {"threshold_degC": degC, "specimens": [{"specimen": "S1", "checks": checks}]}
        data = json.dumps(answer).encode()
        event = AgeingAssessed(
            assessment=sha256(data).hexdigest()[:16],
            key={},
            answer=self.store.archive.seal(data),
            artefacts={},
            sessions=[],
            digest="",
        )
        known = {**self.facts.assessments, event.assessment: event}
        return replace(self, facts=replace(self.facts, assessments=known))


@pytest.fixture
def opened(campaign: Path, tmp_path: Path) -> Iterator[Opened]:
    with Store.open(campaign / "store", write=True) as store:
        yield Opened(campaign, store, ledger_facts.at(store.ledger), tmp_path)


def difference_K(opened: Opened, event: ReplayCompleted) -> float:
    """Winding minus teeth at the end, when all is steady: the heat over the conductance between them."""
    table = read_parquet((opened.work / event.artefacts["temperatures"]).read_bytes())
    return float(table["winding_degC"][-1].as_py() - table["teeth_degC"][-1].as_py())


def dose(h: float) -> Any:
    return pytest.approx(h, abs=0.01)


# --- The law ---------------------------------------------------------------------------------------------------------


def test_the_second_load_is_replayed_with_the_conductance_that_the_oven_left(opened: Opened) -> None:
    new, old = (opened.run(session, "aged") for session in ("new", "old"))
    assert difference_K(opened, new) == pytest.approx(HEAT_W / SLOT_W_per_K, rel=1e-4)
    left = 0.7 ** (DOSE_h / 100.0)
    assert difference_K(opened, old) == pytest.approx(HEAT_W / (SLOT_W_per_K * left), rel=1e-4)
    assert difference_K(opened, opened.run("old", "motor")) == pytest.approx(HEAT_W / SLOT_W_per_K, rel=1e-4)


def test_a_run_says_in_key_and_summary_how_old_its_specimen_was(opened: Opened) -> None:
    new, old = (opened.run(session, "aged") for session in ("new", "old"))
    (entry,) = old.summary["ageing"]
    law = by_law(entry["dose_h"], LAW)
    assert entry == {
        "places": ["winding-teeth"],
        "above_degC": 180.0,
        "dose_h": dose(DOSE_h),
        "factor": pytest.approx(law.factor, abs=1e-9),
        "sd": pytest.approx(law.ln_factor_sd, abs=1e-9),
        "from": "law",
    }
    assert old.key["ageing"] == old.summary["ageing"]
    assert (new.summary["ageing"][0]["dose_h"], new.summary["ageing"][0]["factor"]) == (0.0, 1.0)
    plain = opened.run("old", "motor")
    assert "ageing" not in plain.key
    assert "ageing" not in plain.summary
    assert opened.run("old", "aged").run == old.run
    assert opened.run("old", "aged").digest == old.digest


def test_hours_above_a_temperature_are_a_feature_of_replays(opened: Opened) -> None:
    old = opened.run("old", "counted")
    assert old.summary["hours"] == {"hours_above_180degC": dose(DOSE_h)}
    assert difference_K(opened, old) == pytest.approx(HEAT_W / (SLOT_W_per_K + 0.1 * DOSE_h), rel=1e-3)
    assert opened.run("new", "counted").summary["hours"] == {"hours_above_180degC": 0.0}
    one = opened.facts.session("old")
    for motor, hours in (("counted", old.summary["hours"]), ("aged", {})):
        network = network_of(opened.store, ledger_facts.at(opened.store.ledger), one, opened.model(motor))
        assert hours_of(opened.store, opened.facts, one, network) == hours


@pytest.mark.parametrize("motor", ["aged", "counted"])
def test_a_session_without_specimen_is_refused(opened: Opened, motor: str) -> None:
    with pytest.raises(
        ReplayDataError, match=r"^session unnamed: names no specimen, .* above 180 degC before: ingest it again"
    ):
        opened.of("unnamed", motor)


@pytest.mark.parametrize("motor", ["aged", "counted"])
def test_a_session_behind_an_oven_without_temperatures_is_refused(opened: Opened, motor: str) -> None:
    says = (
        "^session S2_load: the hours of S2 above 180 degC are not known, as its session S2_oven of kind ageing has no t"
    )
    with pytest.raises(ReplayDataError, match=says):
        opened.of("S2_load", motor)


def test_such_sessions_are_replayed_with_a_motor_without_ageing(opened: Opened) -> None:
    assert opened.run("unnamed", "motor").summary["mae_K"]
    assert opened.run("S2_load", "motor").summary["mae_K"]


def test_verbs_that_take_a_specimen_as_new_say_so(opened: Opened) -> None:
    facts, model = opened.facts, opened.model("aged")
    known = ledger_facts.at(opened.store.ledger)
    (line,) = ageing_left_out(opened.store, known, [facts.session("new"), facts.session("old")], model)
    assert line.startswith("session old: winding-teeth taken as new; 13 h above 180 degC have left 0.955 of it")
    assert ageing_left_out(opened.store, known, [facts.session("unnamed")], opened.model("motor")) == []


# --- The state that checks leave -------------------------------------------------------------------------------------

LEFT = State(10.0, -0.08, 0.01, -0.4, 0.03, 0.2)


def test_a_session_goes_on_from_the_state_that_the_last_check_before_it_left(opened: Opened) -> None:
    earlier = replace(LEFT, dose_h=0.0, ln_factor=0.0)
    known = opened.with_states(("a", 2.0, earlier), ("b", 28.0, LEFT), ("c", 60.0, replace(LEFT, ln_factor=-1.0)))
    (entry,) = known.of("old", "aged").ageing
    state = onwards(LEFT, entry.dose_h, LAW)
    assert entry.dose_h == dose(DOSE_h)
    assert entry.factor == pytest.approx(np.exp(-0.08 - 0.4 * (DOSE_h - 10.0) / 100.0), abs=1e-4)
    assert (entry.factor, entry.sd) == pytest.approx((state.factor, state.ln_factor_sd), abs=1e-9)
    assert entry.from_ == list(known.facts.assessments)[-1]
    run, by_its_law = known.run("old", "aged"), opened.run("old", "aged")
    assert difference_K(known, run) == pytest.approx(HEAT_W / (SLOT_W_per_K * entry.factor), rel=1e-4)
    assert run.run != by_its_law.run
    assert run.key["ageing"] == [to_json(entry)]


def test_before_the_first_check_there_is_only_the_law(opened: Opened) -> None:
    known = opened.with_states(("b", 28.0, LEFT))
    assert known.of("new", "aged").ageing[0].from_ == "law"


def test_the_latest_assessment_of_the_specimen_counts(opened: Opened) -> None:
    known = opened.with_states(("b", 28.0, LEFT)).with_states(("b", 28.0, replace(LEFT, ln_factor=-0.2)))
    assert known.of("old", "aged").ageing[0].from_ == list(known.facts.assessments)[-1]
    without = known.with_states(("b", 28.0, None))
    assert without.of("old", "aged").ageing[0].from_ == "law"


def test_of_a_fleet_whose_answer_holds_a_part_the_state_is_in_its_table(opened: Opened) -> None:
    row = {"specimen": "S1", "session": "b", "start_ns": round((MONDAY + timedelta(hours=28)).timestamp() * 1e9)}
    left = json.dumps(asdict(LEFT))
    rows = [{**row, "left": None}, {**row, "left": left}, {**row, "specimen": "S2", "left": "{}"}]
    known = opened.with_states()
    archive = opened.store.archive
    answer = json.dumps({"threshold_degC": 180.0, "specimens": [], "whole": {"specimens": 2}}).encode()
    table = to_parquet(pa.Table.from_pylist(rows))
    (name, event) = list(known.facts.assessments.items())[-1]
    event = replace(event, answer=archive.seal(answer), artefacts={"checks": archive.seal(table)})
    known = replace(known, facts=replace(known.facts, assessments={name: event}))
    (entry,) = known.of("old", "aged").ageing
    assert entry.from_ == name
    assert entry.factor == pytest.approx(onwards(LEFT, entry.dose_h, LAW).factor, abs=1e-9)


def test_a_state_of_hours_above_another_temperature_is_not_taken(opened: Opened) -> None:
    assert opened.with_states(("b", 28.0, LEFT), degC=200.0).of("old", "aged").ageing[0].from_ == "law"


def test_a_state_is_that_of_insulation_and_no_other_place_takes_it(opened: Opened) -> None:
    motor = (opened.folder / "aged.toml").read_text(encoding="utf-8")
    housed = motor.replace("coefficient = 5.0", f"coefficient = 5.0, {AGEING}")
    (opened.folder / "both.toml").write_text(housed, encoding="utf-8")
    known = opened.with_states(("b", 28.0, LEFT))
    assert [(one.places, one.from_ == "law") for one in known.of("old", "both").ageing] == [
        (["winding-teeth"], False),
        (["teeth-air"], True),
    ]
    assert [one.places for one in opened.of("old", "both").ageing] == [["winding-teeth", "teeth-air"]]


def test_as_of_an_earlier_time_later_assessments_and_sessions_are_not_known(campaign: Path, tmp_path: Path) -> None:
    shutil.copytree(campaign, tmp_path / "copy")
    with Store.open(tmp_path / "copy" / "store", write=True) as store:
        here = Opened(tmp_path / "copy", store, ledger_facts.at(store.ledger), tmp_path).with_states(("b", 28.0, LEFT))
        (event,) = here.facts.assessments.values()
        before = max(one.position for one in store.ledger.events())
        store.ledger.append(f"ageing-{event.assessment}", event)
        later = replace(here, facts=ledger_facts.at(store.ledger))
        earlier = replace(here, facts=ledger_facts.at(store.ledger, str(before)))
        assert later.of("old", "aged").ageing[0].from_ == event.assessment
        assert earlier.of("old", "aged").ageing[0].from_ == "law"
        taken_in = [one.position for one in store.ledger.events() if getattr(one.event, "name", "") == "oven_1"]
        only_new = replace(here, facts=ledger_facts.at(store.ledger, str(min(taken_in) - 1)))
        assert [one.name for one in only_new.facts.sessions] == ["new"]
        assert only_new.of("new", "aged").ageing[0].dose_h == 0.0


def test_checks_leave_states_where_they_have_dose_and_resistance(opened: Opened) -> None:
    known = [Check(0.0, math.log(0.050), 0.03), Check(24.0, math.log(0.053), 0.02)]
    ((first, *none, last),) = states_left([[known[0], None, None, known[1]]], LAW)
    assert none == [None, None]
    (expected,) = filtered([known], LAW)
    assert [State(**(one or {})) for one in (first, last)] == list(expected)
    (entry,) = opened.with_states(("b", 28.0, expected[0])).of("old", "aged").ageing
    assert entry.factor == pytest.approx(by_law(DOSE_h, LAW).factor, abs=1e-4)


def test_the_law_beforehand_is_that_of_the_model(opened: Opened) -> None:
    model = opened.model("aged")
    known = ledger_facts.at(opened.store.ledger)
    assert law_of(opened.store, known, model, 180.0) == LAW
    assert law_of(opened.store, known, None, 180.0).rate == 0.0


# --- DC checks -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motor", ["motor", "turning"])
def test_a_dc_check_gives_the_current_and_stands_still(opened: Opened, motor: str) -> None:
    event = opened.run("dc", motor)
    assert difference_K(opened, event) == pytest.approx(HEAT_W / SLOT_W_per_K, rel=1e-4)


def test_a_session_of_another_kind_needs_its_speed_and_its_current(opened: Opened) -> None:
    with pytest.raises(ReplayDataError, match='session new: the motor file uses "speed"'):
        opened.run("new", "turning")
    check = opened.facts.session("dc")
    channels = load(opened.store, opened.facts, check)
    network = network_of(opened.store, ledger_facts.at(opened.store.ledger), check, opened.model("motor"))
    with pytest.raises(ReplayDataError, match='the motor file uses "current"'):
        session_frame(replace(check, kind="s1"), channels, network)


def test_a_current_that_is_recorded_as_such_comes_before_current_dc(opened: Opened) -> None:
    check = opened.facts.session("dc")
    channels = load(opened.store, opened.facts, check)
    (direct,) = (one for one in channels if one.spec.quantity == "current_dc")
    both = [*channels, replace(direct, spec=replace(direct.spec, name="I_phase", quantity="current"))]
    network = network_of(opened.store, ledger_facts.at(opened.store.ledger), check, opened.model("motor"))
    assert [one.spec.name for one in as_fed(check, both, network) if one.spec.quantity == "current"] == ["I_phase"]
    moving = [*both, replace(direct, spec=replace(direct.spec, name="n", quantity="speed"))]
    assert [one.spec.name for one in as_fed(check, moving, network) if one.spec.quantity == "speed"] == ["n"]


def test_a_bare_stator_is_replayed_in_free_air_whatever_its_motor_needs_when_it_turns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = Plan(stators=1, cycles=1, early_stops=0.0, dead=0.0, electrical=False, configuration=CONFIGURATION)
    written = insulation_campaign.write(tmp_path / "logs", seed=4, plan=plan)
    motor = tmp_path / "logs" / "motor.toml"
    turning = motor.read_text(encoding="utf-8").replace("[scale]", "[scale]\nspeed_rpm = 1000.0")
    iron = '[[source]]\nnode = "yoke"\nterms = [{coefficient = 300.0, speed = 1.5}]\n\n[[configuration]]'
    motor.write_text(turning.replace("[[configuration]]", iron, 1), encoding="utf-8")
    store = ["--store", str(tmp_path / "store")]
    assert main([*written.ingest[0], *store]) == 0
    capsys.readouterr()
    assert main(["replay", "dc_01", "--json", *store]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert 80.0 < run["hot_spots"]["winding"]["max_degC"] < 180.0
    assert {node: run["mae_K"][node] for node in ("teeth", "yoke")} == pytest.approx(
        {"teeth": 0.0, "yoke": 0.0}, abs=3.0
    )
