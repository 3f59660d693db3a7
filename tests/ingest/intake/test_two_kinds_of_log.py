"""One bench file for tables and bus logs together: equal names of signals, and stamps of each kind in its own way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import can
import pytest

from made import can_bench
from replay.cli import main

Capture = pytest.CaptureFixture[str]

BENCH = """\
schema = "whyhot.bench/1"
specimen = "m1"
[[channel]]
signal = "rows.MotorSpeed"
quantity = "speed_command"
unit = "rpm"
[[channel]]
signal = "Drive.MotorSpeed"
quantity = "speed"
unit = "rpm"
"""
DBC = can_bench.DBC


def write_logs(folder: Path, table: str) -> list[str]:
    (folder / "bench.dbc").write_text(DBC, encoding="utf-8")
    (folder / "log.csv").write_text(table, encoding="utf-8")
    with can.Logger(str(folder / "log.blf")) as log:
        for i in range(20):
            data = (1000 + i).to_bytes(2, "little") + bytes(6)
            log.on_message_received(
                can.Message(
                    timestamp=1_760_000_000.0 + i, arbitration_id=256, is_extended_id=False, data=data, channel=0
                )
            )
    return [str(folder / "log.csv"), str(folder / "log.blf")]


def rows_of(folder: Path, capsys: Capture, bench: str, logs: list[str], query: str) -> list[dict[str, Any]]:
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    words = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    store = ["--store", str(folder / "store")]
    assert main(["ingest", *logs, *words, *store]) == 0, capsys.readouterr().err
    capsys.readouterr()
    assert main(["sql", query, "--json", *store]) == 0
    return list(json.loads(capsys.readouterr().out)["rows"])


def test_a_table_and_a_bus_that_both_say_speed_go_into_one_bench_file(tmp_path: Path, capsys: Capture) -> None:
    logs = write_logs(tmp_path, "epoch_s,MotorSpeed\n" + "".join(f"{1_760_000_000 + i},{i}\n" for i in range(20)))
    query = "SELECT quantity, max(value) AS most FROM samples WHERE quantity IS NOT NULL GROUP BY ALL ORDER BY ALL"
    assert rows_of(tmp_path, capsys, BENCH, logs, query) == [
        {"quantity": "speed", "most": 1019.0},
        {"quantity": "speed_command", "most": 19.0},
    ]


def test_a_bare_name_of_both_is_refused_with_the_names_that_tell_them_apart(tmp_path: Path, capsys: Capture) -> None:
    logs = write_logs(tmp_path, "epoch_s,MotorSpeed\n1760000000,1\n1760000001,2\n")
    (tmp_path / "bench.toml").write_text(BENCH.replace("rows.", ""), encoding="utf-8")
    words = ["--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
    assert main(["ingest", *logs, *words, "--store", str(tmp_path / "store")]) == 2
    assert "can1:Drive.MotorSpeed, rows.MotorSpeed" in capsys.readouterr().err


def test_stamps_of_one_kind_of_log_are_explained_for_that_kind_alone(tmp_path: Path, capsys: Capture) -> None:
    """The recorder's preamble and its local clock are the table's; the bus log keeps its own UTC."""
    preamble = "Recorder 7;serial 12\nexported by Müller;\n"
    rows = "".join(f"09.10.2025 10:53:{20 + i};{i}\n" for i in range(20))  # 08:53:20 UTC
    logs = write_logs(tmp_path, f"{preamble}Zeit;MotorSpeed\n{rows}")
    time = '[time.csv]\nskip_rows = 2\nzone = "Europe/Rome"\nformat = "%d.%m.%Y %H:%M:%S"\n'
    bench = BENCH.replace('specimen = "m1"\n', f'specimen = "m1"\n{time}')
    query = "SELECT quantity, min(t_ns) // 1000000000 AS first_s FROM samples WHERE quantity IS NOT NULL GROUP BY ALL"
    assert sorted(rows_of(tmp_path, capsys, bench, logs, query), key=str) == [
        {"quantity": "speed", "first_s": 1_760_000_000},
        {"quantity": "speed_command", "first_s": 1_760_000_000},
    ]


def test_two_tables_of_one_kind_are_explained_by_their_loggers(tmp_path: Path, capsys: Capture) -> None:
    """One logger writes UTC, the other one local time, day after day under another name."""
    heads = {"Thermo_2025-10-09.csv": "time,MotorSpeed", "power_2025-10-09.csv": "time,n"}
    hours = {"Thermo_2025-10-09.csv": "10", "power_2025-10-09.csv": "08"}
    for name, head in heads.items():
        rows = "".join(f"2025-10-09 {hours[name]}:53:{20 + i},{i}\n" for i in range(20))
        (tmp_path / name).write_text(f"{head}\n{rows}", encoding="utf-8")
    (tmp_path / "bench.dbc").write_text(DBC, encoding="utf-8")
    logger = '[[logger]]\nname = "thermo"\nfiles = "thermo_*"\nzone = "Europe/Rome"\n'
    bench = BENCH.replace("Drive.MotorSpeed", "n").replace("rows.", "") + logger
    query = "SELECT quantity, min(t_ns) // 1000000000 AS first_s FROM samples WHERE quantity IS NOT NULL GROUP BY ALL"
    logs = [str(tmp_path / name) for name in heads]
    assert sorted(rows_of(tmp_path, capsys, bench, logs, query), key=str) == [
        {"quantity": "speed", "first_s": 1_760_000_000},
        {"quantity": "speed_command", "first_s": 1_760_000_000},
    ]


def test_show_says_whose_stamps_they_are(tmp_path: Path, capsys: Capture) -> None:
    logger = '[[logger]]\nname = "drive"\nfiles = "log.*"\n'
    logs = write_logs(tmp_path, "epoch_s,MotorSpeed\n1760000000,1\n1760000001,2\n")
    rows_of(tmp_path, capsys, BENCH + logger, logs, "SELECT 1")
    assert main(["show", "log", "--store", str(tmp_path / "store")]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if "times: " in line]
    assert len(said) == 2 and all("times: logger drive, " in line for line in said)


def test_lines_to_skip_that_are_all_there_is_are_refused(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "log.csv").write_text("a;b\n1;2\n", encoding="utf-8")
    (tmp_path / "bench.toml").write_text('schema = "whyhot.bench/1"\n[time]\nskip_rows = 7\n', encoding="utf-8")
    words = ["inspect", str(tmp_path / "log.csv"), "--bench", str(tmp_path / "bench.toml")]
    assert main(words) == 1
    assert "has no line below the 7 that skip_rows" in capsys.readouterr().err
