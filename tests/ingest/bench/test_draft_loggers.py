"""Which loggers a draft proposes by the names of logs, each with its columns."""

from __future__ import annotations

import pytest

from ingest.bench.bench_file import read_bench
from ingest.bench.draft import draft_bench
from ingest.bench.draft_loggers import loggers
from ingest.bench.signals import Signal


@pytest.mark.parametrize(
    ("logs", "found"),
    [
        (
            {"thermo_2025-03-14.csv": "T", "power_2025-03-14.csv": "P"},
            {"thermo": "thermo_*", "power": "power_*"},
        ),
        (
            {"run07_T.csv": "T", "run08_T.csv": "T", "run07_n.csv": "n"},
            {"run_t": "run*_T.*", "run07_n": "run07_n.*"},
        ),
        (
            {"14.03.2025 logger1.csv": "T", "14.03.2025 logger2.csv": "n"},
            {"logger1": "* logger1.*", "logger2": "* logger2.*"},
        ),
        (
            {"LMG_A1_1.csv": "P", "LMG_A1_2.csv": "P", "LMG_A2.csv": "P", "Thermo_A1.csv": "T", "Thermo_A2.csv": "T"},
            {"lmg_a": "LMG_A*", "thermo_a": "Thermo_A*"},
        ),
        ({"a_1.csv": "T", "a_1_b.csv": "T", "c_1.csv": "P"}, {}),  # its second part is called otherwise
        ({"T[1] 7.csv": "T", "P[1] 7.csv": "P"}, {"t": "T?*", "p": "P?*"}),
        ({"thermo.csv": "T", "power.csv": "P"}, {}),  # called so already
        ({"thermo_1.csv": "T", "thermo_2.csv": "T"}, {}),  # one logger
        ({"1.csv": "T", "2.csv": "P"}, {}),
        ({"a_1.csv": "T", "b_1.csv": "T", "c_1.csv": "P"}, {}),  # of one logger, and called otherwise
        ({"x_1.csv": "T", "x_2.csv": "P"}, {}),  # not told apart
        ({"can1_7.csv": "T", "x_7.csv": "P"}, {}),
    ],
)
def test_loggers_are_told_by_what_their_files_are_called(logs: dict[str, str], found: dict[str, str]) -> None:
    proposed = loggers({name: (column,) for name, column in logs.items()})
    assert {one.name: one.files for one in proposed} == found
    signals = [Signal(column) for column in dict.fromkeys(logs.values())]
    text = draft_bench(signals, {"loggers": proposed}, "logs")
    assert list(read_bench(text.encode(), "draft.toml").loggers) == proposed
