"""What each test of a campaign teaches of a motor's coefficients and capacities, and in which order to run them.

Under a Gaussian prior the parameters' precision is Lambda + sum_s M_s, M_s the Fisher information of test s with what the test
brings along (start, sensor offsets) integrated out. D-optimal: the next test is the one with the largest gain in
ln det / 2, the information in nats (D. V. Lindley, Ann. Math. Statist. 27 (1956) 986, doi:10.1214/aoms/1177728069; greedy
choice is within 1 - 1/e of the best set: A. Krause et al., J. Mach. Learn. Res. 9 (2008) 235).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.actions import Parameter
from twin.calibration import freedom
from twin.influence import Influence
from twin.model import Model, Test
from twin.network import Network
from twin.noise import ChannelNoise

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Choice:
    """One more test, in the order in which they teach most. `gain`: nats that it adds to those before it; `known_K` (n,): root mean square over the
    drive by which each node is still uncertain once it is learnt from, by the parameters alone."""

    test: int
    gain: float
    known_K: Floats


def information(network: Network, test: Test, noise: Mapping[str, ChannelNoise]) -> Floats:
    """Fisher information (P, P) of a test on ln coefficients and ln capacities, in the order of `twin.calibration.freedom`."""
    parameters = freedom(network, [test])
    model = Model(network, [test], parameters, noise)
    shared = len(freedom(network, ()))
    gram = np.diag(np.concatenate([np.zeros(shared), model.sd[shared:] ** -2.0]))
    for part in model.linearise(np.zeros(len(parameters))):
        white = model.whitened(part.series, part.columns)
        gram[np.ix_(part.at, part.at)] += white.T @ white
    own = slice(shared, None)
    found: Floats = gram[:shared, :shared] - gram[:shared, own] @ np.linalg.solve(gram[own, own], gram[own, :shared])
    return found


def prior(parameters: Sequence[Parameter]) -> Floats:
    """Precision (P, P) before anything is learnt."""
    return np.diag([p.sd**-2.0 for p in parameters])


def in_order(of_tests: Sequence[Floats], drive: Influence) -> list[Choice]:
    """The tests, greedily by what each adds to those before it."""
    precision = prior(drive.parameters)
    left, chosen = list(range(len(of_tests))), []
    while left:
        gains = {s: gain_nats(precision, of_tests[s]) for s in left}
        best = max(gains, key=lambda s: gains[s])
        precision = precision + of_tests[best]
        left.remove(best)
        chosen.append(Choice(best, gains[best], known_K(precision, drive)))
    return chosen


def gain_nats(precision: Floats, more: Floats) -> float:
    """ln det(precision + more) / 2 - ln det(precision) / 2."""
    return float(np.linalg.slogdet(precision + more)[1] - np.linalg.slogdet(precision)[1]) / 2


def known_K(precision: Floats, drive: Influence) -> Floats:
    """(n,) [K]: root mean square over the drive's blocks of each node's standard deviation under the parameters' precision."""
    factor = np.linalg.cholesky(np.linalg.inv(precision))
    return np.array(
        [np.sqrt(((drive.columns[:, i] @ factor) ** 2).sum(axis=1).mean()) for i in range(len(drive.nodes))]
    )
