"""LabVIEW measurement files, laid out by hand as LabVIEW writes them: segments, X columns, clocks, refusals."""

from __future__ import annotations

import gzip
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from ingest.log.reading import Reader
from made.places import LOGS
from made.tables import read

S_NS = 1_000_000_000
JULY_NS = 1_563_815_898 * S_NS  # 22 July 2019, 17:18:18 UTC
END = "***End_of_Header***"


def header(columns: str = "One", pref: str = "Relative", multi: str = "No", separator: str = "Tab") -> str:
    tags = [
        ("Writer_Version", "2"),
        ("Reader_Version", "2"),
        ("Separator", separator),
        ("Decimal_Separator", "."),
        ("Multi_Headings", multi),
        ("X_Columns", columns),
        ("Time_Pref", pref),
        ("Operator", "Öller"),
        ("Date", "2019/07/22"),
        ("Time", "17:18:18.25"),
    ]
    sign = "," if separator == "Comma" else "\t"
    return "LabVIEW Measurement\t\n" + "".join(f"{tag}{sign}{value}\n" for tag, value in tags) + f"{END}\n\n"


def segment(
    rows: str, names: str = "T_w\tn", clock: str | None = "17:18:18.25", dx: str = "0.5", dimension: str = "Time"
) -> str:
    count = len(names.split("\t"))
    tags = [("Channels", str(count)), ("Samples", "\t".join(["1000"] * count)), ("Y_Unit_Label", "deg C\trpm")]
    tags += [] if clock is None else [("Date", "2019/07/22\t2019/07/22"), ("Time", f"{clock}\t{clock}")]
    tags += [("X_Dimension", dimension), ("X0", "0.0000000000000000E+0"), ("Delta_X", dx)]
    return "".join(f"{tag}\t{value}\n" for tag, value in tags) + f"{END}\nX_Value\t{names}\tComment\n{rows}"


def lvm(folder: Path, text: str, name: str = "log.lvm") -> Path:
    path = folder / name
    path.write_bytes(text.replace("\n", "\r\n").encode("cp1252"))
    return path


def test_the_sample_is_read_whole() -> None:
    log, t_ns, columns = read(LOGS / "sample.lvm")
    assert t_ns == [JULY_NS + one for one in (S_NS // 4, 3 * S_NS // 4, 7 * S_NS // 4)]
    assert (columns["T_w"], columns["n"]) == ([20.5, 20.6, 20.8], [0, 1500, 1600])
    assert columns["Comment"] == ["start", "", ""]
    assert (log.absolute, log.units) == (True, {"T_w": "deg C", "n": "rpm"})
    assert [(one.record, one.where, one.why) for one in log.rejected] == [
        (2, "line 26, column n", 'text "ERR" where numbers are')
    ]
    assert log.settings == {"encoding": "utf-8", "time": "s since 1970", "gz": False, "backward_steps": 0}


@pytest.mark.parametrize("name", ["log.lvm", "log.csv", "log"])
@pytest.mark.parametrize("packed", [bytes, gzip.compress])
def test_it_is_recognised_by_its_first_line(tmp_path: Path, name: str, packed: Any) -> None:
    path = tmp_path / name
    path.write_bytes(packed((LOGS / "sample.lvm").read_bytes()))
    assert recognise(path).name == "lvm" and len(read(path)[1]) == 3


@pytest.mark.parametrize(
    ("columns", "pref", "rows", "seconds"),
    [
        ("One", "Relative", "0.000000\t1\t2\n0.500000\t1\t2\n", [0.25, 0.75]),
        ("One", "Relative", "0,000000\t1,0\t2,0\n0,500000\t1,0\t2,0\n", [0.25, 0.75]),
        ("No", "Relative", "\t1\t2\n\t1\t2\n\t1\t2\n", [0.25, 0.75, 1.25]),
        ("One", "Absolute", "3646660698.500000\t1\t2\n3646660699.000000\t1\t2\n", [0.5, 1.0]),
        ("One", "Relative", "-1.5\t1\t2\tbefore\n", [-1.25]),
    ],
)
def test_the_time_is_that_of_the_segment_and_its_x(
    tmp_path: Path, columns: str, pref: str, rows: str, seconds: list[float]
) -> None:
    log, t_ns, found = read(lvm(tmp_path, header(columns, pref) + segment(rows)))
    assert t_ns == [JULY_NS + round(one * S_NS) for one in seconds] and log.absolute
    assert (found["T_w"], found["n"]) == ([1.0] * len(seconds), [2.0] * len(seconds))


def test_the_clock_of_a_file_is_local_and_a_file_without_one_counts_from_its_start(tmp_path: Path) -> None:
    text = header() + segment("0\t1\t2\n1\t1\t2\n")
    assert read(lvm(tmp_path, text), TimeSpec(zone="Europe/Rome"))[1][0] == JULY_NS + S_NS // 4 - 7200 * S_NS
    bare = text.replace("Date\t2019/07/22", "Datum\t")
    log, t_ns, _ = read(lvm(tmp_path, bare))
    assert (t_ns, log.absolute) == ([0, S_NS], False)


def test_each_segment_has_its_own_clock_and_its_header_is_no_row(tmp_path: Path) -> None:
    special = "***Start_Special***\nsome\tthing\n1\t2\t3\n***End_Special***\n"
    parts = [
        segment("0\t1\t2\n0.5\t1.5\t2\n", clock="17:18:18.00"),
        "\n" + special + segment("0\t3\t4\n0.5\t3.5\t4\tend\n", clock="17:20:00.00"),
    ]
    log, t_ns, columns = read(lvm(tmp_path, header(multi="Yes") + "".join(parts)))
    assert t_ns == [JULY_NS + round(one * S_NS) for one in (0, 0.5, 102, 102.5)]
    assert (columns["T_w"], columns["Comment"][-1]) == ([1, 1.5, 3, 3.5], "end")
    assert (log.found, list(log.rejected), log.cut) == (4, [], None)


def test_a_segment_of_other_channels_ends_what_is_read_and_says_so(tmp_path: Path) -> None:
    text = header() + segment("0\t1\t2\n") + segment("0\t3\t4\n", names="T_w\tI_q")
    log, t_ns, _ = read(lvm(tmp_path, text))
    assert len(t_ns) == 1
    line = text[: text.index("I_q")].count("\n") + 1
    assert log.cut and log.cut.startswith(f"goes on with other channels at line {line}: 1 rows were read and kept")


def test_each_channel_may_have_a_column_of_times_and_a_start(tmp_path: Path) -> None:
    tags = "Channels\t2\nDate\t2019/07/22\t\t2019/07/22\nTime\t17:18:18,25\t\t17:18:19,25\nY_Unit_Label\tdegC\t\trpm\n"
    names = f"{END}\nX_Value\tT_w\tX_Value\tn\tComment\n"
    text = header("Multi", multi="Yes") + tags + names + "0,0\t20,5\t0,0\t5\n0,5\t21,5\t2,0\t6\n1,0\t22,5\t\t\n"
    log, t_ns, columns = read(lvm(tmp_path, text))
    begun = JULY_NS + S_NS // 4
    assert sorted(t - begun for t in t_ns) == [0, S_NS // 2, S_NS, S_NS, 3 * S_NS]
    assert (columns["T_w"], columns["n"], log.units) == ([20.5, 21.5, 22.5], [5, 6], {"T_w": "degC", "n": "rpm"})
    assert not log.rejected


def test_separators_may_be_commas(tmp_path: Path) -> None:
    text = header(separator="Comma") + segment("0\t1.5\t2\n1\t2.5\t2\n").replace("\t", ",")
    _, t_ns, columns = read(lvm(tmp_path, text.replace("LabVIEW Measurement\t", "LabVIEW Measurement,")))
    assert len(t_ns) == 2 and columns["T_w"] == [1.5, 2.5]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (header() + segment("0\t1\t2\n", dimension="Frequency"), "its X is Frequency and not time: it is no log."),
        (header(), "holds no line with text: nothing to read."),
        (header() + segment(""), "holds one line and no row below it: nothing to read."),
    ],
)
def test_a_file_without_rows_over_time_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(lvm(tmp_path, text))
    assert str(refused.value).startswith(f"log.lvm: {says}")


def test_a_file_that_was_cut_in_a_row_keeps_those_before(tmp_path: Path) -> None:
    log, t_ns, _ = read(lvm(tmp_path, header() + segment("0\t1\t2\n0.5\t1\t2\n1.0\t1")))
    assert len(t_ns) == 2 and len(log.rejected) == 1
    assert log.cut and log.cut.startswith("ends inside line 26: 2 rows were read and kept")


def test_a_long_file_is_read_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats._text.BLOCK", 1500)
    rows = "".join(f"{k / 10:.6f}\t{20 + k / 8}\t{k}\n" for k in range(3000))
    log, t_ns, columns = read(lvm(tmp_path, header() + segment(rows)))
    assert (log.found, t_ns[-1]) == (3000, JULY_NS + S_NS // 4 + 2999 * S_NS // 10)
    np.testing.assert_array_equal(columns["T_w"], 20 + np.arange(3000) / 8)


def test_it_goes_through_the_child_process(tmp_path: Path) -> None:
    with closing(Reader()) as reader:
        reading = reader.record(LOGS / "sample.lvm", tmp_path / "recording.mcap")
    assert (reading.format, reading.found, reading.written, reading.rejected) == ("lvm", 4, 3, 1)
