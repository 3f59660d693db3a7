"""A real motor, each recording left out in turn: errors of the published network, recalibrated and with what was named,
beside two regressions; and its rotor from the stator's sensors alone.

    python benchmarks/real_motors.py [--data DIR] [--seven] [--left-out N] [--learn N] [--no-diagnosis] [--quick]
        [--json FILE]

The recordings of `examples/hust_motor`, or the `id_*.csv` of DIR, which the same bench and motor file describe
(`--seven`: those of `examples/hust_seven_nodes`, with all thermocouples at seven nodes); or the `profile_*.csv` of DIR,
recordings of LEA Paderborn's motor, each cut into sessions of half an hour, by the template of its four nodes as it
comes. The first N of them are left out in turn; each time all others (the first `--learn` of them)
are learnt from, by `whyhot diagnose` and by the regressions, and the one is judged, nothing fitted on it but the
measured start, against its readings as recorded. Errors are mean absolute, by node [K]; `inside` and `outside`: mean
over the nodes where speed and current were learnt from, and where not. Of the first motor `law first`: how often the
term named first is a cooling of the rotor that grows with speed, which is what the authors' code is known to lack; `law
named`: how often it is among those named.

`recurrent` is an echo state network, `boosted` gradient-boosted trees, left out without scikit-learn. `rotor sensed`:
error of the rotor by filter and smoother that read all other nodes, and by the open loop that begins as they do; and
how often the reading lies in the smoother's 95 % band. `--no-diagnosis`: regressions and the published network alone,
in minutes instead of an hour.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray

from benchmarks import asked
from benchmarks.real import boosted, echo_state
from benchmarks.real.errors import Errors, errors, outside
from benchmarks.real.left_out import Chosen, Regression, residuals
from benchmarks.real.motors import HUST, motor_of, session_of
from benchmarks.real.recordings import Recording, recordings
from benchmarks.real.virtual import Sensed, sensed
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.benches import with_bench_of
from replay.engine.files.models import for_intake
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis.as_recorded import as_recorded
from replay.studies.diagnosis.diagnose import diagnose
from replay.studies.diagnosis.extension import Version
from replay.studies.diagnosis.kept_sessions import node_of
from replay.studies.diagnosis.question import Question

SENSED = "rotor"  # what no sensor of a product reads
SENSED_BY = ("open_loop", "filter", "smoother", "coverage")  # what is said of it, of a `Sensed`

Floats = NDArray[np.float64]
Learn = Callable[[Sequence[Recording]], Regression]


@dataclass(frozen=True)
class LeftOut:
    """One recording left out: what was named without it, which share of it lies outside the trained points, its errors
    by way of saying temperatures, and the rotor sensed by version of the motor."""

    session: str
    named: list[str]
    outside_share: float
    errors: dict[str, Errors]
    rotor: dict[str, Sensed]


def main() -> None:
    line = asked.parser(__doc__, learn=(99, 2))
    line.add_argument("--data", metavar="DIR", type=Path, default=HUST)
    line.add_argument("--seven", action="store_true", help="by the file of seven nodes")
    line.add_argument("--left-out", metavar="N", type=int)
    line.add_argument("--no-diagnosis", action="store_true", help="the published network and the regressions alone")
    args = line.parse_args()
    found = []
    with (
        tempfile.TemporaryDirectory() as name,
        Store.open(Path(name) / "store", create=True, write=True) as store,
    ):
        motor = motor_of(args.data, Path(name), args.quick, args.seven)
        take_in(store, motor.logs, prepare(motor.logs, motor.bench, [], for_intake), Override())
        bench = Bench(store, [session_of(log) for log in motor.logs], not args.no_diagnosis)
        for one in bench.recordings[: args.left_out or (1 if args.quick else None)]:
            others = [other for other in bench.recordings if other is not one][: args.learn]
            found.append(bench.without(others, one))
            print(said(found[-1]), flush=True)
    print("\n".join([*table(found), *sensed_table(found), *(law(found, motor.law) if motor.law else ())]))
    if not find_spec("sklearn"):
        print("boosted is left out: it needs scikit-learn, `pip install -r requirements-bench.lock`")
    asked.keep([asdict(one) for one in found], args.json)


class Bench:
    """Stored recordings, and what is asked of each that is left out."""

    def __init__(self, store: Store, names: Sequence[str], diagnosis: bool) -> None:
        known = facts.at(store.ledger)
        sessions = [known.session(name) for name in names]
        self.store, self.diagnosis = store, diagnosis
        self.model = common_model(known, sessions)
        self.recordings = recordings(store, known, sessions, self.model)
        self.regressions: dict[str, Learn] = {"recurrent": Chosen(echo_state.learnt, echo_state.SIZES).of}
        if find_spec("sklearn"):
            import_module("sklearn.ensemble")  # now: threads are limited of what is loaded
            self.regressions["boosted"] = Chosen(boosted.learnt, boosted.SIZES).of

    def without(self, learnt: Sequence[Recording], one: Recording) -> LeftOut:
        """All ways of saying a recording's temperatures, learnt from others."""
        named, versions = self._versions(learnt, one)
        known = with_bench_of(facts.at(self.store.ledger), self.model)
        question = Question(self.store, known, [], [one.session], self.model, "testing")
        beyond = outside(one, learnt)
        found = {way: errors(replayed(question, version, one), beyond) for way, version in versions.items()}
        for way, learn in self.regressions.items():
            found[way] = errors(residuals(learn(learnt), one), beyond)
        rotor = {way: sensed(question, version, one.session, SENSED) for way, version in versions.items()}
        share = float(np.mean([blocks.mean() for blocks in beyond.values()]))
        return LeftOut(one.name, named, share, found, rotor)

    def _versions(self, learnt: Sequence[Recording], one: Recording) -> tuple[list[str], dict[str, Version]]:
        """What is named, and the versions of motor and bench file; without a diagnosis as published alone."""
        if not self.diagnosis:
            return [], {"published": Version(self.model, None)}
        train = [recording.session for recording in learnt]
        known = facts.at(self.store.ledger)
        chain = diagnose(self.store, known, train, [one.session], None, "testing").chain
        # a step that no file says has no model to replay
        said = [Version(step.model, step.bench, step.benches) for step in chain if step.model]
        versions = dict(zip(("published", "recalibrated", "extended"), (*said[:2], said[-1]), strict=True))
        return [step.id for step in chain if step.id], versions


def replayed(question: Question, version: Version, one: Recording) -> dict[str, Floats]:
    """Node -> the reading as recorded less the replay [K]."""
    ran = as_recorded(question, version, [one.session], [one.test])
    return {node_of(c): ran.residual[c.name] for c in one.test.channels}


def said(one: LeftOut) -> str:
    """A recording in one line."""
    means = ", ".join(f"{way} {_mean(found.mae):.2f}" for way, found in one.errors.items())
    return f"{one.session:12} {means} K; outside {100 * one.outside_share:.0f} %   {', '.join(one.named)}"


def table(found: Sequence[LeftOut]) -> list[str]:
    """Mean errors over the recordings, by node and by where they were driven."""
    ways = list(found[0].errors)
    every = {way: [one.errors[way] for one in found if way in one.errors] for way in ways}
    lines = ["".join(f"{name:>14}" for name in ("", *ways))]
    for node in found[0].errors[ways[0]].mae:
        lines.append(_row(node, [[e.mae[node] for e in every[way]] for way in ways]))
    lines.append(_row("mean", [[_mean(e.mae) for e in every[way]] for way in ways]))
    lines.append(_row("inside", [[e.inside for e in every[way] if e.inside is not None] for way in ways]))
    lines.append(_row("outside", [[e.outside for e in every[way] if e.outside is not None] for way in ways]))
    return lines


def _row(name: str, columns: Sequence[Sequence[float]]) -> str:
    return f"{name:>14}" + "".join(f"{np.mean(own):>14.2f}" if own else f"{'-':>14}" for own in columns)


def sensed_table(found: Sequence[LeftOut]) -> list[str]:
    """The rotor from the stator's sensors alone, mean over the recordings."""
    lines = [f"rotor sensed  {'open loop':>14}{'filter':>14}{'smoother':>14}{'in 95 % band':>14}"]
    for way in found[0].rotor:
        own = [one.rotor[way] for one in found if way in one.rotor]
        means = [np.mean([getattr(one, what) for one in own]) for what in SENSED_BY]
        lines.append(f"{way:>14}" + "".join(f"{mean:>14.2f}" for mean in means[:-1]) + f"{100 * means[-1]:>12.0f} %")
    return lines


def law(found: Sequence[LeftOut], known: str) -> list[str]:
    """How often the law is named that is known to be missing."""
    first = sum(one.named[:1] != [] and one.named[0].startswith(known) for one in found)
    named = sum(any(term.startswith(known) for term in one.named) for one in found)
    return [f"law first {first} of {len(found)}, law named {named} of {len(found)}"]


def _mean(errors: Mapping[str, float]) -> float:
    return float(np.mean(list(errors.values())))


if __name__ == "__main__":
    main()
