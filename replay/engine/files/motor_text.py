"""A motor file that says a changed network: numbers are replaced where they stand, what is new joins its own kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from ingest.texts.toml_spans import spans
from replay.engine.files.motor_file import SCALES, read_motor
from replay.engine.files.toml_edit import edited
from replay.errors import MotorFileError
from twin.motor.ageing_law import Ageing, AgeingTerm, is_insulation, with_ageing
from twin.motor.configured import restored
from twin.motor.network import Configuration, FluidCircuit, Link, Map, Network, Node, Property, Source, Term

# what tells the entries of a kind apart, where that is not their name
_CALLED = {"link": "between", "source": "node"}
_BOM = "\ufeff"


def written(data: bytes, name: str, network: Network, says: str) -> bytes:
    """The motor file `data` (`name` as in messages) with what `network` says otherwise, numbers to 7 digits.

    Coefficients, exponents, capacities, factors and shapes may differ, and nodes, boundaries, links, sources, terms,
    circuits and configurations may be added behind those that are there; of a network without configurations the file's
    own stay. All other text stays as it is. The lines of `says` become comments under the schema, the first one also
    the comment `# added: ...` of what is added. A network that the file says already gives `data`. Raises
    MotorFileError where something was taken away or put before others, or the result would not read back as `network`.
    """
    before = read_motor(data, name)
    network = network if network.configurations else restored(before, network)
    _check_order(name, before, network)
    text = data.decode()
    mark = _BOM if text.startswith(_BOM) else ""
    text = unchanged = text.removeprefix(_BOM)
    # twice: what is new may change a default (a copper loss makes a node copper), and only then it is said
    for whole in (False, True):
        old = _values(read_motor(text.encode(), name), whole)
        text = edited(text, old, _values(network, whole), says.partition("\n")[0])
    if text != unchanged:
        text = _with_comment(text, says)
    result = (mark + text).encode()
    _check_same(name, read_motor(result, name), network)
    return result


def with_law(
    text: str, network: Network, percent_per_100h: float, sd: float, above_degC: float, from_h: float = 0.0
) -> str:
    """The motor file `text`, which says `network`, with this law of deterioration (`twin.motor.ageing_law.Ageing`, of
    the conductance) at every term of every link of copper and iron, those of its configurations too; a law that a term
    has already goes. Raises MotorFileError where no link leads from copper to iron."""
    law, name = Ageing(above_degC, percent_per_100h, sd, from_h), f"motor {network.name}"
    links = [*network.links, *(link for one in network.configurations for link in one.links)]
    if not any(is_insulation(network, link) for link in links):
        raise MotorFileError(
            f'{name}: no link leads from a node of region "copper" to one of region "iron", so there is no insulation '
            "that could age: say the regions of its nodes, or write ageing = {...} into the terms by hand."
        )
    begins = f" from {from_h:g} h on" if from_h else ""
    says = f"insulation: {percent_per_100h:+.3g} % per 100 h above {above_degC:g} degC{begins}, learnt from checks"
    return written(text.encode(), name, with_ageing(network, law), says).decode()


def _with_comment(text: str, says: str) -> str:
    """Under the line of the schema; where there is none, above all."""
    line_break = "\r\n" if "\r\n" in text else "\n"
    comment = "".join(f"# {line}{line_break}" for line in says.splitlines())
    schema = spans(text).get(("schema",))
    at = 0 if schema is None else text.find("\n", schema.end) + 1
    return text[:at] + comment + text[at:]


def _values(network: Network, whole: bool) -> dict[str, Any]:
    """What a motor file can say of a network, numbers to 7 digits. `whole`: also what it may leave to its defaults."""
    values: dict[str, Any] = _to_7_digits(
        {
            "node": [_node(node, whole) for node in network.nodes],
            "boundary": [{"name": boundary.name} for boundary in network.boundaries],
            **_places(network, network, whole),
            "circuit": [_circuit(circuit) for circuit in network.circuits],
            "configuration": [_configuration(one, network, whole) for one in network.configurations],
        }
    )
    return values


def _to_7_digits(value: Any) -> Any:
    """A tree of values with its numbers to 7 digits and its tuples as lists; -0 as 0."""
    if isinstance(value, Mapping):
        return {key: _to_7_digits(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_to_7_digits(one) for one in value]
    return float(f"{value:.7g}") + 0.0 if isinstance(value, float) else value


def _circuit(circuit: FluidCircuit) -> dict[str, Any]:
    fluid = {key: _property(getattr(circuit.fluid, key)) for key in ("density", "heat_capacity")}
    return {**vars(circuit), "fluid": fluid}


def _property(table: Property) -> Any:
    """A number where it is one, else the table."""
    return table.value[0] if len(table.value) == 1 else asdict(table)


def _configuration(one: Configuration, network: Network, whole: bool) -> dict[str, Any]:
    parts = {"remove": one.remove, **_places(one, network, whole)}
    return {"name": one.name, **{key: part for key, part in parts.items() if part}}


def _node(node: Node, whole: bool) -> dict[str, Any]:
    said = {key: getattr(node, key) for key in ("limit_degC", "along", "radius")}
    said = {key: list(value) if isinstance(value, tuple) else value for key, value in said.items() if value is not None}
    default = {"region": node.region, "sd": node.sd} if whole else {}
    return {"name": node.name, "capacity": node.capacity, **said, **default}


def _places(of: Network | Configuration, network: Network, whole: bool) -> dict[str, Any]:
    """The links and sources of a network or of one of its configurations."""

    def terms(place: Link | Source) -> list[dict[str, Any]]:
        return [_term(term, network.scale, whole) for term in place.terms]

    return {
        "link": [{"between": [link.a, link.b], "terms": terms(link)} for link in of.links],
        "source": [{"node": source.node, "terms": terms(source)} for source in of.sources],
    }


def _term(term: Term, scale: Mapping[str, float], whole: bool) -> dict[str, Any]:
    values: dict[str, Any] = {"coefficient": term.coefficient}
    values |= {feature: exponent for feature, exponent in term.exponents.items() if exponent}
    if term.copper or whole:
        values["copper"] = term.copper
    if term.law is not None:
        values["law"] = term.law
    if term.resistance:
        values["resistance"] = term.resistance
    if term.temperature is not None:
        values["temperature"] = asdict(term.temperature)
    if term.shape is not None:
        bent = asdict(term.shape)
        if isinstance(term.shape, Map):
            bent[bent.pop("over")] = bent.pop("load")
        values["map" if isinstance(term.shape, Map) else "shape"] = _bent(bent, scale)
    if isinstance(term, AgeingTerm):
        law = asdict(term.ageing)
        values["ageing"] = law if law["from_h"] or whole else {key: law[key] for key in law if key != "from_h"}
    return values | ({"sd": term.sd} if whole else {})


def _bent(values: dict[str, Any], scale: Mapping[str, float]) -> dict[str, Any]:
    """A shape or map with its knots in the units of the file."""
    axes = [(key, quantity) for key, quantity in SCALES.items() if quantity in values]
    return {key: [knot * scale[quantity] for knot in values.pop(quantity)] for key, quantity in axes} | values


def _check_order(name: str, before: Network, after: Network) -> None:
    """Entries that are there keep their places, so that comments beside them go on speaking of them."""
    old, new = _values(before, whole=False), _values(after, whole=False)
    for kind, entries in old.items():
        called = _CALLED.get(kind, "name")
        for i, entry in enumerate(entries):
            there = new[kind][i] if i < len(new[kind]) else {}
            if there.get(called) != entry[called] or len(there.get("terms", ())) < len(entry.get("terms", ())):
                which = "-".join(entry[called]) if isinstance(entry[called], list) else entry[called]
                raise MotorFileError(
                    f"{name}: [[{kind}]] {i + 1} ({which}) or one of its terms is not in its place in the new network: "
                    "a version of a motor file adds at the ends and takes nothing away."
                )


def _check_same(name: str, found: Network, wanted: Network) -> None:
    values, other = ({**_values(n, whole=True), **_head(n)} for n in (found, wanted))
    wrong = next(_differences(values, other), None)
    if wrong is not None:
        raise MotorFileError(
            f"{name}: the new version would not say {wrong} as it should be: a version of a motor file changes numbers "
            "and adds entries, all else has to be edited by hand."
        )


def _head(network: Network) -> dict[str, Any]:
    return {"name": network.name, "scale": dict(network.scale), "copper": asdict(network.copper)}


def _differences(found: Any, wanted: Any, path: str = "") -> Iterator[str]:
    """Where two trees of values differ, as `source 2 terms 1 coefficient`."""
    if isinstance(found, Mapping) and isinstance(wanted, Mapping):
        for key in dict.fromkeys((*wanted, *found)):
            yield from _differences(found.get(key), wanted.get(key), f"{path} {key}".strip())
    elif isinstance(found, list) and isinstance(wanted, list) and len(found) == len(wanted):
        for i, (one, other) in enumerate(zip(found, wanted, strict=True), 1):
            yield from _differences(one, other, f"{path} {i}")
    elif found != wanted:
        yield path
