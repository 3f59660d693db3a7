"""Cause ids, `kind.place.law`: parsed and printed here and nowhere else.

>>> cause = parse("loss.magnet.speed2_current2")
>>> cause.place, cause.exponents
('magnet', {'speed': 2.0, 'current': 2.0})
>>> says(cause)
'magnet loss grows with speed squared and current squared'
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from twin.errors import CauseError
from twin.motor.features import QUANTITY
from twin.motor.network import Network
from twin.motor.sensor_laws import SENSOR_LAWS

KINDS = ("loss", "conductance", "capacity", "boundary", "sensor", "clock", "input", "ageing")
OF_THE_MOTOR = ("loss", "conductance", "capacity", "ageing")  # what a motor file says; a bench file corrects the others
FIXED_LAWS = {  # kind -> the laws that are no products of features
    "loss": ("scale", "constant", "map"),
    "conductance": ("scale", "constant"),
    "capacity": ("scale", "attached"),
    "boundary": ("bias",),
    "sensor": (*(one.law for one in SENSOR_LAWS), "hold", "dropout", "stuck", "saturation"),
    "clock": ("offset", "drift", "lag"),
    "input": ("gain", "bias", "undersampled"),
    "ageing": (),
}
IN_SESSION = "bias_in_"  # what the law of a boundary begins with in one session alone; behind it the session's name
BEYOND_FEATURES = ("temperature", "session_time", "session")  # what a law may grow with besides the features of a term

_NAME = r"[a-z][a-z0-9_]*"
_SENSOR = rf"{_NAME}(@\w+)?"
_LINK = rf"({_NAME})-({_NAME})"
_PLACES = {  # kind -> how its place is written, in a pattern and in words
    "loss": (_NAME, "a node"),
    "conductance": (_LINK, "a link such as rotor_surface-teeth"),
    "capacity": (_NAME, "a node"),
    "boundary": (_NAME, "a boundary"),
    "sensor": (_SENSOR, "a node, or node@signal"),
    "clock": (r"\w+", "a bus such as can2, a logger, or the stem of a file"),
    "input": (_NAME, "an input quantity"),
    "ageing": (rf"{_NAME}|{_LINK}", "a node or a link"),
}
_BEYOND = r"(?:hours_above_|temperature|session)"
_CIRCUIT = rf"flow_(?!{_BEYOND})[a-z](?:[a-z0-9_]*?[a-z0-9])?"
_EXPONENT = r"(?P<exponent>\d+(?:\.\d+)?)?"
_TERM = re.compile(
    rf"(?P<feature>{_CIRCUIT}){_EXPONENT}(?=$|_flow_|_{_BEYOND})"
    rf"|(?P<other>current_[dq]|hours_above_\d+(?:\.\d+)?degC|session_time|{'|'.join((*QUANTITY, *BEYOND_FEATURES))})"
    rf"{_EXPONENT.replace('exponent', 'power')}(?=$|_)"
)


@dataclass(frozen=True, order=True)
class Cause:
    """A cause: what kind, where, and the law it follows. `str(cause)` is its id;
    raises `CauseError` for what cannot be."""

    kind: str
    place: str
    law: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise CauseError(f'cause "{self}": "{self.kind}" is no kind{_nearest(self.kind, KINDS)}')
        pattern, words = _PLACES[self.kind]
        match = re.fullmatch(pattern, self.place)
        if match is None or ("-" in self.place and len(set(self.place.split("-"))) == 1):
            raise CauseError(f'cause "{self}": "{self.place}" is no place of a {self.kind}: give {words}')
        _check_law(self)

    def __str__(self) -> str:
        return f"{self.kind}.{self.place}.{self.law}"

    @property
    def exponents(self) -> dict[str, float]:
        """Feature -> exponent, where the law is a product of features; else empty."""
        return {} if _is_fixed(self) else dict(_terms(self.law) or ())

    @property
    def ends(self) -> tuple[str, ...]:
        """The names in the place: both ends of a link, else the one place."""
        return tuple(self.place.split("-"))


def parse(text: str) -> Cause:
    """The cause of an id; `str(parse(text)) == text`. Raises `CauseError` where no cause is written so.

    The kind ends at the first dot and the place at the second; a law may hold dots (`speed1.5`).
    """
    if not text.isprintable():
        raise CauseError(f"cause {text!r}: write it in printable characters, such as loss.magnet.speed2_current2")
    parts = text.split(".", 2)
    if len(parts) < 3:
        raise CauseError(f'cause "{text}": write kind.place.law, such as loss.magnet.speed2_current2')
    return Cause(*parts)


def _is_fixed(cause: Cause) -> bool:
    if cause.kind == "boundary" and re.fullmatch(rf"{IN_SESSION}\w+", cause.law):
        return True
    return cause.law in FIXED_LAWS[cause.kind] or (cause.kind == "sensor" and cause.law.startswith("swap_"))


def _check_law(cause: Cause) -> None:
    if cause.kind == "sensor" and cause.law.startswith("swap_"):
        other = cause.law.removeprefix("swap_")
        if re.fullmatch(_SENSOR, other) is None or other == cause.place:
            raise CauseError(f'cause "{cause}": "{other}" is no other sensor: give a node, or node@signal')
        return
    if _is_fixed(cause):
        return
    terms = _terms(cause.law) if cause.kind in ("loss", "conductance", "ageing") else None
    if terms is None:
        known = (*FIXED_LAWS[cause.kind], *(QUANTITY if cause.kind in ("loss", "conductance", "ageing") else ()))
        raise CauseError(f'cause "{cause}": "{cause.law}" is no law of a {cause.kind}{_nearest(cause.law, known)}')
    if cause.kind == "ageing" and not any(feature.startswith("hours_above_") for feature, _ in terms):
        raise CauseError(f'cause "{cause}": ageing follows a dose: write a law such as hours_above_180degC')
    written = law(terms)
    if written != cause.law:
        raise CauseError(f'cause "{cause}": the law "{cause.law}" is written {written}')


def _terms(text: str) -> tuple[tuple[str, float], ...] | None:
    """((feature, exponent), ...) of a law as it is written; None where it is no product of features."""
    found: list[tuple[str, float]] = []
    at = 0
    while at <= len(text):
        match = _TERM.match(text, at)
        if match is None:
            return None
        exponent = match["exponent"] or match["power"]
        found.append((match["feature"] or match["other"], 1.0 if exponent is None else float(exponent)))
        at = match.end() + 1
    return tuple(found) if all(exponent > 0 for _, exponent in found) else None


def law(terms: Iterable[tuple[str, float]]) -> str:
    """How a product of features to exponents is written: in one order, shortest decimals, an exponent of 1 left out.

    >>> law([("current", 2.0), ("speed", 1.5)])
    'speed1.5_current2'
    """
    summed: dict[str, float] = {}
    for feature, exponent in terms:
        summed[feature] = summed.get(feature, 0.0) + exponent
    written = (f + ("" if summed[f] == 1 else f"{summed[f]:.15g}") for f in sorted(summed, key=_order))
    return "_".join(written) or "constant"


def _order(feature: str) -> tuple[int, str]:
    known = (*QUANTITY, "", *BEYOND_FEATURES)  # circuits and hours stand where the empty name is
    return (known.index(feature) if feature in known else len(QUANTITY), feature)


def _nearest(word: str, known: Iterable[str]) -> str:
    names = tuple(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    return f"; the nearest is {near[0]}" if near else f"; there are {', '.join(names)}"


# --- Places -----------------------------------------------------------------------------------------------------------


def spelt(name: str) -> str:
    """A signal's or file's name as ids hold it: every character but letters, digits and `_` as `_`."""
    return re.sub(r"\W", "_", name)


def link_place(network: Network, a: str, b: str) -> str:
    """A link as the motor file writes it; one that it lacks in the order of its nodes, boundaries last."""
    for link in network.links:
        if {link.a, link.b} == {a, b}:
            return f"{link.a}-{link.b}"
    return "-".join(sorted((a, b), key=network.names.index))


def mirrored(name: str) -> dict[str, str]:
    """Stem -> the name of the twin, for each part of a name that is `_a`, `_b`, `_1` or `_2`.

    >>> mirrored("endwinding_a_inner")
    {'endwinding_inner': 'endwinding_b_inner'}
    """
    other = {"a": "b", "b": "a", "1": "2", "2": "1"}
    parts = name.split("_")
    found = {}
    for i in range(1, len(parts)):
        if parts[i] in other:
            found["_".join(parts[:i] + parts[i + 1 :])] = "_".join([*parts[:i], other[parts[i]], *parts[i + 1 :]])
    return found


def groups(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Stem -> the names that differ only in `_a`/`_b` or `_1`/`_2`, in their order;
    stems that are names are left out."""
    given = tuple(names)
    found: dict[str, list[str]] = {}
    for name in given:
        for stem, twin in mirrored(name).items():
            if twin in given and stem not in given:
                found.setdefault(stem, []).append(name)
    return {stem: tuple(members) for stem, members in found.items() if len(members) == 2}


# --- Words ------------------------------------------------------------------------------------------------------------

_SAYS = {
    ("loss", "scale"): "{place} loss is off by one factor at every operating point",
    ("loss", "constant"): "{place} makes a constant heat that the model lacks",
    ("loss", "map"): "{place} loss goes with speed and load in a way that no other law has",
    ("conductance", "scale"): "the heat path between {place} is off by one factor",
    ("conductance", "constant"): "the heat path between {place} has a constant part that the model lacks",
    ("capacity", "scale"): "{place} stores more or less heat than modelled",
    ("capacity", "attached"): "an attached mass stores heat behind {place}",
    ("boundary", "bias"): "{place} is warmer or colder than measured by a constant",
    **{("sensor", one.law): one.says for one in SENSOR_LAWS},
    ("sensor", "hold"): "the sensor at {place} holds one value for a time",
    ("sensor", "dropout"): "the sensor at {place} loses samples",
    ("sensor", "stuck"): "the sensor at {place} stays at one value",
    ("sensor", "saturation"): "the sensor at {place} meets the end of its range",
    ("clock", "offset"): "the stamps of {place} are shifted in time",
    ("clock", "drift"): "the clock of {place} runs fast or slow",
    ("clock", "lag"): "what {place} records follows more slowly than stated, as its logger smooths it",
    ("input", "gain"): "the measured {place} is off in proportion",
    ("input", "bias"): "the measured {place} is off by a constant",
    ("input", "undersampled"): "the measured {place} is sampled too slowly for what it does",
}
_POWERS = {1.0: "", 2.0: " squared", 3.0: " cubed"}
_OWN_WORDS = {
    "temperature": "its own temperature",
    "session_time": "time within a session",
    "session": "the number of the session",
    "current_d": "d-axis current",
    "current_q": "q-axis current",
}


def says(cause: Cause) -> str:
    """The cause in plain words, one sentence without its full stop."""
    place = cause.place if cause.kind == "clock" else place_words(cause.place)  # a logger's name is no words
    if cause.law.startswith("swap_"):
        return f"the sensors at {place} and {_words(cause.law.removeprefix('swap_'))} are exchanged"
    if cause.kind == "boundary" and cause.law.startswith(IN_SESSION):
        session = cause.law.removeprefix(IN_SESSION)
        return f"{place} was warmer or colder than measured by a constant in session {session}"
    if (cause.kind, cause.law) in _SAYS:
        return _SAYS[cause.kind, cause.law].format(place=place)
    grows = product_words(cause.exponents)
    either_way = cause.kind == "ageing" or not set(BEYOND_FEATURES).isdisjoint(cause.exponents)
    subject = f"the heat path between {place}" if len(cause.ends) > 1 else f"{place} loss"
    return f"{subject} {'changes' if either_way else 'grows'} with {grows}"


def place_words(place: str) -> str:
    """A place in plain words: "rotor surface and teeth" of `rotor_surface-teeth`."""
    return " and ".join(_words(name) for name in place.split("-"))


def product_words(exponents: Mapping[str, float]) -> str:
    """A product of features in plain words: "speed squared and current squared"."""
    return " and ".join(_feature_words(feature) + _power(exponent) for feature, exponent in exponents.items())


def _words(name: str) -> str:
    node, at, signal = name.partition("@")
    return node.replace("_", " ") + (f" ({signal})" if at else "")


def _power(exponent: float) -> str:
    return _POWERS.get(exponent, f" to the power {exponent:.15g}")


def _feature_words(feature: str) -> str:
    hours = re.fullmatch(r"hours_above_(.+)degC", feature)
    if hours:
        return f"hours above {hours[1]} degC"
    return _OWN_WORDS.get(feature, feature.replace("_", " "))
