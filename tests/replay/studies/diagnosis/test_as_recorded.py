"""Errors against readings as recorded, where a correction moves the clock of a logger that records a boundary too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.studies.diagnosis.as_recorded import as_recorded
from replay.studies.diagnosis.extension import Version
from replay.studies.diagnosis.question import Question
from replay.studies.sessions.recorded import test_of as read_test
from twin.motor.configured import configured

LATE_s = 7.0  # stamps of the thermocouples' logger
NODES = ("winding", "yoke", "magnet")
CORRECTION = f'[[correction]]\ncause = "clock.thermo.offset"\namount = {LATE_s}\n'


def _table(path: Path, header: str, columns: list[np.ndarray]) -> str:
    np.savetxt(path, np.column_stack(columns), "%.3f", ",", header=header, comments="", encoding="utf-8")
    return str(path)


def _channel(signal: str, quantity: str, unit: str, node: str = "") -> str:
    return f'[[channel]]\nsignal = "{signal}"\nquantity = "{quantity}"\nunit = "{unit}"\n' + (
        f'node = "{node}"\n' if node else ""
    )


@pytest.mark.parametrize("seconds", [598, 603])  # with blocks of 10 s as many as before, and one more
def test_a_corrected_clock_leaves_readings_as_recorded_where_they_were(tmp_path: Path, seconds: int) -> None:
    speed, current = can_bench.drive(seconds, 1)
    truth = can_bench.truth(speed, current, 30.0, magnet_loss=90.0)[:seconds]
    t_s = can_bench.START + np.arange(seconds, dtype=float)
    drive = _table(tmp_path / "drive.csv", "epoch_s,n,I", [t_s, speed[::10], current[::10]])
    thermo = _table(
        tmp_path / "thermo.csv", "epoch_s,T_in,winding,yoke,magnet", [t_s + LATE_s, np.full(seconds, 30.0), truth]
    )
    text = 'schema = "whyhot.bench/1"\nmotor = "motor.toml"\nspecimen = "servo-01"\n[time]\ncolumn = "epoch_s"\n'
    text += _channel("n", "speed", "rpm") + _channel("I", "current", "A")
    text += _channel("T_in", "temperature", "degC", "coolant")
    text += "".join(_channel(node, "temperature", "degC", node) for node in NODES)
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    words = ["ingest", drive, thermo, "--bench", str(tmp_path / "bench.toml"), "--store", str(tmp_path / "store")]
    assert main(words) == 0
    with Store.open(tmp_path / "store", write=True) as store:
        facts = ledger_facts.at(store.ledger)
        (session,) = facts.sessions
        bench = facts.bench_of(session)
        assert bench is not None and bench.model is not None
        question = Question(store, facts, (session,), (), bench.model, "testing")
        network = configured(read_motor(can_bench.MOTOR.encode(), "motor.toml"), None)
        tests = [read_test(store, facts, session, network, (), "testing")]
        new = store.archive.seal((text + CORRECTION).encode())
        published = as_recorded(question, Version(bench.model, None), [session], tests)
        corrected = as_recorded(question, Version(bench.model, new, {bench.sha256: new}), [session], tests)
    assert published.moved["winding"] == 0.0 and corrected.moved["winding"] != 0.0
    was, now = published.residual["winding"], corrected.residual["winding"]
    assert abs(np.abs(was).mean() - np.abs(now).mean()) < 0.05
