"""Numbers as tables write them: 1234.5, 1234,5, + 23.1, and with thousands 1.234,5, 1,234.5, 1 234,5 or 1'234.5."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

NOTHING = (
    "",
    "nan",
    "NaN",
    "NAN",
    "NA",
    "N/A",
    "n/a",
    "null",
    "NULL",
    "None",
    "NoValue",
    "n.a.",
    "N.A.",
    "k.A.",
    "n.v.",
)
OVER_RANGE = ("OL", "O.L", "OVER", "OVLD", "nan", "inf", "Inf", "INF", "∞", "1.#INF", "1.#QNAN", "1.#IND")
BROKEN = ("OPEN", "Open", "INVALID", "Invalid", "Error", "unavailable", "#OVL", "OTC", "---O-F---", "---O-L---")
FAULTS = (  # in any of four spellings: "over range", "Over range", "Over Range", "OVER RANGE"; in four languages
    *("overflow", "underflow", "overload", "over range", "overrange", "under range", "underrange", "burnout"),
    *("bad data", "comm fail", "scan off", "i/o timeout", "calc failed", "pt created"),  # of historians
    *("sensor error", "sensor fault", "no sensor"),
    *("burn out", "open circuit", "short circuit", "sensor break", "no value", "no data", "no signal"),
    *("open tc", "Open TC", "tc open", "TC open", "open thermocouple", "open sensor", "sensor open"),
    *("Überlauf", "Unterlauf", "Fühlerbruch", "Sensorbruch", "Drahtbruch", "Leitungsbruch", "Kurzschluss", "Bruch"),
    *(
        "ungültig",
        "Fehler",
        "kein Wert",
        "Kein Wert",
        "gestört",
        "Störung",
        "Messbereichsüberschreitung",
        "Überbereich",
    ),
    *("fuori scala", "fuori range", "guasto", "rottura", "rottura sensore", "non valido", "errore", "aperto"),
    *("hors échelle", "hors gamme", "rupture", "rupture capteur", "invalide", "erreur", "non valide"),
)
FAILED = ("Bad Input", "#N/A", "#NV", "#DIV/0!", "#VALUE!", "#WERT!", "#NUM!", "#ZAHL!")
MISSING = frozenset(
    (
        *NOTHING,
        *FAILED,
        *BROKEN,
        *(spelt for words in FAULTS for spelt in (words, words.capitalize(), words.title(), words.upper())),
        *(sign + word for word in OVER_RANGE for sign in ("", "+", "-")),
        *(sign * count for sign in "-+*?#" for count in range(1, 13)),
        *("-" * before + "." + "-" * behind for before in range(1, 5) for behind in range(1, 5)),
    )
)
BEYOND = re.compile(r"[<>]=? ?[+-]?[0-9][0-9.,]*")  # >1300, out of the range of a meter
NO_READING = 9.9e37  # from here on no reading: 9.9E37 and 9.91E37 of SCPI-1999 (volume 1, 7.2.1), 9999E+99 of others
ABSENT = (-9999.0, -99999.0)  # as loggers write that there is no reading, where nothing else is that low
LOWEST = -1000.0  # of what else a column holds, for that
BLANKS = " \u00a0\u202f"  # that stand between thousands: plain, no-break, narrow no-break
APOSTROPHES = "'’"
OTHER = {".": ",", ",": "."}
# numbers whose sign stands between no thousands
SURE = {sign: re.compile(rf"[+-]?(?:\d+[{sign}](?:\d{{1,2}}|\d{{4,}})|(?:0|\d{{4,}})[{sign}]\d+)") for sign in ",."}
EXPONENT = r"(?:[eE][+-]?[0-9]+)?"


def is_missing(cell: str) -> bool:
    """Whether a cell, without blanks around it, says that there is no number: by a sign for "missing", or by a bound
    alone."""
    return cell in MISSING or BEYOND.fullmatch(cell) is not None


@dataclass(frozen=True)
class Numerals:
    """How a table writes numbers: `decimal` sign, and `group` between thousands, "" where the first rows show none.

    1.234 is 1234 only where `group` says so; 1.234,5 and 1.234.567 cannot be anything else: they are read always.
    """

    decimal: str
    group: str = ""

    def value(self, cell: str) -> float | None:
        """The number in `cell`; NaN where it is a sign for "missing", or says that it is beyond a range; None where it
        is text or too large."""
        cell = cell.strip()
        if is_missing(cell):
            return float("nan")
        if self._plain.fullmatch(cell):
            found = float(cell.replace(self.decimal, "."))
        elif self._grouped.fullmatch(cell):
            found = float(re.sub(f"[{re.escape(self._groups)}]", "", cell).replace(self.decimal, "."))
        else:
            return None
        if np.isinf(found):
            return None
        return found if abs(found) < NO_READING else float("nan")

    def is_number(self, cell: str) -> bool:
        """Whether `cell`, without blanks around it, is a number."""
        return bool(self._plain.fullmatch(cell) or self._grouped.fullmatch(cell))

    def shows_groups(self, cell: str) -> str | None:
        """The sign between thousands in `cell`, where it cannot be anything else."""
        found = self._sure.fullmatch(cell)
        return next(sign for sign in cell if sign in self._groups) if found else None

    def values(self, cells: pa.Array) -> NDArray[np.float64] | None:
        """A column of cells with `group` between thousands, as `value` reads each (N,); None where one is text."""
        trimmed = pc.utf8_trim_whitespace(cells)
        missing = pc.is_in(trimmed, pa.array(sorted(MISSING)))
        numbers = pc.match_substring_regex(trimmed, f"^(?:{self._plain.pattern}|{self._grouped.pattern})$")
        if not pc.all(pc.or_(missing, numbers)).as_py():
            return None
        bare = pc.replace_substring_regex(trimmed, f"[{re.escape(self._groups)}]", "")
        text = pc.if_else(missing, "nan", pc.replace_substring(bare, self.decimal, "."))
        return np.asarray(pc.cast(text, pa.float64()).to_numpy(zero_copy_only=False))

    @staticmethod
    def read(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers (N,) with NaN for those that say that nothing was read."""
        nothing = np.abs(values) >= NO_READING
        return np.where(nothing, np.nan, values) if nothing.any() else values

    @staticmethod
    def present(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """A column (N,) with NaN for -9999, which loggers write for no reading, where its others are far from that."""
        absent = np.isin(values, ABSENT)
        if not absent.any() or np.nanmin(values[~absent], initial=0.0) < LOWEST:
            return values
        return np.where(absent, np.nan, values)

    @cached_property
    def _groups(self) -> str:
        return OTHER[self.decimal] + BLANKS + APOSTROPHES

    @cached_property
    def _plain(self) -> re.Pattern[str]:
        return re.compile(f"[+-]?{self._unsigned}")

    @cached_property
    def _unsigned(self) -> str:
        sign = re.escape(self.decimal)
        return rf"(?:[0-9]+{sign}?[0-9]*|{sign}[0-9]+){EXPONENT}"

    @cached_property
    def _sure(self) -> re.Pattern[str]:
        """Numbers that surely have thousands: with a blank or apostrophe, both signs, or two groups of one sign; and
        those with blanks behind their sign, which are read as these are."""
        sign, other = re.escape(self.decimal), re.escape(OTHER[self.decimal])
        ends = [
            *(f"(?:{re.escape(one)}[0-9]{{3}})+(?:{sign}[0-9]*)?" for one in BLANKS + APOSTROPHES),
            rf"(?:{other}[0-9]{{3}})+{sign}[0-9]+",
            rf"(?:{other}[0-9]{{3}}){{2,}}",
        ]
        return re.compile(f"[+-] +{self._unsigned}|[+-]?[1-9][0-9]{{0,2}}(?:{'|'.join(ends)})")

    @cached_property
    def _grouped(self) -> re.Pattern[str]:
        if self.group not in OTHER.values():
            return self._sure
        return re.compile(rf"{self._sure.pattern}|[+-]?[1-9][0-9]{{0,2}}{re.escape(self.group)}[0-9]{{3}}")


def recognise(cells: Iterable[str], delimiter: str) -> Numerals:
    """From the cells of the first rows: the sign that surely parts decimals in some, where the other does in none; else
    the one of more cells. Where commas stand between the columns, the decimal sign is the point, unless cells in quotes
    hold commas that stand between no thousands."""
    found = list(cells)
    point, comma = Numerals("."), Numerals(",")
    plain = {sign: any(map(number.fullmatch, found)) for sign, number in SURE.items()}
    if delimiter != "," or plain[","]:
        sure_comma = plain[","] or any(comma.shows_groups(cell) == "." for cell in found)
        sure_point = plain["."] or any(point.shows_groups(cell) == "," for cell in found)
        commas, points = (
            sum(
                numerals.shows_groups(cell) is not None or (numerals.decimal in cell and numerals.is_number(cell))
                for cell in found
            )
            for numerals in (comma, point)
        )
        if commas and (commas >= points if sure_comma == sure_point else sure_comma):
            point = comma
    groups = (point.shows_groups(cell) for cell in found)
    return Numerals(point.decimal, next((group for group in groups if group), ""))
