"""MAT files as scripts, Simulink and ControlDesk lay them out: each vector with the times that are its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from made.places import LOGS
from made.tables import read, same

NAN = float("nan")
T, WARM, FAST = np.array([0.0, 0.5, 1.0, 1.5]), np.array([20.0, 21.0, NAN, 23.0]), np.arange(8.0)
AT_NS = 1_766_563_200_000_000_000  # 2025-12-24 08:00 UTC
DATENUM = 740_000.0 + 1 / 3  # 2026-01-18 08:00


def saved(folder: Path, variables: dict[str, Any]) -> Path:
    savemat(path := folder / "log.mat", variables)
    return path


def seconds(t_ns: list[int]) -> list[float]:
    return [t / 1e9 for t in t_ns]


@pytest.mark.parametrize(
    ("variables", "columns", "unit"),
    [
        ({"t": T, "T_w": WARM}, {"T_w": WARM}, {}),
        ({"t": T[:, None], "T_w": WARM[:, None]}, {"T_w": WARM}, {}),  # columns, as MATLAB has them
        ({"run": {"time": T, "T_w": WARM, "more": {"n": T + 1}}}, {"T_w": WARM, "n": T + 1}, {}),
        ({"time": T, "T_w": np.stack([WARM, T], axis=1)}, {"T_w_1": WARM, "T_w_2": T}, {}),
        ({"tout": T, "yout": WARM}, {"yout": WARM}, {}),
        (
            {
                "out": {
                    "time": T,
                    "signals": [{"values": WARM, "label": "T_w"}, {"values": T + 1, "label": ""}],
                }
            },
            {"T_w": WARM, "signal_2": T + 1},
            {},
        ),
        (
            {
                "rec": {
                    "X": {"Name": "", "Data": T},
                    "Y": [
                        {"Name": "Model/T_w", "Data": WARM, "Unit": "degC", "XIndex": 1},
                        {"Name": "n [rpm]", "Data": T + 1, "Unit": "", "XIndex": 1},
                    ],
                }
            },
            {"Model/T_w": WARM, "n [rpm]": T + 1},
            {"Model/T_w": "degC", "n [rpm]": "rpm"},
        ),
    ],
    ids=["variables", "columns", "struct", "matrix", "tout", "Simulink", "ControlDesk"],
)
def test_a_vector_stands_at_the_times_that_are_its_own(
    variables: dict[str, Any], columns: dict[str, Any], unit: dict[str, str], tmp_path: Path
) -> None:
    log, t_ns, found = read(saved(tmp_path, variables))
    assert found.keys() == columns.keys() and log.units == unit
    assert seconds(t_ns) == T.tolist() and not log.absolute
    assert all(same(found[name], cells) for name, cells in columns.items())


def test_rows_of_two_rates_are_what_both_say_at_one_time(tmp_path: Path) -> None:
    slow, fast = {"time": T, "x": WARM}, {"time": FAST / 4, "x": FAST, "y": FAST}
    log, t_ns, found = read(saved(tmp_path, {"slow": slow, "fast": fast}))
    assert seconds(t_ns) == (FAST / 4).tolist()
    assert same(found["slow/x"], [20, NAN, 21, NAN, NAN, NAN, 23, NAN])
    assert same(found["fast/x"], FAST) and same(found["y"], FAST)
    assert log.found == 8


@pytest.mark.parametrize(
    ("times", "says", "begins_ns"),
    [
        (DATENUM + T / 86_400, "days since 1899-12-30 in UTC", 1_768_723_200_000_000_000),
        (AT_NS / 1e9 + T, "s since 1970", AT_NS),
        (np.array(["24.12.2025 08:00:00", "24.12.2025 08:00:01"] * 2, object), "day.month.year in UTC", AT_NS),
    ],
)
def test_times_may_be_dates(times: Any, says: str, begins_ns: int, tmp_path: Path) -> None:
    log, t_ns, _ = read(saved(tmp_path, {"time": times, "T_w": WARM}))
    assert log.absolute and log.settings["time"] == [says]
    assert abs(t_ns[0] - begins_ns) < 20_000  # a datenum holds 10 us


def test_times_from_an_unknown_start_are_none_beside_dates(tmp_path: Path) -> None:
    dated, other = {"time": DATENUM + T / 86_400, "x": WARM}, {"time": T, "y": WARM}
    log, t_ns, found = read(saved(tmp_path, {"dated": dated, "other": other}))
    assert log.absolute and same(found["x"], WARM) and len(t_ns) == 4
    assert [one.why.split(":")[0] for one in log.rejected] == ["no date, as other rows of the file have one"] * 4


def test_what_has_no_times_is_left_out_by_name(tmp_path: Path) -> None:
    variables = {"t": T, "T_w": WARM, "lost": np.arange(3.0), "z": np.ones((2, 2, 2)), "note": "warm", "size": 3.0}
    log, _, found = read(saved(tmp_path, variables))
    assert [*found] == ["T_w"] and log.settings["left_out"] == ["z", "lost"]


def test_the_bench_file_may_say_which_vector_is_the_time_or_the_rate(tmp_path: Path) -> None:
    path = saved(tmp_path, {"run": {"clock_a": T, "T_w": WARM}})
    for column in ("clock_a", "run/clock_a"):
        assert seconds(read(path, TimeSpec(column=column, unit="s"))[1]) == T.tolist()
    _, t_ns, found = read(path, TimeSpec(rate_hz=2.0))
    assert seconds(t_ns) == T.tolist() and [*found] == ["clock_a", "T_w"]


@pytest.mark.parametrize(
    ("variables", "spec", "says"),
    [
        ({"a": T, "b": WARM}, None, r"no vector is called as times are .* Its vectors: a, b\."),
        ({"t": T, "b": FAST}, None, r"no vector is called as times are"),
        ({"t": T, "b": WARM}, TimeSpec(column="T", unit="s"), r'column = "T" under .* Nearest: t\. They are: t, b\.'),
        ({"n": 3.0}, None, r"Its vectors: none\."),
    ],
)
def test_a_file_without_times_is_refused_with_its_vectors(
    variables: dict[str, Any], spec: TimeSpec | None, says: str, tmp_path: Path
) -> None:
    with pytest.raises(UnreadableLogError, match=says):
        read(saved(tmp_path, variables), spec)


def test_a_file_that_was_cut_keeps_the_variables_before(tmp_path: Path) -> None:
    content = saved(tmp_path, {"t": T, "T_w": WARM, "z": np.arange(4.0)}).read_bytes()
    (cut := tmp_path / "cut.mat").write_bytes(content[:-8])
    log, _, found = read(cut)
    assert [*found] == ["T_w"]
    assert str(log.cut).startswith(f"ends at byte {len(content) - 8:,}, inside variable 3: 4 rows were read and kept")


def test_the_sample_holds_a_record_without_a_time(tmp_path: Path) -> None:
    assert recognise(LOGS / "sample.mat").name == "mat"
    log, t_ns, found = read(LOGS / "sample.mat")
    assert t_ns == [AT_NS, AT_NS + 500_000_000, AT_NS + 1_500_000_000]
    assert same(found["T_w"], [20.0, 21.0, 23.0])
    assert [(one.record, one.where) for one in log.rejected] == [(2, 'group "bench", record 3')]
