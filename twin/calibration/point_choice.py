"""What each test of a campaign teaches of a motor's coefficients and capacities, and in which order to run them.

Under a Gaussian prior the parameters' precision is Lambda + sum_s M_s, M_s the Fisher information of test s with what
the test brings along (start, sensor offsets) integrated out. D-optimal: the next test is the one with the largest gain
in ln det / 2, the information in nats (D. V. Lindley, Ann. Math. Statist. 27 (1956) 986, doi:10.1214/aoms/1177728069;
greedy choice is within 1 - 1/e of the best set: A. Krause et al., J. Mach. Learn. Res. 9 (2008) 235).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twin.calibration.influence import Influence
from twin.fitting.actions import Parameter
from twin.fitting.model import BROAD, Floats, Test
from twin.fitting.noise import ChannelNoise, Series, Whitening
from twin.fitting.recorded import RecordedChannel
from twin.motor.network import Network
from twin.run.block_columns import Thermometer, block_columns, of_motor


@dataclass(frozen=True)
class Choice:
    """One more test, in the order in which they teach most: `gain` [nats] that it adds to those before it; `known_K`
    (n,) [K], how uncertain each node still is once it is learnt from, by the parameters alone, root mean square over
    the drive."""

    test: int
    gain: float
    known_K: Floats


def information(network: Network, test: Test, noise: Mapping[str, ChannelNoise]) -> Floats:
    """Fisher information (P, P) of a test's thermometers on ln coefficients and ln capacities, in the order of
    `twin.calibration.calibrate.freedom`; `noise` by channel.

    Blocks are taken as they come: no test is too long. Raises `DivergedError` where the network's own run leaves the
    finite numbers.
    """
    places, values = of_motor(network)
    step_s, n, shared = test.frame.step_s, len(network.nodes), len(places)
    starts = [places[-1] + 1 + i for i in range(n)]
    offset = [c for c, channel in enumerate(test.channels) if channel.sensor.bias_sd]
    own_sd = np.array([*test.initial_sd, *(test.channels[c].sensor.bias_sd for c in offset)])
    total = shared + own_sd.size
    nodes = [node.name for node in network.nodes]
    read = [Thermometer(c.sensor.over(nodes), c.sensor.time_constant_s, c.blocks(step_s)) for c in test.channels]
    whitenings = [_whitening(c, one, step_s, noise, total) for c, one in zip(test.channels, read, strict=True)]
    gram, done = np.diag(np.concatenate([np.zeros(shared), own_sd**-2.0])), 0
    for some in block_columns(network, test.frame, test.initial, read, [*places, *starts]):
        columns = np.zeros((*some.shape[:2], total))
        columns[:, :, :shared] = some[:, :, :shared] * values
        columns[:, :, shared : shared + n] = some[:, :, shared:]
        columns[:, offset, shared + n + np.arange(len(offset))] = 1.0
        there = [one.blocks.there[done : done + len(some)] for one in read]
        rows = np.concatenate([whitenings[c](columns[there[c], c]) for c in range(len(read))])
        gram += rows.T @ rows
        done += len(some)
    own = slice(shared, None)
    return gram[:shared, :shared] - gram[:shared, own] @ np.linalg.solve(gram[own, own], gram[own, :shared])


def _whitening(
    channel: RecordedChannel, read: Thermometer, step_s: float, noise: Mapping[str, ChannelNoise], columns: int
) -> Whitening:
    times, samples = read.blocks.times_s(step_s), read.blocks.samples
    sensor = channel.sensor
    series = Series(0, sensor.name, times, np.zeros_like(times), samples, sensor.noise, sensor.resolution)
    return Whitening(series, noise.get(sensor.name, BROAD), columns)


def prior(parameters: Sequence[Parameter]) -> Floats:
    """Precision (P, P) of the parameters before anything is learnt."""
    return np.diag([p.sd**-2.0 for p in parameters])


def in_order(
    of_tests: Sequence[Floats], drive: Influence, known: Floats | None = None, hours: Sequence[float] | None = None
) -> list[Choice]:
    """The tests by what each adds to those before it, the best first (greedy), from the information (P, P) of each.

    `known` (P, P) is the precision that the first one begins with, where that is more than the prior. Where `hours`
    says how long each test takes, they are ordered by what they add an hour.
    """
    precision = prior(drive.parameters) if known is None else known
    left = list(range(len(of_tests)))
    chosen: list[tuple[int, float]] = []
    after: list[Floats] = []
    while left:
        gains = {s: gain_nats(precision, of_tests[s]) for s in left}
        best = max(gains, key=lambda s: gains[s] if hours is None else gains[s] / hours[s])
        precision = precision + of_tests[best]
        left.remove(best)
        chosen.append((best, gains[best]))
        after.append(precision)
    unknown_K = drive.unknown_K(after)
    return [Choice(test, gain, course) for (test, gain), course in zip(chosen, unknown_K, strict=True)]


def gain_nats(precision: Floats, more: Floats) -> float:
    """What `more` information adds to a `precision` (P, P) [nats]: ln det(precision + more) / 2 - ln det(precision) /
    2."""
    return float(np.linalg.slogdet(precision + more)[1] - np.linalg.slogdet(precision)[1]) / 2


def known_K(precision: Floats, drive: Influence) -> Floats:
    """Standard deviation of each node's temperature (n,) [K] under the parameters' `precision` (P, P), root mean square
    over the drive's blocks."""
    found: Floats = drive.unknown_K([precision])[0]
    return found
