"""Lines below the header of a table that are no rows: comments, statistics, its end, the header again, delimiters."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ingest.formats._csv_dialect import Dialect, cells

RUNTIME = ('"$RT_', "$RT_")  # marks of Siemens' operator panels: switched on or off, or how many lines there are
_TYPE = (  # of the values of a column
    r"[fiu][1248]|(?:float|u?int)(?:8|16|32|64)?|double|single|l?real|[us]?d?int|d?word|byte|bool(?:ean)?|string|datetime"
)
TYPES_LINE = re.compile(  # `f8 f8 s` as ETAS writes them, `Double;Float;Bool`; "","","Avg","Smp" of Campbell's loggers
    rf'(?i)(?:"?(?:{_TYPE})"?(?:[\t;, ]+"?(?:{_TYPE}|s\d*)"?)*[\t;, ]*|"",""(?:,"[a-z]{{0,3}}")+)\r?'
)
_STATISTICS = (  # what lines below a table are called that tell of its columns, in five languages
    "min;minimum;minimo;max;maximum;massimo;mean;average;avg;mittel;mittelwert;durchschnitt;media;moyenne;promedio;median;"
    "std;stddev;std dev;standard deviation;standardabweichung;sigma;variance;varianz;sum;summe;somma;somme;suma;total;"
    "totale;count;anzahl;range;rms;peak to peak"
)
STATISTICS = frozenset(_STATISTICS.split(";"))
ENDS = ("eof", "end", "end of file", "end of data", "ende")  # the last line, where it says that it is one


def is_row(line: str) -> bool:
    """Whether a line is a row: a blank one is not, nor one of types; one of tabs alone is a row of empty cells."""
    return line.strip(" \r") != "" and not TYPES_LINE.fullmatch(line)


def no_rows(
    lines: Sequence[str], odd: Sequence[int], dialect: Dialect, heads: frozenset[str], *, empty: bool, text_first: bool
) -> list[int]:
    """Places of the lines that are none: those of `heads` again, which loggers write when they are started anew, and
    some of the `odd` ones, which do not begin as most rows do. `empty`: so are delimiters alone, which spreadsheets
    write below a table; `text_first`: the first column may hold any word."""
    found = {place for place in odd if _is_none(lines[place], dialect, empty=empty, text_first=text_first)}
    if not heads.isdisjoint(lines):
        found.update(place for place, line in enumerate(lines) if line in heads)
    return [*found]


def _is_none(line: str, dialect: Dialect, *, empty: bool, text_first: bool) -> bool:
    if line.startswith("#"):
        return len(cells(line, dialect.delimiter)) != len(dialect.names)
    begin = line.lstrip(' "')[:1]
    if begin.isalpha():
        first = cells(line, dialect.delimiter)[:1] if not text_first else []
        ends = len(dialect.names) > 1 and _words([line]) in ENDS
        return ends or TYPES_LINE.fullmatch(line) is not None or _words(first) in STATISTICS
    if begin == "," and TYPES_LINE.fullmatch(line):
        return True
    return line.startswith(RUNTIME) or (empty and line != "" and not line.strip(f'{dialect.delimiter} "\r'))


def _words(first: Sequence[str]) -> str:
    return "".join(first).strip(' :."\r').replace(". ", " ").casefold()
