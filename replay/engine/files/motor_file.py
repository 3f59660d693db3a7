"""motor.toml becomes a network: keys and types, defaults, and every refusal with file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

from ingest.errors import TomlError
from ingest.texts.toml_file import BOOLEAN, NOT_NEGATIVE, NUMBER, POSITIVE, RANGE, TEXT, TEXTS, Kind, TomlTable, read
from replay.errors import MotorFileError
from twin.errors import NetworkError
from twin.motor.ageing_law import Ageing, ageing_term
from twin.motor.check import check
from twin.motor.features import QUANTITY, STREAM_DEGC, is_known
from twin.motor.heat_laws import NAMED
from twin.motor.network import (
    Boundary,
    Configuration,
    Copper,
    Fluid,
    FluidCircuit,
    Link,
    Map,
    Network,
    Node,
    Property,
    Shape,
    Source,
    TemperatureFactor,
    Term,
)

SCHEMA = "whyhot.motor/1"
SCALES = {  # key of [scale] -> quantity
    "speed_rpm": "speed",
    "current_A": "current",
    "torque_Nm": "torque",
    "voltage_V": "voltage",
    "flux_Wb": "flux",
    "flow_lpm": "flow",
}
REGIONS = ("copper", "iron", "magnet", "rotor", "housing", "fluid", "bearing", "other")
KEYS = {
    "root": ("schema", "name", "scale", "copper", "node", "boundary", "link", "source", "circuit", "configuration"),
    "copper": ("alpha_per_K", "reference_degC"),
    "node": ("name", "capacity", "region", "sd", "limit_degC", "along", "radius"),
    "boundary": ("name",),
    "link": ("between", "terms"),
    "source": ("node", "terms"),
    "configuration": ("name", "remove", "link", "source"),
    "circuit": ("name", "inlet", "nodes", "fluid", "flow"),
    "fluid": ("density", "heat_capacity"),
    "property": ("degC", "value"),
    "term": ("coefficient", "sd", "copper", "resistance", "temperature", "shape", "map", "law", "ageing"),
    "temperature": ("node", "slope_per_K", "reference_degC"),
    "shape": ("speed_rpm", "factor", "current_slope"),
    "map": ("speed_rpm", "torque_Nm", "current_A", "values"),
    "ageing": ("above_degC", "percent_per_100h", "sd", "from_h"),
}

CAPACITY_SD = 0.15  # prior sds of the logarithm where none is given
CONDUCTANCE_SD = 0.4
DC_COPPER_SD, LOSS_SD, MAGNET_LOSS_SD = 0.05, 0.15, 0.5
AGEING_SD = 1.0  # % per 100 h

_BY_NAME = (  # a node's region where neither the file nor a copper loss says it
    (r"(end)?winding|terminal", "copper"),
    (r"yoke|teeth|tooth|stator|iron", "iron"),
    (r"magnet", "magnet"),
    (r"rotor|shaft|end_?plate|end_?ring", "rotor"),
    (r"bearing", "bearing"),
    (r"housing|frame|shield|end_?cap", "housing"),
    (r"air|jacket|coolant|oil|water", "fluid"),
)


def _name(value: object) -> str:
    if not (isinstance(value, str) and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}", value)):
        raise ValueError
    return value


def _percent(value: object) -> float:
    POSITIVE.read(NUMBER.read(value) + 100.0)
    return NUMBER.read(value)


def _outwards(value: object) -> tuple[float, float]:
    inner, outer = RANGE.read(value)
    if not 0 <= inner < outer <= 1:
        raise ValueError
    return inner, outer


def _full(value: object) -> list[object]:
    if not (isinstance(value, list) and value):
        raise ValueError
    return value


def _numbers(value: object) -> tuple[float, ...]:
    return tuple(map(NUMBER.read, _full(value)))


_MOTOR_NAME = Kind("a name of letters, digits, _ . and - in quotes", _name)
_NUMBERS = Kind("a list of numbers, such as [0, 4000, 16000]", _numbers)
_ROWS = Kind("a list of rows of numbers, such as [[0, 5], [40, 60]]", lambda value: tuple(map(_numbers, _full(value))))
_OUTWARDS = Kind("two numbers that rise from 0 to 1, such as [0.4, 0.5]", _outwards)
_PERCENT = Kind("a number above -100, such as -3.1", _percent)
_PROPERTY = Kind("a number above 0, or a table {degC = [20, 90], value = [1050, 1005]}", POSITIVE.read)


@lru_cache(maxsize=16)  # a report asks for each file many times
def read_motor(data: bytes, name: str) -> Network:
    """The network of a motor file's bytes; `name` as in messages. Raises MotorFileError with file, line, entry, what is
    wrong and what to do."""
    try:
        root = read(data, name, SCHEMA)
        network = _network(root)
    except TomlError as error:
        raise MotorFileError(str(error)) from None
    try:
        check(network)
    except NetworkError as error:
        raise MotorFileError(_located(root, error)) from None
    return network


def _network(root: TomlTable) -> Network:
    _only(root, "root")
    heated, flowed = _heated(root), _flowed(root)
    nodes = tuple(_node(table, heated, flowed) for table in root.tables("node"))
    if not nodes:
        raise root.error("there is no [[node]]: a motor needs at least one.")
    regions = {node.name: node.region for node in nodes}
    scale = _scale(root)
    return Network(
        name=root.need("name", _MOTOR_NAME),
        nodes=nodes,
        boundaries=tuple(Boundary(_only(table, "boundary").need("name", TEXT)) for table in root.tables("boundary")),
        links=tuple(_link(table, scale) for table in root.tables("link")),
        sources=tuple(_source(table, regions, scale) for table in root.tables("source")),
        copper=_copper(root.table("copper")),
        scale=scale,
        circuits=tuple(_circuit(table) for table in root.tables("circuit")),
        configurations=tuple(_configuration(table, regions, scale) for table in root.tables("configuration")),
    )


def _heated(root: TomlTable) -> set[str]:
    """Nodes with a loss in copper."""
    sources = root.tables("source")
    return {s.need("node", TEXT) for s in sources if any("copper" in t or "resistance" in t for t in s.tables("terms"))}


def _flowed(root: TomlTable) -> set[str]:
    """Nodes of a fluid."""
    return {node for circuit in root.tables("circuit") for node in circuit.need("nodes", TEXTS)}


def _only(table: TomlTable, kind: str, extra: tuple[str, ...] = ()) -> TomlTable:
    """The table, refused where it has another key than its kind."""
    table.only({*KEYS[kind], *extra})
    return table


def _scale(root: TomlTable) -> dict[str, float]:
    table = root.table("scale")
    if table is None:
        return {}
    table.only(set(SCALES))
    return {quantity: table.need(key, POSITIVE) for key, quantity in SCALES.items() if key in table}


def _copper(table: TomlTable | None) -> Copper:
    if table is None:
        return Copper()
    _only(table, "copper")
    given = {"alpha_per_K": table.get("alpha_per_K", POSITIVE), "reference_degC": table.get("reference_degC", NUMBER)}
    return Copper(**{key: value for key, value in given.items() if value is not None})


def _node(table: TomlTable, heated: set[str], flowed: set[str]) -> Node:
    _only(table, "node")
    name, sd = table.need("name", TEXT), table.get("sd", POSITIVE)
    return Node(
        name=name,
        capacity=table.need("capacity", POSITIVE),
        region=table.one_of("region", REGIONS) or _region(name, heated, flowed),
        sd=sd or CAPACITY_SD,
        limit_degC=table.get("limit_degC", NUMBER),
        along=table.need("along", RANGE) if "radius" in table else table.get("along", RANGE),
        radius=table.need("radius", _OUTWARDS) if "along" in table else None,
    )


def _region(name: str, heated: set[str], flowed: set[str]) -> str:
    if name in heated or name in flowed:
        return "copper" if name in heated else "fluid"
    return next((region for pattern, region in _BY_NAME if re.search(rf"(^|_)({pattern})", name)), "other")


def _link(table: TomlTable, scale: Mapping[str, float]) -> Link:
    _only(table, "link")
    ends = table.need("between", TEXTS)
    if len(ends) != 2:
        raise table.error(f'between has {len(ends)} names: give two, such as ["rotor_surface", "teeth"].', "between")
    return Link(ends[0], ends[1], tuple(_term(term, CONDUCTANCE_SD, scale) for term in table.tables("terms")))


def _source(table: TomlTable, regions: Mapping[str, str], scale: Mapping[str, float]) -> Source:
    _only(table, "source")
    node = table.need("node", TEXT)
    other = MAGNET_LOSS_SD if regions.get(node) == "magnet" else LOSS_SD
    sds = [(term, DC_COPPER_SD if _is_dc(term) else other) for term in table.tables("terms")]
    return Source(node, tuple(_term(term, sd, scale) for term, sd in sds))


def _circuit(table: TomlTable) -> FluidCircuit:
    _only(table, "circuit")
    fluid = table.table("fluid")
    if fluid is None:
        says = "fluid is missing: say fluid = {density = 1050.0, heat_capacity = 3500.0}, in kg/m3 and J/(kg K)."
        raise table.error(says)
    _only(fluid, "fluid")
    nodes = table.need("nodes", TEXTS)
    return FluidCircuit(
        name=table.need("name", TEXT),
        inlet=table.need("inlet", TEXT),
        nodes=tuple(nodes),
        fluid=Fluid(_property(fluid, "density"), _property(fluid, "heat_capacity")),
        flow=table.get("flow", TEXT) or "flow",
    )


def _configuration(table: TomlTable, regions: Mapping[str, str], scale: Mapping[str, float]) -> Configuration:
    _only(table, "configuration")
    removed = table.get("remove", TEXTS)
    return Configuration(
        name=table.need("name", TEXT),
        remove=tuple(removed or ()),
        links=tuple(_link(link, scale) for link in table.tables("link")),
        sources=tuple(_source(source, regions, scale) for source in table.tables("source")),
    )


def _property(fluid: TomlTable, key: str) -> Property:
    """A number, or a table over temperature."""
    if not isinstance(fluid.values.get(key), dict):
        return Property((STREAM_DEGC,), (fluid.need(key, _PROPERTY),))
    table = fluid.table(key)
    assert table is not None
    _only(table, "property")
    return Property(table.need("degC", _NUMBERS), table.need("value", _NUMBERS))


def _is_dc(term: TomlTable) -> bool:
    """Copper loss that grows with the current squared alone."""
    used = {key: value for key, value in term.values.items() if is_known(key)}
    return term.get("copper", BOOLEAN) is True and used == {"current": 2}


def _term(table: TomlTable, default_sd: float, scale: Mapping[str, float]) -> Term:
    used = tuple(key for key in table.values if is_known(key))
    _only(table, "term", (*QUANTITY, *used))
    if table.get("resistance", NUMBER) not in (None, -1.0):
        says = "resistance must be -1 (an AC loss, divided by it); for a loss that grows with it write copper = true."
        raise table.error(says, "resistance")
    temperature, ageing = table.table("temperature"), table.table("ageing")
    term = Term(
        coefficient=table.need("coefficient", NUMBER),
        exponents={feature: table.need(feature, NUMBER) for feature in used},
        sd=table.get("sd", POSITIVE) or default_sd,
        copper=table.get("copper", BOOLEAN) or False,
        resistance=-1 if "resistance" in table else 0,
        temperature=_temperature(temperature) if temperature else None,
        shape=_bent(table, scale),
        law=table.one_of("law", NAMED),
    )
    return term if ageing is None else ageing_term(term, _ageing(ageing))


def _ageing(table: TomlTable) -> Ageing:
    _only(table, "ageing")
    return Ageing(
        above_degC=table.need("above_degC", NUMBER),
        percent_per_100h=table.need("percent_per_100h", _PERCENT),
        sd=table.get("sd", POSITIVE) or AGEING_SD,
        from_h=table.get("from_h", NOT_NEGATIVE) or 0.0,
    )


def _temperature(table: TomlTable) -> TemperatureFactor:
    _only(table, "temperature")
    return TemperatureFactor(
        table.need("node", TEXT), table.need("slope_per_K", NUMBER), table.need("reference_degC", NUMBER)
    )


def _bent(term: TomlTable, scale: Mapping[str, float]) -> Shape | Map | None:
    if "map" not in term:
        shape = term.table("shape")
        return _shape(shape, scale) if shape else None
    if "shape" in term:
        raise term.error("a map is the whole form over speed and torque: leave the shape out.", "shape")
    if isinstance(term.values["map"], str):
        table = "map = {speed_rpm = [0, 4000], torque_Nm = [0, 100], values = [[0, 5], [40, 60]]}"
        says = f'map "{term.values["map"]}" stands in a file of its own, which is not at hand here: write {table}.'
        raise term.error(says, "map")
    found = term.table("map")
    assert found is not None
    _only(found, "map")
    if "torque_Nm" in found and "current_A" in found:
        raise found.error("a map goes over the torque or over the current: leave one of them out.", "current_A")
    load = "current_A" if "current_A" in found else "torque_Nm"
    for key in ("speed_rpm", load):
        if SCALES[key] not in scale:
            raise found.error(f"a map needs what 1 means for {SCALES[key]}: say {key} in [scale].")
    return Map(
        speed=tuple(knot / scale["speed"] for knot in found.need("speed_rpm", _NUMBERS)),
        load=tuple(knot / scale[SCALES[load]] for knot in found.need(load, _NUMBERS)),
        values=found.need("values", _ROWS),
        over=SCALES[load],
    )


def _shape(table: TomlTable, scale: Mapping[str, float]) -> Shape:
    _only(table, "shape")
    if "speed" not in scale:
        raise table.error("a shape needs what 1 means for speed: say speed_rpm in [scale].")
    factor, slope = table.need("factor", _NUMBERS), table.get("current_slope", _NUMBERS)
    return Shape(
        speed=tuple(knot / scale["speed"] for knot in table.need("speed_rpm", _NUMBERS)),
        factor=factor,
        current_slope=(0.0,) * len(factor) if slope is None else slope,
    )


def _located(root: TomlTable, error: NetworkError) -> str:
    """The refusal of a network at the line of its entry."""
    at = error.entry
    single = at.table in ("scale", "copper")
    table = root.table(at.table) if single else root.tables(at.table)[at.index]
    says = error.says if error.says.endswith("?") else f"{error.says}."
    return str((table or root).error(says))
