"""Tables: what is recognised, what every row becomes, and the line a person reads where a table is refused."""

import gzip
import random
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, open_log, utc_ns
from ingest.formats._csv_lines import LineReader
from ingest.formats._csv_numbers import MISSING
from made.places import LOGS
from made.tables import read

COPY_AGAIN = "; copy the file again if the original is whole."

S_NS = 1_000_000_000
MARCH_NS = 1_709_280_000 * S_NS  # 1 March 2024, 08:00 UTC


def table(folder: Path, text: str, name: str = "log.csv", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


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


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("packed", [bytes, gzip.compress])
@pytest.mark.parametrize("block", [1 << 20, 1001])  # of bytes: a character may be cut between two
def test_utf_16_with_its_mark_is_read(
    tmp_path: Path, encoding: str, packed: Callable[[bytes], bytes], block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.formats._text.BLOCK", block)
    path = tmp_path / "log.csv"
    rows = "".join(f"{k};{k},5\r\n" for k in range(500))
    path.write_bytes(packed(f"\ufeffZeit;Öl [°C]\r\n{rows}".encode(encoding)))
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


def test_utf_16_without_its_mark_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(UnreadableLogError, match=r"log\.csv: is text in UTF-16 without its mark\. Save it in UTF-8\."):
        read(table(tmp_path, "t;T\n0;20\n", encoding="utf-16-le"))


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
    first, second = lines[place].replace(",", ";").split(";")[-2:]
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


# ---- time -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "cells", "wanted", "absolute"),
    [
        ("time", ["0", "0.5"], [0, S_NS // 2], False),
        ("Time [ms]", ["0", "500"], [0, S_NS // 2], False),
        ("time_us", ["0", "500000"], [0, S_NS // 2], False),
        ("Zeit in min", ["0", "0.5"], [0, 30 * S_NS], False),
        ("timestamp", ["1709280000", "1709280000.25"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("timestamp", ["1709280000000", "1709280000250"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("when", ["2024-03-01 08:00:00", "2024-03-01 08:00:00.25"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("when", ["2024/03/01 08:00:00:250", "2024/3/1 08:00"], [MARCH_NS + S_NS // 4, MARCH_NS], True),
        ("when", ["2024-03-01T08:00:00Z", "2024-03-01T09:00:00+01:00"], [MARCH_NS, MARCH_NS], True),
        ("DateTime", ["01.03.2024 08:00:00,25", "01.03.2024 08:00"], [MARCH_NS + S_NS // 4, MARCH_NS], True),
    ],
)
def test_a_time_column_is_recognised(
    tmp_path: Path, header: str, cells: list[str], wanted: list[int], absolute: bool
) -> None:
    path = table(tmp_path, f"n;{header}\n" + "".join(f"1;{cell}\n" for cell in cells))
    log, t_ns, columns = read(path)
    assert (t_ns, log.absolute, list(columns)) == (wanted, absolute, ["n"])
    assert log.settings["time_column"] == header


@pytest.mark.parametrize(
    ("text", "second_ns", "says"),
    [
        ("t_s,time_utc,T\n0,2024-03-01T08:00:00,1\n1,2024-03-01T08:00:01,2\n", S_NS, "ISO 8601 in UTC"),
        ("t_s;time_utc;T\n0;01.03.2024 08:00:00,0;1\n1;01.03.2024 08:00:01,0;2\n", S_NS, "day.month.year in UTC"),
        (
            "t_s,Zeitstempel,T\n0.0,01.03.2024 09:00:00,1\n0.5,01.03.2024 09:00:00,2\n",
            S_NS // 2,
            "s from the start, dated by Zeitstempel",
        ),
        (
            "Datum;Uhrzeit;t_s;T\n01.03.2024;09:00:00;0;1\n01.03.2024;09:00:01;1;2\n",
            S_NS,
            "day.month.year in Europe/Berlin",
        ),
    ],
)
def test_a_date_beside_a_column_that_counts_is_not_lost(tmp_path: Path, text: str, second_ns: int, says: str) -> None:
    log, t_ns, _ = read(table(tmp_path, text), TimeSpec(zone="Europe/Berlin"))
    assert log.absolute and log.settings["time"] == says
    assert t_ns == [MARCH_NS, MARCH_NS + second_ns]


def test_a_date_that_does_not_go_on_with_the_rows_dates_nothing(tmp_path: Path) -> None:
    log, _, _ = read(table(tmp_path, "t_s,time,T\n0,2024-03-01T08:00:00,1\n9,2024-03-01T08:00:00,2\n"))
    assert not log.absolute and log.settings["time"] == "s from the start"


def test_a_clock_that_is_started_anew_in_the_middle_is_a_time(tmp_path: Path) -> None:
    rows = "".join(f"{k},20\n" for k in range(60))
    log, t_ns, _ = read(table(tmp_path, f"time_s,T\n{rows}time_s,T\n{rows}"))
    assert (len(t_ns), log.settings["backward_steps"], list(log.rejected)) == (120, 1, [])


def test_a_line_in_another_encoding_leaves_the_others_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("t;T_Rücken;note\n0;20;zu\n".encode() + "1;21;Tür\n".encode("cp1252") + bytes(700))
    log, _, columns = read(path)  # a small file that a disk has filled with zeros is a text too
    assert (columns["T_Rücken"], columns["note"], len(log.rejected)) == ([20, 21], ["zu", "Tür"], 1)


def test_a_column_t_that_does_not_rise_is_a_temperature(tmp_path: Path) -> None:
    path = table(tmp_path, "t,n\n20,1\n19.5,1\n19.0,1\n20,1\n")
    with pytest.raises(
        UnreadableLogError, match=r"no column is recognised as its time\. Under \[time\] of the bench file say"
    ):
        read(path)


def test_a_table_without_time_is_refused_with_both_ways_out(tmp_path: Path) -> None:
    path = table(tmp_path, "uhr;T\n1;20\n2;21\n", "id_0.csv")
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    assert str(refused.value) == (
        "id_0.csv: no column is recognised as its time. "
        "Under [time] of the bench file say rate_hz = 1.0 (rows at a fixed "
        'rate), or column = "..." with format or unit.'
    )


def test_a_date_without_a_clock_is_shown_in_the_refusal(tmp_path: Path) -> None:
    path = table(tmp_path, "Time,T\n2024-03-01,20\n2024-03-02,21\n")
    with pytest.raises(UnreadableLogError, match=r'\("Time" holds "2024-03-01", which is no whole stamp\)'):
        read(path)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        ("23:59:58 23:59:59,5 00:00:01", [86_398, 86_399.5, 86_401]),
        ("00:00:00.0 23:59:59.0 24:00:00.0 100:06:40.0", [0, 86_399, 86_400, 360_400]),
        ("23:59:59 00:00:00 23:59:59 00:00:00", [86_399, 86_400, 172_799, 172_800]),
    ],
    ids=["over midnight", "elapsed", "over two midnights"],
)
def test_times_of_day_count_from_their_midnight_and_pass_the_next(
    tmp_path: Path, cells: str, seconds: list[float]
) -> None:
    path = table(tmp_path, "Uhrzeit;T\n" + "".join(f"{cell};1\n" for cell in cells.split()))
    log, t_ns, _ = read(path)
    assert (t_ns, log.absolute, len(log.rejected)) == ([round(s * S_NS) for s in seconds], False, 0)
    assert read(path, TimeSpec(start_ns=DECEMBER_NS))[1][0] == t_ns[0] + DECEMBER_NS


def test_a_time_of_day_that_is_none_is_rejected(tmp_path: Path) -> None:
    log, t_ns, _ = read(
        table(tmp_path, "Time,T\n11:59:59 AM,1\n12:61:00 PM,1\n13:00:00 PM,1\n12:00:01 PM,1\n12:00:02 PM,1\n")
    )
    assert (t_ns, len(log.rejected)) == ([s * S_NS for s in (43_199, 43_201, 43_202)], 2)


@pytest.mark.parametrize(("name", "unit_ns"), [("millis", 1_000_000), ("timestamp_us", 1000)])
@pytest.mark.parametrize("rows", [4, 300])  # before the counter begins anew: within what is looked at first, and behind
def test_a_counter_of_32_bits_that_begins_anew_goes_on(tmp_path: Path, name: str, unit_ns: int, rows: int) -> None:
    counts = [(2**32 - 100 * rows + 100 * k) % 2**32 for k in range(2 * rows)]
    log, t_ns, _ = read(table(tmp_path, f"{name},T\n" + "".join(f"{count},1\n" for count in counts)))
    assert t_ns == [(2**32 - 100 * rows + 100 * k) * unit_ns for k in range(2 * rows)]
    assert (log.settings["counter_wraps"], log.settings["backward_steps"]) == (1, 0)


@pytest.mark.parametrize(("head", "step_s"), [("Zeit;T", 1), ("Datum;T", 600)])
def test_dates_as_spreadsheets_store_them_are_local_days(tmp_path: Path, head: str, step_s: int) -> None:
    days = [45_964 + k * step_s / 86_400 for k in range(5)]  # 2025-11-03
    rows = "".join(f"{day:.8f};1\n".replace(".", ",") for day in days)
    log, t_ns, _ = read(table(tmp_path, head + "\n" + rows), TimeSpec(zone="Europe/Rome"))
    begin = utc_ns(datetime(2025, 11, 3, tzinfo=ZoneInfo("Europe/Rome")))
    np.testing.assert_allclose(np.array(t_ns) - begin, np.arange(5) * step_s * S_NS, atol=500_000)
    assert log.absolute and log.settings["time"] == "days since 1899-12-30 in Europe/Rome"


def test_large_seconds_are_no_dates_of_a_spreadsheet(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Time,T\n45964.0,1\n45965.0,2\n"))
    assert (t_ns, log.absolute) == ([45_964 * S_NS, 45_965 * S_NS], False)


@pytest.mark.parametrize("head", ["Date,Time,Millisecond,T", "Date&Time,,ms,T", "Date,Time,Millisecondes,T"])
def test_milliseconds_in_a_column_of_their_own_belong_to_the_stamp(tmp_path: Path, head: str) -> None:
    blank = "," if head.startswith("Date,") else " "
    rows = [f"2025/12/24{blank}08:00:0{k // 2},{500 * (k % 2)},20" for k in range(4)]
    log, t_ns, columns = read(table(tmp_path, "\n".join([head.replace(",,", ","), *rows, ""])))
    assert t_ns == [DECEMBER_NS + k * S_NS // 2 for k in range(4)]
    assert list(columns) == ["T"] and log.settings["time_column"].endswith(head.split(",")[2])


def test_a_stamp_without_signs_is_a_date_and_no_number(tmp_path: Path) -> None:
    for stamp in ("20251224080000", "20251224T080000Z", "20251224_080000"):
        log, t_ns, _ = read(table(tmp_path, f"Time,T\n{stamp},20\n"))
        assert (t_ns, log.absolute) == ([DECEMBER_NS], True)


def test_a_short_year_may_stand_first_and_is_asked_for(tmp_path: Path) -> None:
    path = table(tmp_path, "Time,T\n25/12/24 08:00:00,1\n")
    with pytest.raises(
        UnreadableLogError, match=r'day or with the year\. .* format = "%d/%m/%y .* "%y/%m/%d %H:%M:%S"'
    ):
        read(path)
    assert read(path, TimeSpec(format="%y/%m/%d %H:%M:%S"))[1] == [DECEMBER_NS]
    assert read(table(tmp_path, "Time;T\n24/12/25 08:00:00;1,5\n"))[1] == [DECEMBER_NS]


def test_rows_at_a_fixed_rate_keep_their_place(tmp_path: Path) -> None:
    path = table(tmp_path, "T\n20\n21\nabc\n22\n23\n")
    log, t_ns, _ = read(path, TimeSpec(rate_hz=2.0))
    assert (t_ns, log.absolute) == ([0, S_NS // 2, 3 * S_NS // 2, 2 * S_NS], False)
    log, t_ns, _ = read(path, TimeSpec(rate_hz=2.0, start_ns=1_709_280_000_000_000_000))
    assert (t_ns[0], log.absolute) == (MARCH_NS, True)


def test_a_stated_column_counts_from_the_stated_start(tmp_path: Path) -> None:
    path = table(tmp_path, "T,clock\n20,10\n21,20\n")
    log, t_ns, columns = read(path, TimeSpec(column="clock", unit="ms", start_ns=1_709_280_000_000_000_000))
    assert (t_ns, log.absolute, list(columns)) == ([MARCH_NS + 10_000_000, MARCH_NS + 20_000_000], True, ["T"])


@pytest.mark.parametrize(
    ("form", "cell", "seconds"),
    [
        ("%d.%m.%Y %H:%M:%S", "1.3.2024 8:00:01", 1),
        ("%m/%d/%y %I:%M:%S %p", "03/01/24 08:00:01 AM", 1),
        ("%m/%d/%y %I:%M:%S %p", "03/01/24 12:00:01 pm", 4 * 3600 + 1),
        ("%Y%m%d%H%M%S", "20240301080001", 1),
        ("%d %b %Y %H:%M:%S.%f", "01 Mar 2024 08:00:01.000", 1),
        ("%Y-%m-%dT%H:%M:%S%z", "2024-03-01T08:00:01-02:00", 7201),
        ("%B %d, %Y %H:%M:%S", "March 01, 2024 08:00:01", 1),
    ],
)
def test_a_stated_format_is_read(tmp_path: Path, form: str, cell: str, seconds: int) -> None:
    path = table(tmp_path, f"when;T\n{cell};20\n{cell};21\n")
    log, t_ns, _ = read(path, TimeSpec(column="when", format=form))
    assert t_ns == [MARCH_NS + seconds * S_NS] * 2 and log.absolute


@pytest.mark.parametrize(
    "cells", [("01.03.2024", "13.03.2024"), ("3/1/2024", "3/13/2024"), ("2024-03-01", "2024-03-13")]
)
def test_days_alone_are_stamps_where_their_column_is_named(tmp_path: Path, cells: tuple[str, str]) -> None:
    path = table(tmp_path, "Datum,R\n" + "".join(f"{cell},0.05\n" for cell in cells))
    _, t_ns, _ = read(path, TimeSpec(column="Datum"))
    assert t_ns == [MARCH_NS - 8 * 3600 * S_NS + days * 24 * 3600 * S_NS for days in (0, 12)]
    path = table(tmp_path, "Datum,Uhrzeit,T\n" + "".join(f"{cell},08:00:00,20\n" for cell in cells))
    with pytest.raises(UnreadableLogError, match="format = "):  # a log's time of day stands beside them
        read(path, TimeSpec(column="Datum"))


@pytest.mark.parametrize("cell", ["31.02.2024 08:00:00", "01.13.2024 08:00:00", "01.03.2024 24:00:00", "gestern", ""])
def test_a_stamp_that_is_none_is_rejected(tmp_path: Path, cell: str) -> None:
    path = table(tmp_path, f"Zeit;T\n01.03.2024 08:00:00;20\n{cell};21\n01.03.2024 08:00:02;20\n")
    log, t_ns, _ = read(path, TimeSpec(column="Zeit", format="%d.%m.%Y %H:%M:%S"))
    assert t_ns == [MARCH_NS, MARCH_NS + 2 * S_NS]
    assert [entry.where for entry in log.rejected] == ["line 3, column Zeit"]


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        (
            TimeSpec(column="Tiem"),
            'column = "Tiem" under [time] of the bench file is none of the table. Nearest: Time.',
        ),
        (TimeSpec(column="T"), 'column "T" holds "warm", which is no number and no stamp that is known. Say format ='),
        (
            TimeSpec(column="Time", format="%H:%M"),
            'format = "%H:%M" under [time] of the bench file holds no whole date.',
        ),
        (TimeSpec(column="Time", format="%Y-%W"), 'format = "%Y-%W" under [time] of the bench file holds %W, which is'),
    ],
)
def test_a_stated_time_that_cannot_be_is_refused(tmp_path: Path, spec: TimeSpec, says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(table(tmp_path, "Time,T\n0,warm\n1,warm\n"), spec)
    assert str(refused.value).startswith(f"log.csv: {says}")


def test_steps_back_in_time_are_kept_and_counted(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "time,T\n" + "".join(f"{n},20\n" for n in (*range(20), 18, 19, 20, 10, 11))))
    assert len(t_ns) == 25 and log.settings["backward_steps"] == 2


def test_local_stamps_are_converted_on_both_sides_of_summer_time(tmp_path: Path) -> None:
    stamps = ["2024-03-31 01:59:59", "2024-03-31 03:00:00", "2024-03-31 03:00:01"]
    path = table(tmp_path, "time,T\n" + "".join(f"{stamp},20\n" for stamp in stamps))
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS, S_NS]
    assert "ambiguous_rows" not in log.settings


def test_the_hour_that_comes_twice_is_told_by_the_step_back(tmp_path: Path) -> None:
    local = ["01:59:59", "02:00:00", "02:59:59", "02:00:00", "02:59:59", "03:00:00"]
    path = table(tmp_path, "time,T\n" + "".join(f"2024-10-27 {clock},20\n" for clock in local))
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS, 3599 * S_NS, S_NS, 3599 * S_NS, S_NS]
    assert (log.settings["ambiguous_rows"], log.settings["backward_steps"]) == (4, 0)


@pytest.mark.parametrize("time", [TimeSpec(), TimeSpec(column="time", format="%d.%m.%Y %H:%M:%S")])
def test_a_time_that_does_not_exist_is_rejected_with_the_reason(tmp_path: Path, time: TimeSpec) -> None:
    local = ["01:59:59", "02:00:00", "02:30:00", "24:00:00", "03:00:00"]
    path = table(tmp_path, "time,T\n" + "".join(f"31.03.2024 {clock},20\n" for clock in local))
    log, t_ns, _ = read(path, replace(time, zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS]
    gone = "does not exist in Europe/Rome on that day (clocks went forward)"
    assert [(entry.where, entry.why) for entry in log.rejected[:2]] == [
        ("line 3, column time", f"02:00:00 {gone}"),
        ("line 4, column time", f"02:30:00 {gone}"),
    ]
    assert log.rejected[2].why.startswith('"31.03.2024 24:00:00" is no time (')


def test_a_stamp_with_its_own_offset_exists_whatever_the_zone(tmp_path: Path) -> None:
    path = table(tmp_path, "time,T\n2024-03-31T02:30:00+01:00,20\n2024-03-31T02:30:00,20\n")
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert len(t_ns) == 1 and log.rejected[0].why.startswith("02:30:00 does not exist in Europe/Rome")


# ---- numbers and stamps as German and Italian loggers write them ----------------------------------------------------


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


DECEMBER_NS = 1_766_563_200 * S_NS  # 24 December 2025, 08:00 UTC


@pytest.mark.parametrize(
    "stamp",
    [
        *("24.12.2025 08:00:0{}", "24.12.25 08:00:0{}", "24.12.2025, 08:00:0{}", "24.12.2025T08.00.0{}"),
        *("24/12/2025 08.00.0{}", "24/12/25 08:00:0{}", "24/12/2025  8:00:0{},000"),
        *("24-dic-2025 08.00.0{}", "24 dicembre 2025 08:00:0{}", "24/dic/25 08.00.0{}"),
        *("24. Dez. 2025 08:00:0{}", "24. Dezember 2025 08:00:0{}", "24.Dez.2025 08:00:0{}", "24-Dec-2025 08:00:0{}"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_german_and_italian_stamps_are_recognised(tmp_path: Path, stamp: str, encoding: str) -> None:
    rows = "".join(f"{stamp.format(i)};{230 + i},5\n" for i in range(3))
    log, t_ns, columns = read(table(tmp_path, f"Öfen;T\n;°C\n{rows}", encoding=encoding))
    assert t_ns == [DECEMBER_NS + i * S_NS for i in range(3)]
    assert (columns, log.units, log.absolute) == ({"T": [230.5, 231.5, 232.5]}, {"T": "°C"}, True)


@pytest.mark.parametrize(
    ("names", "month"),
    [
        ("gen Jan January gennaio Januar Jänner", 1), ("feb Februar febbraio", 2), ("mar März Mrz Maerz marzo", 3),
        ("apr aprile", 4), ("mag Mai May maggio", 5), ("giu Juni June giugno", 6), ("lug Juli July luglio", 7),
        ("ago Aug August agosto", 8), ("set Sep September settembre", 9), ("ott Okt Oct ottobre", 10),
        ("nov November novembre", 11), ("dic Dez Dec", 12),
    ],
)  # fmt: skip
def test_months_have_german_italian_and_english_names(tmp_path: Path, names: str, month: int) -> None:
    for name in names.split():
        _, t_ns, _ = read(table(tmp_path, f"Zeit;T\n01. {name} 2025 08:00:00;1,5\n"))
        assert str(np.array(t_ns, "M8[ns]")[0])[:10] == f"2025-{month:02d}-01", name


def test_a_name_of_no_month_is_rejected(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Zeit;T\n24-dic-2025 08:00:00;1,5\n25-xyz-2025 08:00:00;1,5\n"))
    assert t_ns == [DECEMBER_NS]
    assert [entry.why for entry in log.rejected] == ['"25-xyz-2025 08:00:00" is no time (day month year in UTC)']


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Datum;Uhrzeit", "24.12.2025;08:00:0{}"),
        ("Data;Ora", "24/12/2025;08.00.0{}"),
        ("Data;Ora", "24-dic-2025;08.00.0{}"),
        ("Datum;Uhrzeit", "24.12.25;08.00.0{}"),
        ("Uhrzeit;Datum", "08:00:0{};24.12.2025"),
        ("Datum;Uhrzeit", "2025-12-24;08:00:0{}"),
    ],
)
def test_date_and_time_of_day_may_stand_in_two_columns(tmp_path: Path, head: str, row: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"{head};T\n" + "".join(f"{row.format(i)};230,5\n" for i in range(3))))
    assert t_ns == [DECEMBER_NS + i * S_NS for i in range(3)]
    assert columns == {"T": [230.5] * 3}
    day, clock = sorted(head.split(";"), key=lambda name: name not in ("Datum", "Data"))
    assert log.settings["time_column"] == f"{day} + {clock}"


def test_a_row_without_its_time_of_day_is_rejected_and_a_stated_format_takes_both_columns(tmp_path: Path) -> None:
    path = table(tmp_path, "Data;Ora;T\n" + "12/24/2025;08.00.00;1,5\n" * 3 + "12/24/2025;;1,5\n;;1,5\n")
    log, t_ns, _ = read(path, TimeSpec(format="%m/%d/%Y %H.%M.%S"))
    assert t_ns == [DECEMBER_NS] * 3
    assert [(entry.where, entry.why) for entry in log.rejected] == [
        ("line 5, column Data + Ora", '"12/24/2025 " is no time (%m/%d/%Y %H.%M.%S in UTC)'),
        ("line 6, column Data + Ora", "no time"),
    ]


@pytest.mark.parametrize(
    ("first", "later", "day"),
    [
        ("05/06/2025 08:00:00", "13/06/2025 08:00:00", "2025-06-05"),
        ("05/06/2025 08:00:00", "06/13/2025 08:00:00", "2025-05-06"),
        ("5/6/25 8:00 AM", "6/13/25 8:00 AM", "2025-05-06"),
        ("05/06/2025 08:00:00 am", "45/06/2025 08:00:00 am", None),  # is no day
    ],
)
@pytest.mark.parametrize("rows", [1, 500])  # of the first kind: more than are looked at to recognise all else
def test_a_day_above_12_anywhere_tells_the_order_of_dates(
    tmp_path: Path, first: str, later: str, day: str | None, rows: int
) -> None:
    path = table(tmp_path, "Time,T\n" + f"{first},1\n" * rows + f"{later},1\n")
    if day is None:
        with pytest.raises(UnreadableLogError, match="no row has a day above 12"):
            read(path)
        return
    log, t_ns, _ = read(path)
    assert (str(np.array(t_ns, "M8[ns]")[0])[:10], log.found, list(log.rejected)) == (day, rows + 1, [])
    assert log.settings["time"] == ("day/month/year in UTC" if day == "2025-06-05" else "month/day/year in UTC")


def test_a_date_with_slashes_begins_with_the_day_in_a_european_table(tmp_path: Path) -> None:
    _, t_ns, _ = read(table(tmp_path, "Time;T\n05/06/2025 08:00:00;1,5\n"))
    assert str(np.array(t_ns, "M8[ns]")[0])[:10] == "2025-06-05"
    with pytest.raises(UnreadableLogError, match="may begin with the day or with the month"):
        read(table(tmp_path, "Time;T\n05/06/2025 08:00:00 AM;1.5\n"))


@pytest.mark.parametrize(
    ("head", "stamp", "form"),
    [
        ("Time", "05/06/2025 08:00:00", "{}/%Y %H:%M:%S"),
        ("when", "5/6/25, 7:00 PM", "{}/%y, %I:%M %p"),
        ("Time", "05/06/2025 08:00:00.250", "{}/%Y %H:%M:%S.%f"),
        ("Date,Clock", "05/06/2025,08:00:00", "{}/%Y %H:%M:%S"),
    ],
)
def test_dates_that_may_be_of_either_order_are_asked_for_in_words_that_work(
    tmp_path: Path, head: str, stamp: str, form: str
) -> None:
    quoted = stamp if "," in head else f'"{stamp}"'
    path = table(tmp_path, f"{head},T\n{quoted},1.5\n{quoted},2.5\n")
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    both = [form.format(order) for order in ("%d/%m", "%m/%d")]
    name, cell = head.replace(",", " + "), stamp.replace("5,0", "5 0")
    assert str(refused.value) == (
        f'log.csv: "{name}" holds "{cell}", which may begin with the day or with the month, and no row has a day above '
        f'12. Under [time] of the bench file say format = "{both[0]}" or format = "{both[1]}".'
    )
    days = [str(np.array(read(path, TimeSpec(format=one))[1], "M8[ns]")[0])[:10] for one in both]
    assert days == ["2025-06-05", "2025-05-06"]


@pytest.mark.parametrize(
    ("clock", "wanted"),
    [("8:00:01 AM", "08:00:01"), ("12:00:01 am", "00:00:01"), ("12:30 PM", "12:30:00"), ("11:59:59.5pm", "23:59:59.5")],
)
def test_a_clock_of_twelve_hours_is_read(tmp_path: Path, clock: str, wanted: str) -> None:
    for date in ("2025-12-24", "12/24/2025", "24 Dec 2025", "2025/12/24"):
        _, t_ns, _ = read(table(tmp_path, f"Time,T\n{date} {clock},1\n{date} {clock},1\n"))
        assert str(np.array(t_ns, "M8[ns]")[0]).startswith(f"2025-12-24T{wanted}"), date
    log, _, _ = read(table(tmp_path, "Time,T\n12/24/2025 1:00 PM,1\n12/24/2025 13:00 PM,1\n"))
    assert [one.why for one in log.rejected] == ['"12/24/2025 13:00 PM" is no time (month/day/year in UTC)']


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


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,T\n28-11-2026 14:05:06,20\n28-11-2026 14:05:07,21\n", "day/month/year in UTC"),
        ("time,T\n11-28-2026 14:05:06,20\n11-28-2026 14:05:07,21\n", "month/day/year in UTC"),
    ],
)
def test_dates_with_dashes_are_told_by_a_day_above_12(tmp_path: Path, text: str, told: str) -> None:
    log, t_ns, _ = read(table(tmp_path, text))
    assert (log.settings["time"], t_ns[0]) == (told, 1_795_874_706 * S_NS)


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_date_with_dashes_that_may_begin_with_the_year_is_asked_for(tmp_path: Path, delimiter: str) -> None:
    text = "time,T\n26-11-28 14:05:06.000,20\n26-11-28 14:05:07.000,21\n".replace(",", delimiter)
    with pytest.raises(UnreadableLogError, match=r'say format = "%d-%m-%y %H:%M:%S.%f" or format = "%y-%m-%d %H'):
        read(table(tmp_path, text))


def test_seconds_since_1904_are_those_of_labview(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Time,T\n3878719506.5,20\n3878719507.5,21\n"))
    assert (log.settings["time"], t_ns[0]) == ("s since 1904", 1_795_874_706 * S_NS + S_NS // 2)


def test_the_time_of_catman_is_known_by_its_name(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "Zeit  1 - Standardmessrate\tT_W\ns\t°C\n0,0\t20,5\n0,5\t21,5\n"))
    assert (log.settings["time"], t_ns, columns["T_W"]) == ("s from the start", [0, S_NS // 2], [20.5, 21.5])


def test_numbers_with_units_in_their_cells_are_texts_that_are_named(tmp_path: Path) -> None:
    log, _, _ = read(table(tmp_path, "time,T,n,note\n0,20.5 °C,1000 rpm,\n1,21.5 °C,1001 rpm,b\n"))
    assert log.settings["numbers_with_units"] == {"T": "20.5 °C", "n": "1000 rpm"}


def test_numbers_that_may_have_thousands_are_texts_that_are_named(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "Zeit;n;T\n0;1.500;20,5\n1;900;20,6\n2;1.600;20,7\n"))
    assert (columns["T"], columns["n"]) == ([20.5, 20.6, 20.7], ["1.500", "900", "1.600"])
    assert log.settings["numbers_with_units"] == {"n": "1.500"}


@pytest.mark.parametrize(
    "cell",
    ["NoValue", "Overflow", "OVER RANGE", "∞", "-∞", "---O-F---", "BURN OUT", "Open circuit", "OTC", "no data"],
)
def test_a_sensor_that_says_that_it_failed_is_a_missing_number(tmp_path: Path, cell: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"t,T,U\n0,20,1\n1,{cell},2\n2,21,3\n"))
    np.testing.assert_array_equal(columns["T"], [20, np.nan, 21])
    assert (len(t_ns), columns["U"], list(log.rejected)) == (3, [1, 2, 3], [])


def test_the_minus_of_typesetters_is_one(tmp_path: Path) -> None:
    log, _, columns = read(table(tmp_path, "t,T [°C]\n0,−3.5\n1,−4.5\n2,5\n"))
    assert (columns["T [°C]"], list(log.rejected)) == ([-3.5, -4.5, 5], [])


@pytest.mark.parametrize(
    ("stamp", "utc_hour"),
    [
        ("2024-03-01 10:00:00+01", 9),
        ("2024-03-01 10:00:00.000 UTC", 10),
        ("2024-03-01 10:00:00 CET", 9),
        ("2024-03-01 10:00:00 GMT-5", 15),
        ("01.03.2024 10:00:00 +01:30", 8.5),
        ("13/03/2024 10:00:00 p. m.", 22),
        ("3/13/2024, 12:00:00\u202fAM", 0),
        ("'24-03-01 10:00:00.0", 10),
        ("1 févr. 2024 10:00:00", 10),
        ("1 juin 2024 10:00:00", 10),
        ("1 juillet 2024 10:00:00", 10),
        ("15-ago-2024 10:00:00", 10),
    ],
)
def test_stamps_have_zones_halves_of_the_day_and_months_in_many_spellings(
    tmp_path: Path, stamp: str, utc_hour: float
) -> None:
    log, t_ns, columns = read(table(tmp_path, f"Time;T\n{stamp};20\n{stamp};21\n"))
    assert (columns["T"], log.absolute, list(log.rejected)) == ([20, 21], True, [])
    assert t_ns[0] % (86_400 * S_NS) == utc_hour * 3600 * S_NS


def test_a_month_of_four_letters_is_no_other_one(tmp_path: Path) -> None:
    _, t_ns, _ = read(table(tmp_path, "Temps;T\n1 juin 2024 10:00:00;20\n1 juil. 2024 10:00:00;21\n"))
    assert t_ns[1] - t_ns[0] == 30 * 86_400 * S_NS


@pytest.mark.parametrize("name", ["Temps", "Temps [s]", "Tiempo (s)"])
def test_time_has_its_french_and_spanish_names(tmp_path: Path, name: str) -> None:
    _, t_ns, _ = read(table(tmp_path, f"{name};Étuve\n0,5;20\n1,0;21\n"))
    assert t_ns == [S_NS // 2, S_NS]


def test_dates_and_times_of_day_may_be_a_number_each_as_spreadsheets_store_them(tmp_path: Path) -> None:
    rows = "45352;0,999988426;20\n45353;0;21\n45353;0,5;22\n"
    log, t_ns, columns = read(table(tmp_path, f"Datum;Zeit;T\n{rows}"))
    assert (log.absolute, log.settings["time_column"], list(columns)) == (True, "Datum + Zeit", ["T"])
    first = utc_ns(datetime(2024, 3, 1, 23, 59, 59, tzinfo=ZoneInfo("UTC")))
    assert [round((t - first) / 1e9, 3) for t in t_ns] == [0, 1, 43_201]
    assert read(table(tmp_path, "Datum;Zeit;T\n45352;0,5;20\n45352;1,5;21\n"))[1] == [S_NS // 2, 3 * S_NS // 2]


@pytest.mark.parametrize(("last", "rows"), [("2;20,7;2", 2), ("2;20,7;2,5", 3), ("2;20,7;", 3), ("2;20,7;2\n", 3)])
def test_a_last_line_without_end_whose_number_lacks_decimals_is_cut(tmp_path: Path, last: str, rows: int) -> None:
    log, t_ns, _ = read(table(tmp_path, f"Zeit;T;U\n0;20,5;21,5\n1;20,6;21,6\n{last}"))
    assert (len(t_ns), len(log.rejected), log.cut is None) == (rows, 3 - rows, rows == 3)


@pytest.mark.parametrize(
    ("unit", "second_ns"),
    [
        ("Min", 60 * S_NS), ("min.", 60 * S_NS), ("minutes", 60 * S_NS), ("hr", 3600 * S_NS), ("Std", 3600 * S_NS),
        ("heures", 3600 * S_NS), ("MS", S_NS // 1000), ("msec", S_NS // 1000), ("usec", 1000), ("Sek.", S_NS),
        ("days", 86_400 * S_NS),
    ],
)  # fmt: skip
def test_units_of_time_are_known_as_people_spell_them_in_a_row_and_in_a_name(
    tmp_path: Path, unit: str, second_ns: int
) -> None:
    assert read(table(tmp_path, f"Zeit;T\n{unit};°C\n0;20\n1;21\n"))[1] == [0, second_ns]
    assert read(table(tmp_path, f"Zeit [{unit}];T\n0;20\n1;21\n"))[1] == [0, second_ns]
    assert read(table(tmp_path, f"Time ({unit});T\n0;20\n1;21\n"))[1] == [0, second_ns]
