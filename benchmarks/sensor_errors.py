"""What a calibration says of the sensors, against the plant's own gains and biases: healthy motors of `tests/plant`.

    python benchmarks/sensor_errors.py [--motors N] [--first SEED] [--quick] [--json FILE]

Forms and rules take turns: 20 motors are every form with every rule once. Each is fitted as every diagnosis begins, on
the three sessions that a trial learns from. `z` is (fitted - own) / posterior sd of each channel's gain, and of its
bias in each session; `ratio` is the sum of fitted times own over that of own squared: 1 where all of it is found, 0
where none is. `as recorded` is the rms of the plant's own errors, `less fitted` of what would be left of them if all
that is fitted were taken off. `written`: how many errors of a whole channel the bench file does take off, and
`corrected` what is left then: no correction may leave more than there was.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.trial.campaigns import LEARNT, drive_of, logged, read
from benchmarks.trial.cases import Case, cases
from benchmarks.trial.visibility import healthy_mode
from plant import Plant
from plant.forms import FORMS
from plant.rules import RULES
from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.expressible import expressible, readings
from twin.fitting import actions
from twin.fitting.fit import Fit
from twin.motor.sensor_laws import Bias, Gain, Misreading

Floats = NDArray[np.float64]

LEARN = 3  # sessions, as a trial of a healthy motor
QUICK_S = 120.0  # of each session
LAWS: Sequence[type[Misreading]] = (Gain, Bias)  # as the plant's own errors stand
PRINTED = {"gain": (100.0, "%"), "bias": (1.0, "K")}  # unit
Own = Sequence[Mapping[str, tuple[float, float]]]  # of each session: channel -> gain and bias


@dataclass(frozen=True)
class Learnt:
    """An error of a sensor, a bias that of one session: the plant's `own`, the `fitted` one and its posterior `sd`, and
    what the bench file would take off, 0 where that says nothing of it."""

    motor: str
    channel: str
    law: str
    own: float
    fitted: float
    sd: float
    written: float

    @property
    def z(self) -> float:
        return (self.fitted - self.own) / self.sd


def main() -> None:
    args = asked.parser(__doc__, motors=(20, 1), first=(4000, 4000)).parse_args()
    motors = [(form, rule) for form in FORMS for rule in RULES]
    found: list[Learnt] = []
    with threadpool_limits(1, user_api="blas"):
        for case in cases(args.first, args.motors, 0, 0, motors, "six"):
            found += of_motor(case, QUICK_S if args.quick else math.inf)
            print(f"{case.name}: worst z {max(abs(one.z) for one in found if one.motor == case.name):.1f}", flush=True)
    print("\n".join(table(found)))
    asked.keep([asdict(one) for one in found], args.json)


def of_motor(case: Case, longest_s: float) -> list[Learnt]:
    """What the fit of a healthy motor says of its sensors."""
    plant = Plant(case.seed, form=FORMS[case.form])
    plan = [drive_of(plant, session, number).first(longest_s) for number, session in enumerate(LEARNT[:LEARN])]
    with tempfile.TemporaryDirectory() as name:
        own = [recording.errors for recording in logged(Path(name), case, plant, plan)]
        campaign = read(Path(name))
    mode = healthy_mode(campaign)
    return list(learnt(case.name, mode, own, _written(mode, campaign)))


def _written(mode: Fit, campaign: Campaign) -> Mapping[actions.OnBench, float]:
    """What a bench file with this fit would take off."""
    inputs = {channel.bus for channel in campaign.inputs}
    driving = {channel.name for channel in campaign.observed if channel.bus in inputs}
    return readings(mode, expressible(mode, (), driving), ()).errors


def learnt(motor: str, mode: Fit, own: Own, written: Mapping[actions.OnBench, float]) -> Iterator[Learnt]:
    """Every gain and bias of a fit beside the plant's own."""
    for parameter, fitted, variance in zip(mode.model.parameters, mode.beta, mode.covariance_diagonal, strict=True):
        for at, law in enumerate(LAWS):
            if isinstance(parameter.action, law):
                channel = parameter.action.channel
                true = own[parameter.test or 0][channel][at]
                taken = written.get(parameter.action, 0.0)
                yield Learnt(motor, channel, law.law, true, float(fitted), float(variance**0.5), taken)


def table(found: Sequence[Learnt]) -> list[str]:
    names = ("values", "z rms", "z mean", "z worst", "ratio", "as recorded", "less fitted", "written", "corrected")
    lines = ["".join(f"{name:>12}" for name in ("", *names))]
    for law, (factor, unit) in PRINTED.items():
        chosen = [one for one in found if one.law == law]
        keys = ("z", "own", "fitted", "written")
        z, own, fitted, written = (np.array([getattr(one, key) for one in chosen]) for key in keys)
        ratio = float(fitted @ own / (own @ own))
        channels = len({(one.motor, one.channel) for one in chosen if one.written})
        said = [f"{len(chosen)}", f"{_rms(z):.2f}", f"{z.mean():+.2f}", f"{np.abs(z).max():.1f}", f"{ratio:.2f}"]
        recorded, less, left = (f"{factor * _rms(off):.3f} {unit}" for off in (own, own - fitted, own - written))
        lines.append("".join(f"{cell:>12}" for cell in (law, *said, recorded, less, f"{channels}", left)))
    return lines


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    main()
