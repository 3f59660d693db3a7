"""Long tables: which tables are, what each name becomes, and which tables stay as they stand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import Log, Rows, open_log
from made.tables import S_NS, same, table
from replay.cli import main

NAN = float("nan")
AT_NS = 1_741_939_200 * S_NS  # 14 March 2025, 08:00 UTC
Found = dict[str, tuple[list[float], list[float]]]  # series -> seconds since AT_NS, values


def series(path: Path) -> tuple[Log, Found]:
    """The log at `path`, and its series."""
    log, found = open_log(path), Found()
    for rows in log.batches():
        assert isinstance(rows, Rows) and rows.series is not None
        t_s, values = found.setdefault(rows.series, ([], []))
        t_s += ((rows.t_ns - AT_NS) / S_NS).round(3).tolist()
        values += rows.columns[rows.series].tolist()
    return log, found


TIA = (
    '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\r\n'
    '"T";"14.03.2025 08:00:00";20,0;1;45730333333,3333\r\n"n";"14.03.2025 08:00:00";5;1;45730333336,2269\r\n'
    '"T";"14.03.2025 08:00:01";99,0;0;45730333344,9074\r\n"n";"14.03.2025 08:00:01";6;1;45730333347,8009\r\n'
    '"$RT_OFF$";"14.03.2025 08:00:02";0;2;45730333356,4815\r\n'
)
INFLUX = (
    "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string\n"
    "#default,_result,,,,,,,\n,result,table,_start,_stop,_time,_value,_field,_measurement\n"
    ",,0,2025-03-14T08:00:00Z,2025-03-14T09:00:00Z,2025-03-14T08:00:00Z,20.0,T,motor\n"
    ",,0,2025-03-14T08:00:00Z,2025-03-14T09:00:00Z,2025-03-14T08:00:01Z,,T,motor\n"
    ",,1,2025-03-14T08:00:00Z,2025-03-14T09:00:00Z,2025-03-14T08:00:00.25Z,5,n,motor\n"
    ",,1,2025-03-14T08:00:00Z,2025-03-14T09:00:00Z,2025-03-14T08:00:01.25Z,6,n,motor\n"
)
LONG = {
    "Siemens TIA": TIA,
    "Siemens TIA in UTF-16": "\ufeff" + TIA,
    "InfluxDB": INFLUX,
    "historian": "TagName,DateTime,Value,Quality\nT,3/14/2025 8:00:00 AM,20,Good\nn,3/14/2025 8:00:00 AM,5,Good\n"
    "T,3/14/2025 8:00:01 AM,99,Bad\nn,3/14/2025 8:00:01 AM,6,Good\n",
    "sorted by name": "Tag;Zeitstempel;Wert;Qualität\nT;14.03.2025 08:00:00;20,0;192\nT;14.03.2025 08:00:01;99;24\n"
    "n;14.03.2025 08:00:00;5;192\nn;14.03.2025 08:00:01;6;216\n",
    "OPC UA": "nodeId,sourceTimestamp,value,statusCode\n"
    "T,2025-03-14T08:00:00Z,20,0\nT,2025-03-14T08:00:01Z,99,2147483648\n"
    "n,2025-03-14T08:00:00Z,5,0\nn,2025-03-14T08:00:01Z,6,0\n",
    "seconds since 1970, by name": "ts,sensor,value\n1741939200,T,20\n1741939201,T,\n1741939200,n,5\n1741939201,n,6\n",
}


@pytest.mark.parametrize("kind", LONG)
def test_each_name_is_a_series_with_its_own_times(kind: str, tmp_path: Path) -> None:
    log, found = series(table(tmp_path, LONG[kind], encoding="utf-16-le" if "16" in kind else "utf-8"))
    late_s = 0.25 if kind.startswith(("Siemens", "Influx")) else 0.0
    assert {name: t_s for name, (t_s, _) in found.items()} == {"T": [0, 1], "n": [late_s, 1 + late_s]}
    assert same([values for _, values in found.values()], [[20, NAN], [5, 6]])
    assert (log.found, list(log.rejected), log.absolute) == (4, [], True)
    assert log.settings["series"] == {"T": ["T"], "n": ["n"]}
    assert log.settings.get("invalid") == (None if "sec" in kind or "Influx" in kind else {"T": 1})


def test_annotations_that_stand_again_are_no_rows(tmp_path: Path) -> None:
    lines = INFLUX.splitlines()
    log, found = series(table(tmp_path, "\n".join([*lines[:3], *lines[3:5] * 5, "", *lines[:3], *lines[5:] * 5, ""])))
    assert ({name: len(values) for name, (_, values) in found.items()}, log.found) == ({"T": 10, "n": 10}, 20)
    assert log.settings["lines_of_no_row"] == 3


def test_units_are_those_of_each_name_and_other_columns_are_named(tmp_path: Path) -> None:
    text = "time,Channel,Unit,Reading,operator\n0,T,degC,20,me\n0,n,rpm,5,me\n1,T,degC,21,me\n"
    log, found = series(table(tmp_path, text))
    assert (list(found), log.units) == (["T", "n"], {"T": "degC", "n": "rpm"})
    assert log.settings["long_table"] == {"names": ["Channel"], "values": "Reading", "left_out": ["operator"]}


@pytest.mark.parametrize(
    ("head", "rows", "names"),
    [
        ("time,device,sensor,value", ("a,T", "a,n", "b,T", "b,n"), ["a/T", "a/n", "b/T", "b/n"]),
        ("time,device,sensor,value", ("a,T", "a,n"), ["T", "n"]),
        ("time,Channel,value", ("101", "102"), ["Channel 101", "Channel 102"]),
        ("time,Ort,T", ("Joch", "Zahn"), ["Joch/T", "Zahn/T"]),
    ],
)
def test_what_names_a_series(tmp_path: Path, head: str, rows: tuple[str, ...], names: list[str]) -> None:
    lines = [f"{k},{row},{20 + k}" for k in range(3) for row in rows]
    assert list(series(table(tmp_path, "\n".join([head, *lines, ""])))[1]) == names


def test_a_device_that_comes_late_is_no_other_ones_series(tmp_path: Path) -> None:
    early = [f"{k},a,T,20" for k in range(300)]
    found = series(table(tmp_path, "\n".join(["time,device,sensor,value", *early, "300,b,T,30", ""])))[1]
    assert {name: len(values) for name, (_, values) in found.items()} == {"T": 300, "b/T": 1}


@pytest.mark.parametrize(
    ("head", "rows"),
    [
        ("time,phase,T", "{k},{word},{k}.5"),
        ("time,status,T,n", "{k},{word},{k}.5,1"),
        ("time,T,n,comment", "{k},{k}.5,1,{word}"),
        ("time,sensor,T,n", "{k},{word},{k}.5,1"),
        ("date,stator,R", "2025-03-14 08:00:00,S{k},{k}.5"),
        ("time,phase,value", "{k},{word},{k}.5"),
    ],
)
def test_a_text_beside_what_is_measured_names_no_series(tmp_path: Path, head: str, rows: str) -> None:
    lines = [rows.format(k=k, word=("heat", "hold")[k % 2]) for k in range(6)]
    log = open_log(table(tmp_path, "\n".join([head, *lines, ""])))
    assert [rows.series for rows in log.batches() if isinstance(rows, Rows)] == [None]
    assert "long_table" not in log.settings


def test_a_table_of_more_names_than_channels_is_refused(tmp_path: Path) -> None:
    lines = [f"{k},T{k},20" for k in range(600)]
    with pytest.raises(UnreadableLogError, match=r"more than 500 names in tag\. Export fewer of them at once\."):
        series(table(tmp_path, "\n".join(["time,tag,value", *lines, ""])))


def test_parquet_may_be_long_too(tmp_path: Path) -> None:
    stamps = pa.array([AT_NS, AT_NS, AT_NS + S_NS, AT_NS + S_NS], pa.timestamp("ns", "UTC"))
    columns = {"timestamp": stamps, "tag": ["T", "n"] * 2, "value": [20.0, 5.0, 21.0, 6.0]}
    pa.parquet.write_table(pa.table(columns), tmp_path / "log.parquet")
    log, found = series(tmp_path / "log.parquet")
    assert (log.found, found) == (4, {"T": ([0, 1], [20, 21]), "n": ([0, 1], [5, 6])})


BENCH = """schema = "whyhot.bench/1"
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[derived]]
name = "T_and_n"
expression = "n + T"
quantity = "temperature"
unit = "degC"
"""


def test_a_long_table_is_ingested_as_its_channels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No stamp stands twice, no clock steps back, and a derived channel has what the other series said last."""
    log, store = table(tmp_path, TIA), ["--store", str(tmp_path / "store")]
    (tmp_path / "bench.toml").write_text(BENCH, encoding="utf-8")
    assert main(["inspect", str(log)]) == 0
    assert (
        "each name in VarName is a channel with its own times, its values in VarValue, missing where Validity is bad"
        in (capsys.readouterr().out)
    )
    assert main(["ingest", str(log), "--bench", str(tmp_path / "bench.toml"), *store]) == 0
    said = capsys.readouterr().out
    assert "decoded 4 · unknown id 0 · wrong length 0 · rejected 0 = 4 in the file" in said
    assert "clock" not in said and "stamp" not in said
    assert main(["lineage", "log.csv:3", *store]) == 0
    assert re.search(r"\nRecord 3 +log\.csv, line 5, byte 206; .+; n 6\.0\n", capsys.readouterr().out)
    query = "SELECT channel, value FROM samples WHERE NOT doubled ORDER BY channel, t_ns"
    assert main(["sql", query, "--json", *store]) == 0
    rows = [tuple(row.values()) for row in json.loads(capsys.readouterr().out)["rows"]]
    assert rows == [("T", 20), ("T_and_n", 25), ("T_and_n", 26), ("n", 5), ("n", 6)]
