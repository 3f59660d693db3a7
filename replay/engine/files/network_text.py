"""A motor file made from a network: for motors that a program made, where there is no text to keep."""

from __future__ import annotations

from collections.abc import Sequence

from replay.engine.files.motor_file import SCALES, SCHEMA
from replay.engine.files.motor_text import written
from twin.motor.network import Copper, FluidCircuit, Network, Node, Property, Term


def network_text(network: Network, says: str) -> bytes:
    """The motor file of a checked network, numbers to 7 digits; the lines of `says` are comments under its schema.

    Raises MotorFileError where a motor file cannot say the network.
    """
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
        copper = network.copper
        lines += [
            "",
            "[copper]",
            f"alpha_per_K = {copper.alpha_per_K!r}",
            f"reference_degC = {copper.reference_degC!r}",
        ]
    return lines


def _entries(network: Network) -> list[str]:
    return [
        *(f'[[boundary]]\nname = "{boundary.name}"' for boundary in network.boundaries),
        *map(_node, network.nodes),
        *(f'[[link]]\nbetween = ["{link.a}", "{link.b}"]\n{_terms(link.terms)}' for link in network.links),
        *(f'[[source]]\nnode = "{source.node}"\n{_terms(source.terms)}' for source in network.sources),
        *map(_circuit, network.circuits),
    ]


def _node(node: Node) -> str:
    """A node with its region: default `sd` of its losses follow from it, and a merged node's name may speak of
    another one."""
    return f'[[node]]\nname = "{node.name}"\ncapacity = {node.capacity:.7g}\nregion = "{node.region}"'


def _circuit(circuit: FluidCircuit) -> str:
    nodes = ", ".join(f'"{node}"' for node in circuit.nodes)
    fluid = f"density = {_property(circuit.fluid.density)}, heat_capacity = {_property(circuit.fluid.heat_capacity)}"
    says = f'name = "{circuit.name}"\ninlet = "{circuit.inlet}"\nnodes = [{nodes}]\nflow = "{circuit.flow}"'
    return f"[[circuit]]\n{says}\nfluid = {{{fluid}}}"


def _property(table: Property) -> str:
    if len(table.value) == 1:
        return repr(table.value[0])
    return f"{{degC = {list(table.degC)!r}, value = {list(table.value)!r}}}"


def _terms(terms: Sequence[Term]) -> str:
    written_terms = [f"{{coefficient = {term.coefficient:.7g}}}" for term in terms]
    if len(terms) == 1:
        return f"terms = [{written_terms[0]}]"
    return "\n".join(["terms = [", *(f"  {one}," for one in written_terms), "]"])
