"""Logs looked at before anything is stored: what several files hold together, and the draft for all of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.bench.bench_file import read_bench
from ingest.intake.inspection import draft, inspect

HEAD = "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n"


def asc(path: Path, ids: str) -> Path:
    """A log of one frame for each of `ids`, a tenth of a second apart."""
    frames = [f"   {i / 10:.6f} 1  {one}             Rx   d 2 05 0C\n" for i, one in enumerate(ids.split())]
    path.write_text(HEAD + "".join(frames), encoding="utf-8")
    return path


def csv(path: Path, *values: float) -> Path:
    rows = "".join(f"{i},{value}\n" for i, value in enumerate(values))
    path.write_text(f"time,T_winding\n{rows}", encoding="utf-8")
    return path


def test_unknown_identifiers_are_counted_over_all_files(tmp_path: Path) -> None:
    first, second = asc(tmp_path / "a.asc", "123 123 456"), asc(tmp_path / "b.asc", "123 789")
    assert inspect([first, second], [], None).unknown_ids == {"can1:0x123": 3, "can1:0x456": 1, "can1:0x789": 1}


def test_a_column_of_several_tables_spans_them_all(tmp_path: Path) -> None:
    files = [csv(tmp_path / "a.csv", 20.0, 90.0), csv(tmp_path / "b.csv", 15.0, 30.0)]
    (seen,) = inspect(files, [], None).signals
    assert (seen.low, seen.high) == (15.0, 90.0)


@pytest.mark.parametrize(("remark", "names"), [("", ["T"]), ("door open", ["T", "column_3"])])
def test_a_column_without_name_is_a_signal_where_it_holds_something(
    tmp_path: Path, remark: str, names: list[str]
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"time;T;\n0;20,5;\n1;21,5;{remark}\n", encoding="utf-8")
    found = inspect([path], [], None)
    assert [one.signal.name for one in found.signals] == names
    assert ("column_3" in draft(found)) == (remark != "")


def test_a_unit_at_the_end_of_a_name_is_seen_and_drafted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,speed_rpm,EW_3_degC\n0,1000,20\n1,1001,21\n", encoding="utf-8")
    found = inspect([path], [], None)
    assert [(one.signal.unit, one.quantity) for one in found.signals] == [("rpm", "speed"), ("degC", "temperature")]
    assert 'unit = "degC"\nnode = "ew_3"\n' in draft(found) and "CHECK: the log" not in draft(found)


@pytest.mark.parametrize(
    ("name", "node"),
    [("T_Wicklung [°C]", "winding"), ("giogo (°C)", "yoke"), ("EW_3_degC", "ew_3"), ("T_Rücken", "ruecken")],
)
def test_the_unit_in_a_name_is_no_part_of_the_node_that_is_drafted(tmp_path: Path, name: str, node: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"time,{name}\n0,20\n1,21\n", encoding="utf-8")
    assert f'node = "{node}"\n' in draft(inspect([path], [], None))


@pytest.mark.parametrize(("count", "named"), [(1, "0.csv"), (3, "0.csv, 1.csv, 2.csv"), (4, "4 logs")])
def test_a_draft_names_the_logs_that_it_is_for(tmp_path: Path, count: int, named: str) -> None:
    files = [csv(tmp_path / f"{i}.csv", 20.0, 21.0) for i in range(count)]
    assert f"# Draft for {named}: " in draft(inspect(files, [], None))


@pytest.mark.parametrize(("start_s", "rivals"), [(1_760_000_050, True), (1_760_086_400, False)])
def test_a_draft_knows_which_loggers_run_at_once(tmp_path: Path, start_s: int, rivals: bool) -> None:
    logs = {"a.csv": ("n_mot [rpm]", 1_760_000_000), "b.csv": ("Drehzahl [rpm]", start_s)}
    for name, (column, begin_s) in logs.items():
        rows = "".join(f"{begin_s + i},{1000 + i}\n" for i in range(100))
        (tmp_path / name).write_text(f"epoch_s,{column}\n{rows}", encoding="utf-8")
    text = draft(inspect([tmp_path / name for name in logs], [], None))
    assert ("keep one" in text) == rivals


def test_a_column_of_text_is_drafted_as_no_quantity(tmp_path: Path) -> None:
    """Unless another log has numbers there: then that one is told as it is ingested."""
    (text := tmp_path / "a.csv").write_text("t,T_wdg,speed\n0,20,1.2 K rpm\n1,21,900 rpm off\n")
    found = inspect([text], [], None)
    assert {one.signal.name: one.quantity for one in found.signals} == {"T_wdg": "temperature", "speed": None}
    assert 'signal = "speed"' not in draft(found) and "#   speed" in draft(found)
    (numbers := tmp_path / "b.csv").write_text("t,T_wdg,speed\n0,20,1200\n1,21,900\n")
    assert 'signal = "speed"' in draft(inspect([text, numbers], [], None))


def test_dates_of_either_order_are_asked_for_in_words_and_in_the_draft(tmp_path: Path) -> None:
    path = tmp_path / "us.csv"
    path.write_text("Time,T_w\n5/6/2025 1:00 PM,20\n5/6/2025 1:01 PM,21\n", encoding="utf-8")
    found = inspect([path], [], None)
    asked = 'say format = "%d/%m/%Y %I:%M %p" or format = "%m/%d/%Y %I:%M %p".'
    assert found.files[0].note and found.files[0].note.endswith(f"{asked} Looked at as one row a second.")
    assert f"{asked} Looked at as one row a second.\n[time]\nrate_hz = 1.0" in draft(found)


def test_what_a_log_lacks_of_its_time_is_asked_of_its_logger_and_not_of_logs_that_have_theirs(tmp_path: Path) -> None:
    logs = {
        "drive_1.csv": "Time,n\n2025-03-14 08:00:00,1\n2025-03-14 08:00:02,2\n",
        "thermo_1.csv": "Time,T_w\n5/6/2025 1:00 PM,20\n5/6/2025 1:01 PM,21\n",
    }
    for name, text in logs.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    bench = read_bench(draft(inspect([tmp_path / name for name in logs], [], None)).encode(), "draft.toml")
    assert bench.time.rate_hz is None and not bench.time_of
    assert {one.name: one.time and one.time.rate_hz for one in bench.loggers} == {"drive": None, "thermo": 1.0}


CHECKS = """\
Date;{label};Charge;IR 1min [MΩ];PI
12.03.2025;SN-001;B7;1200;3,0
12.03.2025;SN-002;B7;1100;2,8
13.03.2025;SN-001;B7;1150;2,9
"""


@pytest.mark.parametrize("label", ["Serial No.", "Prüfling", "N° de série", "S/N", "Motor ID", "specimen"])
def test_a_table_of_checks_is_drafted_with_the_columns_that_tell_specimens_batches_and_days(
    tmp_path: Path, label: str
) -> None:
    path = tmp_path / "checks.csv"
    path.write_text(CHECKS.format(label=label), encoding="utf-8")
    found = inspect([path], [], None)
    bench = read_bench(draft(found).encode(), "draft.toml")
    assert (bench.specimen_column, bench.batch_column, bench.time.column) == (label, "Charge", "Date")
    assert "Nothing was guessed for" not in draft(found)
    says = 'rows of 2 specimens, taken as one: say specimen_column = "{}" above the first [table] of a bench file'
    assert found.files[0].stamps == (says.format(label),)
    assert found.files[0].note and found.files[0].note.endswith(
        'column = "Date" (its days). Looked at as the days in "Date".'
    )
    (tmp_path / "bench.toml").write_text(draft(found), encoding="utf-8")
    (again,) = inspect([path], [], tmp_path / "bench.toml").files
    assert (again.stamps, again.reading and again.reading.found) == ((), 3)


def test_numbers_of_rows_are_no_specimens(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,serial,T\n0,1,20\n1,2,21\n1,3,21\n", encoding="utf-8")
    (file,) = inspect([path], [], None).files
    assert file.stamps == ("1 record with the stamp of another one and other values",)


def test_the_number_of_a_sensor_in_its_name_is_no_specimen_and_its_unit_stands_before(tmp_path: Path) -> None:
    """As HOBO loggers write it."""
    names = '"#","Date Time, GMT+01:00","Temp, °F (LGR S/N: 10, SEN S/N: 20451)"\n'
    (path := tmp_path / "a.csv").write_text(names + "1,03/14/2025 09:00:00,68\n2,03/14/2025 09:00:01,69\n")
    found = inspect([path], [], None)
    bench = read_bench(draft(found).encode(), "draft.toml")
    assert (bench.specimen_column, found.files[0].stamps) == (None, ())
    assert [(one.unit, one.node) for one in bench.channels] == [("°F", "temp")]


def test_only_columns_that_all_logs_have_are_drafted_as_those_of_specimens(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,specimen,T\n0,A,20\n1,B,21\n", encoding="utf-8")
    assert "specimen_column" not in draft(inspect([tmp_path / "a.csv", csv(tmp_path / "b.csv", 1.0, 2.0)], [], None))
