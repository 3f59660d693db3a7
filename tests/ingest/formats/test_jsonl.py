"""JSON lines: objects become rows, whatever they hold and lack."""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from made.tables import S_NS, read

AT_S = 1_741_939_200


def objects(folder: Path, *given: Mapping[str, Any] | str) -> Path:
    path = folder / "log.txt"
    lines = (one if isinstance(one, str) else json.dumps(one, ensure_ascii=False) for one in given)
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return path


def test_objects_are_rows_and_their_names_columns(tmp_path: Path) -> None:
    path = objects(
        tmp_path,
        {"t": AT_S, "motor": {"T_Rücken": 20.5, "n": 1e3}, "on": True, "note": 'a\t"b"; c', "phases": [1, {"I": 2}]},
        {"t": AT_S + 0.5, "motor": {"T_Rücken": None, "n": -2}, "on": False},
        {"t": AT_S + 1, "late": "7", "wave": [0] * 65, "spans": []},
    )
    log, t_ns, columns = read(path)
    assert t_ns == [AT_S * S_NS, AT_S * S_NS + S_NS // 2, (AT_S + 1) * S_NS]
    assert (log.absolute, log.found, list(log.rejected), log.settings["left_out"]) == (True, 3, [], ["wave"])
    nan = np.nan
    wanted = {"motor.T_Rücken": [20.5, nan, nan], "motor.n": [1000, -2, nan], "on": [1, 0, nan], "late": [nan, nan, 7]}
    wanted |= {"phases.0": [1, nan, nan], "phases.1.I": [2, nan, nan]}
    for name, values in wanted.items():
        np.testing.assert_array_equal(columns[name], values)
    assert columns["note"] == ['a "b"; c', "", ""]


def test_what_json_cannot_say_is_a_missing_number(tmp_path: Path) -> None:
    rows = ('{"t": 0, "T": 20}', '{"t": 1, "T": NaN}', '{"t": 2, "T": -Infinity}', '{"t": 3, "T": 21}')
    log, _, columns = read(objects(tmp_path, *rows))
    np.testing.assert_array_equal(columns["T"], [20, np.nan, np.nan, 21])
    assert list(log.rejected) == []


def test_a_message_a_line_is_a_channel_for_each_topic(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl.gz"
    rows = [{"ts": 1000 * AT_S + 500 * k, "topic": ("T", "n")[k % 2], "value": k} for k in range(20)]
    path.write_bytes(gzip.compress("\n".join(map(json.dumps, rows)).encode()))
    log, _, _ = read(path)
    assert log.settings["series"] == {"T": ["T"], "n": ["n"]}


def test_a_name_that_comes_late_is_a_column(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats._text.BLOCK", 1000)
    rows: Iterable[dict[str, int]] = ({"t": k, "T": k} | ({"n": k} if k > 900 else {}) for k in range(1000))
    log, t_ns, columns = read(objects(tmp_path, *rows))
    assert (len(t_ns), log.found, list(log.rejected)) == (1000, 1000, [])
    np.testing.assert_array_equal(columns["n"], [*[np.nan] * 901, *range(901, 1000)])


def test_a_line_that_is_no_object_is_rejected_with_its_number(tmp_path: Path) -> None:
    path = objects(tmp_path, {"t": 0, "T": 20}, {"t": 1, "T": 21}, "[1, 2]", "", '{"t": 2, "T"', {"t": 3, "T": 22})
    log, t_ns, columns = read(path)
    assert (t_ns, columns) == ([0, S_NS, 3 * S_NS], {"T": [20, 21, 22]})
    assert [(one.where, one.why) for one in log.rejected] == [
        (line, "is no JSON object, or an empty one") for line in ("line 3", "line 5")
    ]


def test_a_last_object_that_is_cut_is_said(tmp_path: Path) -> None:
    path = objects(tmp_path, {"t": 0, "T": 20}, {"t": 1, "T": 21}, {"t": 2, "T": 22})
    path.write_bytes(path.read_bytes()[:-4])
    log, t_ns, _ = read(path)
    assert len(t_ns) == 2 and log.cut and log.cut.startswith("ends inside line 3: 2 rows were read and kept")


def test_a_log_without_times_has_the_rate_of_the_bench_file(tmp_path: Path) -> None:
    path = objects(tmp_path, {"T": 20, "n": 1}, {"T": 21, "n": 2})
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(path)
    assert read(path, TimeSpec(rate_hz=2.0, skip_rows=3))[1] == [0, S_NS // 2]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[{"t": 0, "T": 20}, {"t": 1, "T": 21}]\n', r"is a text in JSON\. Export it as JSON lines \(jq -c '\.\[\]'\)"),
        ('{"t": [0, 1], "T": [20, 21]}\n', r"is a text in JSON\."),
        ('{\n "t": 0,\n "T": 20\n}\n', r"is a text in JSON\."),
        ("nothing\nof this kind\n", r"no line of it is a JSON object\. Export it as CSV\."),
    ],
)
def test_other_texts_are_refused_with_what_to_do(tmp_path: Path, text: str, says: str) -> None:
    (path := tmp_path / "log.jsonl").write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableLogError, match=says):
        read(path)


def test_names_that_are_data_are_refused(tmp_path: Path) -> None:
    path = objects(tmp_path, *({"t": k, f"id_{k}": 1} for k in range(6000)))
    with pytest.raises(UnreadableLogError, match=r"more than 5,000 names"):
        read(path)
