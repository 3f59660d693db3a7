"""DC checks of the plant's bare stator through the configuration that their bench file names, from logs in a store."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from plant import insulation_campaign
from plant.bare_stator_motor import CONFIGURATION, motor_toml
from plant.insulation_campaign import Check
from plant.timeline import Plan
from replay.cli import main
from replay.engine.files.models import publish_model
from replay.engine.files.motor_file import read_motor
from replay.studies.ageing.configured_checks import LoggedCheck, Rig, evaluate_checks, logged_check, models_of
from replay.studies.motors.new import template
from twin.fitting.recorded import Test
from twin.insulation.check_tests import iron_moved, only, without_iron
from twin.insulation.insulation_fit import insulated
from twin.motor.configured import configured
from twin.motor.features import monomials
from twin.motor.network import Network
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

PLAN = Plan(
    stators=1,
    cycles=4,
    forms=("monotone",),
    repeatability=0.0,
    early_stops=0.0,
    dead=0.0,
    electrical=False,
    cycles_a_log=4,
    configuration=CONFIGURATION,
)


@dataclass(frozen=True)
class Rigged:
    """The store of one stator, its checks as they were logged and as they truly were."""

    store: Path
    folder: Path
    checks: tuple[LoggedCheck, ...]
    truth: tuple[Check, ...]

    def through(self, motor: str) -> tuple[LoggedCheck, ...]:
        """The checks with a motor file of this text."""
        (self.folder / "other.toml").write_text(motor, encoding="utf-8")
        with Store.open(self.store, create=True) as store:
            model = publish_model(store, self.folder / "other.toml")
            return _logged(store, model)


def _logged(store: Store, motor: str | None) -> tuple[LoggedCheck, ...]:
    facts = ledger_facts.at(store.ledger)
    sessions = [session for session in facts.sessions if session.kind == "dc_check"]
    return tuple(logged_check(store, facts, one, load(store, facts, one), motor) for one in sessions)


@pytest.fixture(scope="module")
def rigged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rigged]:
    folder = tmp_path_factory.mktemp("rig")
    written = insulation_campaign.write(folder, seed=11, plan=PLAN)
    for words in written.ingest:
        assert main([*words, "--store", str(folder / "store")]) == 0
    with Store.open(folder / "store") as store:
        checks = _logged(store, None)
    yield Rigged(folder / "store", folder, checks, written.truth.stators[0].checks)


def headed(check: LoggedCheck) -> LoggedCheck:
    """Without its sensors on the iron."""
    assert check.network is not None and check.test is not None
    trace = replace(check.trace, iron_degC=check.trace.iron_degC[:, :0], iron_names=())
    return replace(check, trace=trace, test=without_iron(check.network, check.test))


def between(check: LoggedCheck, first: int, last: int) -> LoggedCheck:
    """Rows of 10 s from `first` to before `last`."""
    assert check.test is not None
    rows, trace, test = slice(first, last), check.trace, check.test
    cut = replace(
        trace,
        t_s=trace.t_s[rows],
        copper_degC=trace.copper_degC[rows],
        iron_degC=trace.iron_degC[rows],
        ambient_degC=trace.ambient_degC[rows],
        power_W=trace.power_W[rows],
        current_A=None if trace.current_A is None else trace.current_A[rows],
    )
    return replace(check, trace=cut, test=_cut(test, rows))


def every(check: LoggedCheck, step: int) -> LoggedCheck:
    """With the samples of every so many steps of 10 s."""
    assert check.test is not None
    shown = np.arange(len(check.test.frame.features)) % step == 0
    return replace(check, test=only(check.test, shown))


def _cut(test: Test, rows: slice) -> Test:
    return replace(
        test,
        frame=Frame(test.frame.step_s, test.frame.features[rows], test.frame.boundaries[rows]),
        inputs={name: values[rows] for name, values in test.inputs.items()},
        features={name: values[rows] for name, values in test.features.items()},
        channels=tuple(
            replace(
                one,
                measured=one.measured[rows],
                samples=one.samples[rows],
                place=one.place[rows],
            )
            for one in test.channels
        ),
    )


def slope(rigged: Rigged, checks: tuple[LoggedCheck, ...], source: str) -> float:
    """Of ln R over that of the slots' resistance; every check by this source."""
    answers, said = evaluate_checks(checks)
    assert (said, {one.source for one in answers}) == ([], {f"{source}, configuration {CONFIGURATION}"})
    truth = np.log([check.insulation for check in rigged.truth])
    assert np.ptp(truth) > 0.1, "else there is nothing to follow"
    return float(np.polyfit(truth, np.log([one.resistance_K_per_W or np.nan for one in answers]), 1)[0])


def test_with_sensors_on_the_iron_the_course_is_that_of_the_slots(rigged: Rigged) -> None:
    assert slope(rigged, rigged.checks, "iron sensor") == pytest.approx(1.0, abs=0.08)


def test_without_these_the_first_minutes_say_it(rigged: Rigged) -> None:
    assert slope(rigged, tuple(map(headed, rigged.checks)), "first minutes") == pytest.approx(1.0, abs=0.1)


def test_rows_of_five_minutes_leave_the_whole_curve(rigged: Rigged) -> None:
    few = tuple(every(headed(check), 30) for check in rigged.checks)
    assert slope(rigged, few, "ambient") == pytest.approx(1.0, abs=0.15)


def test_logs_that_begin_and_end_under_load_say_too_little(rigged: Rigged) -> None:
    answers, said = evaluate_checks([between(headed(check), 120, 1080) for check in rigged.checks])
    assert {one.resistance_K_per_W for one in answers} == {None}
    assert "first minutes: fewer than 20 min recorded after switching on and off" in said[0]
    assert "ambient: known to" in said[0]


def test_conductances_that_are_off_in_the_file_change_the_course_little(rigged: Rigged) -> None:
    lines = motor_toml().splitlines()
    factors = iter(np.tile([0.7, 1.4, 0.8, 1.3], 20))
    wrong = [
        line.replace(value, f"{float(value) * next(factors):.4f}")
        if line.startswith("terms = [{coefficient") and "current" not in line
        else line
        for line in lines
        for value in [line.partition("coefficient = ")[2].partition("}")[0].partition(",")[0]]
    ]
    assert wrong != lines
    found = rigged.through("\n".join(wrong))
    assert slope(rigged, found, "iron sensor") == pytest.approx(1.0, abs=0.1)


def test_the_sd_is_that_of_a_course_and_under_a_hundredth_with_iron(rigged: Rigged) -> None:
    answers, _ = evaluate_checks(rigged.checks)
    r = np.array([one.resistance_K_per_W for one in answers], np.float64)
    sd = np.array([one.sd_K_per_W for one in answers], np.float64) / r
    left = np.log(r) - np.log([check.insulation for check in rigged.truth])
    assert (np.abs(left - left.mean()) < 3.0 * sd).all()
    assert (sd < 0.01).all()


def test_a_check_that_names_no_configuration_has_none_beside_those_that_do(rigged: Rigged) -> None:
    other = LoggedCheck(rigged.checks[2].trace)
    answers, said = evaluate_checks([*rigged.checks[:2], other, *rigged.checks[3:]])
    assert said == []
    assert [one.resistance_K_per_W is None for one in answers] == [False, False, True, False, False]
    assert answers[2].why is not None and "its bench file names no configuration" in answers[2].why


def test_without_a_configuration_nothing_is_said_of_one(rigged: Rigged) -> None:
    answers, said = evaluate_checks([LoggedCheck(check.trace) for check in rigged.checks])
    assert ({one.source for one in answers}, said) == ({"iron sensor"}, [])
    assert evaluate_checks([]) == ((), [])


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (f'name = "{CONFIGURATION}"', 'name = "in_oil"', f'has no configuration "{CONFIGURATION}": known are in_oil'),
        ('name = "winding"', 'name = "winding"\nregion = "other"', "no link from copper to iron"),
        ('name = "ambient"', 'name = "room"', 'boundary "room" of the motor file has no channel in this session'),
    ],
)
def test_a_motor_file_that_does_not_fit_leaves_the_routes_without_one_and_says_why(
    rigged: Rigged, old: str, new: str, why: str
) -> None:
    text = motor_toml()
    if "room" in new:
        text = text.replace('"ambient"]', '"room"]')
    answers, said = evaluate_checks(rigged.through(text.replace(old, new, 1)))
    assert {one.source for one in answers} == {"iron sensor"}
    (line,) = said
    assert line.startswith(f'its checks are evaluated without configuration "{CONFIGURATION}": ')
    assert line.count(why) == 1, "said once for all checks"
    assert line.endswith(".") and not line.endswith("..")


def test_a_network_of_another_machine_is_not_believed(rigged: Rigged) -> None:
    def heavy(network: Network) -> Network:
        return replace(network, nodes=tuple(replace(node, capacity=60.0 * node.capacity) for node in network.nodes))

    wrong = [replace(check, network=heavy(check.network)) for check in rigged.checks[:3] if check.network is not None]
    answers, said = evaluate_checks(wrong)
    assert {one.source for one in answers} == {"iron sensor"}
    assert "misses the measured temperatures by" in said[0]


def test_a_thermocouple_that_fails_in_one_check_is_left_out_of_all(rigged: Rigged) -> None:
    first, *rest = rigged.checks
    copper = first.trace.copper_degC.copy()
    copper[200:, 4] = np.nan
    broken = replace(first, trace=replace(first.trace, copper_degC=copper))
    answers, _ = evaluate_checks([broken, *rest])
    assert all(len(one.left_out) == 1 for one in answers)
    whole, _ = evaluate_checks(rigged.checks)
    ratio = [(a.resistance_K_per_W or 0.0) / (b.resistance_K_per_W or 1.0) for a, b in zip(answers, whole, strict=True)]
    assert ratio == pytest.approx([ratio[0]] * len(ratio), rel=0.02)


def rested(check: LoggedCheck, iron_K: float) -> LoggedCheck:
    """With ten minutes of rest before the load, and sensors on the iron that are off."""
    assert check.network is not None and check.test is not None
    trace, test, rest = check.trace, check.test, 60

    def before(values: Floats, zero: bool = False) -> Floats:
        first = np.repeat(values[:1], rest, axis=0)
        return np.concatenate([0.0 * first if zero else first, values])

    begun = replace(
        trace,
        t_s=np.concatenate([trace.t_s[0] + 10.0 * np.arange(-rest, 0), trace.t_s]),
        copper_degC=before(trace.copper_degC),
        iron_degC=before(trace.iron_degC) + iron_K,
        ambient_degC=before(trace.ambient_degC),
        power_W=before(trace.power_W, zero=True),
        current_A=None if trace.current_A is None else before(trace.current_A, zero=True),
    )
    longer = replace(
        test,
        frame=Frame(test.frame.step_s, before(test.frame.features, zero=True), before(test.frame.boundaries)),
        inputs={name: before(values, zero=True) for name, values in test.inputs.items()},
        features={name: before(values, zero=True) for name, values in test.features.items()},
        channels=tuple(
            replace(
                one,
                measured=before(one.measured),
                samples=before(one.samples),
                place=before(one.place),
            )
            for one in test.channels
        ),
    )
    return replace(check, trace=begun, test=iron_moved(check.network, longer, iron_K))


def test_sensors_that_are_off_by_another_amount_in_each_check_are_read_before_the_load(rigged: Rigged) -> None:
    def course(offs: Sequence[float]) -> Floats:
        some = [rested(check, off) for check, off in zip(rigged.checks, offs, strict=True)]
        answers, _ = evaluate_checks(some)
        ln_r = np.log([one.resistance_K_per_W or np.nan for one in answers])
        return np.asarray(ln_r - ln_r.mean())

    off = course([0.6, -0.6, 0.6, -0.6, 0.0])
    assert off == pytest.approx(course([0.0] * 5), abs=0.01)


def test_a_route_is_asked_only_where_its_data_are(rigged: Rigged) -> None:
    rig = Rig.of([headed(check) for check in rigged.checks])
    assert rig is not None
    iron, *_ = rig.routes()
    assert set(iron.estimates([{}] * len(rigged.checks))) == {"no channel follows iron"}
    short = Rig.of([between(headed(check), 0, 100) for check in rigged.checks])
    assert short is not None
    answers = [set(route.estimates([{}] * len(rigged.checks))) for route in short.routes()[1:]]
    assert answers[0] == {"fewer than 20 min recorded after switching on and off, or samples more than 60 s apart"}
    assert answers[1] == {"loaded for 16.6 min without a break, 20 min are needed"}


def test_the_answer_of_the_command_names_the_route_and_keeps_the_ratio(rigged: Rigged) -> None:
    target = rigged.folder / "ageing.json"
    assert main(["ageing", "--json", str(target), "--store", str(rigged.store)]) == 0
    (specimen,) = json.loads(target.read_text(encoding="utf-8"))["specimens"]
    r = [check["resistance_K_per_W"] for check in specimen["checks"]]
    assert {check["from"] for check in specimen["checks"]} == {f"iron sensor, configuration {CONFIGURATION}"}
    truth = np.array([check.insulation for check in rigged.truth])
    assert np.array(r) / r[0] == pytest.approx(truth / truth[0], rel=0.03)


def test_an_answer_depends_on_the_motor_file_of_its_configuration(rigged: Rigged) -> None:
    with Store.open(rigged.store) as store:
        facts = ledger_facts.at(store.ledger)
        checks = [session for session in facts.sessions if session.kind == "dc_check"]
        found = models_of(facts, checks)
        bare = models_of(facts, [replace(session, configuration=None) for session in checks])
    assert set(found) == {facts.benches[str(checks[0].bench)].model}
    assert set(bare) == {None}


def test_the_template_of_a_motor_file_has_such_a_rig() -> None:
    whole = read_motor(template("ipm_water_jacket"), "ipm_water_jacket.toml")
    rig = configured(whole, "stator_in_air")
    assert insulated(rig)
    assert [boundary.name for boundary in rig.boundaries] == ["ambient"]
    assert {feature for one in monomials(rig) for feature in one.features} <= {"current", "speed"}
    direct = [one.terms[0].coefficient for one in rig.sources if one.node.startswith(("winding", "endwinding"))]
    turning = [one.terms[0].coefficient for one in whole.sources if one.node.startswith(("winding", "endwinding"))]
    assert direct == pytest.approx([2.0 / 3.0 * coefficient for coefficient in turning], rel=2e-3)
