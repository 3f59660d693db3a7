"""Tables: what is recognised, what every row becomes, and the line a person reads where a table is refused."""

import gzip
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, open_log
from ingest.formats._csv_lines import LineReader
from ingest.formats._csv_numbers import MISSING
from made.places import LOGS
from made.tables import DECEMBER_NS, MARCH_NS, S_NS, read, same, table

COPY_AGAIN = "; copy the file again if the original is whole."


def test_the_sample_is_recognised_whole() -> None:
    log, t_ns, columns = read(LOGS / "sample.csv")
    assert t_ns == [MARCH_NS, MARCH_NS + S_NS // 2, MARCH_NS + 3 * S_NS // 2, MARCH_NS + 3 * S_NS]
    np.testing.assert_array_equal(columns["T_mag"], [20.5, 20.6, np.nan, 21.1])
    assert columns["Drehzahl"] == [0, 1500, 1500, 1600]
    assert columns["Kommentar"] == ["", "Start", "a;b", ""]
    assert (columns["n"], columns["n_2"]) == ([1] * 4, [2] * 4)
    assert log.units == {"T_mag": "°C", "Drehzahl": "1/min", "n": "1", "n_2": "1"}
    assert log.settings == {
        "encoding": "cp1252",
        "delimiter": ";",
        "decimal": ",",
        "units_row": True,
        "time_column": "Zeit",
        "time": "day.month.year in UTC",
        "renamed": {"n": ["n", "n_2"]},
        "gz": False,
        "backward_steps": 0,
    }
    assert [(entry.record, entry.where, entry.why) for entry in log.rejected] == [
        (2, "line 5, column T_mag", 'text "abc" where numbers are'),
        (4, "line 8", "has 5 fields where the header has 6"),
        (5, "line 9, column Zeit", '"morgen" is no time (day.month.year in UTC)'),
    ]
    assert log.found == 7


# ---- how a table is written -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "delimiter", "decimal"),
    [
        ("t,T\n0.5,20.5\n1.5,21.5\n", ",", "."),
        ("t;T\n0.5;20.5\n1.5;21.5\n", ";", "."),
        ("t;T\n0,5;20,5\n1,5;21,5\n", ";", ","),
        ("t\tT\n0,5\t20,5\n1,5\t21,5\n", "\t", ","),
        ('t;"T"\n0,5;"20,5"\n"1,5";21,5\n', ";", ","),
        ("t|T\n0.5|20.5\n1.5|21.5\n", "|", "."),
        ("   t    T\n 0.5 20.5\n 1.5\t21.5 \n", " ", "."),
        ("t  T\n0,5  20,5\n1,5  21,5\n", " ", ","),
        ("t;T;note, if any\n0.5;20.5;a,b\n1.5;21.5;\n", ";", "."),
    ],
)
def test_delimiter_and_decimal_sign_are_recognised(tmp_path: Path, text: str, delimiter: str, decimal: str) -> None:
    log, t_ns, columns = read(table(tmp_path, text))
    assert (log.settings["delimiter"], log.settings["decimal"]) == (delimiter, decimal)
    assert t_ns == [S_NS // 2, 3 * S_NS // 2]
    assert columns["T"] == [20.5, 21.5]


def test_names_in_quotes_may_hold_line_feeds(tmp_path: Path) -> None:
    head = 'bench 7\n"Time\n[s]","Speed\n[rpm]","T, winding\n[degC]"\n'
    log, t_ns, columns = read(table(tmp_path, head + "0,1500,20\n1,abc,21\n2,1501,22\n"))
    assert (t_ns, columns) == ([0, 2 * S_NS], {"Speed [rpm]": [1500, 1501], "T, winding [degC]": [20, 22]})
    assert log.rejected[0].where == "line 7, column Speed [rpm]"


@pytest.mark.parametrize("end", ["\r", "\r\n"])
def test_lines_end_as_on_any_machine(tmp_path: Path, end: str) -> None:
    assert read(table(tmp_path, end.join(["t;T", "0;20", "1;21", ""])))[1] == [0, S_NS]


@pytest.mark.parametrize(("encoding", "said"), [("utf-8", "utf-8"), ("utf-8-sig", "utf-8"), ("cp1252", "cp1252")])
def test_encoding_is_recognised(tmp_path: Path, encoding: str, said: str) -> None:
    log, _, columns = read(table(tmp_path, "t;Öl [°C]\n0;20\n1;21\n", encoding=encoding))
    assert (log.settings["encoding"], columns["Öl [°C]"], log.units) == (said, [20, 21], {"Öl [°C]": "°C"})


@pytest.mark.parametrize("block", [1 << 20, 1001])  # of bytes: a character may be cut between two
def test_names_in_shift_jis_are_those_that_were_written(
    tmp_path: Path, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    r"""Of `ポ`, `表` and `ソ` the second byte is `|` or `\`: no delimiter, and nothing that ends a line."""
    monkeypatch.setattr("ingest.formats._text.BLOCK", block)
    rows = "".join(f"{k},{k}.5,{k},表面\r\n" for k in range(500))
    log, t_ns, columns = read(table(tmp_path, f"時間,ポンプ出口[℃],ソレノイド電流[A],備考\r\n{rows}", encoding="cp932"))
    assert log.settings["encoding"] == "cp932"
    assert t_ns == [k * S_NS for k in range(500)]
    assert columns["ポンプ出口[℃]"] == [k + 0.5 for k in range(500)]
    assert {*columns["備考"]} == {"表面"}
    assert log.units["ソレノイド電流[A]"] == "A"


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("mark", ["\ufeff", ""])
@pytest.mark.parametrize("packed", [bytes, gzip.compress])
@pytest.mark.parametrize("block", [1 << 20, 1001])  # of bytes: a character may be cut between two
def test_utf_16_is_read_with_its_mark_and_without(
    tmp_path: Path,
    encoding: str,
    mark: str,
    packed: Callable[[bytes], bytes],
    block: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ingest.formats._text.BLOCK", block)
    path = tmp_path / "log.csv"
    rows = "".join(f"{k};{k},5\r\n" for k in range(500))
    path.write_bytes(packed(f"{mark}Zeit;Öl [°C]\r\n{rows}".encode(encoding)))
    log, t_ns, columns = read(path)
    assert t_ns == [k * S_NS for k in range(500)]
    assert (columns, log.units) == ({"Öl [°C]": [k + 0.5 for k in range(500)]}, {"Öl [°C]": "°C"})
    assert log.settings["encoding"] == "utf-16"


def test_utf_16_that_ends_inside_a_character_keeps_its_whole_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("\ufefft;T\n0;20\n1;21\n2;22".encode("utf-16-le")[:-1])
    log, t_ns, _ = read(path)
    assert (t_ns, len(log.rejected)) == ([0, S_NS], 1)
    assert log.cut and log.cut.startswith("ends inside line 4")


@pytest.mark.parametrize("line", ["\0\0\0", "1;2\0", "1;\x1b\u202e", "1;20;;;;" + "9" * 5000])
def test_a_damaged_line_costs_one_record_that_is_counted(tmp_path: Path, line: str) -> None:
    rows = [f"{k};{20 + k % 7}" for k in range(200)]
    log, t_ns, _ = read(table(tmp_path, "\n".join(["t;T", *rows[:100], line, *rows[101:], ""])))
    assert (log.found, len(t_ns), [one.record for one in log.rejected]) == (200, 199, [100])


PREAMBLES = {
    "GRAPHTEC": "Vendor,GRAPHTEC Corporation\nModel,GL840\nSampling interval,1s\nTotal data points,3\n"
    "AMP settings\nCH,Signal name,Input,Range,Filter\nCH1,Wicklung,TEMP,TC_K,Off\n\nData\n"
    "Number,Date&Time,CH1,CH2\nNO.,Time,degC,degC\n",
    "sections": "[Device]\nSerial;4711\nStart;24.12.2025 08:00:00\n\n[Data]\nZeit;T_mag;T_w\n;°C;°C\n",
    "sep=": "sep=;\nZeit;T_mag;T_w\n",
    "padded": "Bench 7;;\nEngineer;Öller;\n;;\nZeit;T_mag;T_w\ns;°C;°C\n",
    "comments": "# bench 7, test 12; engineer: Öller\n# rate: 1 Hz\n#\nZeit;T_mag;T_w\n",
    "as wide as the table": "Device;GL840;-\nSerial;1234;5678\nMode;fast;on\nZeit;T_mag;T_w\n[s];[°C];[°C]\n",
    "long": "".join(f"Parameter {k}={k * k}\n" for k in range(150)) + "\nZeit;T_mag;T_w\n",
}


@pytest.mark.parametrize("above", PREAMBLES.values(), ids=list(PREAMBLES))
def test_lines_that_a_logger_writes_above_the_header_are_found_and_kept(tmp_path: Path, above: str) -> None:
    lines = above.splitlines()
    place = next(i for i, line in enumerate(lines) if line.startswith(("Zeit", "Number")))
    row = (
        "{0},2025/12/24 08:00:0{0},+    20.5,+    80.5\n" if "," in lines[place] else "24.12.2025 08:00:0{};20,5;80,5\n"
    )
    rows = [row.format(k) for k in range(3)] * (200 if len(lines) > 100 else 1)
    log, t_ns, columns = read(table(tmp_path, above + "".join(rows)))
    first, second = lines[place].replace(",", ";").replace("CH1", "Wicklung").split(";")[-2:]
    assert t_ns[:3] == [DECEMBER_NS + k * S_NS for k in range(3)] and len(t_ns) == len(rows)
    assert (columns[first][:3], columns[second][:3]) == ([20.5] * 3, [80.5] * 3)
    assert log.settings["header_line"] == place + 1
    assert log.settings["above_header"] == [line[:64] for line in lines[:place] if line][:20]
    assert log.settings["units_row"] == (place + 1 < len(lines)) == bool(log.units)


def test_a_spoiled_row_below_the_header_is_no_header(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "Bench 7\nt;T\n0;ERR\n1;21\n2;22\n"))
    assert (t_ns, columns) == ([S_NS, 2 * S_NS], {"T": [21, 22]})
    assert [one.where for one in log.rejected] == ["line 3, column T"]


def test_rows_of_text_below_the_units_are_no_header(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "t;T;n\ns;°C;rpm\noff;off;off\n0;20;1\n1;21;1\n"))
    assert (t_ns, columns["T"], log.units["T"]) == ([0, S_NS], [20, 21], "°C")
    assert [one.where for one in log.rejected] == ["line 3, column t"] and "header_line" not in log.settings


def test_a_line_of_rates_below_the_units_is_no_header(tmp_path: Path) -> None:
    head = "Name;t;T;n\nEinheit;s;degC;1/min\nRate;;10Hz;10Hz\n"
    log, t_ns, columns = read(table(tmp_path, head + "log;0,0;20,5;1\nlog;0,1;20,6;2\n"))
    assert (t_ns, columns["T"], columns["n"]) == ([0, S_NS // 10], [20.5, 20.6], [1, 2])
    assert (log.units["T"], log.units["n"]) == ("degC", "1/min")
    assert (log.found, list(log.rejected)) == (2, [])


@pytest.mark.parametrize("types", ["datetime;Double;Float\n", "REAL;REAL;DINT\n", '"float64";"float64";"int32"\r\n'])
@pytest.mark.parametrize("head", ["t;T;n\n{0}s;degC;rpm\n", "t;T;n\ns;degC;rpm\n{0}", "{0}t;T;n\ns;degC;rpm\n"])
def test_a_line_of_types_is_neither_names_nor_a_row(tmp_path: Path, head: str, types: str) -> None:
    log, t_ns, columns = read(table(tmp_path, head.format(types) + "0;20,5;1\n1;21,5;2\n"))
    assert (t_ns, columns) == ([0, S_NS], {"T": [20.5, 21.5], "n": [1, 2]})
    assert (log.units["T"], log.found, list(log.rejected)) == ("degC", 2, [])


@pytest.mark.parametrize(
    "head",
    [
        'Name,Time,T,n\nUnit,s,degC,rpm\nDescription,since start,winding U,"speed, actual"\n',
        "Name,Time,T,n\nComment,,,at the shaft\nUnit,s,degC,rpm\n",
    ],
)
def test_a_line_of_descriptions_beside_the_units_is_neither_names_nor_a_row(tmp_path: Path, head: str) -> None:
    log, t_ns, columns = read(table(tmp_path, head + ",0,20.5,1\n,1,21.5,2\n"))
    assert (t_ns, columns["T"], columns["n"]) == ([0, S_NS], [20.5, 21.5], [1, 2])
    assert (log.units["T"], log.found, list(log.rejected)) == ("degC", 2, [])


def test_names_and_units_without_a_row_are_said_to_be_such(tmp_path: Path) -> None:
    with pytest.raises(UnreadableLogError, match="holds names and units and no row below them"):
        read(table(tmp_path, "Time,T,n\ns,degC,1/min\n"))
    assert read(table(tmp_path, "Time,T,n\n1,1,1\n"))[2] == {"T": [1], "n": [1]}


def test_a_table_without_lines_above_says_nothing_of_them(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "t,state,T\n0,on,1\n1,off,2\n2,on,3\n"))
    assert "header_line" not in log.settings and columns["state"] == ["on", "off", "on"]


@pytest.mark.parametrize(
    ("rows", "units"),
    [
        ("s,degC,1\n0,20.5,0.1\n1,21,0.2\n", {"t": "s", "T": "degC", "x": "1"}),
        ("[s],(degC),\n0,20.5,0.1\n1,21,0.2\n", {"t": "s", "T": "degC"}),
        ("0,abc,0.1\n1,21,0.2\n2,22,0.3\n", {}),
        ("0,--,0.1\n1,21,0.2\n2,22,0.3\n", {}),
    ],
    ids=["units", "bracketed", "a row with text in it", "a row with a gap in it"],
)
def test_a_row_of_units_is_told_from_a_row_of_data(tmp_path: Path, rows: str, units: dict[str, str]) -> None:
    log, _, _ = read(table(tmp_path, "t,T,x\n" + rows))
    assert (log.settings["units_row"], log.units) == (bool(units), units)
    assert log.found == 2 + (not units)


@pytest.mark.parametrize("token", sorted(MISSING))
def test_a_sign_for_missing_is_nan(tmp_path: Path, token: str) -> None:
    log, _, columns = read(table(tmp_path, f"t,T\n0,20\n1,{token}\n2, {token} \n3,21\n"))
    np.testing.assert_array_equal(columns["T"], [20, np.nan, np.nan, 21])
    assert not log.rejected


@pytest.mark.parametrize("thousands", ["20", '"1,234.5"'])
def test_what_instruments_answer_for_over_range_is_no_reading(tmp_path: Path, thousands: str) -> None:
    rows = f"0,{thousands}\n1,+9.90000E+37\n2,-9.9E37\n3,9.91E+37\n4,9.8E37\n"
    _, _, columns = read(table(tmp_path, "t,T\n" + rows))
    np.testing.assert_array_equal(columns["T"][1:], [np.nan, np.nan, np.nan, 9.8e37])


def test_columns_of_text_stay_text_and_codes_are_no_numbers(tmp_path: Path) -> None:
    _, _, columns = read(table(tmp_path, "t,serial,state,mixed\n0,0417,on,1\n1,0418,off,x\n2,0419,on,y\n"))
    assert columns == {"serial": ["0417", "0418", "0419"], "state": ["on", "off", "on"], "mixed": ["1", "x", "y"]}


def test_a_column_that_is_empty_at_first_is_what_it_holds_later(tmp_path: Path) -> None:
    rows = "".join(f"{n},,\n" for n in range(300)) + "300,start of S1,\n301,,\n302,,7.5\n"
    _, _, columns = read(table(tmp_path, "t,comment,late\n" + rows))
    assert columns["comment"][299:] == ["", "start of S1", "", ""]
    assert columns["late"][-1] == 7.5 and np.isnan(columns["late"][:-1]).all()


def test_empty_and_repeated_names_are_made_unique_and_said(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "t,T,,T,T_2\n0,1,2,3,4\n1,1,2,3,4\n"))
    assert list(columns) == ["T", "column_3", "T_3", "T_2"]
    assert log.settings["renamed"] == {"": ["column_3"], "T": ["T", "T_3"]}


def test_a_delimiter_at_the_end_of_each_row_is_a_column_without_name(tmp_path: Path) -> None:
    """In which a remark may stand further down."""
    rows = "".join(f"{k};20,5;\n" for k in range(300))
    log, _, columns = read(table(tmp_path, f"t;T\n{rows}300;21,5;stopped\n"))
    assert (columns["T"][-1], columns["column_3"][0], columns["column_3"][-1]) == (21.5, "", "stopped")
    assert not log.rejected


def test_a_delimiter_at_the_end_of_the_names_alone_makes_no_column(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "time;T;\ns;°C\n0;20\n1;21\n2;22\n"))
    assert (columns, log.units, list(log.rejected)) == ({"T": [20, 21, 22]}, {"time": "s", "T": "°C"}, [])


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("T (°C) [TC01]", "°C"),
        ("T [TC01]", "TC01"),
        ("T (hot) [K]", "K"),
        ("n (rpm) [1/min]", "1/min"),
        ("p [bar(a)]", "bar(a)"),
    ],
)
def test_brackets_at_the_end_of_a_name_hold_its_unit_unless_it_stands_before(
    tmp_path: Path, name: str, unit: str
) -> None:
    assert read(table(tmp_path, f"t,{name}\n0,20\n1,21\n"))[0].units == {name: unit}


@pytest.mark.parametrize("numbers", ["1;2;3", "0;1;2", ";1;2"])
@pytest.mark.parametrize("units", ["", "s;°C;1/min\n"])
def test_the_names_may_stand_below_the_numbers_of_the_columns(tmp_path: Path, numbers: str, units: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"{numbers}\nTime;T_wdg;Speed\n{units}0;1;2\n1;2;3\n"))
    assert (t_ns, columns) == ([0, S_NS], {"T_wdg": [1, 2], "Speed": [2, 3]})
    assert log.units == ({"Time": "s", "T_wdg": "°C", "Speed": "1/min"} if units else {})


@pytest.mark.parametrize("above", ["", "Bench 3\n"])
@pytest.mark.parametrize("units", ["s;°C;1/min", "[s];[°C];[1/min]", ";°C;1/min"])
def test_units_may_stand_above_the_names(tmp_path: Path, above: str, units: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"{above}{units}\nTime;T_wdg;Speed\n0;20;5\n1;21;6\n"))
    assert (t_ns, columns) == ([0, S_NS], {"T_wdg": [20, 21], "Speed": [5, 6]})
    assert {name: log.units[name] for name in columns} == {"T_wdg": "°C", "Speed": "1/min"}


@pytest.mark.parametrize("cell", [">1300", "> 1300,5", "<-200", ">= 850"])
def test_a_number_that_is_only_a_bound_is_missing(tmp_path: Path, cell: str) -> None:
    log, _, columns = read(table(tmp_path, f"t;T;n\n0;20,5;5\n1;{cell};6\n2;21,5;7\n"))
    assert (same(columns["T"], [20.5, np.nan, 21.5]), columns["n"], list(log.rejected)) == (True, [5, 6, 7], [])


@pytest.mark.parametrize(("cell", "times"), [(">200", 1), ("> 200", 1), (">200 GOhm", 1), ("> 0,2 TΩ", 1000)])
@pytest.mark.parametrize("units", ["", ";GOhm;°C\n"])
def test_a_bound_in_the_first_row_is_no_unit_and_is_counted(tmp_path: Path, cell: str, times: int, units: str) -> None:
    unit = " GOhm" if cell[-1] in "mΩ" else ""
    rows = f"0;{cell};20,5\n1;85{unit};21\n2;{cell};21\n3;66{unit};22\n4;{cell};22\n"
    log, t_ns, columns = read(table(tmp_path, f"t;R_iso;T\n{units}{rows}"))
    assert (len(t_ns), same(columns["R_iso"], [np.nan, 85 / times, np.nan, 66 / times, np.nan])) == (5, True)
    assert (log.settings["bounds"], list(log.rejected)) == ({"R_iso": [cell, 3]}, [])


@pytest.mark.parametrize("delimiter", [";", "\t", "  "])
@pytest.mark.parametrize("late", ["20,5", "-2,5E+01"])
def test_decimal_commas_may_come_late(tmp_path: Path, delimiter: str, late: str) -> None:
    rows = [["Zeit", "T", "n"], *([f"{k}", "20", "0"] for k in range(1000)), ["1000", late, "0"]]
    log, _, columns = read(table(tmp_path, "".join(delimiter.join(row) + "\n" for row in rows)))
    assert columns["T"] == [*[20.0] * 1000, float(late.replace(",", "."))]
    assert (log.settings["decimal"], list(log.rejected)) == (",", [])


@pytest.mark.parametrize(("thousands", "number", "decimal"), [("1,200", "20.50", "."), ("1.200", "20,50", ",")])
def test_a_sign_that_surely_parts_decimals_goes_before_one_that_may_part_thousands(
    tmp_path: Path, thousands: str, number: str, decimal: str
) -> None:
    rows = f"0\t{thousands}\t{thousands}\t{number}\n1\t900\t900\t20\n"
    log, _, columns = read(table(tmp_path, f"t\tn\tM\tT\n{rows}"))
    assert (log.settings["decimal"], columns["T"]) == (decimal, [20.5, 20])
    assert log.settings["numbers_with_units"] == {"n": thousands, "M": thousands}


def test_late_commas_between_thousands_are_no_decimal_ones(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "t\tn\n" + "".join(f"{k}\t900\n" for k in range(300)) + "300\t1,200\n"))
    assert (len(columns["n"]), [one.why for one in log.rejected]) == (300, ['text "1,200" where numbers are'])


def test_decimal_commas_between_commas_are_refused_with_what_to_do(tmp_path: Path) -> None:
    path = table(tmp_path, "t,T,n\n0,5,20,5,1\n1,5,21,5,1\n")
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    assert str(refused.value) == (
        "log.csv: rows hold 5 fields where the header holds 3: the comma seems to be the decimal sign as well as the "
        'delimiter. Export it with decimal points, or with ";" between the columns.'
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0,20.5\n1,21.5\n", "log.csv: line 1 holds numbers where the names of the columns should be."),
        (
            "2025-03-14 08:00:00;T;20\n2025-03-14 08:00:01;T;21\n",
            'log.csv: line 1 holds a time ("2025-03-14 08:00:00")',
        ),
        ('"t;T"\n"0;20,5"\n"1;21,5"\n', "log.csv: each line stands in quotes as one cell,"),
        ("t,T\n", "log.csv: holds one line and no row below it: nothing to read."),
        ("\n \n", "log.csv: holds no line with text: nothing to read."),
        ("t,T,n\n0,x\n1,20\n2,21\n", "log.csv: most rows hold 2 fields where line 1 holds 3: it is not their header."),
        ("t,T\n,20\n,21\n", "log.csv: no column is recognised as its time."),
    ],
)
def test_a_table_that_cannot_be_one_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(table(tmp_path, text))
    assert str(refused.value).startswith(says)


# ---- rows -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("row", "where", "why"),
    [
        ("7,20,30,40", "line 9", "has 4 fields where the header has 3"),
        ("7,20", "line 9", "has 2 fields where the header has 3"),
        ("pause", "line 9", "has 1 field where the header has 3"),
        ("7,ERR,1", "line 9, column T", 'text "ERR" where numbers are'),
        ("7,1e999,1", "line 9, column T", 'text "1e999" where numbers are'),
        ("7,1_0,1", "line 9, column T", 'text "1_0" where numbers are'),
        ("7,0x10,1", "line 9, column T", 'text "0x10" where numbers are'),
        (",20,1", "line 9, column t", "no time"),
        ('7,"20,1', "line 9", "has 2 fields where the header has 3"),
        ("9e18,20,1", "line 9, column t", '"9e+18" is no time (s from the start)'),
    ],
)
def test_a_row_that_cannot_be_read_is_rejected_and_the_others_are_kept(
    tmp_path: Path, row: str, where: str, why: str
) -> None:
    rows = [f"{n},{20 + n},1" for n in range(7)] + [row] + [f"{n},{20 + n},1" for n in range(8, 200)]
    log, t_ns, columns = read(table(tmp_path, "t,T,n\n" + "\n".join(rows) + "\n"))
    assert [(entry.record, entry.where, entry.why) for entry in log.rejected] == [(7, where, why)]
    assert len(t_ns) == 199 and columns["T"][7] == 28
    assert log.cut is None


def test_blank_lines_are_no_rows_but_count_as_lines(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "t,T\r\n0,20\r\n\r\n1,abc\r\n2,21\r\n3,21\r\n \r\n"))
    assert (log.found, t_ns) == (4, [0, 2 * S_NS, 3 * S_NS])
    assert log.rejected[0].where == "line 4, column T"


def test_comments_and_the_header_again_are_no_rows_but_count_as_lines(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "t,T\n0,20\n# door opened\n1,abc\nt,T\n2,21\n# end"))
    assert (log.found, t_ns, log.settings["lines_of_no_row"]) == (3, [0, 2 * S_NS], 3)
    assert log.rejected[0].where == "line 4, column T" and log.cut is None


def test_a_last_row_that_is_cut_is_said(tmp_path: Path) -> None:
    log, _, _ = read(table(tmp_path, "t,T,n\n0,20,1\n1,21,1\n2,2"))
    assert log.cut == f"ends inside line 4: 2 rows were read and kept{COPY_AGAIN}"


PLAIN = ["1", "-2.5", "+3e-2", ".5", "7.", "", "NaN", "-", "x", "inf", " 4 ", '"5"', '"6', "1,2", "1e400", "٣"]
GROUPED = [
    "1.234,5",
    "-1.234",
    "1.234.567",
    "1,5",
    "12",
    "",
    "NaN",
    "x",
    " 4,0 ",
    '"1.000,5"',
    "1.23",
    "1 000",
    "1e400",
]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10_000), written=st.sampled_from([(",", PLAIN, "1"), (";", GROUPED, "1.234,5")]))
def test_rows_read_together_equal_rows_read_one_by_one(
    tmp_path: Path, seed: int, written: tuple[str, list[str], str]
) -> None:
    chance, (delimiter, cells, usual) = random.Random(seed), written
    rows = [delimiter.join([str(n), chance.choice(cells), chance.choice(["a", "", '"b,c"'])]) for n in range(40)]
    fine = [delimiter.join([str(n), usual, "a"]) for n in range(200)]
    path = table(tmp_path, delimiter.join(["t", "T", "note"]) + "\n" + "\n".join(fine + rows) + "\n")
    both = []
    for together in (LineReader._together, lambda self, lines: None):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(LineReader, "_together", together)
            log, t_ns, columns = read(path)
        both.append((log.rejected, t_ns, columns["note"], [repr(value) for value in columns["T"]]))
    assert both[0] == both[1]


def test_a_line_in_another_encoding_leaves_the_others_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("t;T_Rücken;note\n0;20;zu\n".encode() + "1;21;Tür\n".encode("cp1252") + bytes(700))
    log, _, columns = read(path)  # a small file that a disk has filled with zeros is a text too
    assert (columns["T_Rücken"], columns["note"], len(log.rejected)) == ([20, 21], ["zu", "Tür"], 1)


@pytest.mark.parametrize(("last", "rows"), [("2;20,7;2", 2), ("2;20,7;2,5", 3), ("2;20,7;", 3), ("2;20,7;2\n", 3)])
def test_a_last_line_without_end_whose_number_lacks_decimals_is_cut(tmp_path: Path, last: str, rows: int) -> None:
    log, t_ns, _ = read(table(tmp_path, f"Zeit;T;U\n0;20,5;21,5\n1;20,6;21,6\n{last}"))
    assert (len(t_ns), len(log.rejected), log.cut is None) == (rows, 3 - rows, rows == 3)


# ---- numbers as German and Italian loggers write them ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "wanted", "said"),
    [
        (["1.234,5", "998,25", "1.234"], [1234.5, 998.25, 1234.0], "."),
        (["1.234.567,5", "-2.000,0", "+1,5e3"], [1234567.5, -2000.0, 1500.0], "."),
        (["1 234,5", "998,25", "12 345 678"], [1234.5, 998.25, 12345678.0], " "),
        (["1\u202f234,5", "998,25", "1,0"], [1234.5, 998.25, 1.0], "\u202f"),
        (["1'234.5", "998.25", "1'000"], [1234.5, 998.25, 1000.0], "'"),
        (["1,234.5", "998.25", "1,234"], [1234.5, 998.25, 1234.0], ","),
        (["1.234.567", "0,5", "--"], [1234567.0, 0.5, np.nan], "."),
        (["+    23.1", "- 0.5", "+   998"], [23.1, -0.5, 998.0], " "),
        (["0.5", "1.234", "20.125"], [0.5, 1.234, 20.125], None),  # decimals, not thousands
    ],
)
def test_signs_between_thousands_are_read_where_they_cannot_be_decimals(
    tmp_path: Path, cells: list[str], wanted: list[float], said: str | None
) -> None:
    log, _, columns = read(table(tmp_path, "t;R\n" + "".join(f"{i};{cell}\n" for i, cell in enumerate(cells))))
    np.testing.assert_array_equal(columns["R"], wanted)
    assert log.settings.get("thousands") == said and not log.rejected


def test_thousands_that_come_late_are_read_where_they_are_sure_and_rejected_where_not(tmp_path: Path) -> None:
    rows = [f"{i};998,5\n" for i in range(300)]
    log, _, columns = read(table(tmp_path, "t;R\n" + "".join(rows) + "300;1.001,5\n301;1.002\n302;1.002.003\n"))
    assert columns["R"][300:] == [1001.5, 1002003.0]
    assert [(entry.where, entry.why) for entry in log.rejected] == [
        ("line 303, column R", 'text "1.002" where numbers are')
    ]


@pytest.mark.parametrize("text", ["1.23,5", "1234.567,5", "0.123,5", "1.2345,5", "1,234.5", "1 23", "12.3456"])
def test_groups_that_are_not_of_three_digits_are_no_number(tmp_path: Path, text: str) -> None:
    log, _, _ = read(table(tmp_path, f"t;R\n0;1.234,5\n1;2,5\n2;3,5\n3;{text}\n"))
    assert [entry.why for entry in log.rejected] == [f'text "{text}" where numbers are']


@pytest.mark.parametrize("end", ["", "3 s,oops,1000 rpm,\n"])  # all rows together, and one by one
def test_units_in_the_cells_are_those_of_their_columns(tmp_path: Path, end: str) -> None:
    rows = "0 s,20.5 °C,1000 rpm,\n1 s,--- °C,1001rpm,b\n2 s,21 °C,,\n"
    log, t_ns, columns = read(table(tmp_path, f"time,T,n,note\n{rows}{end}"))
    np.testing.assert_array_equal(columns["T"], [20.5, np.nan, 21])
    np.testing.assert_array_equal(columns["n"], [1000, 1001, np.nan])
    assert (t_ns, log.units) == ([0, S_NS, 2 * S_NS], {"time": "s", "T": "°C", "n": "rpm"})
    assert len(log.rejected) == (end != "")
    assert "numbers_with_units" not in log.settings


def test_units_in_the_cells_may_stand_behind_decimal_commas(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "Zeit;T;M [x];U;d\n0;20,5 °C;1.200,5 Nm;5,0V;50%\n1;21 °C;7 Nm;5,1V;5%\n"))
    assert (columns["T"], columns["M [x]"], columns["U"], columns["d"]) == ([20.5, 21], [1200.5, 7], [5, 5.1], [50, 5])
    assert log.units == {"T": "°C", "M [x]": "Nm", "U": "V", "d": "%"}


@pytest.mark.parametrize(
    "cells",
    [
        ("12A", "13A"),
        ("1 pc", "2 pc"),
        ("12-", "13-"),
        ("900 mV", "1.2 A"),
        ("20 °C", "290 K"),
        ("5 V", "b"),
        ("1.5k", "900m"),
    ],
)
def test_cells_that_do_not_end_in_units_of_one_kind_stay_texts(tmp_path: Path, cells: tuple[str, str]) -> None:
    _, _, columns = read(table(tmp_path, "time,T,x\n0,20," + "\n1,21,".join(cells) + "\n"))
    assert columns["x"] == [*cells]


@pytest.mark.parametrize("cell", ["1.5-", "20 ± 0.5", "20±0.5", "(1.5)", "0x1F", "2.05D+01"])
def test_numbers_with_other_signs_are_texts_that_are_named(tmp_path: Path, cell: str) -> None:
    log, _, columns = read(table(tmp_path, f"time,T,n\n0,{cell},1\n1,{cell},2\n"))
    assert (columns["T"], log.settings["numbers_with_units"]) == ([cell, cell], {"T": cell})


def test_numbers_with_units_of_several_kinds_in_their_cells_are_texts_that_are_named(tmp_path: Path) -> None:
    log, _, _ = read(table(tmp_path, "time,T,U\n0,20,900 mV\n1,21,1.2 A\n"))
    assert log.settings["numbers_with_units"] == {"U": "900 mV"}


@pytest.mark.parametrize("rows", [4, 400])  # before the meter chooses another range: what is looked at first, and more
def test_a_meter_may_choose_its_range_row_by_row(tmp_path: Path, rows: int) -> None:
    cells = ["5 mV", *["900.5 mV"] * (rows - 2), "---- V", "1.25 V", "1,2"]
    log, _, columns = read(table(tmp_path, "time;U\n" + "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))))
    np.testing.assert_allclose(columns["U"], [5, *[900.5] * (rows - 2), np.nan, 1250])
    assert (log.units, [one.why for one in log.rejected]) == ({"U": "mV"}, ['text "1,2" where numbers are'])


def test_a_row_of_data_is_no_header_where_its_time_is_one(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "time,M\n0,(1.5)\n1,(2.5)\n2,3.5\n3,4.5\n4,5.5\n"))
    assert (t_ns, columns, log.found) == ([2 * S_NS, 3 * S_NS, 4 * S_NS], {"M": [3.5, 4.5, 5.5]}, 5)


def test_numbers_that_may_have_thousands_are_texts_that_are_named(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "Zeit;n;T\n0;1.500;20,5\n1;900;20,6\n2;1.600;20,7\n"))
    assert (columns["T"], columns["n"]) == ([20.5, 20.6, 20.7], ["1.500", "900", "1.600"])
    assert log.settings["numbers_with_units"] == {"n": "1.500"}


@pytest.mark.parametrize(
    "cell",
    [
        "NoValue",
        "n.a.",
        "k.A.",
        "Overflow",
        "OVER RANGE",
        "∞",
        "-∞",
        "---O-F---",
        "BURN OUT",
        "Open circuit",
        "OTC",
        "no data",
        "No Data",
        "I/O Timeout",
        "Pt Created",
        "Open TC",
        "Fühlerbruch",
        "FÜHLERBRUCH",
        "Fuori scala",
        "hors échelle",
    ],
)
def test_a_sensor_that_says_that_it_failed_is_a_missing_number(tmp_path: Path, cell: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"t,T,U\n0,20,1\n1,{cell},2\n2,21,3\n"))
    np.testing.assert_array_equal(columns["T"], [20, np.nan, 21])
    assert (len(t_ns), columns["U"], list(log.rejected)) == (3, [1, 2, 3], [])


def test_the_minus_of_typesetters_is_one(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "t,T [°C]\n0,−3.5\n1,−4.5\n2,5\n"))
    assert (columns["T [°C]"], list(log.rejected)) == ([-3.5, -4.5, 5], [])


# ---- size and packing -----------------------------------------------------------------------------------------------


def test_a_packed_table_is_read_through(tmp_path: Path) -> None:
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"t,T\n0,20\n1,21\n"))
    log, t_ns, _ = read(path)
    assert (t_ns, log.settings["gz"]) == ([0, S_NS], True)


def test_a_packed_table_that_is_cut_keeps_its_whole_rows(tmp_path: Path) -> None:
    chance = random.Random(6)
    packed = gzip.compress(("t,T\n" + "".join(f"{n},{chance.random() * 100:.6f}\n" for n in range(5000))).encode())
    path = tmp_path / "log.csv.gz"
    path.write_bytes(packed[:-20_000])
    log, t_ns, _ = read(path)
    assert 500 < len(t_ns) < 4500
    assert log.cut and log.cut.startswith(f"ends inside its packed contents at byte {len(packed) - 20_000:,}: ")
    assert log.rejected == [] or log.rejected[-1].why == "the file ends inside it"


def test_a_packed_bomb_is_stopped_at_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats.ALWAYS", 1 << 20)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"t,T\n" + b"0,20\n" * 4_000_000, compresslevel=9))
    log, _, _ = read(path, TimeSpec(rate_hz=1.0))
    limit = 200 * path.stat().st_size
    assert limit < 20_000_000
    assert log.cut and log.cut.startswith(f"unpacks to more than {limit:,} bytes: ")


def test_an_overlong_line_without_end_is_a_cut_row(tmp_path: Path) -> None:
    path = tmp_path / "line.csv"
    path.write_bytes(b"t,T\n0,20\n1,21\n" + b"0" * (6 << 20))
    log, t_ns, _ = read(path)
    assert len(t_ns) == 2
    assert log.cut == f"ends inside line 4: 2 rows were read and kept{COPY_AGAIN}"


def test_a_table_of_several_blocks_counts_lines_and_records_through(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.formats._text.BLOCK", 1000)
    rows = [f"{n},{20 + n}" for n in range(3000)]
    rows[2500] = "2500,abc"
    log, t_ns, _ = read(table(tmp_path, "t,T\n" + "\n".join(rows)))
    assert (log.found, len(t_ns), t_ns[-1]) == (3000, 2999, 2999 * S_NS)
    assert [(entry.record, entry.where) for entry in log.rejected] == [(2500, "line 2,502, column T")]


def test_a_packed_table_with_a_flipped_byte_is_not_half_believed(tmp_path: Path) -> None:
    path = tmp_path / "flip.csv.gz"
    rows = "".join(f"{k},{20 + k % 7 / 10}\n" for k in range(5000))
    data = bytearray(gzip.compress(f"time,T\n{rows}".encode(), mtime=0))
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)
    with pytest.raises(UnreadableLogError, match=r"flip\.csv\.gz: .*any line may be wrong"):
        list(open_log(path).batches())


def test_a_table_with_a_row_a_check_needs_no_time(tmp_path: Path) -> None:
    checks = table(tmp_path, "serial,dose_h,R\nM1,12,0.05\nM2,10,0.04\nM1,0,0.06\n")
    log, t_ns, columns = read(checks, TimeSpec(untimed=True))
    assert (t_ns, columns["dose_h"], log.absolute) == ([0, S_NS, 2 * S_NS], [12, 10, 0], False)
    dated = table(tmp_path, "serial,Zeit,R\nM1,03.03.2024,0.05\nM2,01.03.2024,0.04\n", "dated.csv")
    assert read(dated, TimeSpec(untimed=True))[0].absolute
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(table(tmp_path, "serial,Zeit,R\nM1,soon,0.05\n", "soon.csv"), TimeSpec(untimed=True))


# ---- zeros where a disk lost something ------------------------------------------------------------------------------

LONG_TABLE = "t_s,n_rpm\n" + "".join(f"{k},{1000 + k}\n" for k in range(400))


def test_zeros_above_a_table_are_said_and_its_rows_are_read(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "\0" * 512 + LONG_TABLE))
    assert (log.settings["zeros_at_head"], log.found, columns["n_rpm"][-1]) == (512, 400, 1399)


def test_a_table_whose_header_is_lost_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"2026-11-28T10:{k // 60:02d}:{k % 60:02d}Z,{k}\n" for k in range(400))
    with pytest.raises(UnreadableLogError, match=r"its first 512 bytes are 0: its header is lost\. Copy the file"):
        read(table(tmp_path, "\0" * 512 + rows[512:]))


def test_a_lost_sector_costs_the_rows_in_it(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, LONG_TABLE[:1024] + "\0" * 512 + LONG_TABLE[1536:]))
    assert (len(log.rejected), len(columns["n_rpm"]), columns["n_rpm"][-1]) == (1, log.found - 1, 1399)
