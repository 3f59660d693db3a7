"""How far a motor's uncertain coefficients and capacities may move the temperature of each node over recorded tests.

The paper's sensitivities (its section 3.1): the exact derivative of every node's temperature by every parameter's
logarithm, here times the parameter's prior standard deviation, so that a well-known loss and a guessed film are
measured with one scale. All are sums over blocks of 10 s, taken as the blocks come (`twin.run.block_columns`): no test
is too long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dtrmm

from twin.calibration.calibrate import freedom
from twin.fitting.actions import Parameter
from twin.fitting.model import Floats, Test
from twin.motor.network import Network
from twin.run.block_columns import block_columns, of_every_node, of_motor

ROWS = 256  # that are multiplied with the parameters' covariance at a time


@dataclass(frozen=True)
class Influence:
    """How far each of the motor's `parameters` (P,) moves each node of `network` over `tests`: `per_sd_K` (P, n) [K] by
    one prior standard deviation, root mean square over all blocks of the tests."""

    network: Network
    tests: tuple[Test, ...]
    parameters: tuple[Parameter, ...]
    per_sd_K: Floats

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes."""
        return tuple(node.name for node in self.network.nodes)

    def order(self, nodes: Sequence[int]) -> list[int]:
        """Places of all parameters; first the one that moves any of these nodes most."""
        return [int(i) for i in np.argsort(-self.per_sd_K[:, list(nodes)].max(axis=1), kind="stable")]

    def unknown_K(self, precisions: Sequence[Floats]) -> Floats:
        """Standard deviation of each node's temperature (K, n) [K], root mean square over all blocks of the tests,
        under each of K precisions (P, P) of the parameters; the tests are run once for all of them."""
        roots = [np.linalg.cholesky(np.linalg.inv(precision)) for precision in precisions]

        def squares(rows: Floats) -> Floats:
            total = np.zeros((len(roots), rows.shape[1]))
            at_once = max(1, ROWS // rows.shape[1])
            for first in range(0, len(rows), at_once):
                some = rows[first : first + at_once]
                for own, root in zip(total, roots, strict=True):
                    moved = dtrmm(1.0, root.T, some.reshape(-1, len(root)).T)  # a triangle: half of a product
                    own += np.einsum("pi,pi->i", moved, moved).reshape(some.shape[:2]).sum(axis=0)
            return total

        return np.sqrt(_mean(self.network, self.tests, squares))


def influence(network: Network, tests: Sequence[Test]) -> Influence:
    """The influence of every coefficient and capacity on every node. Raises `DivergedError` where the network's own run
    leaves the finite numbers."""
    parameters = freedom(network, ())
    sd = np.array([p.sd for p in parameters])
    square = _mean(network, tests, lambda rows: np.einsum("bnp,bnp->pn", rows, rows))
    return Influence(network, tuple(tests), parameters, np.sqrt(square) * sd[:, None])


def columns(network: Network, test: Test) -> Iterator[Floats]:
    """The derivative of each node's temperature in each block by each ln parameter [K], some blocks at a time (b, n,
    P)."""
    places, values = of_motor(network)
    every = of_every_node(network, test.frame)
    return (some * values for some in block_columns(network, test.frame, test.initial, every, places))


def _mean(network: Network, tests: Sequence[Test], of: Callable[[Floats], Floats]) -> Floats:
    """Mean over all blocks of all tests of what `of` sums over some of them; two tests are run at a time."""

    def summed(test: Test) -> tuple[Floats, int]:
        total, count = np.zeros(()), 0
        for some in columns(network, test):
            total, count = total + of(some), count + len(some)
        return total, count

    with ThreadPoolExecutor(2) as pool:
        totals, counts = zip(*pool.map(summed, tests), strict=True)
    mean: Floats = np.sum(totals, axis=0) / sum(counts)
    return mean
