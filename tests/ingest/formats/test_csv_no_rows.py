"""Lines below the header of a table that are no rows."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.formats import TimeSpec
from made.tables import read, table


def test_statistics_below_a_table_are_no_rows(tmp_path: Path) -> None:
    rows = "".join(f"{k};20,5;5\n" for k in range(8))
    below = "Mittelwert;20,5;5\nMax:;21;6\nStd. Dev.;0;0\nStd Dev;0,5;0,5\nEnde;;\n"
    log, _, columns = read(table(tmp_path, f"Zeit;T;n\n{rows}{below}"))
    assert (columns["T"], log.found, log.settings["lines_of_no_row"]) == ([20.5] * 8, 9, 4)
    assert [one.where for one in log.rejected] == ["line 14, column Zeit"]
    rows = "mode,t,T\nidle,0,20\nmax,1,21\nidle,2,22\n"  # where texts stand first they are what they are
    assert read(table(tmp_path, rows))[2]["mode"] == ["idle", "max", "idle"]


@pytest.mark.parametrize("empty", [";;\n", "; ;\r\n", '"";"";""\n'])
def test_lines_of_delimiters_alone_are_no_rows(tmp_path: Path, empty: str) -> None:
    path = table(tmp_path, f"t;T;n\n0;20;5\n{empty}1;21;6\n{empty * 3}")
    log, t_ns, _ = read(path)
    assert (len(t_ns), log.found, list(log.rejected), log.settings["lines_of_no_row"]) == (2, 2, [], 4)
    log, t_ns, columns = read(path, TimeSpec(rate_hz=1.0))  # each counts where rows have no time of their own
    assert (len(t_ns), columns["T"][2]) == (6, 21)


@pytest.mark.parametrize("end", ["EOF", "End of file\r", "END"])
def test_a_line_that_says_the_end_is_no_row(tmp_path: Path, end: str) -> None:
    log, t_ns, _ = read(table(tmp_path, f"t;T\n0;20\n1;21\n{end}\n"))
    assert (len(t_ns), log.found, list(log.rejected)) == (2, 2, [])
