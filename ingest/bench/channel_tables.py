"""The `[[channel]]` and `[[derived]]` tables of a bench file: what may stand there, and what it means."""

from __future__ import annotations

import re
from collections.abc import Mapping

from ingest.bench.channel import Channel
from ingest.bench.signals import BUS, TABLE
from ingest.errors import BenchFileError, ExpressionError, UnitError
from ingest.texts.expressions import parse
from ingest.texts.quantities import CONVENTIONS, STORED_UNIT, converter, known_quantity
from ingest.texts.toml_file import NAME, NAMED_NUMBERS, NOT_NEGATIVE, NUMBER, POSITIVE, RANGE, TEXT, TomlTable

LEVELS = ("testing", "production")
ROLES = ("observed", "input", "ignored")
REGIONS = ("copper", "iron", "magnet", "rotor", "housing", "fluid", "bearing", "other", "boundary")
OBSERVABLE = ("temperature", "power", "heat", "resistance", "flux")
THERMOMETRIC = ("resistance", "flux")  # they go with the temperature of nodes
_PLACED = {"temperature": "what it measures", **dict.fromkeys(THERMOMETRIC, "whose temperature it goes with")}
COMMON_KEYS = (
    *("quantity", "unit", "node", "weights", "region", "level", "noise", "bias_sd", "resolution", "time_constant_s"),
    *("sensor", "card", "convention", "role", "gain_sd", "reference", "reference_degC", "slope_per_K", "bin_degC"),
)
CHANNEL_KEYS = ("signal", "value", *COMMON_KEYS)
VALUE_KEYS = ("value", "quantity", "unit", "node")
DERIVED_KEYS = ("name", "expression", *COMMON_KEYS)


def read_channel(table: TomlTable, elsewhere: Mapping[str, str]) -> Channel:
    """A `[[channel]]`. `elsewhere`: keys of the file that stand in other tables. Raises as `read_bench`."""
    table.only(CHANNEL_KEYS, {"name": "in [[derived]]", "expression": "in [[derived]]", **elsewhere})
    if "value" in table:
        return _valued(table)
    signal = table.need("signal", TEXT)
    qualified = re.fullmatch(rf"(?:{BUS}:)?\w+\.(\w+)", signal)
    name = qualified[1] if qualified else signal.removeprefix(f"{TABLE}.")
    return _common(table, name=name, signal=signal, expression=None)


def _valued(table: TomlTable) -> Channel:
    """A boundary that no log holds: its temperature as a number."""
    table.only(VALUE_KEYS, dict.fromkeys(CHANNEL_KEYS, "beside a signal, not a value"))
    quantity, unit, convention = _measure(table, None)
    if quantity != "temperature":
        raise refusal(table, "value", f"value is the temperature of a boundary that is not measured, no {quantity}.")
    node = table.need("node", NAME)
    conversion = converter(unit, quantity, convention)
    degC = conversion.scale * table.need("value", NUMBER) + conversion.offset
    lines = {key: table.line(key) for key in table.values}
    return Channel(node, quantity, unit, value=degC, node=node, role="input", line=table.line(), lines=lines)


def read_derived(table: TomlTable, elsewhere: Mapping[str, str]) -> Channel:
    """A `[[derived]]` channel, as `read_channel`."""
    table.only(DERIVED_KEYS, {"signal": "in [[channel]]; a derived channel has name and expression", **elsewhere})
    name, expression = table.need("name", TEXT), table.need("expression", TEXT)
    try:
        parse(expression)
    except ExpressionError as error:
        raise ExpressionError(f"{table.file}:{table.line('expression')}: {error}") from None
    return _common(table, name=name, signal=None, expression=expression)


def _common(table: TomlTable, *, name: str, signal: str | None, expression: str | None) -> Channel:
    role = table.one_of("role", ROLES)
    quantity, unit, convention = _measure(table, role)
    scale = converter(unit, quantity, convention).scale if quantity else 1.0
    node, weights = _place(table)
    if role == "observed":
        _observable(table, quantity, node, weights)
    _refuse_keys_of_others(table, quantity, role)
    return Channel(
        name=name,
        quantity=quantity,
        unit=unit,
        signal=signal,
        expression=expression,
        node=node,
        weights=weights,
        region=table.one_of("region", REGIONS),
        level=table.one_of("level", LEVELS) or "testing",
        noise=_scaled(table.get("noise", NOT_NEGATIVE), scale),
        bias_sd=_scaled(table.get("bias_sd", NOT_NEGATIVE), scale),
        resolution=_scaled(table.get("resolution", POSITIVE), scale),
        time_constant_s=table.get("time_constant_s", NOT_NEGATIVE) or 0.0,
        sensor=table.get("sensor", TEXT),
        card=table.get("card", TEXT),
        convention=convention,
        role=role,
        gain_sd=table.get("gain_sd", NOT_NEGATIVE),
        reference=_scaled(table.get("reference", POSITIVE), scale),
        reference_degC=_reference_degC(table),
        slope_per_K=_slope(table),
        bin_degC=table.get("bin_degC", RANGE),
        line=table.line(),
        lines={key: table.line(key) for key in table.values},
    )


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value * scale


def _measure(table: TomlTable, role: str | None) -> tuple[str, str, str]:
    """Quantity, unit and convention; an ignored channel may say none of them."""
    convention = table.one_of("convention", CONVENTIONS) or "rms"
    if role == "ignored" and "quantity" not in table:
        return "", table.get("unit", TEXT) or "", convention
    quantity = table.need("quantity", TEXT)
    at = "quantity"
    try:
        known_quantity(quantity)
        at = "unit"
        unit = _unit(table, quantity)
        converter(unit, quantity, convention)
    except UnitError as error:
        raise UnitError(f"{table.file}:{table.line(at)}: {error}") from None
    return quantity, unit, convention


def _unit(table: TomlTable, quantity: str) -> str:
    """Pure numbers need no unit."""
    if STORED_UNIT[quantity] == "1" and not table.values.get("unit"):
        return "1"
    return table.need("unit", TEXT)


def _place(table: TomlTable) -> tuple[str | None, Mapping[str, float]]:
    """The node, or the weights of several (`node = {a = 0.7, b = 0.3}` is the same as `weights`)."""
    exclusive(table, "node", "weights")
    key = "node" if isinstance(table.values.get("node"), dict) else "weights"
    weights = table.get(key, NAMED_NUMBERS)
    if weights is None:
        return table.get("node", NAME), {}
    total = sum(weights.values())
    if not weights or min(weights.values()) <= 0:
        raise refusal(table, key, f"{key} must be numbers above 0, such as {{winding = 0.7, air = 0.3}}.")
    if abs(total - 1) > 1e-6:
        raise refusal(table, key, f"{key} add up to {total:.6g}, but are shares of one channel: make them add up to 1.")
    for place in weights:
        TomlTable(table.file, {"node": place}, (*table.path, key), table.lines, table.label).need("node", NAME)
    return None, weights


def _observable(table: TomlTable, quantity: str, node: str | None, weights: Mapping[str, float]) -> None:
    """Refuse an observed channel that says too little, or too much, of what it measures."""
    key = "role"
    if quantity not in OBSERVABLE:
        says = f'{quantity} cannot be observed, only {", ".join(OBSERVABLE)}: write role = "input".'
    elif quantity in _PLACED and not (node or weights):
        says = f"an observed {quantity} needs a node or weights: say {_PLACED[quantity]}."
    elif quantity == "flux" and "slope_per_K" not in table:
        says = "an observed flux needs slope_per_K, such as -0.001: say how it falls as the magnets warm."
    elif quantity == "heat" and not node:
        says = 'an observed heat needs the boundary that takes it, such as node = "coolant".'
    elif quantity == "power" and (node or weights):
        key = "node" if "node" in table else "weights"
        says = "an observed power is that of the whole motor: take it out."
    else:
        return
    raise refusal(table, key, says)


def _refuse_keys_of_others(table: TomlTable, quantity: str, role: str | None) -> None:
    """Keys of some quantities where they would mean nothing."""
    if "bin_degC" in table and quantity != "dose":
        says = 'bin_degC is of hours that a counter counts: write quantity = "dose", or take it out.'
        raise refusal(table, "bin_degC", says)
    for key in ("gain_sd", "reference", "reference_degC", "slope_per_K"):
        meters = ("power", "heat", *THERMOMETRIC) if key == "gain_sd" else THERMOMETRIC
        if key in table and not (role == "observed" and quantity in meters):
            of = f"{', '.join(meters[:-1])} or {meters[-1]}"
            raise refusal(table, key, f'{key} is of an observed {of}: add role = "observed", or take it out.')


def _reference_degC(table: TomlTable) -> float:
    degC = table.get("reference_degC", NUMBER)
    return Channel.reference_degC if degC is None else degC


def _slope(table: TomlTable) -> float | None:
    slope = table.get("slope_per_K", NUMBER)
    if slope == 0.0:
        raise refusal(table, "slope_per_K", "slope_per_K is 0: then the reading says nothing of a temperature.")
    return slope


def refusal(table: TomlTable, key: str, says: str) -> BenchFileError:
    """What a bench file says at `key` and cannot, to be raised."""
    return BenchFileError(f"{table.where(key)} {says}")


def exclusive(table: TomlTable, *keys: str) -> None:
    """Raises BenchFileError where more than one of these keys is given."""
    given = [key for key in keys if key in table]
    if len(given) > 1:
        raise refusal(table, given[1], f"{' and '.join(given)} exclude each other: keep one.")
