"""MAT: files of MATLAB up to version 7, as scripts (`save`), Simulink and ControlDesk of dSPACE write them.

A column is a vector, wherever it stands: a variable, a field of a struct, a column of a matrix with a row a moment
(`T_1`, `T_2`), the `signals` of a structure with time (Simulink), the `Y` of a measurement (ControlDesk). Its times are
the vector as long that is called time (`t`, `time`, `tout`) in the innermost struct around both. Of several such
vectors a row is what all of them say at one time. Columns are named as their vectors, with the structs before
(`run1/T`) where two are called alike. Dates may be counted in days of the year 0 (`datenum`). What has no times is
left out (`settings["left_out"]`), and so are tables, timetables and datetimes, which only MATLAB reads.

Format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

from __future__ import annotations

import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import groupby
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from ingest.errors import UnreadableLogError
from ingest.formats import SHOWN, Rows
from ingest.formats._csv_clocks import Clock
from ingest.formats._csv_dialect import SAMPLE_ROWS, UNIT_IN_NAME, Dialect
from ingest.formats._csv_numbers import Numerals
from ingest.formats._csv_time import recognise_clock, rises
from ingest.formats._csv_time_names import is_time_name
from ingest.formats._joined_tables import JoinedTables, OwnTimes, held, undated
from ingest.texts.nearest import hint

TIME, SIMULINKS_TIME = "time", "tout"
DATENUM_D = (719_529.0, 803_000.0)  # days of the year 0: 1970 to 2198
SPREADSHEETS_D = 693_960.0  # by how much such a day is more than the same one as spreadsheets count
HEADER, TAG = 128, 8  # bytes
DAMAGE = (  # what scipy raises of bytes that are not as the format says
    MatReadError,
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    NotImplementedError,
    OSError,
    TypeError,
    ValueError,
    zlib.error,
)
MOST_COLUMNS = 100  # of a matrix; one with more holds no signals
NAMED = 300  # characters of names in a refusal


@dataclass(frozen=True, eq=False)
class _Vector:
    """Its `path` through structs ("run1", "T"), its cells (N,), numbers or texts, and its unit, "" without."""

    path: tuple[str, ...]
    cells: NDArray[Any]
    unit: str = ""

    @property
    def name(self) -> str:
        return self.path[-1]

    @property
    def said(self) -> str:
        """`run1/T`."""
        return "/".join(self.path)

    @property
    def is_text(self) -> bool:
        return self.cells.dtype == object

    @property
    def is_time(self) -> bool:
        """Whether it is called time, and numbers go on as time does."""
        named = is_time_name(self.name) or self.name == SIMULINKS_TIME
        return named and (self.is_text or rises(self.cells[~np.isnan(self.cells)]))


@dataclass(frozen=True)
class _Base:
    """Vectors of one length and their times."""

    times: _Vector
    vectors: list[_Vector]


class MatLog(JoinedTables):
    """A MAT file, its variables in memory."""

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where it is damaged, or nothing in it has times."""
        content = self.path.read_bytes()
        whole, count = _whole(content)
        ended = f"ends at byte {len(content):,}, inside variable {count + 1}" if whole < len(content) else None
        vectors, others = _vectors(self._variables(content[:whole]))
        bases = self._bases(vectors)
        timed = {id(one) for base in bases for one in (base.times, *base.vectors)}
        if left := [*others, *(one.said for one in vectors if id(one) not in timed)]:
            self.settings["left_out"] = left
        clocks = [self._clock(base) for base in bases]
        self.settings["time"] = sorted({clock.says for clock, _ in clocks})
        self.absolute = any(clock.absolute for clock, _ in clocks)
        often = Counter(one.name for base in bases for one in base.vectors)
        tables = [_table(base, *clock, often) for base, clock in zip(bases, clocks, strict=True)]
        comparable = [clock.absolute == self.absolute for clock, _ in clocks]
        yield from self._joined([one if known else undated(one) for one, known in zip(tables, comparable, strict=True)])
        self.end_rows(ended, self.rejected[0].why if self.rejected else "its vectors hold no value")

    def _variables(self, content: bytes) -> dict[str, Any]:
        try:
            with warnings.catch_warnings(action="ignore"):  # of a name that comes twice
                found: dict[str, Any] = loadmat(BytesIO(content), simplify_cells=True)
        except DAMAGE as error:
            says = " ".join(str(error).split())[:200] or type(error).__name__
            raise UnreadableLogError(
                f"{self.path.name}: is damaged ({says}): nothing of it is used. Copy the file again."
            ) from None
        return {str(name): value for name, value in found.items() if not str(name).startswith("__")}

    def _bases(self, vectors: Sequence[_Vector]) -> list[_Base]:
        """The vectors by their times. Raises UnreadableLogError where none has any."""
        if self.time.rate_hz is not None:
            by_length = sorted(vectors, key=lambda one: len(one.cells))
            of_lengths = groupby(by_length, key=lambda one: len(one.cells))
            return [_Base(_Vector((TIME,), np.arange(count, dtype=float)), [*own]) for count, own in of_lengths]
        stated = self.time.column
        times = [one for one in vectors if (one.is_time if stated is None else stated in (one.name, one.said))]
        bases = [_Base(one, []) for one in times]
        for one in vectors:
            if one not in times and (base := _innermost(one, bases)):
                base.vectors.append(one)
        bases = [base for base in bases if base.vectors]
        if bases:
            return bases
        names = ", ".join(one.said for one in vectors)[:NAMED] or "none"
        if stated is not None and not times:
            wrong = f'column = "{stated}" under [time] of the bench file is none of its vectors.'
            near = hint(stated, [one.said for one in vectors])
            raise UnreadableLogError(f"{self.path.name}: {wrong}{near} They are: {names}.")
        raise UnreadableLogError(
            f"{self.path.name}: no vector is called as times are (t, time) with others as long beside it. Its vectors: "
            f'{names}. Under [time] of the bench file say column = "..." or rate_hz = 1.0 (rows at a fixed rate); what '
            "is a table or timetable write in MATLAB with writetable(T, 'log.csv')."
        )

    def _clock(self, base: _Base) -> tuple[Clock, NDArray[Any]]:
        """How its times tell the time, and their cells as that clock takes them."""
        times, cells = base.times, base.times.cells
        if not times.is_text and DATENUM_D[0] <= np.nanmedian(cells) < DATENUM_D[1]:
            cells = cells - SPREADSHEETS_D
        name = TIME if times.name == SIMULINKS_TIME else times.name
        sample = tuple((one if times.is_text else f"{one:.17g}",) for one in cells[:SAMPLE_ROWS].tolist())
        units = {name: times.unit} if times.unit else {}
        dialect = Dialect("\t", Numerals("."), (name,), (not times.is_text,), units, False, {}, sample)
        spec = replace(self.time, column=self.time.column and name)
        return recognise_clock(spec, dialect, self.path.name), cells


def _table(base: _Base, clock: Clock, cells: NDArray[Any], often: Mapping[str, int]) -> OwnTimes:
    return OwnTimes(
        name="/".join(base.times.path[:-1]),
        columns=tuple(one.name if often[one.name] == 1 else one.said for one in base.vectors),
        units=tuple(_unit(one) for one in base.vectors),
        count=len(cells),
        times=held(*clock.t_ns(cells, np.arange(len(cells)))),
        cells=lambda place, start, stop: base.vectors[place].cells[start:stop],
        raw=lambda i: str(cells[i]).encode(errors="replace")[:SHOWN],
        why=lambda i: clock.why(str(cells[i])),
        where=lambda i: f'value {i + 1:,} of "{base.times.said}"',
    )


def _whole(content: bytes) -> tuple[int, int]:
    """Where the last variable ends that a file holds to its end, and how many there are. Each is a tag, kind and size
    with 4 bytes each, and so many bytes."""
    order: Literal["little", "big"] = "little" if content[HEADER - 2 : HEADER] == b"IM" else "big"
    at, count = HEADER, 0
    while at + TAG <= len(content):
        end = at + TAG + int.from_bytes(content[at + TAG // 2 : at + TAG], order)
        if end > len(content):
            break
        at, count = end, count + 1
    return min(at, len(content)), count


def _innermost(one: _Vector, bases: Sequence[_Base]) -> _Base | None:
    """The base whose times stand in the innermost struct around a vector as long; where none does, the only one that
    is as long."""
    as_long = [base for base in bases if len(base.times.cells) == len(one.cells)]
    around = [base for base in as_long if one.path[: len(base.times.path) - 1] == base.times.path[:-1]]
    if not around and len(as_long) == 1:
        return as_long[0]
    return max(around, key=lambda base: len(base.times.path), default=None)


def _unit(one: _Vector) -> str:
    named = UNIT_IN_NAME.search(one.name)
    return one.unit or (named[1] if named else "")


def _vectors(variables: Mapping[str, Any]) -> tuple[list[_Vector], list[str]]:
    """All vectors, and what is none and no single value either."""
    found = [one for name, value in variables.items() for one in _flat((name,), value)]
    return [one for one in found if isinstance(one, _Vector)], [one for one in found if isinstance(one, str)]


def _flat(path: tuple[str, ...], value: Any, unit: str = "") -> Iterator[_Vector | str]:
    """The vectors in a value, and the names of what is left out in it."""
    if isinstance(value, dict):
        for names, one, its_unit in _fields(value):
            yield from _flat((*path, *names), one, its_unit)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 1:
        yield from _of_numbers(path, value.astype(np.float64), unit)
    elif isinstance(value, np.ndarray | list) and np.ndim(value) == 1 and len(value) > 1:
        if all(isinstance(one, str) for one in value):
            yield _Vector(path, np.array(value, object), unit)
        else:  # an array of structs, or cells
            for number, one in enumerate(value, 1):
                yield from _flat((*path[:-1], f"{path[-1]}_{number}"), one, unit)
    elif isinstance(value, np.ndarray) and value.size:
        yield "/".join(path)


def _of_numbers(path: tuple[str, ...], value: NDArray[np.float64], unit: str) -> Iterator[_Vector | str]:
    """A vector, or the columns of a matrix, along its longer axis."""
    if value.ndim == 1:
        yield _Vector(path, value, unit)
    elif value.ndim > 2 or min(value.shape) > MOST_COLUMNS:
        yield "/".join(path)
    else:
        for number, column in enumerate(value if value.shape[0] < value.shape[1] else value.T, 1):
            yield _Vector((*path[:-1], f"{path[-1]}_{number}"), column, unit)


def _fields(struct: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], Any, str]]:
    """(path below the struct, value, unit) of each of its fields, signals or channels."""
    if struct.keys() >= {"X", "Y"} and _all_hold(struct["X"], "Data") and _all_hold(struct["Y"], "Data"):
        for number, times in enumerate(_several(struct["X"]), 1):
            yield (f"raster_{number}", TIME), times["Data"], _text(times.get("Unit"))
        for channel in _several(struct["Y"]):
            name, number = _text(channel.get("Name")) or "channel", channel.get("XIndex") or 1
            yield (f"raster_{number}", name), channel["Data"], _text(channel.get("Unit"))
    elif struct.keys() >= {"time", "signals"} and _all_hold(struct["signals"], "values"):
        yield (TIME,), struct["time"], ""
        for number, signal in enumerate(_several(struct["signals"]), 1):
            yield (_text(signal.get("label")) or f"signal_{number}",), signal["values"], ""
    else:
        yield from (((str(name),), value, "") for name, value in struct.items())


def _several(value: Any) -> list[Any]:
    return [value] if isinstance(value, dict) else list(value)


def _all_hold(value: Any, field: str) -> bool:
    """Whether a value is a struct with this field, or several."""
    if not isinstance(value, dict | list | np.ndarray) or not len(value):
        return False
    return all(isinstance(one, dict) and field in one for one in _several(value))


def _text(value: Any) -> str:
    return value.strip() if isinstance(value, str) else ""


reader = MatLog
