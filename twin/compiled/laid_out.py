"""A network as loops that are compiled once for all networks take it, worked out once for each."""

from __future__ import annotations

from typing import NamedTuple

from twin.compiled.indexed import Program, program
from twin.compiled.integrators import DEFAULT
from twin.compiled.laws import Law, Table
from twin.compiled.once import once_a_network
from twin.compiled.structure import Parameters, Structure, described
from twin.motor.network import Network


class LaidOut(NamedTuple):
    """`laws`, and the `table` of them, are those of the groups of `shape`, in their order."""

    shape: Structure
    values: Parameters
    program: Program
    laws: tuple[Law, ...]
    table: Table


@once_a_network
def laid_out(network: Network) -> LaidOut:
    """A network laid out for the default integrator; it is not checked, as one with a coefficient of 0 has candidates
    in it."""
    shape, values = described(network)
    laws = tuple(Law.of(group, values, g) for g, group in enumerate(shape.groups))
    return LaidOut(shape, values, program(shape, DEFAULT), laws, Table.of(laws, network.copper))
