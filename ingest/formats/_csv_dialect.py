"""How a table is written: recognised from its first rows, and refused in one line where it cannot be.

Loggers write lines of their own above the table: the header is the nearest line of names above the first row of data.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isnan

from ingest.errors import UnreadableLogError
from ingest.formats import _csv_numbers
from ingest.formats._csv_numbers import Numerals, is_missing
from ingest.formats._csv_stamps import is_stamp
from ingest.formats._csv_units import bare, unit_in_cells
from ingest.texts.names import each_once
from ingest.texts.units import normal_unit

DELIMITERS = (",", ";", "\t", "|")
BLANKS = " "  # any number of them, and tabs, between two columns: where nothing else cuts
SAMPLE_ROWS = 200
SAMPLE_BODY = 40  # rows that tell which columns hold values
CODE = re.compile(r"0\d+", re.ASCII)  # 0417 is the name of something, no number
EITHER = (Numerals("."), Numerals(","))
UNIT_IN_NAME = re.compile(r"\[((?!0|[2-9]|1\d|OLE2)[^\[\]]*)\]\s*$")  # not the place in Y[0], nor a kind of stamps
ONE_CELL = re.compile(r'"(?:[^"]|"")*"\r?')  # a line in quotes
STAMPED = re.compile(r"\d:\d\d|\d[-/.]\d+[-/.]\d")  # as no name of a column is, of the cells that may be stamps
NAME_AND_UNIT = re.compile(r"\w.*[\[(].*[\])]$")  # so that a line of them holds names
UNIT_WORDS = ("unit", "units", "einheit", "einheiten", "unità")  # that head a line of units above the names
SIGNAL_NAME = "signal name"  # heads what the settings of Graphtec's loggers call each input


@dataclass(frozen=True)
class Dialect:
    """How a table is written. `names` are unique; `numeric`: which columns hold numbers, None: empty as yet;
    `in_cells`: the units that stand in the cells of a column, which `sample` leaves out; `lines_above`: those with text
    above the header; `rows` gives all rows of the table, cell by cell."""

    delimiter: str
    numerals: Numerals
    names: tuple[str, ...]
    numeric: tuple[bool | None, ...]
    units: dict[str, str]
    units_row: bool
    renamed: dict[str, list[str]]  # as the header says it -> as it is called here
    sample: tuple[tuple[str, ...], ...]  # the first rows that fit, cell by cell
    lines_above: tuple[str, ...] = ()
    in_cells: Mapping[str, str] = field(default_factory=dict)
    rows: Callable[[], Iterable[Sequence[str]]] = tuple

    def renamed_as(self, name: Callable[[str, str | None, bool], str]) -> Dialect:
        """The table with other names: those that `name` gives for a name, its unit, and whether it holds text."""
        kinds = zip(self.names, self.numeric, strict=True)
        names = {one: name(one, self.units.get(one), numeric is False) for one, numeric in kinds}
        units = {names[one]: unit for one, unit in self.units.items()}
        renamed = {said: [names[one] for one in called] for said, called in self.renamed.items()}
        in_cells = {names[one]: unit for one, unit in self.in_cells.items()}
        return replace(self, names=tuple(names.values()), units=units, renamed=renamed, in_cells=in_cells)

    def is_number(self, column: str) -> bool:
        """Whether a column holds numbers."""
        return self.numeric[self.names.index(column)] is True

    def cells_of(self, column: str) -> list[str]:
        """The cells of a column in the sample."""
        place = self.names.index(column)
        return [row[place] for row in self.sample]

    def said(self, column: str) -> list[str]:
        """Those of them that are not missing."""
        return [cell for cell in self.cells_of(column) if not is_missing(cell)]

    def all_said(self, column: str) -> Iterator[str]:
        """Those of all rows of the table."""
        place = self.names.index(column)
        whole = (row[place].strip() for row in self.rows() if len(row) == len(self.names))
        return (cell for cell in whole if not is_missing(cell))

    def shows_decimals(self) -> bool:
        """Whether a number in the sample has a decimal sign: else nothing tells it as yet."""
        decimal = self.numerals.decimal
        return any(decimal in cell and self.numerals.is_number(cell) for row in self.sample for cell in row)

    def numbers(self, column: str) -> list[float]:
        """Those of them that are numbers."""
        values = map(self.numerals.value, self.cells_of(column))
        return [value for value in values if value is not None and not isnan(value)]


def cells(line: str, delimiter: str) -> list[str]:
    """The cells of one line. A line is a row: a quoted cell does not go on in the next."""
    if delimiter == BLANKS:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=delimiter != "\t"), [])
    except csv.Error:
        return []


def header_in_one_line(lines: list[str]) -> list[str]:
    """The lines with a header whose quoted names hold line feeds in one of them; blank lines stand for the others, so
    that each line keeps its number."""
    open_ones = [place for place, line in enumerate(lines[:SAMPLE_BODY]) if line.count('"') % 2]
    if len(open_ones) < 2:
        return lines
    begin, end = open_ones[:2]
    whole = " ".join(lines[begin : end + 1])
    if any(one.is_number(cell.strip(' "')) for cell in re.split(r"[,;\t|]", whole) for one in EITHER):
        return lines
    return [*lines[:begin], whole, *[""] * (end - begin), *lines[end + 1 :]]


def recognise_dialect(lines: Sequence[str], log: str) -> Dialect:
    """From the first lines of a table, blank lines left out. Raises UnreadableLogError where they are none."""
    if not lines:
        raise UnreadableLogError(f"{log}: holds no line with text: nothing to read. Copy the file again.")
    if len(lines) == 1:
        raise UnreadableLogError(f"{log}: holds one line and no row below it: nothing to read. Export the table again.")
    if all(map(ONE_CELL.fullmatch, lines)) and re.search("[,;\t]", lines[-1]):
        raise UnreadableLogError(
            f"{log}: each line stands in quotes as one cell, as a spreadsheet writes what was not split into columns. "
            "Split its first column there (Data, Text to Columns) and save it again."
        )
    delimiter, above = _layout(lines)
    if delimiter == BLANKS:  # where a sign of a comment would be a name of its own
        lines = [line.lstrip("#%") if line[:1] in ("#", "%") else line for line in lines]
        delimiter, above = _layout(lines)
    if delimiter == "|" and any(line.strip("|-: ") == "" for line in lines):
        raise UnreadableLogError(f"{log}: is a page with a table in Markdown, no log. Export the table as CSV.")
    header = _merged([cell.strip() for cell in cells(lines[above], delimiter)], lines[above - 1 : above], delimiter)
    below = [line for line in lines[above + 1 :] if line not in lines[: above + 1]]
    rows = [cells(line, delimiter) for line in below[: SAMPLE_ROWS + 1]]
    if rows and all(_open_end(row, header) for row in rows[1:] or rows):
        header.append("")
        if len(rows[0]) == len(header) - 1:  # units, which end as the names do
            rows[0].append("")
    elif not header[-1] and 2 * sum(len(row) == len(header) - 1 for row in rows) > len(rows):
        header.pop()  # names that end with a delimiter above rows that do not
    _check_header(header, rows, delimiter, log)
    fitting = [tuple(cell.strip() for cell in row) for row in rows if len(row) == len(header)]
    names, renamed = unique(_called_in_settings(lines[:above], header, delimiter))
    columns = zip(names, zip(*fitting, strict=True), strict=False)
    in_cells = {name: unit for name, column in columns if (unit := unit_in_cells(column))}
    ends = [in_cells.get(name, "") for name in names]
    fitting = [tuple(bare(cell, end) for cell, end in zip(row, ends, strict=True)) for row in fitting]
    numerals = _csv_numbers.recognise((cell for row in fitting for cell in row), delimiter)
    of_settings = _in_settings(lines[:above], header, delimiter, UNIT_WORDS)
    units = {name: _bare(of_settings[head]) for head, name in zip(header, names, strict=True) if head in of_settings}
    units |= _units_above(lines[:above], names, delimiter)
    has_units = _is_units_row(fitting, numerals)
    units |= {name: unit for name, text in zip(names, header, strict=True) if (unit := _unit_in(text))}
    if has_units:
        units |= {name: _bare(cell) for name, cell in zip(names, fitting[0], strict=True) if cell}
        fitting = fitting[1:]
    units |= in_cells
    numeric = tuple(_is_numeric([row[i] for row in fitting], numerals) for i in range(len(names)))
    return Dialect(
        delimiter,
        numerals,
        names,
        numeric,
        units,
        has_units,
        renamed,
        tuple(fitting[:SAMPLE_ROWS]),
        tuple(lines[:above]),
        in_cells,
    )


def _unit_in(name: str) -> str | None:
    """The unit in brackets at the end of a name: "degC" of `T [degC]`, and "°C" of `T (°C) [TC01]`, where another thing
    stands there."""
    found = UNIT_IN_NAME.search(name)
    if found is None:
        return None
    before = re.findall(r"\(([^()]+)\)", name[: found.start()])
    inner = (one for one in before if normal_unit(one) is not None)
    return next(inner, found[1]) if normal_unit(found[1]) is None else found[1]


def _merged(header: list[str], over: Sequence[str], delimiter: str) -> list[str]:
    """The names, each empty one from the line over it, as a cell is that was merged with the one below."""
    above = [cell.strip() for line in over for cell in cells(line, delimiter)]
    if len(above) != len(header) or any(map(is_value, above)):
        return header
    return [name or other for name, other in zip(header, above, strict=True)]


def _units_above(lines: Sequence[str], names: Sequence[str], delimiter: str) -> dict[str, str]:
    """The units that a line above the names says, where it has as many cells and is headed so, or holds units alone."""
    rows = ([cell.strip() for cell in cells(line, delimiter)] for line in lines)
    fitting = [row for row in rows if len(row) == len(names)]
    if fitting and _are_units_alone(fitting[-1]):
        return {name: _bare(cell) for name, cell in zip(names, fitting[-1], strict=True) if cell}
    said = next(filter(_heads_units, fitting), [""])
    return {name: _bare(cell) for name, cell in zip(names[1:], said[1:], strict=False) if cell}


def _in_settings(lines: Sequence[str], header: Sequence[str], delimiter: str, head: Sequence[str]) -> dict[str, str]:
    """Name in the header -> what a table of settings above it says of that input, a line for each, as Graphtec writes
    it, in the column that one of `head` heads."""
    said, place = dict[str, str](), 0
    for row in ([cell.strip() for cell in cells(line, delimiter)] for line in lines):
        place = next((i for i, cell in enumerate(row) if i and cell.casefold() in head), place)
        if place and len(row) > place and row[0] in header and row[place]:
            said[row[0]] = row[place]
    return said


def _called_in_settings(lines: Sequence[str], header: Sequence[str], delimiter: str) -> list[str]:
    """The header as the settings call its inputs, "Winding" for CH1, but where they call several so."""
    called = _in_settings(lines, header, delimiter, (SIGNAL_NAME,))
    often = Counter((*called.values(), *(name for name in header if name not in called)))
    return [called[name] if name in called and often[called[name]] == 1 else name for name in header]


def _repeats(row: Sequence[str]) -> bool:
    """Whether cells say one thing several times, as names do not."""
    said = [cell for cell in row if cell]
    return len(set(said)) < len(said)


def _heads_units(row: Sequence[str]) -> bool:
    return bool(row) and row[0].casefold().rstrip(":") in UNIT_WORDS


def no_table_of(lines: Sequence[str], log: str) -> str | None:
    """Why the first lines of a text, blank ones left out, are no header and rows that hold numbers; None where they
    are."""
    try:
        return None if True in recognise_dialect(lines, log).numeric else "no column of it holds numbers."
    except UnreadableLogError as error:
        return str(error).removeprefix(f"{log}: ")


def _layout(lines: Sequence[str]) -> tuple[str, int]:
    """(delimiter, lines above the header): the delimiter that cuts most rows into as many cells as the header; of
    several, the one that makes most cells. Blanks where no other cuts half of them so."""

    def fit(layout: tuple[str, int]) -> tuple[bool, int, int]:
        delimiter, above = layout
        header = cells(lines[above], delimiter)
        rows = [cells(line, delimiter) for line in lines[above + 1 :]]
        cuts = max(len(header), _usual(rows)) > 1
        return cuts, sum(len(row) - _open_end(row, header) == len(header) for row in rows), len(header)

    best = max(((delimiter, _above_header(lines, delimiter)) for delimiter in DELIMITERS), key=fit)
    cuts, fitting, _ = fit(best)
    if cuts and 2 * fitting >= len(lines) - best[1] - 1:
        return best
    return max((best, (BLANKS, _above_header(lines, BLANKS))), key=fit)


def _above_header(lines: Sequence[str], delimiter: str) -> int:
    """How many lines stand above the header: the line above that of the units, the first line of all, or else the last
    line of names above the first row of data. 0 where there is none."""
    table = [[cell.strip() for cell in cells(line, delimiter)] for line in lines]
    usual = _usual(table[len(table) // 2 :])
    fitting = [place for place, row in enumerate(table) if usual <= len(row) <= usual + (row[-1:] == [""])]
    below = [table[place] for place in fitting[len(fitting) // 2 :][:SAMPLE_BODY]]
    columns = zip(*(row[:usual] for row in below), strict=True)
    valued = [i for i, column in enumerate(columns) if _holds_values(column)]
    of_values = {place: [table[place][i] for i in valued] for place in fitting}
    numbered = fitting[:1] == [0] and _numbers_columns(table[0])
    first = next((place for place in fitting[numbered:] if _is_data(of_values[place])), 0)
    above = [place for place in fitting if place < first and not any(map(is_value, table[place]))]
    under = next((place for place in above if place - 1 in above and _heads_units(table[place])), None)
    if under is not None and _repeats(of_values[above[-1]]):  # below the units yet a line of rates or of comments
        return under - 1
    above = [place for place in above if not _heads_units(table[place])]
    names = [place for place in above if 2 * sum(map(bool, of_values[place])) > len(valued)]
    names = [place for place in names if "1" not in table[place] or place - 1 in names]  # which no column is called
    together = [place for place in names if set(range(place, names[-1])) <= set(names)]
    units = next((place for place in together[1:] if _is_units(of_values[place])), None)
    if units is not None:
        return units - 1
    if len(together) > 1 and _are_units_alone(of_values[together[-2]]) and not _is_units(of_values[together[-1]]):
        return together[-1]
    two = len(together) > 1 and any(NAME_AND_UNIT.search(cell) for cell in table[together[-1]])
    return 0 if not together or (together[0] == 0 and not two) else together[-1]


def _numbers_columns(row: Sequence[str]) -> bool:
    """Whether cells count the columns, as above their names: 1, 2, 3."""
    said = [cell for cell in row if cell]
    begin = int(said[:1] != ["0"])
    return len(said) > 1 and said == [str(begin + place) for place in range(len(said))]


def _holds_values(column: Sequence[str]) -> bool:
    """Whether a column holds numbers or stamps: more of them than texts."""
    said = [cell for cell in column if not is_missing(cell)]
    return 2 * sum(cell == "1" or is_value(cell) for cell in said) > len(said)


def is_value(cell: str) -> bool:
    """Whether a cell is a number or a stamp, as rows of data hold them; 1 is a unit as well."""
    return cell != "1" and (any(one.is_number(cell) for one in EITHER) or is_stamp(cell))


def _is_data(row: Sequence[str]) -> bool:
    """Whether the cells of columns with values are such, or missing."""
    return any(map(is_value, row)) and all(is_missing(cell) or cell == "1" or is_value(cell) for cell in row)


def _is_units(row: Sequence[str]) -> bool:
    """Whether cells are units, at least half of those that are not empty: loggers write "NO." and "Time" among them."""
    said = [cell for cell in row if cell]
    units = [cell for cell in said if _bare(cell) != cell or normal_unit(cell) is not None]
    return 2 * len(units) >= len(said) > 0


def _are_units_alone(row: Sequence[str]) -> bool:
    """Whether cells are units, all that are not empty, though none heads them as such: above the names."""
    said = [cell for cell in row if cell]
    return bool(said) and all(normal_unit(_bare(cell)) is not None for cell in said)


def _open_end(row: Sequence[str], header: Sequence[str]) -> bool:
    """Whether a row ends with a delimiter more than the header has."""
    return len(row) == len(header) + 1 and not row[-1].strip()


def _usual(rows: Sequence[Sequence[str]]) -> int:
    return Counter(map(len, rows)).most_common(1)[0][0]


def _check_header(header: Sequence[str], rows: Sequence[Sequence[str]], delimiter: str, log: str) -> None:
    only = [cell.strip() for cell in rows[0]] if len(rows) == 1 else []
    if _are_units_alone(only) and not any(cell in ("1", "-") or is_value(cell) for cell in only):
        raise UnreadableLogError(f"{log}: holds names and units and no row below them: nothing to read.")
    if any(header) and all(any(one.is_number(cell) for one in EITHER) for cell in header if cell):
        raise UnreadableLogError(
            f"{log}: line 1 holds numbers where the names of the columns should be. Put a line of names above them."
        )
    if stamp := next((cell for cell in header if STAMPED.search(cell) and is_stamp(cell)), None):
        raise UnreadableLogError(
            f'{log}: line 1 holds a time ("{stamp[:40]}") where the names of the columns should be. Put a line of '
            "names above it."
        )
    if 2 * sum(len(row) == len(header) for row in rows) >= len(rows):
        return
    usual = _usual(rows)
    if delimiter == "," and usual > len(header) > 1:
        raise UnreadableLogError(
            f"{log}: rows hold {usual} fields where the header holds {len(header)}: the comma seems to be the decimal "
            'sign as well as the delimiter. Export it with decimal points, or with ";" between the columns.'
        )
    raise UnreadableLogError(
        f"{log}: most rows hold {usual} fields where line 1 holds {len(header)}: it is not their header. Under "
        "[time] of the bench file say how many lines stand above it (skip_rows = 1), or export the table again."
    )


def unique(header: Sequence[str]) -> tuple[tuple[str, ...], dict[str, list[str]]]:
    """Each name once: an empty one is called by its place, a second `T` is called `T_2`."""
    names = each_once([text or f"column_{place}" for place, text in enumerate(header, 1)])
    called: dict[str, list[str]] = {}
    for text, name in zip(header, names, strict=True):
        called.setdefault(text, []).append(name)
    return names, {text: names for text, names in called.items() if names != [text]}


def _is_units_row(rows: Sequence[Sequence[str]], numerals: Numerals) -> bool:
    """Whether the first row holds units: text where the rows below hold numbers, and no number but the unit 1."""
    if len(rows) < 2:
        return False
    numeric = [i for i in range(len(rows[0])) if _is_numeric([row[i] for row in rows[1:]], numerals)]
    said = [rows[0][i] for i in numeric if not is_missing(rows[0][i])]
    return any(not numerals.is_number(cell) for cell in said) and not any(
        numerals.is_number(cell) and cell != "1" for cell in rows[0]
    )


def _bare(unit: str) -> str:
    """A unit without its brackets: `[degC]`, `(degC)` and `{degC}` become `degC`."""
    return unit[1:-1].strip() if unit[0] + unit[-1] in ("[]", "()", "{}") else unit


def _is_numeric(column: Sequence[str], numerals: Numerals) -> bool | None:
    """Whether a column holds numbers: more of them than texts, and no code such as 0417; None where it is empty."""
    said = [cell for cell in column if not is_missing(cell)]
    if not said:
        return None
    numbers = [cell for cell in said if numerals.is_number(cell)]
    return 2 * len(numbers) > len(said) and not all(CODE.fullmatch(cell) for cell in numbers)
