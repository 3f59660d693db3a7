"""ATFX: measurements of ASAM ODS as XML, with their values in the file.

The file says its own model first: which of its elements is a submatrix, a local column, a unit, and what their
attributes are called. A submatrix is a table, a local column a column of it, called as its measurement quantity is.
The time of a table is its independent column, dates or seconds since its measurement began, else a column of dates or
one that is called as times are. Columns whose values lie in files beside it are left out and named, and those that are
neither numbers, dates nor texts. Dates have no zone: they are local ones, as those of tables are. Described in
https://github.com/peak-solution/openatfx, which holds examples of ASAM.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ingest.formats import WALL_CLOCK, Rows
from ingest.formats._csv_time_names import UNITS_NS, base_and_unit, is_time_name, unit_of_time
from ingest.formats._joined_tables import JoinedTables, OwnTimes, counted, held

MEASUREMENT, QUANTITY, SUBMATRIX, COLUMN, UNIT = (
    *("aomeasurement", "aomeasurementquantity", "aosubmatrix", "aolocalcolumn", "aounit"),
)
KINDS = (MEASUREMENT, QUANTITY, SUBMATRIX, COLUMN, UNIT)
NUMBERS = frozenset(f"A_{kind}" for kind in ("INT8", "INT16", "INT32", "INT64", "FLOAT32", "FLOAT64", "BOOLEAN"))
TEXTS, DATES = "A_UTF8STRING", "A_TIMESTRING"
WORDS = {"true": "1", "false": "0"}
GOOD = 0b1001  # of a value's flags: it is valid, and defined
DATE = re.compile(r"(\d{4})(\d\d)?(\d\d)?(\d\d)?(\d\d)?(\d\d)?(\d{0,9})", re.ASCII)
NO_TIME = "no time"
BAD_TIME = "has a stamp that no log can reach"

FARTHEST_NS = 1e18  # after the start
NO_DATE = -1  # in place of one that is none

Values = NDArray[np.float64]


class _NotRead(Exception):
    """Why a column is left out."""


@dataclass(frozen=True)
class _Instance:
    """An element of the data: attributes of the base model -> text, and the values of a column as their element."""

    said: dict[str, str]
    values: ElementTree.Element | None = None

    def refers(self, relation: str) -> list[str]:
        return self.said.get(relation, "").split()


@dataclass(frozen=True)
class _Column:
    """A column as it stands: `values` (N,) numbers, int64 nanoseconds UTC where `dated`, or texts."""

    name: str
    unit: str
    independent: bool
    values: NDArray[Any]
    missing: NDArray[np.bool_]
    dated: bool


@dataclass
class AtfxLog(JoinedTables):
    """A file of measurements, read as a whole."""

    _found: dict[str, dict[str, _Instance]] = field(default_factory=lambda: {kind: {} for kind in KINDS})
    _left: dict[str, str] = field(default_factory=dict)

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where no row can be read."""
        ended = self._read()
        tables = [table for number, one in self._found[SUBMATRIX].items() if (table := self._table(number, one))]
        self.settings["groups"] = counted(tables)
        if self._left:
            self.settings["unconverted"] = self._left
        yield from self._joined(tables)
        why = "; ".join(f"{name}: {says}" for name, says in [*self._left.items()][:2])
        first = self.rejected[0].why if self.rejected else None
        self.end_rows(ended, ended if ended and not self.found else first or why or "it holds no submatrix with values")

    # ---- the file --------------------------------------------------------------------------------------------------

    def _read(self) -> str | None:
        """Take in what the file holds; why it ended early, if it did."""
        model: dict[str, tuple[str, dict[str, str]]] = {}  # element -> (kind, its attribute -> that of the base model)
        where: list[str] = []
        try:
            for event, element in ElementTree.iterparse(self.path, ("start", "end")):
                tag = _bare(element.tag)
                if event == "start":
                    where.append(tag)
                    continue
                where.pop()
                if tag == "application_element":
                    kind, said = _modelled(element)
                    if kind in KINDS:
                        model[_said(element, "name")] = kind, said
                elif where[-1:] == ["instance_data"]:
                    if tag in model:
                        kind, said = model[tag]
                        one = _instance(element, said)
                        self._found[kind][one.said.get("id", "")] = one
                    element.clear()
        except ElementTree.ParseError as error:
            return f"is no whole XML ({error})"
        return None

    def _table(self, number: str, submatrix: _Instance) -> OwnTimes | None:
        """A submatrix, where it has columns of values."""
        name = submatrix.said.get("name") or f"submatrix {number}"
        own = [
            one
            for key, one in self._found[COLUMN].items()
            if number in one.refers("submatrix") or key in submatrix.refers("local_columns")
        ]
        columns = [column for one in own if (column := self._column(one, submatrix, name))]
        count = min((len(one.values) for one in columns), default=0)
        clock = _clock(columns)
        kept = [one for one in columns if one is not clock]
        if not count or not kept:
            return None
        if clock is None:
            self._left[name] = "nothing in it says a time"
            return None
        t_ns, bad = self._stamps(clock, submatrix, count)
        return OwnTimes(
            name=name,
            columns=tuple(one.name for one in kept),
            units=tuple(one.unit for one in kept),
            count=len(t_ns),
            times=held(t_ns, bad),
            cells=lambda place, start, stop: _cells(kept[place], start, stop),
            raw=lambda i: str(clock.values[i]).encode(),
            why=lambda i: NO_TIME if clock.missing[i] else BAD_TIME,
            where=lambda i: f"value {i + 1:,}",
        )

    def _column(self, one: _Instance, submatrix: _Instance, table: str) -> _Column | None:
        """A local column; None where it is left out."""
        quantity = self._found[QUANTITY].get(one.said.get("measurement_quantity", "").strip(), _Instance({}))
        unit = self._found[UNIT].get(quantity.said.get("unit", "").strip(), _Instance({}))
        name = quantity.said.get("name") or one.said.get("name") or f"column {one.said.get('id', '')}"
        try:
            values, dated = self._values(one, submatrix)
            missing = _missing(one, len(values)) | (dated & (values == NO_DATE))
        except _NotRead as why:
            self._left[f"{table}/{name}"] = str(why)
            return None
        independent = one.said.get("independent", "0").strip() in ("1", "true")
        return _Column(name, unit.said.get("name", ""), independent, values, missing, dated)

    def _values(self, one: _Instance, submatrix: _Instance) -> tuple[NDArray[Any], bool]:
        """(the values of a column, whether they are dates). Raises _NotRead."""
        how = one.said.get("sequence_representation", "explicit").strip().casefold()
        given = _numbers(one.said.get("generation_parameters", ""))
        held = next((child for child in (() if one.values is None else one.values)), None)
        if how in ("implicit_constant", "implicit_linear") and len(given) == 1 + (how == "implicit_linear"):
            count = _numbers(submatrix.said.get("number_of_rows", "")).astype(int)
            step = given[1] if how == "implicit_linear" else 0.0
            return given[0] + step * np.arange(count[0] if 0 < count[:1].sum() < 1 << 31 else 0), False
        if held is None or how.endswith(("_external", "_component")) or _bare(held.tag) == "component":
            where = next((child for child in (() if held is None else held) if _bare(child.tag) == "identifier"), None)
            named = f" ({where.text})" if where is not None and where.text else ""
            raise _NotRead(f"its values lie in a file beside it{named}: export it with its values in the file")
        kind, text = _bare(held.tag), held.text or ""
        if kind in NUMBERS and how in ("explicit", "raw_linear"):
            values = _numbers(" ".join(WORDS.get(word, word) for word in text.split()))
            if how == "explicit":
                return values, False
            if len(given) == 2:
                return given[0] + given[1] * values, False
        if how == "explicit" and kind == DATES:
            return np.array([self._date_ns(word) or NO_DATE for word in text.split()], np.int64), True
        if how == "explicit" and kind == TEXTS:
            return np.array([" ".join((child.text or "").split()) for child in held], object), False
        raise _NotRead(f"values of the kind {kind}, {how}, are not read")

    # ---- time ------------------------------------------------------------------------------------------------------

    def _date_ns(self, text: str) -> int | None:
        """Nanoseconds UTC of `20051202103115000000`, of which the first parts may be there alone; None for none."""
        match = DATE.fullmatch(text.strip())
        if match is None:
            return None
        parts = zip(match.groups()[:6], (0, 1, 1, 0, 0, 0), strict=True)
        year, month, day, hour, minute, second = (int(part or lowest) for part, lowest in parts)
        try:
            begun = self.time.wall_ns(datetime(year, month, day, hour, minute, second))
        except ValueError:
            return None
        self.settings["time"] = WALL_CLOCK
        return None if begun is None else begun + int(f"{match[7]:0<9}")

    def _stamps(self, clock: _Column, submatrix: _Instance, count: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """(t_ns, whether there is none) of each record (N,)."""
        missing = clock.missing[:count]
        if clock.dated:
            self.absolute = True
            return clock.values[:count], missing
        begun = self._begin_ns(submatrix)
        self.absolute |= begun is not None
        since = clock.values[:count] * UNITS_NS[_unit_of(clock) or "s"]
        bad = missing | ~(np.abs(since) < FARTHEST_NS)
        return (begun or 0) + np.rint(np.where(bad, 0.0, since)).astype(np.int64), bad

    def _begin_ns(self, submatrix: _Instance) -> int | None:
        """When the measurement of a submatrix began; else when the bench file says; None where nothing says it."""
        ones = (self._found[MEASUREMENT].get(key, _Instance({})) for key in submatrix.refers("measurement"))
        begun = (self._date_ns(one.said.get("measurement_begin", "")) for one in ones)
        return next((one for one in begun if one is not None), self.time.start_ns)


def _clock(columns: Sequence[_Column]) -> _Column | None:
    numbers = [one for one in columns if one.values.dtype != object]
    wanted = (
        *(one for one in numbers if one.independent and (one.dated or _unit_of(one) or is_time_name(one.name))),
        *(one for one in numbers if one.dated),
        *(one for one in numbers if is_time_name(one.name)),
    )
    return next(iter(wanted), None)


def _unit_of(column: _Column) -> str | None:
    """The unit of time that a column counts in, if it is one."""
    return unit_of_time(column.unit.strip() or base_and_unit(column.name)[1])


def _cells(column: _Column, start: int, stop: int) -> NDArray[Any]:
    """Some values, empty where they are missing; dates beside the time as seconds since 1970."""
    values, missing = column.values[start:stop], column.missing[start:stop]
    if values.dtype == object:
        return np.where(missing, "", values)
    return np.where(missing, np.nan, values / 1e9 if column.dated else values)


def _missing(one: _Instance, count: int) -> NDArray[np.bool_]:
    """Which values (N,) the file calls invalid or undefined."""
    flags = _numbers(one.said.get("flags", "")) if one.said.get("flags", "").strip() else None
    if flags is None:
        flags = np.full(count, (*_numbers(one.said.get("global_flag", "")), GOOD)[0])
    if len(flags) < count or not np.isfinite(flags).all():
        raise _NotRead("it has fewer flags than values")
    return np.asarray((flags[:count].astype(np.int64) & GOOD) != GOOD)


def _numbers(text: str) -> Values:
    try:
        return np.array(text.split(), np.float64)
    except ValueError:
        raise _NotRead("a value of it is no number") from None


def _bare(tag: str) -> str:
    return tag.rpartition("}")[2]


def _said(element: ElementTree.Element, name: str) -> str:
    """The text of the child of this name."""
    return next(((child.text or "").strip() for child in element if _bare(child.tag) == name), "")


def _modelled(element: ElementTree.Element) -> tuple[str, dict[str, str]]:
    """The kind of an element of the model, and its attributes and relations -> those of the base model."""
    said = {}
    for child in element:
        if base := _said(child, "base_attribute") or _said(child, "base_relation"):
            said[_said(child, "name")] = base.casefold()
    return _said(element, "basetype").casefold(), said


def _instance(element: ElementTree.Element, model: dict[str, str]) -> _Instance:
    said, values = {}, None
    for child in element:
        base = model.get(_bare(child.tag))
        if base == "values":
            values = child
        elif base:
            said[base] = " ".join("".join(child.itertext()).split())
    return _Instance(said, values)


reader = AtfxLog
