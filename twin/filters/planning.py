"""The plan of a filter's step (`twin.filters.plan`), made from a network, unknowns and readings as arrays."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import LaneStore, width
from twin.arithmetic.vectors import LANES
from twin.filters.plan import LawTable, Parts, Plan
from twin.motor.heat_laws import NUMBER
from twin.motor.network import NOBODY

Floats = NDArray[np.float64]


def plan(parts: Parts, boundaries: int, store: LaneStore) -> Plan:
    """The plan of a run's step among so many boundaries. `store` is given room for all that the step works on, and
    the numbers and indices that no step changes. The network's integrator has to have two stages and to end at the
    second, as the default does."""
    program, m, meters = parts.program, len(parts.weights), len(parts.signs)
    n, edges, heats, factors = program.n, len(program.edge_to), len(parts.heats), parts.unknown_factors
    share = float(program.stages[1, 0])
    assert program.stages.shape == (2, 2) and program.weights.tolist() == [share, 1.0], "it ends at its second stage"
    state = parts.state.tolist()
    lagging = [j for j in range(m) if state[j] >= 0]
    size = parts.sought + len(lagging)
    length = width(size + 1 + factors)
    amounts, terms, nominal = _amounts(parts)
    plain, rims, constants, others = _assembly(parts)
    monomial, group = np.nonzero(amounts[:-1])
    vary = list(zip(group.tolist(), monomial.tolist(), strict=True))
    changing = {g for g, _ in vary} | {g for g, _, _ in terms}
    fixed = [*parts.constant.tolist(), *[0.0] * (width(2 * n + 2 * edges + 1) - n)]
    fixed[n + 2 * edges] = -1.0
    always = amounts[-1].tolist()
    for g, aa, bb, ab, ba in (row for row in plain if row[0] not in changing):
        fixed[aa] += always[g]
        fixed[bb] += always[g]
        fixed[ab] -= always[g]
        fixed[ba] -= always[g]
    plain = [row for row in plain if row[0] in changing]
    driven, drive = _drives(parts, terms)
    drives = len(drive)
    bent = sorted({row[0] for row in others} | {row[1] for row in driven})
    order, edge_to = program.order.tolist(), (program.edge_to * length).tolist()
    rows = [length * i for i in range(max(size, n))]
    pivots = [rows[i] for i in order]
    backward = [range(int(b) - 1, int(a) - 1, -1) for a, b in itertools.pairwise(program.edge_start)]
    forward = _forward(parts, length)
    nodes = [np.flatnonzero(weights).tolist() for weights in parts.weights]
    first = list(itertools.accumulate([len(own) for own in nodes], initial=0))
    shares = np.array([-parts.weights[j, i] for j, own in enumerate(nodes) for i in own])
    lag = np.array([parts.lag[j] for j, own in enumerate(nodes) for _ in own]).reshape(-1, 3)
    reads = [[(rows[i], first[j] + k) for k, i in enumerate(nodes[j])] for j in lagging]
    lags = [rows[state[j]] for j in lagging]
    driven_rows = [((size + 1) % LANES + p) * length for p in range(factors)]

    def with_drives(stage: int) -> list[list[tuple[int, int]]]:
        """`forward`, and what the factors' rows drive into each node in this stage."""
        at: dict[int, list[tuple[int, int]]] = {}
        for (i, p), k in drive.items():
            at.setdefault(i, []).append((length * (n + heats + p), 2 * n + 2 * edges + 1 + stage * drives + k))
        return [[*own, *at.get(i, [])] for i, own in zip(order, forward, strict=True)]

    moved = store.rows(length, length)
    return Plan(
        laws=law_table(parts, boundaries, store),
        n=n,
        heats=heats,
        factors=factors,
        size=size,
        length=length,
        monomials=len(amounts) - 1,
        groups=amounts.shape[1],
        terms=len(terms),
        varied=len(vary),
        plains=len(plain),
        rims=len(rims),
        constants=len(constants),
        others=len(others),
        bents=len(bent),
        edges=edges,
        filled=len(fixed),
        drives=drives,
        channels=m,
        meters=meters,
        lagging=len(lagging),
        around=boundaries,
        unit=store.put(np.array([0.0, 1.0])),
        own=store.put(parts.constant),
        fixed=store.put(np.array(fixed)),
        inverse=store.put(1 / parts.constant),
        process=store.rows(1, size),
        own_begun=store.put(parts.constant * share),
        own_less=store.put(parts.constant * (share - 1.0)),
        more=store.put(np.array([1.0 / (share - 1.0)])),
        constant=store.put(amounts[-1]),
        by_monomial=store.put(amounts[monomial, group]),
        nominal=store.put(np.array(nominal)),
        node_share=store.put(shares),
        before=store.put(shares * lag[:, 1]),
        now=store.put(shares * lag[:, 2]),
        kept=store.put(np.append(1.0, parts.lag[:, 0])),
        signs=store.put(parts.signs),
        of_losses=store.put(parts.of_losses),
        features=store.rows(1, len(amounts)),
        amounts=store.rows(1, amounts.shape[1]),
        scale=store.rows(1, factors),
        values=store.rows(1, 2 * n + 2 * edges + 1 + 2 * drives),
        beyond=store.rows(2, n),
        stage=store.rows(n + heats + factors, length),
        state=store.rows(length, length),
        moved=moved,
        turned=store.rows(length, length),
        driven_rows=store.rows(width((size + 1) % LANES + factors), length),
        ahead=moved,
        row=store.index(range(0, length * length, length)),
        term=store.table(terms),
        vary=store.pairs(vary),
        plain=store.table(plain),
        rim=store.table(rims),
        constant_heat=store.table(constants),
        other=store.table(others),
        bent=store.index(bent),
        order=store.index(order),
        edge_start=store.index(program.edge_start.tolist()),
        update=store.index(program.update.tolist()),
        driven=store.table(driven),
        by_factor=store.pairs((row, p) for p, row in enumerate(driven_rows)),
        node_start=store.index(first),
        node=store.index([i for own in nodes for i in own]),
        channel_state=store.index(state),
        channel_bias=store.index(parts.bias.tolist()),
        forward=store.sweep(pivots, order, forward),
        driven_first=store.sweep(pivots, order, with_drives(0)),
        driven_second=store.sweep(pivots, order, with_drives(1)),
        backward=store.sweep(pivots[::-1], order[::-1], [[(edge_to[e], n + e) for e in own] for own in backward[::-1]]),
        unmoved=store.sweep(
            [*rows[n : parts.sought], *lags],
            [*[0] * (parts.sought - n), *(1 + j for j in lagging)],
            [*[[]] * (parts.sought - n), *reads],
        ),
        follow=store.sweep(lags, [0] * len(lags), reads),
    )


def law_table(parts: Parts, boundaries: int, store: LaneStore) -> LawTable:
    """The laws of a network among so many boundaries; `store` is given room for them."""
    total = len(parts.places)
    return LawTable(
        total=total,
        knots=(parts.numbers.shape[1] - 2) // 2,
        copper=store.put(parts.copper),
        numbers=store.put(parts.numbers),
        psi=store.rows(total, 4),
        temperatures=store.rows(1, parts.program.n + boundaries),
        places=store.table(parts.places.tolist()),
        each=store.index(range(total)),
    )


def _amounts(parts: Parts) -> tuple[Floats, list[tuple[int, int, int]], list[float]]:
    """What each monomial, and in the last row 1, adds to each group's amount (F + 1, G filled up), but for terms that
    an unknown factor multiplies; then those terms as rows of `Plan.term`, and their coefficients."""
    program, groups = parts.program, len(parts.places)
    amounts = np.zeros((int(program.term_monomial.max(initial=-1)) + 2, width(groups)))
    group, coefficient = np.repeat(np.arange(groups), np.diff(program.term_start)), program.term_coefficient
    factor, nominal = parts.factor_of[coefficient], parts.nominal[coefficient]
    fixed, free = np.flatnonzero(factor < 0), np.flatnonzero(factor >= 0)
    np.add.at(amounts, (program.term_monomial[fixed], group[fixed]), nominal[fixed])  # -1 is the last row
    terms = [(int(group[t]), int(factor[t]), int(program.term_monomial[t])) for t in free]
    return amounts, terms, nominal[free].tolist()


def _assembly(parts: Parts) -> tuple[list[list[int]], list[list[int]], list[list[int]], list[list[int]]]:
    """Every group as a row of `Plan.plain`, `rim`, `constant_heat` or `other`, by what it adds to of the step
    matrix."""
    n, edges = parts.program.n, len(parts.program.edge_to)
    right = n + 2 * edges + 1
    plain, rims, constants, others = [], [], [], []
    for g, (a, b, law, other, one_way, _) in enumerate(parts.places.tolist()):
        aa, bb, ab, ba, am, bm = parts.program.place[g].tolist()
        bent = other != NOBODY or law not in (NUMBER["linear"], NUMBER["source"])
        if b == NOBODY and not bent:
            constants.append([g, right + a])
        elif b >= n and not bent:
            rims.append([g, aa, right + a, b])
        elif not 0 <= b < n or one_way:
            others.append([g, aa, ab, am, -1, -1, -1, -1])
        elif bent:
            others.append([g, aa, ab, am, ba, bb, bm, right + b])
        else:
            plain.append([g, aa, bb, ab, ba])
    return plain, rims, constants, others


def _forward(parts: Parts, length: int) -> list[list[tuple[int, int]]]:
    """For each pivot in their order, pairs: where a stage's row begins that elimination takes from the pivot's, and
    the place in `values` of its share. Unknown heats are among the rows. Of the example: none; (0, 5); (16, 6) and
    (48, 7), row 48 the heat."""
    program = parts.program
    n, edges, order = program.n, len(program.edge_to), program.order.tolist()
    found: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    for p, i in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            found[int(program.edge_to[e])].append((i * length, n + edges + e))
    for o, node in enumerate(parts.heats.tolist()):
        found[node].append(((n + o) * length, n + 2 * edges))
    return [found[i] for i in order]


def _drives(
    parts: Parts, terms: Sequence[tuple[int, int, int]]
) -> tuple[list[tuple[int, int, int, int]], dict[tuple[int, int], int]]:
    """The terms that unknown factors multiply, as rows of `Plan.driven`; and for each pair of a node and a factor,
    which of a stage's drives it is."""
    where: dict[tuple[int, int], int] = {}
    driven = []
    for t, (g, p, _) in enumerate(terms):
        a, b, _, _, one_way, _ = parts.places[g].tolist()
        into = where.setdefault((a, p), len(where))
        out = where.setdefault((b, p), len(where)) if 0 <= b < parts.program.n and not one_way else -1
        driven.append((t, g, into, out))
    return driven, where
