"""Units in the cells of a table, as in "20.5 °C": one for each column, whatever range its meter chose for a row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

from ingest.formats._csv_numbers import Numerals, is_missing
from ingest.texts.units import factor, normal_unit, spellings, tidy

NUMBER_AND_REST = re.compile(r"((?:[<>]=? ?)?[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?|[-+*?]+)(\s?)([^\W\d].*|[°%].*)")
PREFIXES = frozenset("pnuµmkMG")  # 1.5k and 900m alone are thousands and thousandths of something
WITH_ZERO = frozenset(("degC", "degF", "K"))  # of temperatures: one is no multiple of another


def unit_in_cells(column: Sequence[str]) -> str | None:
    """The unit that the first number of a column ends in; None where most cells end in none, or in several that are not
    known or not of one kind. `12A` alone may be the name of something."""
    said = [cell for cell in column if not is_missing(cell)]
    ended = [match for match in map(NUMBER_AND_REST.fullmatch, said) if match]
    if not ended:
        return None
    unit = ended[0][3]
    alike = all(_times(match[3], unit) for match in ended)
    no_name = any(match[2] or match[3] in "°%" or len(match[3]) > 1 or re.search("[.,]", match[1]) for match in ended)
    no_prefix = any(match[2] for match in ended) or unit not in PREFIXES
    often = len(ended) + sum(cell.endswith(unit) and not NUMBER_AND_REST.fullmatch(cell) for cell in said)
    return unit if alike and no_name and no_prefix and 2 * often > len(said) else None


def bare(cell: str, unit: str) -> str:
    """A cell without the unit that it ends in: that of its column, or another one of its kind."""
    if match := NUMBER_AND_REST.fullmatch(cell):
        return match[1] if unit and _times(match[3], unit) else cell
    return cell.removesuffix(unit).rstrip()


def value(cell: str, unit: str, numerals: Numerals) -> float | None:
    """The number in a cell in the unit of its column, as `Numerals.value`."""
    found, match = numerals.value(bare(cell, unit)), NUMBER_AND_REST.fullmatch(cell)
    return found * (_times(match[3], unit) or 1.0) if found is not None and match else found


@lru_cache(maxsize=256)
def _times(said: str, unit: str) -> float | None:
    """How many `unit` one of the unit `said` is; None where that is not known, or of another kind."""
    one, other = normal_unit(said), normal_unit(unit)
    if tidy(said) not in spellings() or one is None or other is None or "1" in (one, other):
        return None
    if one == other or {one, other} & WITH_ZERO:
        return 1.0 if one == other else None
    return factor(one, other)
