"""A session looked through in parts: what is seen of the whole is seen of its parts, and memory holds one of them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray

from ingest.catalogue import kinds, looked, power
from ingest.catalogue.looked import in_parts, look
from ingest.catalogue.show import describe
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import MotorFile, prepare
from ingest.log import recording, samples
from made.blf import write_blf

BENCH = """\
schema = "whyhot.bench/1"
[time]
column = "time"
unit = "s"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "m"
quantity = "torque"
unit = "Nm"
[[channel]]
signal = "p"
quantity = "power"
unit = "W"
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
node = "winding"
[[channel]]
signal = "U"
quantity = "temperature"
unit = "degC"
node = "yoke"
"""
ROWS = 24_000  # 40 minutes, 10 a second
OPEN = 3_000


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def table() -> NDArray[np.float64]:
    """Time, speed, torque, power and two temperatures: a drive, with a dropout, a sensor that sticks, a gap, and a
    thermocouple that is open from five minutes before the end on."""
    random = np.random.default_rng(3)
    t = np.arange(ROWS) / 10
    t[15_000:] += 400.0
    speed = 3000 + 1500 * np.sin(t / 90) + random.normal(0, 5, ROWS)
    torque = 40 + 10 * np.sin(t / 300) + random.normal(0, 0.5, ROWS)
    power = 1.1 * torque * speed * np.pi / 30
    winding = 60 + 20 * np.sin(t / 500) + random.normal(0, 0.2, ROWS)
    yoke = 50 + 15 * np.sin(t / 700) + random.normal(0, 0.2, ROWS)
    winding[2_960:3_100] = winding[2_960]  # 14 s
    yoke[7_000:14_500] = yoke[7_000]  # 12 min
    winding[-OPEN:] = np.nan
    columns = np.stack([t, speed, torque, power, winding, yoke], axis=1).astype(np.float64)
    return np.round(columns, 2)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    lines = [",".join(f"{value:.2f}" for value in row) for row in table()]
    (tmp_path / "log.csv").write_text("\n".join(["time,n,m,p,T,U", *lines]) + "\n")
    (tmp_path / "bench.toml").write_text(BENCH)
    with Store.open(tmp_path / "s", create=True) as opened:
        paths = [tmp_path / "log.csv"]
        take_in(opened, paths, prepare(paths, tmp_path / "bench.toml", [], _no_motor), Override())
    return tmp_path / "s"


@pytest.fixture
def small_row_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "BATCH_RECORDS", 500)
    monkeypatch.setattr(samples, "ROW_GROUP", 1000)


@pytest.mark.usefixtures("small_row_groups")
@pytest.mark.parametrize("most", [60_000, 25_000, 9_000])
def test_parts_show_what_the_whole_shows(store: Path, most: int) -> None:
    with Store.open(store) as opened:
        known = facts.at(opened.ledger)
        session = known.sessions[0]
        whole, parts = look(opened, known, session), in_parts(opened, known, session, most)
    assert kinds.recognise(parts.channels) == kinds.recognise(whole.channels)
    for a, b in zip(parts.qualities, whole.qualities, strict=True):
        same = (a.name, a.role, a.samples, a.low, a.high, a.resolution, a.gaps, a.stretches)
        assert same == (b.name, b.role, b.samples, b.low, b.high, b.resolution, b.gaps, b.stretches)
        assert a.rate_Hz == pytest.approx(b.rate_Hz)
        stuck = any(one.kind == "stuck" for one in b.stretches)  # a third of it has no noise: the median part has
        assert stuck or a.noise == pytest.approx(b.noise, rel=0.15)
    assert {one.kind for seen in whole.qualities for one in seen.stretches} == {"held", "stuck"}
    gaps_s = {one.name: [gap.duration_s for gap in one.gaps] for one in whole.qualities}
    assert gaps_s["U"] == [pytest.approx(400.1)]
    assert gaps_s["T"] == [pytest.approx(400.1), pytest.approx(OPEN / 10)], "to the end of its log"
    balances = [power.balance(seen.channels) for seen in (parts, whole)]
    assert balances[0] and balances[1]
    assert balances[0].mechanical_kWh == pytest.approx(balances[1].mechanical_kWh, rel=1e-3)


@pytest.mark.usefixtures("small_row_groups")
def test_of_a_long_session_no_more_is_read_at_once_than_a_part(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows: list[int] = []
    read = samples.read

    def counted(path: Path, columns: Sequence[str] | None, groups: Sequence[int] | None) -> pa.Table:
        table = read(path, columns, groups)
        rows.append(table.num_rows)
        return table

    monkeypatch.setattr(samples, "read", counted)
    monkeypatch.setattr(looked, "MOST_VALUES", 25_000)
    with Store.open(store) as opened:
        known = facts.at(opened.ledger)
        assert describe(opened, known, known.sessions[0]).channels[0].samples == ROWS
    assert len(rows) >= 5
    assert max(rows) <= 25_000 / 5 * 1.2 + 2 * samples.ROW_GROUP


GROWS = """\
import resource, sys
from pathlib import Path
from ingest.catalogue import channels, looked
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.catalogue.show import describe
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from ingest.log import decode

channels.MOST_VALUES = looked.MOST_VALUES = decode.WAITING_VALUES = 400_000
paths, dbc = [Path(sys.argv[1])], Path(sys.argv[2])
with Store.open(paths[0].with_suffix(".store"), create=True) as store:
    take_in(store, paths, prepare(paths, None, [dbc], None), Override())
    known = facts.at(store.ledger)
    assert describe(store, known, known.sessions[0]).channels[0].samples == int(sys.argv[3])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
DBC = """\
VERSION ""
BU_: BENCH
BO_ 256 All: 8 BENCH
 SG_ T0 : 0|16@1+ (0.01,0) [0|0] "degC" BENCH
 SG_ T1 : 16|16@1+ (0.01,0) [0|0] "degC" BENCH
 SG_ T2 : 32|16@1+ (0.01,0) [0|0] "degC" BENCH
 SG_ T3 : 48|16@1+ (0.01,0) [0|0] "degC" BENCH
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no resource module")
def test_memory_hardly_grows_with_the_length_of_a_log(tmp_path: Path) -> None:
    (tmp_path / "all.dbc").write_text(DBC)
    peaks = []
    for frames in (400_000, 1_600_000):
        log = tmp_path / f"{frames}.blf"
        write_blf(log, frames)
        command = [sys.executable, "-c", GROWS, str(log), str(tmp_path / "all.dbc"), str(frames)]
        peaks.append([int(word) for word in subprocess.run(command, check=True, capture_output=True).stdout.split()])
    grown = np.diff(peaks, axis=0)[0] * 1024 / 1_200_000
    assert grown.max() < 15, f"bytes a frame, in the program and in the child that reads: {grown}"
