"""Where the numbers of a run of the paper's filter are (`twin.paper.ekf_step`), and their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import LaneStore, Sweep, width, within
from twin.filters.plan import LawTable, Parts
from twin.filters.planning import law_table

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Rates(NamedTuple):
    """How many there are of what a run works on, and where it begins in the run's numbers or indices
    (`twin.arithmetic.lanes`). A table has one row behind the other; comments show a row for the motor of
    `twin.filters.plan`, whose P_y is of S_y = 7 numbers y, that state's own."""

    laws: LawTable
    n: int
    heats: int
    unknown: int  # numbers of rho: heats, factors, errors of channels
    size: int  # S_y
    length: int  # of a row
    edges: int  # E
    entries: int  # of Q_z
    cells: int  # rows of `cell`: entries of Q_z first, then those of Q_rho
    channels: int
    meters: int
    multiplied: int  # P, pieces of laws that one factor multiplies
    driven: int  # entries of -Q_rho that are of factors
    around: int  # boundaries
    # Numbers, by where they begin.
    unit: int  # 0, 1
    own: int  # (n,) 2 C / h [W/K]
    amounts: int  # (L,) of each law, factors included
    terms: int  # (P,) amounts of the pieces that factors multiply
    heat: int  # (n,) into the capacitors [W], and a number for what no node takes, which nobody reads
    # -Q_z at the edge of P_y, placed as in `values`; a number for what has no place, which nobody reads; -Q_rho, the
    # unknown heats' first; then -1 and -2 C / h. Then what lagging readings take.
    # Of the motor: 7 of -Q_z, 1, 3 of -Q_rho, 4 and more.
    slopes: int
    values: int  # 2 C / h - Q_z, eliminated: n diagonals, E entries above it, E below
    right: int  # (S_y,)
    after: int  # what lagging readings take of the temperatures after a step, sign changed
    noise: int  # S_y rows: covariance of what a step adds to its right-hand side
    signs: int  # (q, L)
    of_losses: int  # (q,)
    shares: int  # (m + q rows) of each reading, sign changed
    state: int  # [P_y | y]
    moved: int
    turned: int
    ahead: int  # [P_y | y] as predicted
    # Indices, by where they begin.
    row: int  # 0, 8, 16 ...: where each row of [P_y | y] begins
    order: int
    edge_start: int
    edge_to: int
    update: int
    into: int  # (laws, 8) a, b, then aa, ab, am, ba, bb, bm in `slopes`; 7 is read by nobody: 0, 1, 0, 3, 7, 5, 1, 7
    node: int  # (heats,)
    term: int  # (P, 4) law, factor, and where in `slopes` its heat goes into a and comes out of b: 0, 0, 9, 10
    cell: int  # (cells, 3) place in `slopes`, node and number of y. Of the unknown heat: 8, 2, 3
    taken: int  # (m + q, S_y) pairs for each reading: where a row begins that it takes, and which share
    number: int  # (m + q,) how many pairs each has
    reach: Sweep  # the right-hand side of a step: what each of its rows takes of the rows of P_y
    forward: Sweep  # elimination, forward
    backward: Sweep  # and backward
    follow: Sweep  # lagging readings with the temperatures after a step


@within
def share_at(rates: Rates, q: int, i: int) -> np.uint64:
    """The place of the share that reading q takes of number i of y."""
    return u(rates.shares + q * rates.length + i)


@within
def term_of(rates: Rates, at: Index, t: int) -> tuple[int, int, int, int]:
    """Of a piece that an unknown factor multiplies: its law, the factor, and where in `slopes` its heat goes into a
    and comes out of b."""
    row = rates.term + 4 * t
    return at[u(row)], at[u(row + 1)], at[u(row + 2)], at[u(row + 3)]


@within
def into_of(rates: Rates, at: Index, g: int) -> tuple[int, int, int, int, int, int, int, int]:
    """Of law g: the nodes a and b, and the places of aa, ab, am, ba, bb, bm in `slopes`."""
    row = rates.into + 8 * g
    a, b, aa, ab = at[u(row)], at[u(row + 1)], at[u(row + 2)], at[u(row + 3)]
    return a, b, aa, ab, at[u(row + 4)], at[u(row + 5)], at[u(row + 6)], at[u(row + 7)]


@within
def cell_of(rates: Rates, at: Index, c: int) -> tuple[int, int, int]:
    """An entry of Q_z, or behind these of Q_rho: its place in `slopes`, the node, and the number of y."""
    row = rates.cell + 3 * c
    return at[u(row)], at[u(row + 1)], at[u(row + 2)]


def shares_of(parts: Parts, monomials: int) -> tuple[Floats, list[tuple[int, int]]]:
    """What each of F monomials, and in the last row 1, adds to amounts (F + 1, L + P): first to that of each law,
    without what factors multiply, then to the P pieces of laws that a factor multiplies. And which law and which
    factor each piece is of."""
    program, laws = parts.program, len(parts.places)
    law = np.repeat(np.arange(laws), np.diff(program.term_start)).tolist()
    factor = parts.factor_of[program.term_coefficient].tolist()
    multiplied = sorted({(g, p) for g, p in zip(law, factor, strict=True) if p >= 0})
    where = {term: laws + t for t, term in enumerate(multiplied)}
    column = np.array([where.get(term, term[0]) for term in zip(law, factor, strict=True)])
    found = np.zeros((monomials + 1, laws + len(multiplied)))
    np.add.at(found, (program.term_monomial, column), parts.nominal[program.term_coefficient])  # -1 is the last row
    return found, multiplied


def rates_of(
    parts: Parts,
    multiplied: Sequence[tuple[int, int]],
    capacities: Floats,
    boundaries: int,
    step_s: float,
    store: LaneStore,
) -> Rates:
    """The places of a run among so many boundaries; `store` is given room for it. `multiplied` as in `shares_of`."""
    program, m, meters = parts.program, len(parts.weights), len(parts.signs)
    n, edges, heats, o = program.n, len(program.edge_to), len(parts.heats), parts.sought - program.n
    lagging = np.flatnonzero(parts.state >= 0).tolist()
    size = n + o + len(lagging)
    length = width(size + 1)
    order, own = program.order.tolist(), 2 * capacities / step_s
    where = {i: (i, i) for i in range(n)}
    forward: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    backward: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    for p, i in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            j = int(program.edge_to[e])
            where[n + e], where[n + edges + e] = (i, j), (j, i)
            forward[j].append((i * length, n + edges + e))
            backward[i].insert(0, (j * length, n + e))
    used = sorted({*range(n), *(int(e) for e in program.place.ravel() if 0 <= e < n + 2 * edges)})
    fixed = [-1.0, *(-own)]  # behind the slopes
    nobody = n + 2 * edges
    drive = {(node, k): nobody + 1 + k for k, node in enumerate(parts.heats.tolist())}
    terms = []
    into = []
    for (a, b, _, _, one_way, _), places in zip(parts.places.tolist(), program.place.tolist(), strict=True):
        aa, bb, ab, ba, am, bm = (e if 0 <= e < nobody else nobody for e in places)
        both = 0 <= b < n and not one_way
        into.append([a, b, aa, ab, am, ba, bb, bm] if both else [a, n, aa, ab, am, nobody, nobody, nobody])
    for g, p in multiplied:
        a, b = into[g][:2]
        goes = drive.setdefault((a, heats + p), nobody + 1 + len(drive))
        comes = drive.setdefault((b, heats + p), nobody + 1 + len(drive)) if b < n else nobody
        terms.append([g, p, goes, comes])
    one = nobody + 1 + len(drive)
    cells = [[e, *where[e]] for e in used] + [[e, i, n + k] for (i, k), e in drive.items()]
    takes: list[list[tuple[int, int]]] = [[(i * length, one + 1 + i)] for i in range(n)]
    for e, i, j in cells:
        takes[i].append((j * length, e))
    takes += [[((n + k) * length, one)] for k in range(o)]
    by_noise = np.zeros((size, n + o))
    by_noise[:n, :n], by_noise[n : n + o, n:] = np.diag(own), np.eye(o)
    after: list[float] = []
    follows = []
    for k, j in enumerate(lagging):
        kept, before, now = parts.lag[j].tolist()
        nodes = np.flatnonzero(parts.weights[j]).tolist()
        takes.append(
            [
                ((n + o + k) * length, one + len(fixed)),
                *((i * length, one + len(fixed) + 1 + q) for q, i in enumerate(nodes)),
            ]
        )
        fixed += [-kept, *(-before * parts.weights[j, nodes])]
        follows.append([(i * length, len(after) + q) for q, i in enumerate(nodes)])
        after += (-now * parts.weights[j, nodes]).tolist()
        by_noise[n + o + k, :n] = -now * parts.weights[j]
    noise = np.zeros((length, length))
    noise[:size, :size] = (by_noise * parts.process[: n + o]) @ by_noise.T
    rows = [i * length for i in range(size)]
    pivots = [rows[i] for i in order]
    values = store.rows(1, nobody + 1)
    slopes = store.put(np.concatenate([np.zeros(nobody + 1), -np.ones(heats), np.zeros(len(drive) - heats), fixed]))
    for (i, k), e in drive.items():
        forward[i].append(((n + k) * length, slopes - values + e))
    return Rates(
        laws=law_table(parts, boundaries, store),
        n=n,
        heats=heats,
        unknown=o,
        size=size,
        length=length,
        edges=edges,
        entries=len(used),
        cells=len(cells),
        channels=m,
        meters=meters,
        multiplied=len(terms),
        driven=len(drive) - heats,
        around=boundaries,
        unit=store.put(np.array([0.0, 1.0])),
        own=store.put(own),
        amounts=store.rows(1, len(parts.places)),
        terms=store.rows(1, len(terms)),
        heat=store.rows(1, n + 1),
        slopes=slopes,
        values=values,
        right=store.rows(1, size),
        after=store.put(np.array(after)),
        noise=store.put(noise),
        signs=store.put(parts.signs),
        of_losses=store.put(parts.of_losses),
        shares=store.rows(m + meters, length),
        state=store.rows(length, length),
        moved=store.rows(length, length),
        turned=store.rows(length, length),
        ahead=store.rows(length, length),
        row=store.index(range(0, length * length, length)),
        order=store.index(order),
        edge_start=store.index(program.edge_start.tolist()),
        edge_to=store.index(program.edge_to.tolist()),
        update=store.index(program.update.tolist()),
        into=store.table(into),
        node=store.index(parts.heats.tolist()),
        term=store.table(terms),
        cell=store.table(cells),
        taken=store.index([0] * ((m + meters) * size)),
        number=store.index([0] * (m + meters)),
        reach=store.sweep(rows, [0] * size, takes),
        forward=store.sweep(pivots, [0] * n, [forward[i] for i in order]),
        backward=store.sweep(pivots[::-1], order[::-1], [backward[i] for i in order[::-1]]),
        follow=store.sweep(rows[n + o :], [0] * len(lagging), follows),
    )
