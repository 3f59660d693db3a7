"""A motor file from the thermal matrices that Motor-CAD exports.

They are texts of one name, cells between semicolons: `.cmf` heat capacities [J/K], `.pmf` losses [W], `.tmf` the fixed
temperatures [degC] (-1e7 of a node that is free), `.rmf` thermal resistances [K/W] (very large where there is no
link), `.nmf` the nodes of each group. Node 0 is the ambient. So public programs read them: examples/links/
thermal_twinbuilder.py of github.com/ansys/pymotorcad, and ThermalInterface.m of
github.com/mathworks/import-motorcad-thermal-simulink.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ingest.texts.names import each_once
from replay.engine.files.motor_file import SCHEMA
from replay.engine.files.toml_edit import as_text
from replay.errors import MotorFileError

LABEL = re.compile(r"\s*(\d+)\s*\((.*)\)\s*")  # 12 (Housing [Active])
FREE_degC = -1e7
NO_LINK = 1e8  # K/W
ALIKE = 0.01  # relative: both directions of a link, and the resistances along a circuit
MASSLESS = 1e-6  # J/K
FLUID_CAPACITY = 1.0  # J/K of a fluid node without one: seconds, where a circuit carries some 100 W/K
DENSITY = 1000.0  # of the fluid in the file: only its product with the heat capacity is known

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Matrices:
    """N nodes, the ambient first: names, capacities [J/K], losses [W], which are fixed in temperature, and the
    conductances [W/K]. `stream[i, j]`: what fluid carries, the one of two directions that the file has."""

    names: tuple[str, ...]
    groups: Mapping[str, str]  # name -> group
    capacity: Values
    loss: Values
    fixed: NDArray[np.bool_]
    link: Values  # (N, N), symmetric
    stream: Values  # (N, N), symmetric


def is_matrices(path: Path) -> bool:
    """Whether the name is one of an export of matrices."""
    return path.suffix.lower() in (".rmf", ".cmf", ".pmf", ".tmf", ".nmf")


def motor_of(path: Path, flows_lpm: Sequence[float]) -> str:
    """The motor file of the matrices of which `path` is one; `flows_lpm`: of each circuit in the export [l/min].

    Raises MotorFileError where they are missing, do not fit each other, or hold what no motor file says.
    """
    found = _without_massless(_read(path))
    circuits = _circuits(found, path)
    if len(flows_lpm) != len(circuits) or not all(flow > 0 for flow in flows_lpm):
        named = ", ".join(name for name, _ in circuits)
        raise MotorFileError(
            f"{path.name}: fluid flows through {named}, and the matrices do not say how much: give the volume flow "
            "of each in the export [l/min], in this order, with --flow-lpm."
            if circuits
            else f"{path.name}: no fluid flows through its nodes: take --flow-lpm away."
        )
    says = (
        f"# From the thermal matrices {path.stem}.rmf, .cmf, .pmf, .tmf of Motor-CAD. Conductances and losses are\n"
        "# those of the operating point of the export: give them their features (current, speed, flow, map)."
    )
    scale = f"\n\n[scale]\nflow_lpm = {max(flows_lpm):g}" if circuits else ""
    head = f'schema = "{SCHEMA}"\nname = "{re.sub(r"[^A-Za-z0-9_.-]", "-", path.stem)}"\n{says}{scale}'
    return "\n\n".join([head, *_entries(found, circuits, flows_lpm)]) + "\n"


# ---- the files -------------------------------------------------------------------------------------------------------


def _read(path: Path) -> Matrices:
    fixed = _vector(path, ".tmf")
    numbers, titles = list(fixed), [title for title, _ in fixed.values()]
    names = _named(titles)
    capacity, loss = ({n: value for n, (_, value) in _vector(path, end).items()} for end in (".cmf", ".pmf"))
    if lacking := [titles[i] for i, n in enumerate(numbers) if n and n not in capacity]:
        raise MotorFileError(f"{path.stem}.cmf: has no capacity of {lacking[0]}: export the matrices again.")
    resistance = _square(path, len(numbers))
    linked = (resistance < NO_LINK) & ~np.eye(len(numbers), dtype=bool)
    if (resistance[linked] <= 0).any():
        raise MotorFileError(f"{path.stem}.rmf: holds resistances of 0 or below between nodes: export it again.")
    both = linked & linked.T
    if (uneven := np.argwhere(both & (np.abs(resistance - resistance.T) > ALIKE * resistance))).size:
        a, b = (titles[i] for i in uneven[0])
        raise MotorFileError(f"{path.stem}.rmf: {a} and {b} have another resistance in each direction: no link has.")
    g = np.where(linked, 1 / np.where(linked, resistance, 1.0), 0.0)
    groups = {names[numbers.index(n)]: group for n, group in _groups(path).items() if n in numbers}
    return Matrices(
        names=names,
        groups=groups,
        capacity=np.array([capacity.get(n, 0.0) for n in numbers]),
        loss=np.array([loss.get(n, 0.0) for n in numbers]),
        fixed=np.array([n == 0 or degC > FREE_degC for n, (_, degC) in fixed.items()]),
        link=np.where(both, (g + g.T) / 2, 0.0),
        stream=np.where(linked ^ linked.T, g + g.T, 0.0),
    )


def _lines(path: Path, end: str) -> list[list[str]]:
    file = path.with_suffix(end)
    try:
        text = file.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise MotorFileError(
            f"{file}: cannot be read: {error.strerror}. Motor-CAD exports it with the others."
        ) from None
    return [[cell.strip() for cell in line.split(";")] for line in text.splitlines()]


def _vector(path: Path, end: str) -> dict[int, tuple[str, float]]:
    """Number of each node -> (name, value)."""
    rows = {}
    for label, *cells in _lines(path, end):
        if (match := LABEL.fullmatch(label)) and cells:
            rows[int(match[1])] = (match[2].strip(), _number(cells[0], path.stem + end))
    if not rows:
        raise MotorFileError(f'{path.stem}{end}: holds no lines as "12 (Housing);345.6": export it with semicolons.')
    return rows


def _square(path: Path, count: int) -> Values:
    rows = [cells[1 : count + 1] for cells in _lines(path, ".rmf") if LABEL.fullmatch(cells[0]) and len(cells) > count]
    if len(rows) != count:
        raise MotorFileError(f"{path.stem}.rmf: holds {len(rows)} rows of {count} nodes: export the matrices again.")
    return np.array([[_number(cell, f"{path.stem}.rmf") for cell in row] for row in rows])


def _number(cell: str, file: str) -> float:
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        raise MotorFileError(f'{file}: "{cell[:40]}" is not a number: export it again.') from None


def _groups(path: Path) -> dict[int, str]:
    """Number of each node -> its group, where the file of groups is there."""
    group, groups = "", {}
    for cells in _lines(path, ".nmf") if path.with_suffix(".nmf").is_file() else []:
        if cells[0].startswith("["):
            group = cells[0].strip("[]")
        elif match := LABEL.fullmatch(cells[0]):
            groups[int(match[1])] = group
    return groups


def _plain(title: str) -> str:
    """`Housing [Active]` -> `housing_active`."""
    name = "_".join(re.findall(r"[a-z0-9]+", title.casefold()))
    return name if name[:1].isalpha() else f"node_{name}".rstrip("_")


def _named(titles: Sequence[str]) -> tuple[str, ...]:
    """Each title as a name of a motor file, once."""
    return each_once([_plain(title) for title in titles])


# ---- the network -----------------------------------------------------------------------------------------------------


def _without_massless(found: Matrices) -> Matrices:
    """The same network without nodes that hold no heat: what flows between their neighbours, and their losses, stay."""
    link, loss = found.link.copy(), found.loss.copy()
    empty = ~found.fixed & (found.capacity < MASSLESS) & ~found.stream.any(axis=1)
    for node in np.flatnonzero(empty).tolist():
        g = link[node].copy()
        if g.any():
            link += np.outer(g, g) / g.sum()
            loss += loss[node] * g / g.sum()
        link[node, :] = link[:, node] = 0.0
        np.fill_diagonal(link, 0.0)
    kept = np.flatnonzero(~empty & (found.fixed | link.any(axis=1) | found.stream.any(axis=1)))
    square = np.ix_(kept, kept)
    return Matrices(
        tuple(found.names[i] for i in kept.tolist()),
        found.groups,
        found.capacity[kept],
        loss[kept],
        found.fixed[kept],
        link[square],
        found.stream[square],
    )


def _circuits(found: Matrices, path: Path) -> list[tuple[str, list[int]]]:
    """(name, inlet and nodes in the order of the flow) of each circuit: fluid comes from where temperature is fixed."""
    circuits: list[tuple[str, list[int]]] = []
    seen = set[int]()
    for inlet in np.flatnonzero(found.fixed & found.stream.any(axis=1)).tolist():
        for first in np.flatnonzero(found.stream[inlet]).tolist():
            way = _way(found, inlet, first)
            g = [found.stream[a, b] for a, b in pairwise(way)]
            if way == [] or seen.intersection(way[1:]) or max(g) > (1 + ALIKE) * min(g):
                raise MotorFileError(
                    f"{path.stem}.rmf: the flow from {found.names[inlet]} splits or comes together at "
                    f"{found.names[first]} or behind it: a circuit of a motor file flows from node to node."
                )
            seen.update(way[1:])
            circuits.append((found.groups.get(found.names[first]) or found.names[inlet], way))
    left = set(np.flatnonzero(found.stream.any(axis=1) & ~found.fixed).tolist()) - seen
    if left:
        raise MotorFileError(
            f"{path.stem}.rmf: nothing says where the fluid of {found.names[min(left)]} comes from: no node on its way "
            "has a fixed temperature."
        )
    return [(name, way) for name, (_, way) in zip(_named([title for title, _ in circuits]), circuits, strict=True)]


def _way(found: Matrices, inlet: int, first: int) -> list[int]:
    """The nodes from an inlet on, until the fluid leaves; none where it splits."""
    way = [inlet, first]
    while True:
        onward = [one for one in np.flatnonzero(found.stream[way[-1]]).tolist() if one != way[-2]]
        if not onward:
            return way
        if len(onward) > 1 or onward[0] in way:
            return []
        way += onward


def _entries(found: Matrices, circuits: Sequence[tuple[str, list[int]]], flows_lpm: Sequence[float]) -> Iterator[str]:
    for name, fixed in zip(found.names, found.fixed.tolist(), strict=True):
        if fixed:
            yield as_text("boundary", {"name": name})
    for name, fixed, capacity in zip(found.names, found.fixed.tolist(), found.capacity.tolist(), strict=True):
        if not fixed:
            yield as_text("node", {"name": name, "capacity": capacity if capacity >= MASSLESS else FLUID_CAPACITY})
    for a, b in np.argwhere(np.triu(found.link)).tolist():
        if not found.fixed[[a, b]].all():
            terms = [{"coefficient": float(found.link[a, b])}]
            yield as_text("link", {"between": [found.names[a], found.names[b]], "terms": terms})
    for name, fixed, loss in zip(found.names, found.fixed.tolist(), found.loss.tolist(), strict=True):
        if loss and not fixed:
            yield as_text("source", {"node": name, "terms": [{"coefficient": loss}]})
    for (name, (inlet, *nodes)), flow_lpm in zip(circuits, flows_lpm, strict=True):
        heat_capacity = float(found.stream[inlet, nodes[0]]) / (DENSITY * flow_lpm / 60_000)
        yield as_text(
            "circuit",
            {
                "name": name,
                "inlet": found.names[inlet],
                "nodes": [found.names[node] for node in nodes],
                "fluid": {"density": DENSITY, "heat_capacity": heat_capacity},
                "flow": "flow" if len(circuits) == 1 else f"flow_{name}",
            },
        )
