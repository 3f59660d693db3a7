"""Where no sensor sits: how wrong a motor file is there beside what it is at its sensors, and what a fit makes of it.

    python benchmarks/unmeasured.py [--motors N] [--first SEED] [--quick] [--json FILE]

Healthy motors of `tests/plant`; forms and rules take turns: 20 motors are every form with every rule once. `at sensors`
and `elsewhere`: what the file's own run is off by at the hottest moment of a channel, and of a node that no sensor
follows (sessions that are kept), as a share of the rise over the coldest boundary, rms; `ratio` of the two. Then the
mean error in kelvin at such nodes in kept sessions: of the file, of a fit to the readings alone, and of the fit as
every diagnosis begins, which supposes of these nodes what the file says (`twin.fitting.supposed`).
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.trial.campaigns import Course, driven, middles, read
from benchmarks.trial.cases import Case, cases
from benchmarks.trial.inside import error_K
from plant.forms import FORMS
from plant.rules import RULES
from twin.diagnosis.refined import calibrated, refined
from twin.differences.everyday import everyday
from twin.fitting.fit import NEAR_ENOUGH, fit
from twin.fitting.model import Model
from twin.fitting.recorded import Test
from twin.fitting.supposed import LEAST_RISE_K, wrong_share
from twin.motor.network import Network

QUICK_S = 120.0  # of each session


@dataclass(frozen=True)
class Motor:
    """Shares of the rise that the file is wrong by, rms, and mean errors where no sensor sits [K]."""

    motor: str
    at_sensors: float
    elsewhere: float
    file_K: float | None
    alone_K: float | None
    supposing_K: float | None

    @property
    def ratio(self) -> float:
        return self.elsewhere / self.at_sensors


def main() -> None:
    args = asked.parser(__doc__, motors=(20, 1), first=(5000, 5000)).parse_args()
    motors = [(form, rule) for form in FORMS for rule in RULES]
    found = []
    print(f"{'motor':36} at sensors  elsewhere  ratio    file K  readings alone  supposing")
    with threadpool_limits(1, user_api="blas"):
        for case in cases(args.first, args.motors, 0, 0, motors, "six"):
            found.append(measured(case, QUICK_S if args.quick else math.inf))
            print(line(found[-1]), flush=True)
    print("\n".join(summary(found)))
    asked.keep([asdict(one) | {"ratio": one.ratio} for one in found], args.json)


def measured(case: Case, longest_s: float) -> Motor:
    """One healthy motor, driven, read and fitted."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        behind = driven(replace(case, longest_s=longest_s), (), folder)
        campaign = read(folder)
    learnt, kept = campaign.tests[: behind.learnt], campaign.tests[behind.learnt :]
    network = campaign.network
    names = [node.name for node in network.nodes]
    as_file = Model(network, learnt, ())
    at_sensors = wrong_share(learnt, names, [as_file.course(s, np.zeros(0))[1] for s in range(len(learnt))])
    model = Model(network, learnt, everyday(network, learnt))
    begun = fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH)
    alone = refined(begun, campaign.candidates, model.parameters, quiet)
    fits = (None, alone, calibrated(model, campaign.candidates, quiet))
    errors = [error_K(one, network, kept, behind.nodes) for one in fits]
    return Motor(case.name, at_sensors, wrong_elsewhere(network, kept, behind.nodes), *errors)


def quiet(_: str) -> None:
    """Nobody waits for a fit to say where it is."""


def wrong_elsewhere(network: Network, kept: Sequence[Test], nodes: Sequence[Course]) -> float:
    """As `wrong_share`, of nodes that no sensor follows, by their true temperatures."""
    model, shares = Model(network, kept, ()), []
    for number, (test, truth) in enumerate(zip(kept, nodes, strict=True)):
        run = model.course(number, np.zeros(0))[1]
        followed = {node for channel in test.channels for node in channel.sensor.weights}
        t = middles(len(run) * test.frame.step_s, test.frame.step_s)
        for node, shown in zip(network.nodes, run.T, strict=True):
            if node.name not in followed:
                k = int(shown.argmax())
                true = np.interp(t[k], middles(len(truth[node.name])), truth[node.name])
                shares.append((shown[k] - true) / max(LEAST_RISE_K, shown[k] - test.coldest_degC))
    return float(np.sqrt(np.mean(np.square(shares))))


def line(one: Motor) -> str:
    errors = "".join(f"{'-' if e is None else f'{e:.1f}':>12}" for e in (one.file_K, one.alone_K, one.supposing_K))
    return f"{one.motor:36} {one.at_sensors:9.1%}  {one.elsewhere:9.1%}  {one.ratio:5.2f} {errors}"


def summary(found: Sequence[Motor]) -> list[str]:
    ratios = [one.ratio for one in found]
    means = [
        float(np.mean([e for e in errors if e is not None]))
        for errors in zip(*((one.file_K, one.alone_K, one.supposing_K) for one in found), strict=True)
    ]
    spread = f"{min(ratios):.1f} to {max(ratios):.1f}, median {np.median(ratios):.1f}"
    file, alone, supposed = (f"{mean:.1f}" for mean in means)
    return [
        f"ratio: {spread}, rms {np.sqrt(np.mean(np.square(ratios))):.1f}",
        f"where no sensor sits, mean: file {file}, readings alone {alone}, supposing {supposed} K",
    ]


if __name__ == "__main__":
    main()
