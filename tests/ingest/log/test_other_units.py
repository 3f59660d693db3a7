"""Units of a table and of its bench file that differ."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.errors import BenchFileError
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import Intake, take_in
from ingest.intake.setup import prepare

BENCH = """
schema = "whyhot.bench/1"

[[channel]]
signal = "{}"
quantity = "temperature"
unit = "degC"
"""


def _taken(folder: Path, signal: str, tables: dict[str, str]) -> Intake:
    """Each table of three rows has a column of this header, or a row of this unit below `T`."""
    (folder / "bench.toml").write_text(BENCH.format(signal), encoding="utf-8")
    logs = []
    for name, header in tables.items():
        rows = "".join(f"{second},{20 + second}\n" for second in range(3))
        (folder / name).write_text(f"time [s],{header}\n{rows}", encoding="utf-8")
        logs.append(folder / name)
    with Store.open(folder / "store", create=True) as store:
        setup = prepare(logs, folder / "bench.toml", [], lambda path: pytest.fail(str(path)))
        return take_in(store, logs, setup, Override())


def test_a_column_in_another_unit_than_the_bench_file_means_is_told(tmp_path: Path) -> None:
    intake = _taken(tmp_path, "T_wdg [degC]", {"mon.csv": "T_wdg [degC]", "tue.csv": "T_wdg (°F)", "wed.csv": "T_wdg"})
    assert [flag.says for _, flag in intake.flags if flag.flag == "other_unit"] == [
        "tue.csv: holds T_wdg (°F) and not T_wdg [degC] of the bench file: give what it holds a [[channel]] too"
    ]


def test_the_log_whose_unit_row_disagrees_is_named(tmp_path: Path) -> None:
    with pytest.raises(BenchFileError, match=r'bench.toml:7: unit "degC" .* disagrees with tue.csv, which says "K"'):
        _taken(tmp_path, "T", {"mon.csv": "T\ns,degC", "tue.csv": "T\ns,K"})
