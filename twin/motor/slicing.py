"""A motor cut into slices along its stack: one lump becomes a row of lumps, with conduction along the row.

Capacities, losses, and all conductances between different parts are split so that their sums stay; the conduction
along a part is new, k V / L^2 for its whole length (V = C / (rho c) its volume, L the stack's length), or what the
file has between the halves of a part. So the sliced motor has a temperature profile along the stack that the lumped
one cannot have.

Cutting says nothing new of a value: priors of slices are independent, so each of n that add up has sqrt(n) times the
part's `sd`, and their sum (of links along a row, that of their resistances) is known as well as the part's own number
was, to first order in `sd`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from twin.errors import BadValueError, DuplicateError, Entry, UnknownNodeError
from twin.motor.check import meant
from twin.motor.network import Configuration, Link, Network, Node, Source, Term

# region -> conductivity along the shaft [W/(m K)], volumetric heat capacity [J/(m3 K)]; sheets conduct across their
# insulation only
MATERIAL: Mapping[str, tuple[float, float]] = {
    "copper": (390.0, 3.44e6),
    "iron": (4.0, 3.52e6),
    "rotor": (4.0, 3.52e6),
    "magnet": (9.0, 3.45e6),
    "housing": (160.0, 2.43e6),
}
_ENDS = ("a", "b")  # parts of a name that say the end of the motor


@dataclass(frozen=True)
class _Part:
    """A node in its row of slices: it takes those in `at`, which bear its `names` in order."""

    node: str
    at: range
    names: tuple[str, ...]

    def name(self, at: int) -> str:
        return self.names[at - self.at.start]


def sliced(network: Network, nodes: Sequence[str], slices: int, length_m: float) -> Network:
    """`nodes` cut into `slices` along the stack of `length_m` [m]; the middle slice of each keeps its node's name.

    Nodes that differ only in `_a` and `_b` are the two halves of one part, and share its slices. A neighbour that is
    not cut touches the first slice where its own name says `_a`, the last where it says `_b`, else all of them in
    equal parts. Rows that are neighbours touch slice by slice. A temperature factor follows the slice at the same
    place, else the middle one. Configurations remove every slice of what they remove, and what they put in the place
    of others is cut like these.

    Raises `UnknownNodeError` for a name that is no node, `BadValueError` for a number of slices that cannot be shared
    out, a length that is not above 0, a node of a circuit, or a region that has no conductivity along the shaft,
    `DuplicateError` for a name given twice.
    """
    _check(network, nodes, slices, length_m)
    rows = _rows(nodes)
    parts = {part.node: part for row in rows for part in _parts(row, slices)}
    links = [new for link in network.links for new in _links(link, parts)]
    along = [new for row in rows for new in _along(network, [parts[name] for name in row], slices, length_m)]
    halves = [[parts[name] for name in row] for row in rows if len(row) > 1]
    return replace(
        network,
        name=f"{network.name}_{slices}_slices",
        nodes=tuple(new for node in network.nodes for new in _cut(node, parts.get(node.name))),
        links=(*links, *along),
        sources=tuple(new for source in network.sources for new in _sources(source, parts)),
        configurations=tuple(_configuration(one, parts, halves, slices) for one in network.configurations),
    )


def _check(network: Network, nodes: Sequence[str], slices: int, length_m: float) -> None:
    known = {node.name: node for node in network.nodes}
    for i, name in enumerate(nodes):
        if name not in known:
            raise UnknownNodeError(
                Entry("node", i, name), f"{network.name} has no such node: {meant(name, list(known))}"
            )
        if name in nodes[:i]:
            raise DuplicateError(Entry("node", i, name), "it is to be cut twice: name it once")
        if known[name].region not in MATERIAL:
            says = f"of region {known[name].region} conducts nothing along the shaft: leave it whole"
            raise BadValueError(Entry("node", i, name), f"{says}, or give it one of {', '.join(MATERIAL)}")
        wet = next((circuit.name for circuit in network.circuits if name in circuit.nodes), None)
        if wet is not None:
            raise BadValueError(Entry("node", i, name), f"the fluid of circuit {wet} flows through it: leave it whole")
    most = max((len(row) for row in _rows(nodes)), default=1)
    if slices < 2 or slices % most:
        says = f"{slices} slices cannot be shared out: give 2 or more" + ", an even number as halves are among them" * (
            most > 1
        )
        raise BadValueError(Entry("motor", 0, network.name), says)
    if not length_m > 0:
        raise BadValueError(
            Entry("motor", 0, network.name), f"a stack of {length_m:g} m has no length: give that of the iron"
        )


def _end(name: str) -> str | None:
    """ "a" or "b" where the name says the end of the motor."""
    said = [word for word in name.split("_") if word in _ENDS]
    return said[-1] if said else None


def _rows(nodes: Sequence[str]) -> list[tuple[str, ...]]:
    """Parts of the stack from end a to end b: the halves of one part together."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for name in nodes:
        rows.setdefault(tuple("" if word in _ENDS else word for word in name.split("_")), []).append(name)
    return [tuple(sorted(row, key=lambda name: _end(name) or "")) for row in rows.values()]


def _parts(row: Sequence[str], slices: int) -> Iterator[_Part]:
    each = slices // len(row)
    for i, name in enumerate(row):
        names = tuple(name if k == each // 2 else f"{name}_{k + 1}" for k in range(each))
        yield _Part(name, range(i * each, (i + 1) * each), names)


def _sd(sd: float, count: int) -> float:
    """The sd of each of `count` independent parts of equal size whose sum has `sd`."""
    return round(sd * math.sqrt(count), 3)


def _shared(terms: Sequence[Term], count: int) -> tuple[Term, ...]:
    """The terms of each of `count` places side by side."""
    return tuple(replace(t, coefficient=t.coefficient / count, sd=_sd(t.sd, count)) for t in terms)


def _in_row(terms: Sequence[Term], count: int) -> tuple[Term, ...]:
    """The terms of each of `count` places in series."""
    return tuple(replace(t, coefficient=t.coefficient * count, sd=_sd(t.sd, count)) for t in terms)


def _following(terms: Sequence[Term], at: int, parts: Mapping[str, _Part]) -> tuple[Term, ...]:
    """The terms for slice `at`: a temperature factor of a cut node follows its slice there; where the node does not
    reach there, its middle slice, which keeps the name."""
    return tuple(
        replace(term, temperature=replace(term.temperature, node=parts[term.temperature.node].name(at)))
        if term.temperature and term.temperature.node in parts and at in parts[term.temperature.node].at
        else term
        for term in terms
    )


def _cut(node: Node, part: _Part | None) -> Iterator[Node]:
    if part is None:
        yield node
        return
    for name in part.names:
        count = len(part.names)
        slice_ = replace(node, name=name, capacity=node.capacity / count, sd=_sd(node.sd, count))
        yield replace(slice_, along=None, radius=None)


def _sources(source: Source, parts: Mapping[str, _Part]) -> Iterator[Source]:
    part = parts.get(source.node)
    if part is None:
        yield source
        return
    terms = _shared(source.terms, len(part.names))
    for at in part.at:
        yield replace(source, node=part.name(at), terms=_following(terms, at, parts))


def _links(link: Link, parts: Mapping[str, _Part]) -> Iterator[Link]:
    """What a link becomes between slices; nothing for the link between halves, which `_along` takes."""
    a, b = parts.get(link.a), parts.get(link.b)
    if a is None and b is None:
        yield link
    elif a is not None and b is not None:
        if not _halves(link):
            touching = [at for at in a.at if at in b.at] or [max(a.at.start, b.at.start)]
            for at in touching:
                ends = (a.name(at if at in a.at else a.at[-1]), b.name(at if at in b.at else b.at[-1]))
                terms = _following(_shared(link.terms, len(touching)), at, parts)
                yield replace(link, a=ends[0], b=ends[1], terms=terms)
    else:
        part, other = (a, link.b) if a is not None else (b, link.a)
        assert part is not None, "one of the two is cut"
        touching = {"a": [part.at[0]], "b": [part.at[-1]]}.get(_end(other) or "", list(part.at))
        for at in touching:
            ends = (part.name(at), other) if a is not None else (other, part.name(at))
            terms = _following(_shared(link.terms, len(touching)), at, parts)
            yield replace(link, a=ends[0], b=ends[1], terms=terms)


def _halves(link: Link) -> bool:
    return len(_rows((link.a, link.b))) == 1


def _along(network: Network, row: Sequence[_Part], slices: int, length_m: float) -> Iterator[Link]:
    """Links from slice to slice: the file's own between halves, whose middles are L / halves apart, else the
    material's."""
    own = _said(network.links, row, slices)
    if own:
        yield from own
        return
    nodes = [node for node in network.nodes if node.name in {part.node for part in row}]
    conductivity, heat = MATERIAL[nodes[0].region]
    volume = sum(node.capacity for node in nodes) / heat
    yield from _chain(row, _in_row((Term(conductivity * volume / length_m**2),), slices))


def _said(links: Sequence[Link], row: Sequence[_Part], slices: int) -> list[Link]:
    """What a link between the two halves of a part becomes along its row; nothing where there is none."""
    members = {part.node for part in row}
    own = next((link for link in links if {link.a, link.b} == members), None)
    return [] if own is None else list(_chain(row, _in_row(own.terms, slices // len(row))))


def _chain(row: Sequence[_Part], terms: tuple[Term, ...]) -> Iterator[Link]:
    names = [name for part in row for name in part.names]
    return (Link(one, other, terms) for one, other in itertools.pairwise(names))


def _configuration(
    one: Configuration, parts: Mapping[str, _Part], halves: Sequence[Sequence[_Part]], slices: int
) -> Configuration:
    return replace(
        one,
        remove=tuple(new for name in one.remove for new in (parts[name].names if name in parts else (name,))),
        links=(
            *(new for link in one.links for new in _links(link, parts)),
            *(new for row in halves for new in _said(one.links, row, slices)),
        ),
        sources=tuple(new for source in one.sources for new in _sources(source, parts)),
    )
