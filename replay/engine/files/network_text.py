"""A motor file made from a network: for motors that a program made, where there is no text to keep."""

from __future__ import annotations

from replay.engine.files.motor_file import SCALES, SCHEMA
from replay.engine.files.motor_text import written
from replay.engine.files.toml_edit import as_text
from twin.motor.network import Copper, FluidCircuit, Link, Network, Property, Source


def network_text(network: Network, says: str) -> bytes:
    """The motor file of a checked network, numbers to 7 digits; the lines of `says` are comments under its schema.
    Raises MotorFileError where a motor file cannot say the network."""
    return written(_bare(network).encode(), f"{network.name}.toml", network, says)


def _bare(network: Network) -> str:
    """Every entry of the network with its coefficients alone; `written` adds what else it says of each."""
    return "\n\n".join(["\n".join(_head(network)), *_entries(network)]) + "\n"


def _head(network: Network) -> list[str]:
    """The values that `written` compares and does not change, as precise as they are."""
    lines = [f'schema = "{SCHEMA}"', f'name = "{network.name}"']
    if network.scale:
        said = {quantity: key for key, quantity in SCALES.items()}
        lines += ["", "[scale]", *(f"{said[quantity]} = {value!r}" for quantity, value in network.scale.items())]
    if network.copper != Copper():
        lines += ["", "[copper]", *(f"{key} = {value!r}" for key, value in vars(network.copper).items())]
    return lines


def _entries(network: Network) -> list[str]:
    """A node is said with its region: default `sd` of its losses follow from that, and a merged node's name may speak
    of another one."""
    return [
        *(as_text("boundary", {"name": boundary.name}) for boundary in network.boundaries),
        *(as_text("node", {"name": n.name, "capacity": n.capacity, "region": n.region}) for n in network.nodes),
        *(as_text("link", {"between": [link.a, link.b], **_terms(link)}) for link in network.links),
        *(as_text("source", {"node": source.node, **_terms(source)}) for source in network.sources),
        *map(_circuit, network.circuits),
    ]


def _circuit(circuit: FluidCircuit) -> str:
    says = {"name": circuit.name, "inlet": circuit.inlet, "nodes": list(circuit.nodes), "flow": circuit.flow}
    fluid = f"density = {_property(circuit.fluid.density)}, heat_capacity = {_property(circuit.fluid.heat_capacity)}"
    return f"{as_text('circuit', says)}\nfluid = {{{fluid}}}"


def _property(table: Property) -> str:
    if len(table.value) == 1:
        return repr(table.value[0])
    return f"{{degC = {list(table.degC)!r}, value = {list(table.value)!r}}}"


def _terms(place: Link | Source) -> dict[str, list[dict[str, float]]]:
    return {"terms": [{"coefficient": term.coefficient} for term in place.terms]}
