"""Numbers that a database gives a name instead: which of these names say that there is no number (`SNA`, `Error`).

Only of what is measured, a signal with a unit that is known or a law, and with names for few of its numbers, a name can
say so: the names of states (`Off`, `On`, `Error`) are its values.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ingest.log.bits import Layout
from ingest.texts.units import normal_unit

WHAT = r"(?:(?:the )?(?:signal|value|data|sensor|measurement|wert|messwert|is|ist) )*"
OF_IT = r"(?: (?:signal|value|data|indicator|indication|wert))?"
NO_VALUE = (
    r"(?:\w+ )?sna|n a|not avail\w*|unavailable|nicht verf(?:ü|ue)gbar|invalid|not valid|ung(?:ü|ue)ltig|undefined|"
    r"undef|not defined|nicht definiert|no (?:signal|value|data)|kein (?:signal|wert)|nan|reserved|reserviert|unused|"
    r"not used|nicht (?:belegt|benutzt|verwendet)"
)
BEFORE_ANY = r"init|initial|initiali[sz]ation|not initiali[sz]ed|initwert"  # what is sent before there is a value
NOT_AVAILABLE = re.compile(f"{WHAT}(?:{NO_VALUE}){OF_IT}")
BEGUN = re.compile(f"{WHAT}(?:{BEFORE_ANY}){OF_IT}")
BROKEN = (
    r"error|err|fault|faulty|failure|fehler|defect|defective|defekt|overflow|underflow|(?:out of|over|under) ?range|"
    r"short circuit|open (?:circuit|load)|wire break|kurzschlu(?:ss|ß)|(?:draht|leitungs|sensor|f(?:ü|ue)hler)bruch"
)
ERROR = re.compile(f"{WHAT}(?:{BROKEN}){OF_IT}")


def no_numbers_named(
    names: Mapping[int, Any], layout: Layout, unit: str | None
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The bits of a signal whose names say "error", and those whose names say "not available".

    `names`: stored number -> name.
    """
    measured = normal_unit(unit) not in (None, "1") or layout.scale != 1 or layout.offset != 0
    if not measured or layout.is_float or 2 * len(names) >= 1 << layout.length:
        return (), ()
    mask = (1 << layout.length) - 1
    told = [(int(number) & mask, _plain(str(name))) for number, name in sorted(names.items())]
    errors = tuple(bits for bits, name in told if ERROR.fullmatch(name))
    begun = [bits for bits, name in told if BEGUN.fullmatch(name) and bits]  # a 0 at first may be one
    absent = [bits for bits, name in told if NOT_AVAILABLE.fullmatch(name)]
    return errors, tuple(sorted([*absent, *begun]))


def _plain(name: str) -> str:
    """`SignalNotAvailable`, `Signal_not_available` and `signal not available (SNA)` as one."""
    apart = re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", name.partition("(")[0])
    return " ".join(re.findall(r"\w+", apart.replace("_", " ").lower()))
