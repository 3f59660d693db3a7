"""Unit texts as logs write them: one spelling each, and how large they are.

Aliases come first (`Nm`, `U/min`, `1/min` mean something else to a unit library), then pint, which is imported only
where a unit has to be converted.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

# canonical text -> (what pint calls it, other texts). Degrees are converted here, exactly.
_UNITS: Mapping[str, tuple[str, str]] = {
    "degC": (
        "degC",
        (
            "°C|deg C|deg_C|deg. C|degree C|degrees C|C|Grad C|GradC|Grad Celsius|Celsius|degree_Celsius|"
            "degrees Celsius|Cel|ßC|øC|¡C|"  # with the sign of a display, of DOS and of an old Mac
            "Â°C|\ufffdC|ï¿½C|?C"  # as programs write it that lost the sign
        ),
    ),
    "K": ("K", "kelvin|degK|deg K|°K"),
    "degF": ("degF", "°F|deg F|deg_F|Fahrenheit|degree_Fahrenheit"),
    "rpm": ("rpm", "1/min|min-1|min^-1|/min|U/min|Umin|Upm|rev/min|r/min|tr/min|tr/mn|giri/min|umdr/min|rot/min"),
    "krpm": ("krpm", "1000 rpm|1000/min"),
    "rps": ("turn/s", "rev/s|r/s|U/s"),
    "rad/s": ("rad/s", "rad s-1|rad s^-1|rad*s-1"),
    "deg/s": ("deg/s", "°/s|degrees/s|degree/s"),
    "Nm": ("N*m", "N m|N.m|N*m|N-m|Newtonmeter|newton meter|newton metre"),
    "kNm": ("kN*m", "kN m|kN.m|kN*m"),
    "mNm": ("mN*m", "mN m|mN.m|mN*m"),
    "lbf ft": ("lbf*ft", "lb ft|lb-ft|lb*ft|ft lb|ft-lb|ft*lb|lbf*ft|ft lbf|ft*lbf|lbft|ftlb|lbf-ft|ft-lbf|lbf.ft"),
    "lbf in": ("lbf*inch", "lb in|lb-in|in lb|in-lb|lb*in|in*lb|lbf-in|in-lbf|lbf*in|in*lbf|in lbf|lbf.in|lbin|inlb"),
    "A": ("A", "amp|amps|ampere|amperes|A DC|A_DC|A AC|A_AC"),
    "V": ("V", "volt|volts|VDC|V DC|V_DC|VAC|V AC|V_AC"),
    "W": ("W", "watt|watts"),
    "hp": ("hp", "HP"),
    "PS": ("metric_horsepower", "CV"),
    "lpm": ("L/min", "l/min|L/min|ltr/min|l min-1|l*min-1|l/minute|liter/min|litre/min|Liter/min|dm3/min"),
    "l/h": ("L/h", "L/h|lph|ltr/h"),
    "l/s": ("L/s", "L/s"),
    "ml/min": ("mL/min", "mL/min|cm3/min|ccm/min"),
    "m3/h": ("m**3/h", "m^3/h|cbm/h"),
    "gpm": ("gallon/min", "gal/min|US gal/min"),
    "ohm": ("ohm", "Ω|Ohms"),
    "Wb": ("Wb", "Vs|V s|V*s|V.s|weber"),
    "mWb": ("mWb", "mVs|mV s|mV*s"),
    "m/s2": ("m/s**2", "m/s^2|m/s/s|m s-2|m/s**2|m/sec2|m/sec^2"),
    "F": ("F", "farad"),
    "H": ("H", "henry"),
    "1": ("dimensionless", "-|–|—|none|n/a|unitless|dimensionless"),
    "%": ("percent", "percent|Prozent|pct|per cent"),
    "K/W": ("K/W", "°C/W|degC/W|C/W|K W-1"),
    "W/K": ("W/K", "W/°C|W/degC"),
    "J/K": ("J/K", "J/°C|J/degC"),
    "h": ("h", "hr|hrs|hour|hours|Std|Stunden|ore"),
    "min": ("min", "minute|minutes|Minuten"),
    "s": ("s", "sec|secs|second|seconds|Sek"),
    "bar": ("bar", ""),
    "Pa": ("Pa", "pascal"),
    "psi": ("psi", ""),
    "deg": ("deg", "°|degree|degrees|Grad"),
    "rad": ("rad", "radian|radians"),
    "m": ("m", "meter|metre"),
    "mm": ("mm", ""),  # metres by hand: "NM" is a torque, never a nanometre
    "cm": ("cm", ""),
    "km": ("km", ""),
    "hPa": ("hPa", ""),
    "m/s": ("m/s", ""),
    "km/h": ("km/h", "kph|kmh"),
    "mph": ("mile/h", ""),
    "g": ("g", ""),
    "Hz": ("Hz", "hertz"),
    "J": ("J", "joule"),
    "Wh": ("W*h", "W*h"),
    "Ah": ("A*h", "A*h"),
    "N": ("N", "newton"),
    "T": ("T", "tesla"),
}
_WRITTEN: Mapping[str, str] = {"degC": "°C", "lpm": "l/min", "ohm": "Ω", "m/s2": "m/s²"}
_PREFIXED = ("A", "V", "W", "ohm", "F", "H", "Hz", "Pa", "s", "J", "Wh", "Ah", "bar", "N", "T", "g")
_PREFIXES = ("p", "n", "u", "m", "k", "M", "G")
_OF_OHM = (*_PREFIXES, "T")  # as meters of insulation go: of others "T" is a time or a tesla
_PLAIN = str.maketrans(dict.fromkeys("·⋅∙•‧", "*") | dict.fromkeys("−‐‑", "-") | {"º": "°", "µ": "u", "μ": "u"})
_AT_END = re.compile(r"(?<=\S)[ _]*[\[(]([^\[\]()]+)[\])]\s*$")  # a unit, behind a name


def normal_unit(text: str | None) -> str | None:
    """One spelling for a unit as databases and unit rows write it ("°C" -> "degC"); None where it is not known."""
    if not text:
        return None
    bare, mark = without_mark(tidy(text))
    return None if mark == "peak" else spellings().get(bare) or _folded().get(bare.casefold())


def as_written(unit: str) -> str:
    """A unit that is spelt as here, as people write it."""
    return _WRITTEN.get(unit, unit)


def without_unit(name: str) -> str:
    """A name of a log without the unit that it ends in: "TC_yoke" of `TC_yoke [°C]`, "n" of `n (rpm)`."""
    own = _AT_END.search(name)
    return name[: own.start()] if own and normal_unit(own[1]) else name


def with_unit(name: str, unit: str) -> str:
    """`TC_winding [degC]`: the unit that a name ends in gives way to that of the values."""
    return f"{without_unit(name)} [{unit}]"


def tidy(text: str) -> str:
    """Compatibility characters (Ω of ohm, ², ℃), raised dots and the minus of min⁻¹ made plain, brackets and blanks
    around taken off."""
    plain = unicodedata.normalize("NFKC", text.replace("º", "°")).translate(_PLAIN)
    plain = " ".join(plain.split())
    inner = re.fullmatch(r"\[(.*)\]|\((.*)\)", plain)
    return next((part.strip() for part in inner.groups() if part is not None), "") if inner else plain


def without_mark(text: str) -> tuple[str, str | None]:
    """ "Arms" -> ("A", "rms"), "V_pk" -> ("V", "peak"), others -> (text, None)."""
    found = re.fullmatch(r"([mkuM]?[AV])[ _]?(rms|eff|pk|peak|RMS)", text)
    return (found[1], "rms" if found[2] in ("rms", "eff", "RMS") else "peak") if found else (text, None)


def factor(unit: str, stored: str) -> float | None:
    """How many `stored` one `unit` is; None where it is no unit, or of another kind.

    Base units are compared, not dimensions: those of rpm hold the radian, those of Hz do not.
    """
    expression = _pint_text(unit)
    if expression is None:
        return None
    import pint

    try:
        size, base = _base(expression)
        stored_size, stored_base = _base(_expressions()[stored])
    except (pint.PintError, ValueError, TypeError, AttributeError):
        return None
    same = base == stored_base and isinstance(size, int | float) and isinstance(stored_size, int | float)
    return float(size / stored_size) if same else None


def _pint_text(unit: str) -> str | None:
    """A unit as pint writes it. Only products and quotients of names with one-digit powers get through."""
    if unit in _expressions():
        return _expressions()[unit]
    name = r"[A-Za-z_°]+(?:(?:\^|\*\*)?-?\d)?"
    if len(unit) > 40 or not re.fullmatch(rf"(?:1|{name})(?:[*/ .]{name})*", unit):
        return None
    powers = re.sub(r"([A-Za-z_°])(?:\^|\*\*)?(-?\d)", r"\1**\2", unit)
    return re.sub(r"[ .]", "*", powers)


def _base(expression: str) -> Any:
    return _registry().get_base_units(_registry().parse_units(expression))


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1)
def _expressions() -> Mapping[str, str]:
    """Canonical unit -> pint's text."""
    plain = {unit: text for unit, (text, _) in _UNITS.items()} | {"g_0": "g_0"}
    prefixed = {p + unit: p + _UNITS[unit][0] for unit in _PREFIXED for p in (_OF_OHM if unit == "ohm" else _PREFIXES)}
    return prefixed | plain


@lru_cache(maxsize=1)
def spellings() -> Mapping[str, str]:
    """Tidy text -> canonical unit."""
    found = {unit: unit for unit in _expressions() if unit != "g_0"}
    for unit, (_, aliases) in _UNITS.items():
        found |= {tidy(alias): unit for alias in aliases.split("|") if alias}
    for prefix in _OF_OHM:
        found |= {f"{prefix}{sign}": f"{prefix}ohm" for sign in (tidy("Ω"), "Ohm", "OHM", "Ohms", "ohms")}
    return found | {tidy("Ω"): "ohm", "Ohm": "ohm"}


@lru_cache(maxsize=1)
def _folded() -> Mapping[str, str]:
    """Lower-case text -> canonical unit, where no two units share it (mW and MW do)."""
    units: dict[str, set[str]] = {}
    for text, unit in spellings().items():
        units.setdefault(text.casefold(), set()).add(unit)
    return {text: next(iter(found)) for text, found in units.items() if len(found) == 1}
