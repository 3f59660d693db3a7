"""Rows as CSV: plain, or as the Excel of a country opens it with a double click."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np

from ingest.texts.plain import plain_line
from replay.exports.samples import SessionRows, Stamps

DIGITS = 10  # of a number that are written
COMMANDS = ("=", "+", "-", "@", "\t", "\r")  # a cell that begins so is run by a spreadsheet


@dataclass(frozen=True)
class Country:
    """How numbers, cells and stamps are written; `stamp` turns "2025-10-09T08:53:20.123456" into the country's own."""

    delimiter: str
    decimal: str
    stamp: Callable[[str], str]
    begins: str = "\ufeff"
    line_end: str = "\r\n"


def _day_first(mark: str, decimal: str) -> Callable[[str], str]:
    return lambda t: f"{t[8:10]}{mark}{t[5:7]}{mark}{t[:4]} {t[11:19]}{decimal}{t[20:23]}"


PLAIN = Country(",", ".", lambda t: f"{t}Z", begins="", line_end="\n")
EXCELS: Mapping[str, Country] = {
    "de": Country(";", ",", _day_first(".", ",")),
    "es": Country(";", ",", _day_first("/", ",")),
    "fr": Country(";", ",", _day_first("/", ",")),
    "it": Country(";", ",", _day_first("/", ",")),
    "uk": Country(",", ".", _day_first("/", ".")),
    "us": Country(",", ".", lambda t: f"{t[5:7]}/{t[8:10]}/{t[:4]} {t[11:23]}"),
}


def write(path: Path, rows: SessionRows, excel: str | None = None) -> None:
    """`excel`: a country of `EXCELS`."""
    country = EXCELS[excel] if excel else PLAIN
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(country.begins)
        for line in _lines(rows, country):
            file.write(country.delimiter.join(line) + country.line_end)


def _lines(rows: SessionRows, country: Country) -> Iterator[Sequence[str]]:
    stamped = ["time_utc"] if rows.absolute else []
    yield [*stamped, "t_s", *(_cell(title, country) for title in rows.titles)]
    for t_ns, values in rows.parts:
        columns = [[country.stamp(text) for text in utc(t_ns)]] if rows.absolute else []
        numbers = [rows.seconds(t_ns), *values.T]
        columns += [[number(x, country.decimal) for x in own.tolist()] for own in numbers]
        yield from zip(*columns, strict=True)


def utc(t_ns: Stamps) -> list[str]:
    """`2025-10-09T08:53:20.123456` of each stamp [ns] since 1970."""
    texts: list[str] = np.datetime_as_string(t_ns.astype("datetime64[ns]"), unit="us").tolist()
    return texts


def number(value: float, decimal: str = ".") -> str:
    """A number as text; nothing for NaN."""
    return "" if isnan(value) else f"{value:.{DIGITS}g}".replace(".", decimal)


def _cell(text: str, country: Country) -> str:
    """A name that no spreadsheet runs as a formula and no terminal obeys, in quotes where it holds what parts cells."""
    safe = plain_line(f"'{text}" if text.startswith(COMMANDS) else text)
    parted = any(mark in safe for mark in (country.delimiter, '"'))
    return '"' + safe.replace('"', '""') + '"' if parted else safe
