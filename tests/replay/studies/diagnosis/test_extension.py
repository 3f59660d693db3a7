"""What was learnt of sensors, written into a bench file: exchanged channels and named sensors, on a small bench."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from ingest.bench.bench_file import read_bench
from ingest.bench.corrections import correct
from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.models import model_of
from replay.engine.files.motor_file import read_motor
from replay.studies.diagnosis.extension import _Said, version
from replay.studies.diagnosis.question import Question, campaign_of
from twin.diagnosis.evidence_split import EvidenceSplit
from twin.diagnosis.rounds import Refit
from twin.diagnosis.swaps import Swap, exchanged
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Model
from twin.motor import sensor_laws
from twin.motor.sensor import Sensor


@pytest.fixture(scope="module")
def question(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Question]:
    folder = tmp_path_factory.mktemp("small")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_learn.blf", seconds=300)
    words = ["ingest", str(folder / "1_learn.blf"), "--bench", str(folder / "bench.toml")]
    assert main([*words, "--dbc", str(folder / "bench.dbc"), "--store", str(folder / "store")]) == 0
    with Store.open(folder / "store", write=True) as store:
        facts = ledger_facts.at(store.ledger)
        yield Question(store, facts, facts.sessions, [], model_of(facts, facts.sessions[0]), "testing")


def test_what_was_learnt_with_channels_exchanged_is_said_of_the_channel_that_reads_there(question: Question) -> None:
    campaign = campaign_of(question)
    ids = {str(c.cause): c for c in campaign.candidates}
    swap, lag = ids["sensor.yoke.swap_magnet"], ids["sensor.winding.lag"]
    tests = exchanged(campaign.tests, "TC_yoke", "TC_magnet")
    names = [node.name for node in campaign.network.nodes]
    numbers = [
        (Parameter("sensor.TC_yoke.gain", sensor_laws.Gain("TC_yoke"), 0.01), 0.02),
        (Parameter("sensor.TC_yoke.beside", actions.Beside("TC_yoke", names.index("winding")), 0.1), 0.1),
        (Parameter("sensor.TC_magnet.lag", sensor_laws.Lag("TC_magnet"), 0.8), 0.5),
        (Parameter("sensor.TC_winding.lag", sensor_laws.Lag("TC_winding"), 0.8), 0.25),
        (Parameter(str(lag.cause), sensor_laws.Lag("TC_winding"), 20.0), 9.0),
    ]
    model = Model(campaign.network, tests, [parameter for parameter, _ in numbers])
    fit = Fit(model, np.array([value for _, value in numbers]), 0.0, np.diag((10 / model.sd) ** 2), (), 0.0, True, 1)
    named = Refit(lag, model.parameters[4], fit, 50.0, 9.0, 1.0, EvidenceSplit(50.0, np.zeros(0), 0.0), 9.0)
    made = version(question, campaign, fit, [named], [Swap(swap, 90.0)], "By a test.")
    assert made.motor == question.model  # nothing of the motor was learnt
    assert question.written == [made.motor, made.bench]
    assert made.bench is not None
    bench = read_bench(question.store.archive.read(made.bench), "bench.toml")
    assert bench.corrections[0].cause == "sensor.yoke.swap_magnet"
    under = correct("bench.toml", bench.channels, bench.corrections)
    read = {c.name: (c, steps) for c, steps in zip(under.channels, under.steps, strict=True)}
    # at the yoke reads, in part, what was stamped as the magnet, 2 % too high
    channel, steps = read["TC_magnet"]
    assert channel.weights == {"yoke": 0.9, "winding": 0.1}
    assert [(one.law, one.amount) for one in steps] == [("gain", 0.02)]
    assert (read["TC_yoke"][0].node, read["TC_yoke"][0].time_constant_s) == ("magnet", 0.5)
    assert read["TC_winding"][0].time_constant_s == pytest.approx(9.25)


def test_a_correction_finds_its_sensor_whatever_that_was_learnt_to_follow(question: Question) -> None:
    campaign = campaign_of(question)
    lag = next(c for c in campaign.candidates if str(c.cause) == "sensor.magnet.lag")
    names = [node.name for node in campaign.network.nodes]
    numbers = [
        (Parameter("sensor.TC_magnet.beside", actions.Beside("TC_magnet", names.index("winding")), 0.1), 0.6),
        (Parameter("sensor.TC_magnet.gain", sensor_laws.Gain("TC_magnet"), 0.01), 0.02),
        (Parameter(str(lag.cause), sensor_laws.Lag("TC_magnet"), 20.0), 9.0),
    ]
    model = Model(campaign.network, campaign.tests, [parameter for parameter, _ in numbers])
    fit = Fit(model, np.array([value for _, value in numbers]), 0.0, np.diag((10 / model.sd) ** 2), (), 0.0, True, 1)
    named = Refit(lag, model.parameters[2], fit, 50.0, 9.0, 1.0, EvidenceSplit(50.0, np.zeros(0), 0.0), 9.0)
    made = version(question, campaign, fit, [named], [], "By a test.")
    assert made.bench is not None
    bench = read_bench(question.store.archive.read(made.bench), "bench.toml")
    under = correct("bench.toml", bench.channels, bench.corrections)
    channel, steps = next((c, s) for c, s in zip(under.channels, under.steps, strict=True) if c.name == "TC_magnet")
    assert channel.weights == {"magnet": 0.4, "winding": 0.6}, "more of the winding than of its own place"
    assert channel.time_constant_s == pytest.approx(9.0)
    assert [(one.law, one.amount) for one in steps] == [("gain", 0.02)]


def test_inputs_that_are_stamped_early_are_written_as_sensors_that_are_late() -> None:
    """A file moves the sensors' logger: by what it is late itself, and by what the inputs are early."""
    bench = read_bench(can_bench.BENCH.encode(), "bench.toml").at(None)
    sensor = Sensor("TC_yoke", {"yoke": 1.0}, "thermo")
    motor = read_motor(can_bench.MOTOR.encode(), "motor.toml")
    said = _Said(bench, [sensor], (), motor, {"TC_yoke": ["thermo"]})
    own, inputs = actions.Late(("TC_yoke",), False), actions.Late(("TC_yoke",), False, -1.0)
    assert said.corrections({inputs: -5.5}) == {"clock.thermo.offset": 5.5}
    assert said.corrections({inputs: -5.5, own: 0.25}) == {"clock.thermo.offset": 5.75}
