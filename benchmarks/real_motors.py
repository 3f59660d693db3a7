"""A real motor, each recording left out in turn: errors of the published network, recalibrated and with what was named.

    python benchmarks/real_motors.py [--data DIR] [--left-out N] [--learn N] [--quick] [--json FILE]

The recordings of `examples/hust_motor`, or the `id_*.csv` of DIR, which the same bench and motor file describe. The
first N of them are left out in turn; each time all others (the first `--learn` of them) are learnt from, by `whyhot
diagnose`, and the one is replayed, nothing fitted on it, against its readings as recorded. Errors are mean absolute, by
node [K]. `law first`: how often the term named first is a cooling of the rotor that grows with speed, which is what the
authors' code is known to lack; `law named`: how often it is among those named.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np

from benchmarks import asked
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.models import for_intake
from replay.studies.diagnosis.answer import ChainStep, Diagnosis
from replay.studies.diagnosis.diagnose import diagnose

MOTOR = HERE.parent / "examples" / "hust_motor"
LAW = "conductance.stator-rotor.speed"
QUICK = ("id_1", "id_9", "id_10")  # the shortest


@dataclass(frozen=True)
class LeftOut:
    """One recording left out: what was named without it, and its errors by node [K]."""

    session: str
    named: list[str]
    published: dict[str, float]
    recalibrated: dict[str, float]
    extended: dict[str, float]


def main() -> None:
    line = asked.parser(__doc__, learn=(99, 2))
    line.add_argument("--data", metavar="DIR", type=Path, default=MOTOR)
    line.add_argument("--left-out", metavar="N", type=int)
    args = line.parse_args()
    logs = [log for log in recordings(args.data) if not args.quick or _name(log) in QUICK]
    found = []
    with tempfile.TemporaryDirectory() as name:
        with Store.open(Path(name) / "store", create=True, write=True) as store:
            take_in(store, logs, prepare(logs, MOTOR / "bench.toml", [], for_intake), Override())
        names = [_name(log) for log in logs]
        for one in names[: args.left_out or (1 if args.quick else None)]:
            others = [other for other in names if other != one][: args.learn]
            found.append(without(Path(name) / "store", others, one))
            print(said(found[-1]), flush=True)
    print("\n".join(table(found)))
    asked.keep([asdict(one) for one in found], args.json)


def recordings(folder: Path) -> list[Path]:
    """The logs of a folder, by their numbers."""
    return sorted(folder.glob("id_*.csv*"), key=lambda log: int(_name(log).removeprefix("id_")))


def _name(log: Path) -> str:
    return log.name.split(".")[0]


def without(folder: Path, learn: Sequence[str], left_out: str) -> LeftOut:
    """A diagnosis of some recordings, measured on another."""
    with Store.open(folder, write=True) as store:
        known = facts.at(store.ledger)
        train = [known.session(name) for name in learn]
        found = diagnose(store, known, train, [known.session(left_out)], None, "testing").diagnosis
    return of(found, left_out)


def of(found: Diagnosis, left_out: str) -> LeftOut:
    """What a diagnosis says of the recording that it kept."""
    published, recalibrated, *terms = found.chain
    last: ChainStep = terms[-1] if terms else recalibrated
    errors = [step.kept_mae_K for step in (published, recalibrated, last)]
    return LeftOut(left_out, [step.id for step in terms if step.id], *errors)


def said(one: LeftOut) -> str:
    """A recording in one line."""
    means = " -> ".join(f"{_mean(errors):.2f}" for errors in _stages(one))
    return f"{one.session:6} {means} K   {', '.join(one.named) or 'nothing named'}"


def table(found: Sequence[LeftOut]) -> list[str]:
    """Mean errors over the recordings, by node, and how often the law is named."""
    nodes = list(found[0].published)
    lines = ["".join(f"{name:>14}" for name in ("", "published", "recalibrated", "extended"))]
    for node in nodes:
        means = [np.mean([errors[node] for errors in stage]) for stage in zip(*map(_stages, found), strict=True)]
        lines.append(f"{node:>14}" + "".join(f"{mean:>14.2f}" for mean in means))
    means = [np.mean([_mean(errors) for errors in stage]) for stage in zip(*map(_stages, found), strict=True)]
    lines.append(f"{'mean':>14}" + "".join(f"{mean:>14.2f}" for mean in means))
    first = sum(one.named[:1] != [] and one.named[0].startswith(LAW) for one in found)
    named = sum(any(term.startswith(LAW) for term in one.named) for one in found)
    return [*lines, f"law first {first} of {len(found)}, law named {named} of {len(found)}"]


def _stages(one: LeftOut) -> Iterator[dict[str, float]]:
    yield from (one.published, one.recalibrated, one.extended)


def _mean(errors: dict[str, float]) -> float:
    return float(np.mean(list(errors.values())))


if __name__ == "__main__":
    main()
