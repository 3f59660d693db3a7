"""What a motor file says of nodes that no sensor follows, as if each had been read once.

Nothing that is measured keeps such a node near any temperature. Where a motor does what no law of its file can, a fit
would pay for a tenth of a kelvin at its sensors with a winding at 900 degC behind a path that hardly conducts. But a
file is about as right where no sensor sits as where one does, and its own run shows how right that is. So the node's
hottest moment by the file stands among the readings, with a standard deviation that is a share of its rise: `TIMES` of
what the file is off by at the hottest moments of its sensors, in root mean square over sensors and tests.

On 20 healthy motors, five forms with files by four rules, that ratio was 0.7 to 2.3, its median 1.3. A fit to the
readings alone was off by 4.1 K where no sensor sits, the file by 3.9 K, and the fit that supposes this by 3.6 K
(`benchmarks/unmeasured.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.fitting.model import Floats, Model
from twin.fitting.recorded import RecordedChannel, Test
from twin.motor.sensor import Sensor

TIMES = 1.25
LEAST_SHARE = 0.25  # of the rise: a file that happens to be right at its few sensors is no better than others elsewhere
LEAST_RISE_K = 10.0


def supposing(model: Model) -> Model:
    """The model, nodes that no sensor follows known as well as its file is at the sensors. Raises `DivergedError` where
    the file's own run leaves the finite numbers."""
    nodes, tests = model.network.nodes, model.tests
    followed = {node for test in tests for channel in test.channels for node in channel.sensor.weights}
    unknown = [i for i, node in enumerate(nodes) if node.name not in followed]
    if not unknown:
        return model
    as_file = Model(model.network, tests, ())
    runs = [as_file.course(number, np.zeros(0))[1] for number in range(len(tests))]
    share = max(LEAST_SHARE, TIMES * wrong_share(tests, [node.name for node in nodes], runs))
    supposed: list[list[RecordedChannel]] = [[] for _ in tests]
    for i in unknown:
        rises = [run[:, i] - test.coldest_degC for test, run in zip(tests, runs, strict=True)]
        hottest = max(range(len(tests)), key=lambda number: float(rises[number].max()))
        step = int(rises[hottest].argmax())
        sd = share * max(LEAST_RISE_K, float(rises[hottest][step]))
        supposed[hottest].append(_read_once(nodes[i].name, runs[hottest][:, i], step, sd))
    known = [replace(test, supposed=tuple(own)) for test, own in zip(tests, supposed, strict=True)]
    return Model(model.network, known, model.parameters, model.noise)


def wrong_share(tests: Sequence[Test], names: Sequence[str], runs: Sequence[Floats]) -> float:
    """What the file is off by at the hottest moment of each channel of each test, as a share of its rise there, in root
    mean square; `names` (n,) of the nodes, `runs`: of each test the file's temperatures (N, n) [degC]."""
    shares = []
    for test, run in zip(tests, runs, strict=True):
        for channel in test.channels:
            read = np.where(channel.samples > 0, channel.measured, -np.inf)
            step = int(read.argmax())
            if np.isfinite(read[step]):
                shown = run @ channel.sensor.over(names)
                off = float(shown[step] - read[step])
                shares.append(off / max(LEAST_RISE_K, float(shown[step]) - test.coldest_degC))
    return float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0


def _read_once(node: str, shown: Floats, step: int, sd: float) -> RecordedChannel:
    """A node as if it had been read in one step of a test."""
    samples = np.zeros(len(shown))
    samples[step] = 1.0
    return RecordedChannel(
        Sensor(f"{node} by the file", {node: 1.0}, noise=sd), shown, samples, np.full(len(shown), 0.5)
    )
