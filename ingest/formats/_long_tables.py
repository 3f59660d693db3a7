"""Long tables, as historians and clouds write them: a row a sample, with columns of names and one of values.

Each name is a series with stamps of its own. A table is long where a column is called as names are and the column of
values as values are; where only one of both is, or neither, rows of several names must share their stamps, and no
other column may hold numbers. Everything else stays a table as it stands: a phase or a comment names no series.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import SERIES, Rows
from ingest.formats._csv_dialect import Dialect
from ingest.formats._csv_numbers import MISSING
from ingest.formats._csv_stamps import is_stamp
from ingest.formats._csv_time_names import is_part_of_second, is_time_name, words


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


# what columns are called, their words in one
NAMES = _set(
    """name names tag tagname tagid tagpath varname var variable variablename variabile nome channel channelname
    channelid kanal kanalname canale signal signalname segnale sensor sensorname sensorid point pointname
    pointid item itemid itemname field parameter metric measurement measurand measurename messstelle messgröße
    messgroesse datapoint datenpunkt series seriesname bezeichnung nodeid displayname browsename entityid topic
    key"""
)
PLACES = _set("device deviceid devicename host asset location")  # name a series too, beside what is measured there
VALUES = _set(
    """value varvalue val wert werte messwert istwert reading valore numericvalue floatvalue doublevalue measurevalue
    measurevaluedouble state"""
)
QUALITIES = _set(
    """quality qualitycode qualitydetail qualität qualitaet qualità opcquality qual dataintegrity status statuscode"""
)
VALIDITIES = _set("validity valid isvalid gültig gueltig gültigkeit gueltigkeit good isgood")  # 0: no
UNITS = _set("unit units einheit unità uom eu engunits engineeringunits")
COUNTS = _set("id index row rownumber nr no number lfdnr table seq sequence scan")
THINGS = _set("specimen stator motor prüfling pruefling probe dut serial batch charge muster part")
BAD = re.compile(
    r"(?:bad|uncertain|invalid|not good|false|error|fault|failed|schlecht|ungültig|unsicher|fehler|questionable)\b.*",
    re.IGNORECASE,
)
OPC_BYTE = range(192, 256)  # good, as the quality of OPC Data Access counts: 0 is bad, 64 uncertain
OPC_UA_GOOD = 2**30  # status codes of OPC UA below this are good
SHARED = 0.9  # of the first rows that share their stamp with those of other names, at least
REPEATED = 0.5  # of the first rows: more names than this are none
MOST_SERIES = 500  # each is a file of its own
BETWEEN = "/"  # the parts of a name


@dataclass
class LongTable:
    """The columns of a long table, and what was found in it. `names`: those that name a series, of which `telling` are
    not the same in all of the first rows; `told`: the name of the value column is part of the name of a series."""

    value: str
    names: tuple[str, ...]
    telling: tuple[str, ...]
    told: bool
    quality: str | None = None
    opc: bool = False  # its numbers are those of OPC Data Access
    unit: str | None = None
    left_out: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)  # of a series
    bad: Counter[str] = field(default_factory=Counter)  # samples of a series that are bad by their quality
    _called: dict[tuple[str, ...], str] = field(default_factory=dict)  # cells of `names` -> name of the series

    def series(self, log: str, rows: Rows) -> Iterator[Rows]:
        """The rows of a table as rows of its series. Raises UnreadableLogError where these are too many."""
        labels = [*zip(*(rows.columns[name].tolist() for name in self.names), strict=True)]
        places = {label: place for place, label in enumerate(dict.fromkeys(labels))}
        which = np.array([places[label] for label in labels], np.int64)
        values = np.where(self._good(rows), rows.columns[self.value], np.nan)
        for label, place in places.items():
            at, name = np.flatnonzero(which == place), self._name(tuple(map(_text, self.names, label)))
            self.bad[name] += int(np.isnan(values[at]).sum() - np.isnan(rows.columns[self.value][at]).sum())
            if self.unit is not None and (unit := str(rows.columns[self.unit][at[0]]).strip()):
                self.units.setdefault(name, unit)
            yield Rows(rows.t_ns[at], {name: values[at]}, rows.record[at], name)
        if len(self._called) > MOST_SERIES:
            raise UnreadableLogError(
                f"{log}: is a long table with more than {MOST_SERIES} names in {' + '.join(self.names)}. Export fewer "
                "of them at once."
            )

    def settings(self) -> dict[str, Any]:
        """What is said of the table."""
        long = {
            "names": list(self.names),
            "values": self.value,
            "quality": self.quality,
            "left_out": list(self.left_out),
        }
        bad = {name: count for name, count in self.bad.items() if count}
        long = {what: said for what, said in long.items() if said}
        series = {name: [name] for name in self._called.values()}
        return {"long_table": long, SERIES: series} | ({"invalid": bad} if bad else {})

    def _name(self, label: tuple[str, ...]) -> str:
        """The name of a series: the parts that tell it, all of them where another is called so."""
        if label not in self._called:
            parts = [part for name, part in zip(self.names, label, strict=True) if name in self.telling]
            ends = [self.value] if self.told else []
            plain, whole = (BETWEEN.join([*some, *ends]) for some in (parts, label))
            self._called[label] = whole if plain in self._called.values() else plain
        return self._called[label]

    def _good(self, rows: Rows) -> NDArray[np.bool_]:
        """Which rows (N,) have a value by their quality."""
        if self.quality is None:
            return np.ones(len(rows.t_ns), np.bool_)
        cells = rows.columns[self.quality]
        if cells.dtype == object:
            bad = {text for text in set(cells.tolist()) if BAD.fullmatch(text.strip())}
            return np.array([text not in bad for text in cells.tolist()], np.bool_)
        if _called(self.quality) in VALIDITIES:
            return np.asarray(cells != 0)
        return ~(cells >= OPC_UA_GOOD) & ~(self.opc & (cells < OPC_BYTE.start))


def recognise_long(dialect: Dialect, clock: Sequence[str], t_ns: NDArray[np.int64]) -> LongTable | None:
    """The long table that the first rows show, with their stamps (N,); None where it is none. `clock`: the columns that
    hold the time."""
    sample = dict(zip(dialect.names, zip(*dialect.sample, strict=True), strict=True)) if dialect.sample else {}
    kinds = dict(zip(dialect.names, dialect.numeric, strict=True))
    rest = [name for name in sample if name not in clock and not _is_time(name, kinds[name], sample[name])]
    of_quality, naming = QUALITIES | VALIDITIES, NAMES | PLACES
    numbers = [name for name in rest if kinds[name] and _called(name) not in of_quality | COUNTS | naming]
    named = tuple(name for name in rest if _called(name) in naming and kinds[name] is not None)
    texts = [name for name in rest if kinds[name] is False and _called(name) not in of_quality | UNITS]
    values = [name for name in numbers if _called(name) in VALUES]
    value = next(iter(values if len(values) == 1 else numbers if len(numbers) == 1 else ()), None)
    names = named or tuple(name for name in texts if not THINGS.intersection(words(name)))
    if value is None or not names or (not named and len(texts) > 1):
        return None
    labels = [*zip(*(sample[name] for name in names), strict=True)]
    sure = named and values and (len(numbers) == 1 or _called(value) != "state")
    if not sure and (len(numbers) > 1 or not _share_stamps(t_ns, labels)):
        return None
    quality, unit = (next((name for name in rest if _called(name) in some), None) for some in (of_quality, UNITS))
    used = (value, *names, quality, unit)
    return LongTable(
        value=value,
        names=names,
        telling=_telling(names, sample),
        told=not values,
        quality=quality,
        opc=any(cell.isdigit() and int(cell) in OPC_BYTE for cell in (sample[quality] if quality else ())),
        unit=unit if unit and kinds[unit] is False else None,
        left_out=tuple(name for name in rest if name not in used and not MISSING.issuperset(sample[name])),
    )


def _telling(names: Sequence[str], sample: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """The columns of names that are not the same in all of the first rows; where all are, one that tells no place."""
    several = tuple(name for name in names if len(set(sample[name])) > 1)
    return several or tuple(sorted(names, key=lambda name: _called(name) in PLACES)[:1])


def _share_stamps(t_ns: NDArray[np.int64], labels: Sequence[tuple[str, ...]]) -> bool:
    """Whether most of the first rows are of several names at one stamp, no name twice, and names come again."""
    stamps = t_ns.tolist()
    often = Counter(stamps)
    together = sum(often[stamp] > 1 for stamp in stamps)
    once = len(set(zip(stamps, labels, strict=True))) == len(labels)
    return once and together >= SHARED * len(labels) and len(set(labels)) <= REPEATED * len(labels)


def _text(column: str, cell: str | float) -> str:
    """What a cell of a column of names says; a number, as some name their channels, with the column's own name."""
    return cell.strip() if isinstance(cell, str) else f"{column} {cell:g}"


def _is_time(name: str, numeric: bool | None, cells: Sequence[str]) -> bool:
    """Whether a column holds times that are not those of the rows: it names and measures nothing."""
    said = [cell for cell in cells if cell not in MISSING]
    stamps = numeric is False and all(map(is_stamp, said))
    return stamps or is_time_name(name) or is_part_of_second(name)


def _called(name: str) -> str:
    """What a column is called, without what stands in brackets behind it."""
    return "".join(words(re.split(r"[\[(]", name)[0]))
