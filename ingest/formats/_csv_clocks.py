"""Clocks of tables: how the rows have their time, from a rate, from numbers that count, or from stamps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats._csv_stamps import LocalClock, parse, time_of_day

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

UNITS_NS = {"ns": 1.0, "us": 1e3, "µs": 1e3, "μs": 1e3, "ms": 1e6, "s": 1e9, "sec": 1e9, "min": 60e9, "h": 3600e9}
SHOWN = 64  # characters of a cell that is no time
LATEST_NS = 9.2e18  # what int64 holds


@dataclass(kw_only=True)
class Clock(ABC):
    """How the rows of a table have their time."""

    says: str
    absolute: bool
    columns: tuple[str, ...] = ()  # those that hold it: none, one, or two (date and time of day)
    is_text: bool = False  # their cells are wanted as text

    @abstractmethod
    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        """(t_ns, bad) of consecutive rows (N,); bad where the cell of the column, or both `joined`, is no time."""

    def why(self, cell: str) -> str:
        """Why a cell that `t_ns` called bad is no time."""
        return f'"{cell[:SHOWN]}" is no time ({self.says})'

    def counted(self) -> dict[str, int]:
        """What was counted on the way, for the settings."""
        return {}


@dataclass(kw_only=True)
class Rate(Clock):
    """Rows at a fixed rate: row k is at k / `rate_hz` after the origin."""

    rate_hz: float
    origin_ns: int

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        return self.origin_ns + np.rint(record * (1e9 / self.rate_hz)).astype(np.int64), np.zeros(len(record), bool)


@dataclass(kw_only=True)
class Counted(Clock):
    """Numbers of a unit, counted from the origin. `step_ns`: what they are rounded to."""

    unit_ns: float
    origin_ns: int = 0
    step_ns: int = 1

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        steps = cells * (self.unit_ns / self.step_ns)
        bad = ~(np.abs(steps) < (LATEST_NS - self.origin_ns) / self.step_ns)
        return self.origin_ns + np.rint(np.where(bad, 0.0, steps)).astype(np.int64) * self.step_ns, bad


@dataclass(kw_only=True)
class Stamped(Clock):
    """Dates and times of a pattern, local or with their own offset."""

    pattern: str
    local: LocalClock
    is_text: bool = field(default=True, init=False)

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        return parse(cells, self.pattern, self.local)

    def why(self, cell: str) -> str:
        clock = time_of_day(cell, self.pattern)
        if clock is None:
            return super().why(cell)
        return f"{clock} does not exist in {self.local.zone.key} on that day (clocks went forward)"

    def counted(self) -> dict[str, int]:
        return {"ambiguous_rows": self.local.ambiguous} if self.local.ambiguous else {}
