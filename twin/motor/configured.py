"""The same motor on another rig: nodes taken away, links and sources added or put in the place of others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeVar

from twin.errors import ConfigurationError
from twin.motor.network import Configuration, FluidCircuit, Network

E = TypeVar("E")


def configured(network: Network, name: str | None) -> Network:
    """The network in a configuration, every coefficient shared; None: the whole motor.

    What is removed takes its links, its source and its place in circuits along (the fluid flows on to the next node);
    a circuit without inlet or nodes goes, and so does a boundary that nothing touches any more. Of the whole motor,
    boundaries that only configurations touch are left out. Raises `ConfigurationError` where there is no such
    configuration.
    """
    if name is None:
        return _without_untouched(replace(network, configurations=()), _touched_later(network))
    found = next((one for one in network.configurations if one.name == name), None)
    if found is None:
        known = ", ".join(one.name for one in network.configurations)
        advice = f"known are {known}" if known else "it has none: add [[configuration]] to its motor file"
        raise ConfigurationError(f'motor "{network.name}" has no configuration "{name}": {advice}')
    return _without_untouched(_changed(network, found), {boundary.name for boundary in network.boundaries})


def restored(motor: Network, network: Network) -> Network:
    """The motor file's network again: `network`, a version of the whole motor as `configured` gave it, with what only
    the configurations of `motor` have."""
    later, there = _touched_later(motor), set(network.boundaries)
    boundaries = [b for b in motor.boundaries if b in there or b.name in later]
    added = [b for b in network.boundaries if b not in motor.boundaries]
    return replace(network, boundaries=(*boundaries, *added), configurations=motor.configurations)


def _touched_later(network: Network) -> set[str]:
    """The ends of the configurations' links."""
    return {end for one in network.configurations for link in one.links for end in (link.a, link.b)}


def _changed(network: Network, configuration: Configuration) -> Network:
    removed = set(configuration.remove)
    links = (link for link in network.links if not {link.a, link.b} & removed)
    sources = (source for source in network.sources if source.node not in removed)
    circuits = (_shortened(circuit, removed) for circuit in network.circuits)
    return replace(
        network,
        nodes=tuple(node for node in network.nodes if node.name not in removed),
        boundaries=tuple(boundary for boundary in network.boundaries if boundary.name not in removed),
        links=_merged(links, configuration.links, lambda link: frozenset((link.a, link.b))),
        sources=_merged(sources, configuration.sources, lambda source: source.node),
        circuits=tuple(circuit for circuit in circuits if circuit.nodes and circuit.inlet not in removed),
        configurations=(),
    )


def _shortened(circuit: FluidCircuit, removed: set[str]) -> FluidCircuit:
    return replace(circuit, nodes=tuple(node for node in circuit.nodes if node not in removed))


def _merged(old: Iterable[E], new: Iterable[E], place: Callable[[E], object]) -> tuple[E, ...]:
    """The old ones, each replaced by a new one of its place, then the other new ones."""
    found = {place(one): one for one in old}
    found.update((place(one), one) for one in new)
    return tuple(found.values())


def _without_untouched(network: Network, among: set[str]) -> Network:
    """Without those boundaries of `among` that no link and no circuit ends at."""
    touched = {end for link in network.links for end in (link.a, link.b)} | {c.inlet for c in network.circuits}
    kept = tuple(b for b in network.boundaries if b.name in touched or b.name not in among)
    return replace(network, boundaries=kept)
