"""What TwinCAT Scope exports: columns of several clocks below names that stand far above them."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from made.places import LOGS
from made.tables import read

MS_NS = 1_000_000
BEGUN_NS = 1_709_251_200_000 * MS_NS  # 1 March 2024
HEAD = (
    "Name;Scope;\nFile;C:\\scope.csv;\nStarttime of export;133537248000000000;Freitag, 1. März 2024;00:00:00.000\n"
    "Endtime of export;133537248010000000;Freitag, 1. März 2024;00:00:01.000\n\n\n"
)
CHANNELS = (
    "Name;Signal;n;Name;Signal\nSymbolComment;;;SymbolComment;\nSampleTime[ms];1;1;SampleTime[ms];0,5\n"
    "SymbolName;MAIN.T_w;MAIN.n;SymbolName;MAIN.T_j\nUnit;degC (Temperature);(None);Unit;K\n\n"
)


def scope(folder: Path, text: str) -> Path:
    path = folder / "scope.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_sample_is_read_whole() -> None:
    log, t_ns, columns = read(LOGS / "sample.twincat")
    assert (t_ns, log.absolute) == ([BEGUN_NS + one * MS_NS for one in (0, 500, 2000)], True)
    assert columns == {"T_mag": [20.5, 20.6, 20.8], "Drehzahl": [0, 1500, 1600]}
    assert log.units == {"T_mag": "°C"}
    assert [(one.where, one.why) for one in log.rejected] == [
        ("line 16, column Time", 'text "x" where numbers are'),
        ("line 17, column T_mag", 'text "ERR" where numbers are'),
    ]
    assert (log.found, log.settings["time"]) == (5, "ms from the start")
    assert log.settings["above_header"][0] == "Name\tPrüfstand 7"


@pytest.mark.parametrize("sign", [";", "\t", ","])
def test_each_clock_stamps_its_own_channels(tmp_path: Path, sign: str) -> None:
    """One has ended in the last row, where its cells are blank; names alike are those of symbols."""
    rows = "0;20;5;0;300\n1;21;6;0.5;301\n2;22;7;1;302\n ; ; ;1.5;303\n"
    log, t_ns, columns = read(scope(tmp_path, (HEAD + CHANNELS + rows).replace(";", sign)))
    assert sorted((t - BEGUN_NS) / MS_NS for t in t_ns) == [0, 0, 0.5, 1, 1, 1.5, 2]
    assert columns == {"MAIN.T_w": [20, 21, 22], "n": [5, 6, 7], "MAIN.T_j": [300, 301, 302, 303]}
    assert log.units == {"MAIN.T_w": "degC", "MAIN.T_j": "K"} and not log.rejected
    assert log.settings["backward_steps"] == 0


def test_cells_of_columns_that_have_ended_may_be_left_out(tmp_path: Path) -> None:
    log, _, columns = read(scope(tmp_path, HEAD + CHANNELS + "0;20;5;0;300\n1;21;6\n2;22;7\nEOF\n"))
    assert (columns["MAIN.T_w"], columns["MAIN.T_j"], list(log.rejected)) == ([20, 21, 22], [300], [])


def test_a_start_that_the_bench_file_says_goes_before_its_own(tmp_path: Path) -> None:
    path = scope(tmp_path, HEAD + "Name;T\n0;20\n1;21\n")
    assert read(path, TimeSpec(start_ns=MS_NS))[1] == [MS_NS, 2 * MS_NS]


def test_signs_that_names_hold_too_are_refused_with_what_to_do(tmp_path: Path) -> None:
    path = scope(tmp_path, (HEAD + CHANNELS + "0;20;5;0;300\n").replace(";", ":"))
    assert recognise(path).name == "twincat"
    with pytest.raises(UnreadableLogError, match=r'^scope\.csv: ":" stands between its columns.* Export it from Twin'):
        read(path)
