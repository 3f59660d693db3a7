"""How often a hidden effect is named, and how often nothing is where nothing is hidden: motors of `tests/plant`, fresh
seeds.

    python benchmarks/trials.py [--healthy N] [--effects N] [--many N] [--first SEED] [--forms jacketed,weakened]
                                [--rules fitted,hand] [--layout six|ten] [--jobs N] [--cache FOLDER] [--quick]
                                [--json FILE]

A trial is one specimen of a form, with the motor file that one rule makes of it, its sessions written as BLF with
motor, bench and DBC files, ingested, and diagnosed. With one hidden effect or none it has two S1, one S2 and two WLTC,
the first S1, the S2 and a WLTC to learn from; every third effect is off the library. `--many`: three to five effects at
once in 5 to 12 sessions. Forms and rules are all that `plant.forms.FORMS` and `plant.rules.RULES` have, in turn;
`--rules seven_nodes,three_nodes` are crude files (`plant.crude`), with 8 to 12 sessions of many effects.

Sizes are scaled so that effects spread from hardly to clearly visible: with the catalogue's size a reference specimen
of the same form and rule (the seed before the first) has d, and the size is multiplied by wanted / d, at least 0.2 and
at most 6 times (factors: their logarithms, the factor within 0.2 to 5). How well each can be seen in its own motor is
told by its expected ln BF (`benchmarks/trial/visibility.py`), and rates are given by it.

Logs are kept in the cache folder, under the hash of the plant's sources, with the sizes as first scaled; results beside
them, one line each, in a file of their own for each hash of the twin's sources, thresholds included: a run that was
interrupted goes on where it stopped. Held, stuck, saturated and lost readings are masked before anything is named and
are no part of this; nor are causes that need an ageing dose or a second session of a kind.
"""

from __future__ import annotations

import functools
import hashlib
import math
import sys
import tempfile
from argparse import ArgumentTypeError, Namespace
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import asdict, replace
from multiprocessing import get_context
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.trial import rates
from benchmarks.trial.answers import Result, read_results, written
from benchmarks.trial.cases import Case, cases
from benchmarks.trial.one import RunsAway, trial
from benchmarks.trial.sizes import read_strengths, sized, strengths, write_strengths
from plant import Effect
from plant.forms import FORMS
from plant.rules import CRUDE, RULES
from replay.cli.progress import tell
from replay.engine.runs.sources import code_of

QUICK_S = 120.0  # of each session


def main() -> None:
    """Run what is missing, print and write the rates."""
    parser = asked.parser(__doc__, healthy=(60, 0), effects=(120, 0), many=(60, 1), first=(1000, 1007), jobs=(1, 1))
    parser.add_argument("--forms", metavar="NAMES", type=functools.partial(some_of, FORMS), default=list(FORMS))
    parser.add_argument(
        "--rules", metavar="NAMES", type=functools.partial(some_of, (*RULES, *CRUDE)), default=list(RULES)
    )
    parser.add_argument("--layout", choices=("six", "ten"), default="six")
    parser.add_argument("--cache", metavar="FOLDER", type=Path, default=Path(tempfile.gettempdir()) / "whyhot-trials")
    args = parser.parse_args()
    if args.quick:
        with tempfile.TemporaryDirectory() as fresh:
            run(args, Path(fresh), QUICK_S)
    else:
        run(args, args.cache, math.inf)


def some_of(known: Collection[str], text: str) -> list[str]:
    """The names in a text with commas between them."""
    names = text.split(",")
    if not set(names) <= set(known):
        raise ArgumentTypeError(f"{text}: choose from {', '.join(known)}")
    return names


def run(args: Namespace, cache: Path, longest_s: float) -> None:
    """What is asked, of drives that end after `longest_s`."""
    code, logs = code_of("replay.studies.diagnosis.diagnose")[:12], cache / plant_code()
    path = logs / f"results-{code}.jsonl"
    done = {r.case: r for r in read_results(path)}
    motors = [(form, rule) for form in args.forms for rule in args.rules]
    drawn = cases(args.first, args.healthy, args.effects, args.many, motors, args.layout)
    wanted = [replace(case, longest_s=longest_s) for case in drawn]
    missing = [case for case in wanted if case not in done]
    logs.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(args.jobs, get_context("spawn"), initializer=_alone) as pool:
        try:
            for result in answered(missing, args.first, logs, pool):
                done[result.case] = result
                written(path, result)
                print(line(result), flush=True)
        finally:
            pool.shutdown(cancel_futures=True)
    report([done[case] for case in wanted if case in done], args, code)


def answered(missing: Sequence[Case], first: int, logs: Path, pool: Executor) -> Iterator[Result]:
    """The results of these cases as they come."""
    hidden = sizes(missing, first, logs, pool)
    begun = [pool.submit(trial, case, hidden[case], logs / case.name) for case in missing]
    done = as_completed(begun)
    for number in range(1, len(begun) + 1):
        tell(f"trial {number} of {len(begun)}")
        future = next(done)
        tell("")
        try:
            yield future.result()
        except RunsAway as error:
            print(f"left out: {error}", flush=True)


def _alone() -> None:
    threadpool_limits(1, user_api="blas")  # the matrices are small: more threads only wait for each other


def plant_code() -> str:
    """The hash of the sources that make the logs."""
    sha = hashlib.sha256()
    sources = [*(HERE.parent / "tests" / "plant").glob("*.py"), HERE / "trial" / "campaigns.py"]
    for source in sorted(sources):
        sha.update(source.name.encode() + source.read_bytes())
    return sha.hexdigest()[:12]


def sizes(missing: Sequence[Case], first: int, logs: Path, pool: Executor) -> dict[Case, list[Effect]]:
    """What each case hides; the reference of a form and rule is asked for the causes that it was not asked for
    before."""
    references = {c: Case(first - 1, c.layout, c.form, c.rule, longest_s=c.longest_s) for c in missing}
    asked_for: defaultdict[Case, set[str]] = defaultdict(set)
    for case, reference in references.items():
        asked_for[reference] |= {hidden.cause for hidden in case.hidden}
    paths = {reference: logs / f"d_{reference.name}.json" for reference in asked_for}
    known = {reference: read_strengths(path) for reference, path in paths.items()}
    new = {r: sorted(causes - known[r].keys()) for r, causes in asked_for.items() if causes - known[r].keys()}
    for reference, found in zip(new, pool.map(strengths, new, new.values()), strict=True):
        print(f"{reference.name}: sizes of {', '.join(found)}", flush=True)
        known[reference] |= found
        write_strengths(paths[reference], known[reference])
    return {case: [sized(hidden, known[references[case]]) for hidden in case.hidden] for case in missing}


def line(result: Result) -> str:
    """A trial in one line, the expected ln BF of what it hides in brackets."""
    visible = ["-" if one.log_bf is None else f"{one.log_bf:.1f}" for one in result.hidden]
    verdict = "" if result.case.kind == "many" else f"{result.verdict} "
    said = result.failed or f"{verdict}{', '.join(result.told) or 'silent'}"
    return f"{result.case.name} [{', '.join(visible)}]: {said} ({result.seconds:.0f} s)"


def report(results: Sequence[Result], args: Namespace, code: str) -> None:
    """Print and write all rates."""
    singles = rates.singles(results)
    tables = [rates.singles_table(singles), rates.many_table(results), rates.gains_table(results)]
    tables += [rates.by_entry_table(results), rates.reliability_table(rates.stated_of(results))]
    tables += [rates.by_what_hides_table(results), rates.lost_table(results), rates.crudeness_table(results)]
    tables += [rates.beyond_usual_table(results), rates.audit_table(results)]
    print("\n\n".join("\n".join(table) for table in tables))
    audits = {form: {name: asdict(one) for name, one in own.items()} for form, own in rates.audits(results).items()}
    found: dict[str, object] = {"singles": singles, "many": rates.many(results), "gains": rates.gains(results)}
    found |= {"entered": rates.by_entry(results), "reliability": rates.reliability(rates.stated_of(results))}
    found |= {"by what hides": rates.by_what_hides(results)}
    found |= {"lost": rates.lost_causes(results), "audits": audits}
    asked.keep({"twin": code, "first": args.first, "layout": args.layout, **found}, args.json)


if __name__ == "__main__":
    main()
