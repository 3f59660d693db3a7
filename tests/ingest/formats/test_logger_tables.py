"""Tables as loggers and measuring programs write them: what each becomes, to its last number.

Each text is made after public descriptions of the program, with three rows of T (20, 21, none) and n (5, 6, 7).
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from made.tables import read, same
from replay.cli import main

NAN = float("nan")
S_NS = 1_000_000_000
AT_NS = 1_741_939_200 * S_NS  # 14 March 2025, 08:00 UTC


@dataclass(frozen=True)
class Logged:
    """A text and its encoding; the names of T and n, their units as the file says them; when its rows are."""

    text: str
    names: tuple[str, str] = ("T", "n")
    units: tuple[str | None, str | None] = (None, None)
    begins_ns: int = AT_NS
    step_ns: int = S_NS
    encoding: str = "utf-8"


KEYSIGHT = (
    "Name:,Bench\nAcquisition Date:,3/14/2025 8:00:00 AM\n\nInstrument:,34970A\nChannel,Name,Function,Range\n"
    "101,T,Temp (Type K),,C\n102,n,Freq,,Hz\n\nScan Control:\n,Start Action:,Immediately\n\n"
    "Scan,Time,101 <T> (C),Alarm 101,102 <n> (Hz),Alarm 102\n1,03/14/2025 08:00:00:000,20.0,0,5,0\n"
    "2,03/14/2025 08:00:01:000,21.0,0,6,0\n3,03/14/2025 08:00:02:000,9.90000000E+37,0,7,0\n"
)
TENTH = S_NS // 10
LOGGED = {
    "ETAS MDA": Logged(
        "ETASAsciiItemFile\trecord\tCrLf\tTab\nsampleCount\t3\ntime\tT\tn\t\nf8\tf8\tf8\t\n"
        '"s"\t"°C"\t"1/min"\t\n0.0\t20.0\t5\t\n0.1\t21.0\t6\t\n0.2\t\t7\t\n',
        units=("°C", "1/min"),
        begins_ns=0,
        step_ns=TENTH,
        encoding="cp1252",
    ),
    "dSPACE ControlDesk": Logged(
        "title;Measurement 1\ndate;14.03.2025 08:00:00\nunit;s;°C;1/min\ntrace_names;Time;T;n\n"
        "trace_values;0,0;20,0;5\n;0,1;21,0;6\n;0,2;;7\n",
        units=("°C", "1/min"),
        begins_ns=0,
        step_ns=TENTH,
    ),
    "dSPACE without times": Logged(
        "title,Measurement 1\nsampling_period,0.1\nunit,degC,rpm\ntrace_names,T,n\ntrace_values,20.0,5\n,21.0,6\n,,7\n",
        units=("degC", "rpm"),
        begins_ns=0,
        step_ns=TENTH,
    ),
    "Dewesoft": Logged(
        "Data info\nFile name\tmotor.dxd\nStart time\t14.3.2025 08:00:00.000\nNumber of channels\t2\n\n"
        "Data1\nTime (s)\tT (°C)\tn (rpm)\n0,0000\t20,00\t5\n0,1000\t21,00\t6\n0,2000\t\t7\n",
        names=("T (°C)", "n (rpm)"),
        step_ns=TENTH,
        encoding="utf-8-sig",
    ),
    "rate in a line above": Logged("Sample rate: 10 Hz\nT;n\n20,0;5\n21,0;6\n;7\n", begins_ns=0, step_ns=TENTH),
    "interval in a line above": Logged(
        "Abtastintervall;100 ms\n\nT;n;M\n20,0;5;1\n21;6;1\n;7;1\n", begins_ns=0, step_ns=TENTH
    ),
    "imc FAMOS": Logged(
        "Zeit\tT\tn\ns\t°C\t1/min\n0,0\t20,0\t5\n1,0\t21,0\t6\n2,0\t****\t7\n",
        units=("°C", "1/min"),
        begins_ns=0,
        encoding="cp1252",
    ),
    "HBM catman": Logged(
        "HBM_CATMAN_DATAFILE_40\t\nNumber of channels: 3\nT0 = 14.03.2025 08:00:00\n\n"
        "Zeit  1 - Standardmessrate\tT\tn\ns\t°C\t1/min\n0,0\t20,0\t5\n1,0\t21,0\t6\n2,0\t#OVL\t7\n",
        units=("°C", "1/min"),
        encoding="cp1252",
    ),
    "NI waveforms": Logged(
        "waveform\t[0]\t[1]\nt0\t14.03.2025 08:00:00,000000\t14.03.2025 08:00:00,000000\ndelta t\t1,0\t1,0\n\n"
        "time[0]\tY[0]\tY[2]\n14.03.2025 08:00:00,0\t2,0E+1\t5\n14.03.2025 08:00:01,0\t2,1E+1\t6\n"
        "14.03.2025 08:00:02,0\tNaN\t7\n",
        names=("Y[0]", "Y[2]"),
    ),
    "Yokogawa WT": Logged(
        "Store No.,Date,Time,Millisecond,T,n\n1,2025/03/14,08:00:00,0,20.0,5\n2,2025/03/14,08:00:00,500,21.0,6\n"
        "3,2025/03/14,08:00:01,0,Error,7\n",
        step_ns=S_NS // 2,
    ),
    "Hioki": Logged(
        '"HIOKI PW6001","Ver 3.00"\n"INTERVAL","1s"\n"Date","Time","Status","T[C]","n[Hz]"\n'
        '"2025/03/14","08:00:00","00000000",+2.00000E+01,5\n"2025/03/14","08:00:01","00000000",+2.10000E+01,6\n'
        '"2025/03/14","08:00:02","00000000",+9999.99E+99,7\n',
        names=("T[C]", "n[Hz]"),
        units=("C", "Hz"),
    ),
    "Keysight BenchLink": Logged(KEYSIGHT, names=("101 <T> (C)", "102 <n> (Hz)")),
    "Keysight BenchLink with a date in its name": Logged(
        KEYSIGHT.replace("Name:,Bench\n", "Name:,Data 1 3/14/2025 8:00:00 AM\n"),
        names=("101 <T> (C)", "102 <n> (Hz)"),
    ),
    "Keysight BenchLink in UTF-16": Logged(KEYSIGHT, names=("101 <T> (C)", "102 <n> (Hz)"), encoding="utf-16"),
    "Keithley": Logged(
        "Reading Set,1\nScan,Time Stamp,T,n\n1,03/14/2025 08:00:00 AM,20.0,5\n2,03/14/2025 08:00:01 AM,21.0,6\n"
        "3,03/14/2025 08:00:02 AM,OVERFLOW,7\n"
    ),
    "Almemo": Logged(
        "ALMEMO 2890-9;\nDATUM:;ZEIT:;M00: °C;M01: rpm\n14.03.25;08:00:00;20,0;5\n14.03.25;08:00:01;21,0;6\n"
        "14.03.25;08:00:02;-----;7\n",
        names=("M00: °C", "M01: rpm"),
        encoding="cp1252",
    ),
    "Almemo with dates where they change": Logged(
        "DATUM:;ZEIT:;M00: °C;M01: rpm\n14.03.25;08:00:00;20,0;5\n;08:00:01;21,0;6\n;08:00:02;-----;7\n",
        names=("M00: °C", "M01: rpm"),
        encoding="cp1252",
    ),
    "Delphin": Logged(
        "Datum;Uhrzeit;T;n\n;;°C;1/min\n14.03.2025;08:00:00;20,0;5\n14.03.2025;08:00:01;21,0;6\n"
        "14.03.2025;08:00:02;####;7\n",
        units=("°C", "1/min"),
        encoding="cp1252",
    ),
    "Gantner": Logged(
        "Time[OLE2],T,n\n45730.3333333333,20.0,5\n45730.3333449074,21.0,6\n45730.3333564815,OPEN,7\n",
    ),
    "a thermocouple that is said to be open": Logged(
        "Time,T,n\n2025-03-14 08:00:00,20.0,5\n2025-03-14 08:00:01,21.0,6\n2025-03-14 08:00:02,Open TC,7\n",
    ),
    "Graphtec with settings of each channel": Logged(
        "Vendor;GRAPHTEC Corporation\nAMP settings\nCH;Signal name;Range;Span;;Unit;Color\nT;T_w;50V;25;-25;degC;5\n"
        "n;speed;50V;10;-10;rpm;3\nData\nNumber;Date;Time;us;T;n;Alarm\n1;14/03/2025;08:00:00;0;+20,0;+5;LLLL\n"
        "2;14/03/2025;08:00:00;100000;+21,0;+6;LLLL\n3;14/03/2025;08:00:00;200000;+++++++;+7;LLLL\n",
        names=("T_w", "speed"),
        units=("degC", "rpm"),
        step_ns=TENTH,
    ),
    "Hioki power analyser": Logged(
        "Date,Time,Time(ms),Etime,Etime(ms),T,n\n2025/03/14,08:00:00,0,00:00:00,0,20,5\n"
        "2025/03/14,08:00:00,500,00:00:00,500,21,6\n2025/03/14,08:00:01,0,00:00:01,0,--.---,7\n",
        step_ns=S_NS // 2,
    ),
    "names in quotes behind blanks": Logged(
        '"Time [ms]", "T [degC]", "n [rpm]"\n0, 20.0, 5\n100, 21.0, 6\n200, , 7\n',
        names=("T [degC]", "n [rpm]"),
        units=("degC", "rpm"),
        begins_ns=0,
        step_ns=TENTH,
    ),
    "TOA5 of Campbell": Logged(
        '"TOA5","bench","CR1000X","7","CR1000X.Std.05","CPU:a.CR1X","5","T1"\n"TIMESTAMP","RECORD","T","n"\n'
        '"TS","RN","Deg C","rpm"\n"","","Avg","Smp"\n"2025-03-14 08:00:00",0,20,5\n"2025-03-14 08:00:01",1,21,6\n'
        '"2025-03-14 08:00:02",2,"NAN",7\n',
        units=("Deg C", "rpm"),
    ),
    "a trend of Rockwell": Logged(
        "Controller Name:,L81E\nTrend Name:,Run 3\nTrend Tags:,2\nSample Period:,1000,ms\n"
        "Header:,Date,Time,T,n\nData:,3/14/2025,8:00:00;000,20,5\nData:,3/14/2025,8:00:01;000,21,6\n"
        "Data:,3/14/2025,8:00:02;000,,7\n"
    ),
    "X in seconds": Logged("X;T;n\ns;°C;1/min\n0;20;5\n1;21;6\n2;;7\n", units=("°C", "1/min"), begins_ns=0),
    "a sign of a comment before the names": Logged(
        "# Motor 7, run 3\n# t[s] T[degC] n[rpm]\n 0 20.0 5\n 1 21.0 6\n 2 NaN 7\n",
        names=("T[degC]", "n[rpm]"),
        units=("degC", "rpm"),
        begins_ns=0,
    ),
    "decimal commas in quotes": Logged(
        '"t","T","n"\n"0,0","20,0","5"\n"0,1","21,0","6"\n"0,2","","7"\n', begins_ns=0, step_ns=TENTH
    ),
    "names below those of groups": Logged(
        "Time,Stator,Rotor\nTime,T [degC],n [rpm]\n0,20,5\n1,21,6\n2,,7\n",
        names=("T [degC]", "n [rpm]"),
        units=("degC", "rpm"),
        begins_ns=0,
    ),
    "ticks of .NET": Logged(
        "Ticks,T,n\n638775360000000000,20,5\n638775360010000000,21,6\n638775360020000000,,7\n",
    ),
    "ticks of Windows": Logged(
        "FileTime,T,n\n133864128000000000,20,5\n133864128010000000,21,6\n133864128020000000,,7\n",
    ),
    "-9999": Logged("time,T,n\n0,20.0,5\n1,21.0,6\n2,-9999,7\n", begins_ns=0),
    "INVALID": Logged("time,T,n\n0,20.0,5\n1,21.0,6\n2,INVALID,7\n", begins_ns=0),
    "stamps of C": Logged(
        "time,T,n\nFri Mar 14 08:00:00 2025,20.0,5\nFri Mar 14 08:00:01 2025,21.0,6\nFri Mar 14 08:00:02 2025,,7\n"
    ),
    "stamps of a shell": Logged(
        "date,T,n\nFri Mar 14 09:00:00 CET 2025,20,5\nFri Mar 14 09:00:01 CET 2025,21,6\n"
        "Fri Mar 14 09:00:02 CET 2025,,7\n"
    ),
    "stamps of mails": Logged(
        'time,T,n\n"Fri, 14 Mar 2025 10:00:00 +0200",20,5\n"Fri, 14 Mar 2025 10:00:01 +0200",21,6\n'
        '"Fri, 14 Mar 2025 10:00:02 +0200",,7\n'
    ),
    "a month by its name before the day": Logged(
        'time,T,n\n"Mar 14, 2025 8:00:00 AM",20,5\n"Mar 14, 2025 8:00:01 AM",21,6\n"Mar 14, 2025 8:00:02 AM",,7\n'
    ),
    "weekday and day.month.year": Logged(
        "Zeit;T;n\nFr 14. März 2025 08:00:00;20;5\nFr 14. März 2025 08:00:01;21;6\nFr 14. März 2025 08:00:02;;7\n"
    ),
    "date and time in a column for each part": Logged(
        "Jahr;Monat;Tag;Stunde;Minute;Sekunde;T;n\n2025;3;14;8;0;0;20,0;5\n2025;3;14;8;0;1;21,0;6\n2025;3;14;8;0;2;;7\n"
    ),
    "and in one for milliseconds": Logged(
        "Year,Month,Day,Hour,Minute,Second,ms,T,n\n2025,3,14,8,0,0,0,20,5\n2025,3,14,8,0,0,100,21,6\n"
        "2025,3,14,8,0,0,200,,7\n",
        step_ns=TENTH,
    ),
    "and in one that counts finer": Logged(
        "Year,Month,Day,Hour,Minute,Second,Time [s],T,n\n2025,3,14,8,0,0,10.0,20,5\n2025,3,14,8,0,0,10.1,21,6\n"
        "2025,3,14,8,0,0,10.2,,7\n",
        step_ns=TENTH,
    ),
    "minutes and seconds that a spreadsheet left": Logged(
        "Time,T,n\n59:59.0,20,5\n00:00.0,21,6\n00:01.0,,7\n", begins_ns=3599 * S_NS
    ),
    "a text among the columns that MDA exported": Logged(
        "ETASAsciiItemFile\trecord\tCrLf\tTab\nsampleCount\t3\ntime\tT\tn\tstate\t\nf8\tf8\tf8\ts\t\n"
        "s\t°C\t1/min\t\t\n0.0\t20\t5\tRUN\t\n0.1\t21\t6\tRUN\t\n0.2\t\t7\tSTOP\t\n",
        units=("°C", "1/min"),
        begins_ns=0,
        step_ns=TENTH,
    ),
    "mm:ss": Logged("time (mm:ss),T,n\n09:58,20,5\n09:59,21,6\n10:00,,7\n", begins_ns=598 * S_NS),
    "rows that end with a delimiter, unlike names and units": Logged(
        "time;T;n\ns;degC;rpm\n0,0;20,0;5;\n0,1;21,0;6;\n0,2;;7;\n", units=("degC", "rpm"), begins_ns=0, step_ns=TENTH
    ),
    "header and units again": Logged(
        "Time;T;n\ns;degC;rpm\n0;20;5\n1;21;6\nTime;T;n\ns;degC;rpm\n2;;7\n", units=("degC", "rpm"), begins_ns=0
    ),
    "blank lines between": Logged(
        "Date,Time,T,n\n03/14/2025,08:00:00 AM,20,5\n\n03/14/2025,08:00:01 AM,21,6\n\n\n03/14/2025,08:00:02 AM,,7\n"
    ),
}


def test_an_input_of_graphtec_is_called_by_its_name_where_that_is_its_own(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    head = "AMP settings\nCH,Signal name,Input,Range\nCH1,{},TEMP,TC_K\nCH2,{},DC,10V\nData\nNumber,Time,CH1,CH2\n"
    rows = "1,0,20,5\n2,1,21,6\n"
    for names, called in ((("W1", "W2"), ["W1", "W2"]), (("W", "W"), ["CH1", "CH2"]), (("", "Time"), ["CH1", "CH2"])):
        path.write_text(head.format(*names) + rows)
        assert [*read(path)[2]] == ["Number", *called]


def test_a_date_that_stands_where_it_changes_is_carried_over_midnight(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "DATUM:;ZEIT:;T\n14.03.25;23:59:58;20\n;23:59:59;21\n;23:59:59;21\n15.03.25;00:00:00;22\n;00:00:01;23\n"
    )
    assert [(t - AT_NS) // S_NS - 57_598 for t in read(path)[1]] == [0, 1, 1, 2, 3]


@pytest.mark.parametrize("one", LOGGED.values(), ids=list(LOGGED))
def test_a_table_of_a_logger_is_read_whole(one: Logged, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(one.text.encode(one.encoding))
    log, t_ns, columns = read(path)
    assert [round((t - one.begins_ns) / 1e6) for t in t_ns] == [k * one.step_ns // 10**6 for k in range(3)]
    assert same([columns[name] for name in one.names], [[20, 21, NAN], [5, 6, 7]])
    assert tuple(log.units.get(name) for name in one.names) == one.units
    assert (log.found, list(log.rejected)) == (3, [])


def test_a_time_of_day_may_be_named_in_the_bench_file(tmp_path: Path) -> None:
    (path := tmp_path / "log.csv").write_text("a,b,T\n08:00:00,1,20\n08:00:01,2,21\n", encoding="utf-8")
    log, t_ns, _ = read(path, TimeSpec(column="a"))
    assert log.settings["time"] == "time of day"
    assert t_ns == [8 * 3600 * S_NS, (8 * 3600 + 1) * S_NS]


def test_minus_9999_is_a_number_among_others_as_low(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,count\n0,-9998\n1,-9999\n2,-10000\n")
    assert read(path)[2] == {"count": [-9998, -9999, -10000]}


def test_a_time_that_a_recording_took_is_no_interval_of_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Recording time: 300 s\nT;n\n20;5\n21;6\n")
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("title,Run 1\nunit,degC,rpm\ntrace_names,T,n\ntrace_values,20,5\n,21,6\n,,7\n", "In ControlDesk of dSPACE"),
        ("HBM_CATMAN_DATAFILE_40\nT0 = 14.03.2025 08:00:00\n\nT\tn\n°C\t1/min\n20,0\t5\n21,0\t6\n", "In catman export"),
        ("ETASAsciiItemFile\trecord\tCrLf\tTab\nT\tn\t\nf8\tf8\t\n20.0\t5\t\n21.0\t6\t\n", "In MDA of ETAS export"),
        ("Data info\nSample rate\t-\n\nT (°C)\tn (rpm)\n20\t5\n21\t6\n21\t7\n", "In DewesoftX export"),
        ("Store No.,T,n\n1,20,5\n2,21,6\n3,21,6\n", "Let the power analyser store date and time"),
        ("Channel,Unit,0.0,1.0,2.0\nT,degC,20,21,22\nn,rpm,1,2,3\n", "Its channels seem to be rows"),
        ("Time,T\n00:00,20\n00:01,21\n00:02,22\n", "Minutes and seconds alone may be hours and minutes"),
        ("T,n\n20,5\n21,6\n22,7\n", "Under [time] of the bench file say rate_hz"),
    ],
)
def test_a_table_without_times_says_how_its_program_writes_them(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableLogError, match=r"no column is recognised as its time.*\. " + re.escape(says)):
        read(path)


def test_a_first_column_that_says_a_unit_of_time_holds_the_times(tmp_path: Path) -> None:
    """As Siglent's oscilloscopes write it; numbers that do not go on are none."""
    path = tmp_path / "log.csv"
    path.write_text("Source,CH1\nSecond,Volt\n-0.5,20\n0,21\n0.5,22\n")
    assert read(path)[1] == [-S_NS // 2, 0, S_NS // 2]
    path.write_text("Lap,CH1\nMin,Volt\n1,20\n2,21\n")
    assert read(path)[1] == [60 * S_NS, 120 * S_NS]
    path.write_text("Lap,CH1\ns,Volt\n1,20\n0,21\n")
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(path)


def test_a_name_may_say_the_order_of_its_dates(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for order, month in (("MM/DD/YYYY", 3), ("dd/mm/yyyy", 4)):
        path.write_text(f"Date ({order}),Time (HH:mm:ss),T\n03/04/2025,08:00:00,20\n03/04/2025,08:00:01,21\n")
        assert datetime.fromtimestamp(read(path)[1][0] / S_NS, UTC).month == month


def test_times_since_the_start_may_count_days(tmp_path: Path) -> None:
    """As pandas writes a Timedelta."""
    path = tmp_path / "log.csv"
    path.write_text("Elapsed,T\n0 days 00:00:00,20\n0 days 23:59:59.500000,21\n1 days 00:00:00.25,22\n")
    assert read(path)[1] == [0, 86_399 * S_NS + S_NS // 2, 86_400 * S_NS + S_NS // 4]


# ---- several series ------------------------------------------------------------------------------------------------


def test_each_column_of_times_stamps_those_behind_it(tmp_path: Path) -> None:
    """A row is a record of each rate that it holds; a slow rate that has ended leaves its cells empty."""
    path = tmp_path / "log.csv"
    head = "Time  1 - fast [s];T;Time  2 - slow [s];n;M\n"
    path.write_text(head + "0,0;20;0;5;1\n0,1;21;10;6;2\n0,2;22;;;\n;9;;;\n0,3;23;x;7;3\n")
    log, t_ns, columns = read(path)
    assert columns == {"T": [20, 21, 22], "n": [5, 6], "M": [1, 2]}
    assert sorted(t_ns) == [0, 0, TENTH, 2 * TENTH, 10 * S_NS]
    assert [(one.record, one.where, one.why) for one in log.rejected] == [
        (5, "line 5, column Time  1 - fast [s]", "no time"),
        (6, "line 6, column Time  2 - slow [s]", 'text "x" where numbers are'),
    ]
    assert (log.found, log.settings["series"]) == (7, {"": ["T"], "Time  2 - slow [s]": ["n", "M"]})


def test_columns_of_times_may_be_numbered(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Zeit 1;T;Zeit 2;n\n" + "".join(f"{_stamp(k)};20;{_stamp(2 * k)};5\n" for k in range(4)))
    assert read(path)[1] == [AT_NS + k * S_NS for k in (0, 1, 2, 3, 0, 2, 4, 6)]


@pytest.mark.parametrize(("second", "series"), [((0, 2, 4, 6), True), ((5, 4, 6, 4), False)])
def test_numbered_times_may_say_their_unit_and_go_on_as_times_do(
    tmp_path: Path, second: tuple[int, ...], series: bool
) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t1 [s];T;t2 [s];n\n" + "".join(f"{k};20;{other};5\n" for k, other in enumerate(second)))
    log, t_ns, _ = read(path)
    assert t_ns == [k * S_NS for k in (*range(4), *(second if series else ()))]
    assert ("series" in log.settings) == series


def _stamp(second: int) -> str:
    return f"14.03.2025 08:00:0{second}"


@pytest.mark.parametrize("head", ["x;T;x;n\ns;°C;s;rpm", "T_X;T;n_X;n\ns;°C;s;rpm", "X [s];T;X [s];n"])
def test_each_channel_may_have_an_x_with_a_unit_of_time(tmp_path: Path, head: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(head + "\n0,0;20;0;5\n0,1;21;10;6\n0,2;22;;\n", encoding="utf-8")
    _, t_ns, columns = read(path)
    assert columns == {"T": [20, 21, 22], "n": [5, 6]}
    assert sorted(t_ns) == [0, 0, TENTH, 2 * TENTH, 10 * S_NS]


def test_columns_of_times_that_tell_the_same_are_one_series(tmp_path: Path) -> None:
    """A row in which they do not, further down, has no time."""
    path = tmp_path / "log.csv"
    path.write_text("Time;T;Time;n\n" + "".join(f"{k};20;{k};5\n" for k in range(300)) + "300;21;9;6\n301;22;;\n")
    log, t_ns, columns = read(path)
    assert (t_ns[-1], columns["T"][298:], list(columns)) == (301 * S_NS, [20, 20, 22], ["T", "n"])
    assert "series" not in log.settings
    assert [(one.where, one.why) for one in log.rejected] == [
        ("line 302, column Time", "another time in Time_2, which said the same at first")
    ]


ONE = "Zeit;T\n14.03.2025 08:00:00;20,5\n14.03.2025 08:00:01;21,5\n\n"


def test_another_table_below_the_first_is_read_with_its_own_times(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(ONE + "Zeit;n;T\n;rpm;\n14.03.2025 08:00:00;5;abc\n14.03.2025 08:00:10;6;def\n")
    log, t_ns, columns = read(path)
    assert t_ns == [AT_NS, AT_NS + S_NS, AT_NS, AT_NS + 10 * S_NS]
    assert columns == {"T": [20.5, 21.5], "n": [5, 6], "T_2": ["abc", "def"]}  # a text is no more of that T
    assert (log.found, log.units, log.settings["further_tables"]) == (4, {"n": "rpm"}, ["line 5"])


@pytest.mark.parametrize("block", [1 << 20, *range(110, 125)])  # of bytes: one ends with the header that comes again
def test_a_header_that_comes_again_over_other_units_begins_another_table(
    tmp_path: Path, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Yokogawa's recorders write it where a range was changed."""
    monkeypatch.setattr("ingest.formats._text.BLOCK", block)
    path = tmp_path / "log.csv"
    path.write_text(
        '"CH/TAG","T","U"\n"UNIT","degC","mV"\n2025/03/14 08:00:00,20,-14\n2025/03/14 08:00:01,21,-15\n'
        '"CH/TAG","T","U"\n"UNIT","degC","V"\n2025/03/14 08:00:02,22,-0.014\n'
    )
    log, _, columns = read(path)
    assert columns == {"T": [20, 21, 22], "U": [-14, -15], "U_2": [-0.014]}
    assert (log.units["U"], log.units["U_2"], list(log.rejected)) == ("mV", "V", [])
    assert log.settings["further_tables"] == ["line 5"]


def test_files_joined_to_one_are_read_through_their_marks(tmp_path: Path) -> None:
    """Each with its own byte order mark and header; a delimiter ends each line, so that a column has no name."""
    path = tmp_path / "log.csv"
    one = "\ufefft;T;n;\n0;20;5;\n1;21;6;\n"
    path.write_text(one + one.replace("0;", "2;").replace("1;", "3;"))
    log, t_ns, columns = read(path)
    assert (t_ns, columns["T"], list(log.rejected)) == ([k * S_NS for k in range(4)], [20, 21, 22, 23], [])
    path.write_text(one + one.replace("T", "T_2"))
    assert read(path)[2]["T_2"] == [20, 21]


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ("Time;n\n0;5\n1;6\n", "one of both without dates: make two files of it."),
        ("Datum;n\n5;x\n6;y\n", "no column is recognised as its time"),
    ],
)
def test_another_table_that_cannot_be_read_is_said_with_its_line(tmp_path: Path, other: str, says: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(ONE + other)
    with pytest.raises(UnreadableLogError, match=r"log\.csv: another table begins at line 5[:,] ") as caught:
        read(path)
    assert says in str(caught.value)


def test_words_among_the_rows_are_no_header(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t;T;note\n0;20;start time\n1;21;\nmean time;max;min\n2;22;\n")
    log, _, columns = read(path)
    assert (columns["T"], [one.where for one in log.rejected]) == ([20, 21, 22], ["line 4, column t"])


def test_series_are_ingested_with_their_own_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No stamp stands twice, no clock steps back, and a column that two tables have is one channel."""
    rates, tables, store = tmp_path / "rates.csv", tmp_path / "tables.csv", ["--store", str(tmp_path / "store")]
    rates.write_text("Time;T;Time;n\n0,0;20;0;5\n0,1;21;1;6\n0,2;22;;\n")
    tables.write_text(ONE + "Zeit;n;T\n14.03.2025 08:00:01;5;30\n14.03.2025 08:00:02;6;31\n")
    assert main(["ingest", str(rates), str(tables), *store]) == 0
    said = capsys.readouterr().out
    assert said.count("decoded 5 ") == said.count("decoded 4 ") == 1
    assert "clock" not in said and "stamp" not in said
    query = "SELECT channel, t_ns // 100000000 % 100 AS t, value FROM samples WHERE NOT doubled"
    assert main(["sql", f"{query} ORDER BY t_ns < 1000000000000, channel, t_ns, value", "--json", *store]) == 0
    rows = [tuple(row.values()) for row in json.loads(capsys.readouterr().out)["rows"]]
    assert rows == [
        *(("T", 0, 20.5), ("T", 10, 21.5), ("T", 10, 30), ("T", 20, 31), ("n", 10, 5), ("n", 20, 6)),
        *(("T", 0, 20), ("T", 1, 21), ("T", 2, 22), ("n", 0, 5), ("n", 10, 6)),
    ]


def test_a_table_of_which_no_row_can_be_read_leaves_the_other_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"2024-03-01 10:00:0{i},2.5,400\n" for i in range(3))
    (tmp_path / "log.csv").write_text(f"CH,U1,U2\nComment,coil,dc\nRatio,1,1\nTime,U1-1,U1-2\n{rows}")
    assert main(["ingest", str(tmp_path / "log.csv"), "--store", str(tmp_path / "store")]) == 1
    said = capsys.readouterr().out
    assert "decoded 3 " in said and "rejected 1 " in said


DL = """\
"Header Size","11"
"Model Name","DL850"
"BlockNumber","1"
"TraceName","T, end","n"
"BlockSize","3","3"
"VUnit","C","rpm"
"HResolution","5.0E-01","5.0E-01"
"HOffset","-5.0E-01","-5.0E-01"
"HUnit","s","s"
"Date","2025/03/14","2025/03/14"
"Time","08:00:00.12","08:00:00.12"

,2.00E+01,5.0E+00
,2.10E+01,6.0E+00
,,7.0E+00
"""


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("unquoted", [False, True])
def test_labels_above_a_table_say_its_names_units_and_rate(tmp_path: Path, timed: bool, unquoted: bool) -> None:
    text = DL.replace("T, end", "T end" if unquoted else "T, end")
    for k in range(3) if timed else ():
        text = text.replace("\n,", f"\n{k / 2},", 1)
    (path := tmp_path / "dl.csv").write_text(text.replace('"', "") if unquoted else text, encoding="utf-8")
    log, t_ns, columns = read(path)
    names = ("T end", "n")
    assert t_ns == [0, S_NS // 2, S_NS]
    assert [same(columns[name], want) for name, want in zip(names, ([20, 21, NAN], [5, 6, 7]), strict=True)] == [
        True,
        True,
    ]
    assert [log.units[name] for name in names] == ["C", "rpm"]
    assert (log.found, list(log.rejected), log.settings["header_line"]) == (3, [], 11)


@pytest.mark.parametrize(
    ("label", "other"),
    [('"BlockNumber","1"', '"BlockNumber","2"'), ('"5.0E-01"\n"HO', '"1"\n"HO'), (",,7.0E+00\n", f"\n{DL}")],
)
def test_several_blocks_or_rates_below_labels_are_refused_as_that(tmp_path: Path, label: str, other: str) -> None:
    assert label in DL
    (path := tmp_path / "dl.csv").write_text(DL.replace(label, other), encoding="utf-8")
    with pytest.raises(UnreadableLogError, match=r"Of a Yokogawa DL scope one block at one rate is read: convert each"):
        read(path)
