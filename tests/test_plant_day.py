"""A bench day that was written as set values is run by the plant as it is set."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from plant import Plant, day
from plant import __main__ as bench
from plant.machine import MACHINE, operate


def test_the_torque_of_a_current_is_the_one_that_takes_it() -> None:
    speed, torque = np.array([500.0, 3000.0, 6000.0, 9000.0]), np.array([120.0, 40.0, 75.0, 60.0])
    current = operate(speed, torque, np.full(4, day.MAGNET_degC), MACHINE).current
    np.testing.assert_allclose(day.torque(speed, current), torque, rtol=0.03)
    assert day.torque(np.zeros(1), np.array([100.0])).tolist() == [0.0]


def test_a_day_is_run_and_logged_as_it_is_set(tmp_path: Path) -> None:
    t = np.arange(120.0)
    rows = np.column_stack(
        [t, np.where(t < 60, 3000.0, 0.0), np.full(120, 100.0), np.full(120, 50.0), np.full(120, 5.0)]
    )
    file = tmp_path / "day.csv"
    columns = "time_s,speed_rpm,current_A,coolant_degC,flow_lpm"
    np.savetxt(file, rows, delimiter=",", header=columns, comments="")
    drive = day.read(file)
    assert drive.seconds == pytest.approx(120.0)
    assert drive.torque_Nm[100] > 0.0 == drive.torque_Nm[-1]
    assert drive.direct_A[100] == 0.0
    assert drive.direct_A[-1] == pytest.approx(100.0 * 2**0.5)
    assert np.abs(drive.inlet_degC - 50.0).max() < 1.0
    assert set(drive.flow_lpm.tolist()) == {5.0}
    log = bench.run(file, Plant(11), tmp_path / "logs")
    assert log.name == f"{bench.AFTER + 1}_day.blf"
    assert log.stat().st_size > 10_000


def test_a_bench_day_without_arguments_says_how_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["plant"])
    with pytest.raises(SystemExit, match=r"day\.csv SEED FOLDER"):
        runpy.run_path(str(bench.__file__), run_name="__main__")


def test_a_file_that_sets_no_load_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "day.csv"
    file.write_text("time_s,speed_rpm\n0,0\n1,0\n", encoding="utf-8")
    with pytest.raises(ValueError, match="needs time_s, speed_rpm and torque_Nm or current_A"):
        day.read(file)
