"""Numbers and places in plain words, with units. Text only: nothing here may slow the command line down."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from itertools import pairwise

from ingest.texts.times import clock

PLACES: Mapping[str, tuple[str, str]] = {  # key of `where` -> words before, unit after; the most telling first
    "speed_rpm": ("at", "rpm"),
    "current_A": ("at", "A"),
    "temperature_degC": ("when it is at", "°C"),
    "torque_Nm": ("at", "Nm"),
}


def kelvin(value: float) -> str:
    """`4.36` -> "4.4 K"."""
    return f"{value:.1f} K"


def figures(values: Sequence[float | None]) -> list[str]:
    """Sizes that are compared, with as many digits as tell them apart, up to two behind the point: "1.4" and "0.9",
    "0.71" and "0.69"; what would be 0.0 as "0.03"; "–" for None."""
    one, two = ([_figure(value, digits) for value in values] for digits in (1, 2))
    return two if len(set(one)) < len(set(two)) else one


def _figure(value: float | None, digits: int) -> str:
    if value is None:
        return "–"
    fixed = f"{value:.{digits}f}"
    return fixed if float(fixed) else f"{value:.1g}"


def less(before: str, after: str) -> str:
    """By how much one of two `figures` is less, in their digits: "+1.2", "−0.02"; zero has no sign."""
    change = Decimal(before) - Decimal(after)
    return f"{change:+f}".replace("-", "−") if change else f"{abs(change):f}"


def became(values: Sequence[float | None]) -> str:
    """ "8.1 -> 0.7 -> 0.5"; "0.7 = 0.7" where nothing changed that could be told."""
    told = figures(values)
    steps = (f" {'=' if now == was != '–' else '->'} {now}" for was, now in pairwise(told))
    return told[0] + "".join(steps) if told else ""


def signed(value: float) -> str:
    """`4.36` -> "+4.4"; zero has no sign."""
    return "0.0" if abs(value) < 0.05 else f"{value:+.1f}".replace("-", "−")


def signed_kelvin(value: float) -> str:
    """`4.36` -> "+4.4 K"."""
    return f"{signed(value)} K"


def number(value: float) -> str:
    """Whole, or with one decimal below 10; thousands with a comma: "3,000", "104", "2.5", "−20"; zero has no sign."""
    text = f"{value:,.0f}" if abs(value) >= 10 or value == round(value) else f"{value:.1f}"
    return text.replace("-", "−") if text.strip("-0.") else text.lstrip("-")


def fixed(value: float, digits: int = 1) -> str:
    """A number in a table, as many digits as its neighbours: "1,234.5", "−1.4"; what rounds to nothing is "0.0", what
    is not known (NaN) a dash."""
    return "–" if math.isnan(value) else f"{round(value, digits) or 0.0:,.{digits}f}".replace("-", "−")


def digits(value: float, count: int = 3) -> str:
    """A number of so many significant digits, whole above: "96.1", "1,240", "0.0312", "−1.4"."""
    text = f"{value:,.0f}" if abs(value) >= 10 ** (count - 1) else f"{value:.{count}g}"
    return text.replace("-", "−")


def rounded(value: float) -> float:
    """To two significant digits above 100, to whole numbers below: bounds of a range carry no more."""
    if abs(value) < 100:
        return float(round(value))
    step = 10.0 ** (len(str(int(abs(value)))) - 2)
    return round(value / step) * step


def duration(seconds: float) -> str:
    """ "45 s", "12 min", "2 h 40 min"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02} min"


def where(places: Mapping[str, Sequence[float]], told: int = 2) -> str:
    """`{"speed_rpm": [3000, 4000]}` -> "at 3,000 to 4,000 rpm", the `told` most telling; "" without a place."""
    parts = [
        f"{before} {_range(*places[key])} {unit}"
        for key, (before, unit) in PLACES.items()
        if key in places and not (key == "torque_Nm" and "current_A" in places)
    ]
    if "t_s" in places:
        parts.append(f"from {clock(places['t_s'][0])} to {clock(places['t_s'][1])}")
    return joined(parts[:told])


def _range(low: float, high: float) -> str:
    ends = [number(rounded(low)), number(rounded(high))]
    return " to ".join(dict.fromkeys(ends))


def joined(parts: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, [", ".join(parts[:-1]), *parts[-1:]]))


def name(identifier: str) -> str:
    """`rotor_surface` -> "rotor surface"."""
    return identifier.replace("_", " ")


def counted(count: int, noun: str) -> str:
    """ "1 session", "3 sessions"."""
    return f"{count:,} {noun}{'s' * (count != 1)}"


def size(count: int) -> str:
    """Bytes as "0.3 kB", "6.2 MB", "1.4 GB"."""
    if count >= 1e9:
        return f"{count / 1e9:.1f} GB"
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{max(count / 1e3, 0.1):.1f} kB"


def capital(text: str) -> str:
    """First letter upper case, the rest as it is."""
    return text[:1].upper() + text[1:]


def short(digest: str) -> str:
    """First eight characters of a hash: enough to tell two apart by eye."""
    return digest[:8]
