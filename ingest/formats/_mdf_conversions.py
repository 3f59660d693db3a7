"""What stored numbers of an MDF file stand for: laws, tables of numbers and of texts. Formulas are parsed, never run.

Kinds of conversions are numbered as MF4 numbers them: https://www.asam.net/standards/detail/mdf/wiki/
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import ExpressionError
from ingest.texts.expressions import parse

IDENTITY, LINEAR, RATIONAL, FORMULA, INTERPOLATED, NEAREST, RANGES, TEXTS, RANGE_TEXTS = range(9)
KINDS = {9: "from text to number", 10: "from text to text", 11: "from bits to text"}  # which are not read
ARGUMENTS = {"X", "X1", "x", "x1"}  # of a formula

Array = NDArray[Any]
Floats = NDArray[np.float64]
Law = Callable[[Array], Array]


@dataclass(frozen=True)
class MdfConversion:
    """From stored numbers (N,) to physical ones.

    `numbers` gives NaN where a text stands for a number, `texts` gives "" where none does; None where there are none.
    `all_texts`: each value is a text. `refused`: why the conversion is not read; `numbers` then gives what is stored.
    """

    numbers: Law
    texts: Law | None = None
    all_texts: bool = False
    refused: str | None = None


Named = str | MdfConversion | None  # what an entry of a table of texts stands for: a text, a law, or the number itself


def as_stored(refused: str | None = None) -> MdfConversion:
    """No conversion."""
    return MdfConversion(lambda raw: raw, refused=refused)


def conversion(kind: int, values: Floats, named: Sequence[Named], formula: str = "") -> MdfConversion:
    """The conversion of this kind with its numbers and, of a table of texts, what its entries stand for."""
    number = KINDS.get(kind, f"of kind {kind}")
    if kind == IDENTITY:
        return as_stored()
    if kind == FORMULA:
        return _formula(formula)
    if kind in (TEXTS, RANGE_TEXTS):
        return _texts(kind, values, named)
    if kind in KINDS or kind > RANGE_TEXTS:
        return as_stored(f"conversion {number} is not read")
    law = _law(kind, values)
    return (
        MdfConversion(law) if law else as_stored(f"conversion of kind {kind} has {len(values)} numbers, or wrong ones")
    )


def _law(kind: int, values: Floats) -> Law | None:
    """A law of numbers alone; None where its numbers are not those of its kind."""
    count = len(values)
    keys, found = values[: count - count % 2 : 2], values[1::2]
    if kind == LINEAR and count == 2:
        return lambda raw: values[0] + values[1] * raw
    if kind == RATIONAL and count == 6:
        return lambda raw: _rational(values, raw)
    if kind in (INTERPOLATED, NEAREST) and count >= 2 and count % 2 == 0 and (np.diff(keys) > 0).all():
        middles = (keys[1:] + keys[:-1]) / 2
        if kind == NEAREST:
            return lambda raw: np.where(_missing(raw), np.nan, found[np.searchsorted(middles, raw)])
        return lambda raw: np.asarray(np.interp(raw, keys, found))
    if kind == RANGES and count >= 4 and count % 3 == 1:
        lows, highs, results = values[:-1:3], values[1:-1:3], np.append(values[2:-1:3], values[-1])
        return lambda raw: results[_within(lows, highs, raw)]
    return None


def _rational(values: Floats, raw: Array) -> Floats:
    x = raw.astype(np.float64)
    a, b, c, d, e, f = values
    with np.errstate(all="ignore"):
        found = (a * x * x + b * x + c) / (d * x * x + e * x + f)
    return np.where(np.isfinite(found), found, np.nan)


def _formula(text: str) -> MdfConversion:
    try:
        expression = parse(text.replace("^", "**"))
    except ExpressionError as error:
        return as_stored(str(error))
    if not ARGUMENTS.issuperset(expression.names):
        return as_stored(f'the formula "{text[:80]}" names more than the value X')
    return MdfConversion(lambda raw: expression.evaluate(dict.fromkeys(expression.names, raw)))


def _texts(kind: int, values: Floats, named: Sequence[Named]) -> MdfConversion:
    """Values, or ranges of them, each with what it stands for; the last of `named` is for all others."""
    width = 1 if kind == TEXTS else 2
    count = len(values) // width
    if len(named) != count + 1:
        return as_stored(f"conversion of kind {kind} has {count} keys and {len(named)} texts")
    lows, highs = values[: count * width : width], values[width - 1 : count * width : width]

    def place(raw: Array) -> NDArray[np.intp]:
        return _within(lows, highs, raw, exact=kind == TEXTS)

    return MdfConversion(
        lambda raw: _numbers_among(named, place(raw), raw),
        lambda raw: _texts_among(named, place(raw), raw),
        all_texts=not any(isinstance(one, MdfConversion) for one in named),
    )


def _within(lows: Floats, highs: Floats, raw: Array, *, exact: bool = False) -> NDArray[np.intp]:
    """In which range each number (N,) is: its place, or the number of ranges where it is in none.

    The upper end is part of a range of whole numbers, and not of one of others, but where it is its lower end too.
    """
    order = np.argsort(lows, kind="stable")
    numbers = raw.astype(np.float64)
    found = np.searchsorted(lows[order], numbers, "right") - 1
    place = order[np.maximum(found, 0)] if len(order) else np.zeros(len(raw), np.intp)
    if not len(order):
        return place
    below = numbers <= highs[place] if exact or raw.dtype.kind != "f" else numbers < highs[place]
    inside = (found >= 0) & (below | (numbers == lows[place]))
    return np.where(inside, place, len(order))


def _numbers_among(named: Sequence[Named], place: NDArray[np.intp], raw: Array) -> Floats:
    found = np.full(len(raw), np.nan)
    for number in np.unique(place).tolist():
        law, at = named[number], place == number
        if not isinstance(law, str):
            found[at] = law.numbers(raw[at]) if law else raw[at]
    return found


def _texts_among(named: Sequence[Named], place: NDArray[np.intp], raw: Array) -> NDArray[np.object_]:
    found = np.full(len(raw), "", object)
    for number in np.unique(place).tolist():
        text, at = named[number], place == number
        if isinstance(text, str):
            found[at] = text
        elif text is None:
            found[at] = [f"{one:.15g}" for one in raw[at].tolist()]
        elif text.texts:
            found[at] = text.texts(raw[at])
    return found


def _missing(raw: Array) -> NDArray[np.bool_]:
    return np.isnan(raw) if raw.dtype.kind == "f" else np.zeros(len(raw), np.bool_)
