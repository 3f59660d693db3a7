"""A log of rows as its columns, for the tests of formats; and the bench file of one that is as small as can be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ingest.formats import Log, Rows, TimeSpec, open_log, recognise

S_NS = 1_000_000_000
START_NS = 1_700_000_000 * S_NS
MARCH_NS = 1_709_280_000 * S_NS  # 1 March 2024, 08:00 UTC
DECEMBER_NS = 1_766_563_200 * S_NS  # 24 December 2025, 08:00 UTC
# Of tables with the columns time (ISO 8601) and T; those that follow each other within a minute are one session.
ONE_CHANNEL = """
schema = "whyhot.bench/1"
specimen = "stator-07"
[time]
column = "time"
join_gap_s = 60
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
node = "winding"
"""


def table(folder: Path, text: str, name: str = "log.csv", encoding: str = "utf-8") -> Path:
    """A log of this text."""
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def read(path: Path, spec: TimeSpec | None = None) -> tuple[Log, list[int], dict[str, list[Any]]]:
    """(log, t_ns, columns) of all rows of the log at `path`."""
    log = open_log(path, spec)
    t_ns: list[int] = []
    columns: dict[str, list[Any]] = {}
    for batch in log.batches():
        assert isinstance(batch, Rows)
        t_ns += batch.t_ns.tolist()
        for name, values in batch.columns.items():
            columns.setdefault(name, []).extend(values.tolist())
    return log, t_ns, columns


def columns_of(name: str, path: Path, spec: TimeSpec | None = None) -> tuple[Log, dict[str, list[Any]]]:
    """The log at `path`, which is of the format of this name, and its columns, with `t`, seconds since `START_NS`."""
    assert recognise(path).name == name
    log, t_ns, columns = read(path, spec)
    return log, {"t": [round((t - START_NS) / 1e9, 9) for t in t_ns], **columns}


def same(found: Any, expected: Any) -> bool:
    """Whether numbers are equal; one that is missing equals one that is."""
    return np.array_equal(np.array(found, float), np.array(expected, float), equal_nan=True)
