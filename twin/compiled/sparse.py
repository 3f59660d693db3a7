"""Symbolic LU factorisation without pivoting, once a network: the order of elimination and what it fills in.

The step matrix `C / (gamma h) + L` of a thermal network is an M-matrix (positive diagonal, other entries not positive,
diagonally dominant), so elimination along the diagonal is stable in any order (Golub & Van Loan, Matrix Computations,
4th ed., section 3.4.10 and 4.1.1); the minimum degree order keeps the fill small (A. George, J. W. H. Liu, SIAM Review
31, 1989, doi:10.1137/1031001). Values may be unsymmetric, the pattern is kept symmetric.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Pattern:
    """`order`: nodes as they are eliminated. `later[p]`: the nodes after p that row and column p touch, in the same
    order."""

    order: tuple[int, ...]
    later: tuple[tuple[int, ...], ...]


def factorise(n: int, edges: Iterable[tuple[int, int]]) -> Pattern:
    """Minimum degree order (ties: the lower index) of `n` nodes with couplings `edges`, and the filled pattern."""
    neighbours: list[set[int]] = [set() for _ in range(n)]
    for a, b in edges:
        if a != b:
            neighbours[a].add(b)
            neighbours[b].add(a)
    order: list[int] = []
    touched: list[set[int]] = [set() for _ in range(n)]
    remaining = set(range(n))
    while remaining:
        pivot = min(remaining, key=lambda i: (len(neighbours[i]), i))
        order.append(pivot)
        remaining.remove(pivot)
        touched[pivot] = neighbours[pivot]
        for i in touched[pivot]:
            neighbours[i] |= touched[pivot]
            neighbours[i] -= {i, pivot}
    rank = {node: position for position, node in enumerate(order)}
    return Pattern(tuple(order), tuple(tuple(sorted(row, key=rank.__getitem__)) for row in touched))
