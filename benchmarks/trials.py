"""How often a hidden effect is named, and how often nothing is where nothing is hidden: motors of `tests/plant`, fresh
seeds.

    python benchmarks/trials.py [--healthy N] [--effects N] [--first SEED] [--layout six|ten] [--cache FOLDER] [--quick]
                                [--json FILE]

A trial is one specimen with two S1, one S2 and two WLTC sessions, written as BLF with motor, bench and DBC files,
ingested, and diagnosed from the first S1, the S2 and the first WLTC; the other two are kept. Every third effect is off
the library.

Sizes are scaled so that d_true spreads from 2 to 20: with the catalogue's size a reference specimen (the seed before
the first) has d_ref, and the size is multiplied by wanted / d_ref, at least 0.2 and at most 6 times (factors: their
logarithms, the factor within 0.2 to 5). The bins are by the d_true of the trial itself: |v'P x| / sqrt(v'P v), v the
whitened column of the true cause at the calibrated fit and x what the effect does to the readings without noise, on the
same drives; sqrt(x'P x) off the library; the size times sqrt(v'P v) where it acts on a reading, a clock or an input.
Swaps have no size and no d_true.

Campaigns are kept in the cache folder, one file each, and results beside them, one line each: a run that was
interrupted goes on where it stopped. Results of other code have another file: its name holds the hash of the twin's
sources, thresholds included. Held, stuck, saturated and lost readings are masked before anything is named and are no
part of this; nor are causes that need an ageing dose or a second session of a kind.
"""

from __future__ import annotations

import functools
import json
import math
import pickle
import sys
import tempfile
import time
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta
from threadpoolctl import threadpool_limits

from benchmarks import asked
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from plant import CATALOGUE, Effect, Plant, drives, points, write_campaign
from plant.drives import Drive
from plant.plant import Truth
from plant.sensors import LAG_s, lagged, record, sensors
from plant.thermocouples import Sensor
from replay.engine.files.models import for_intake
from replay.engine.runs.sources import code_of
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis import question
from replay.studies.diagnosis.search import find
from twin.diagnosis.naming import Naming, search
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.swaps import scan
from twin.diagnosis.told_apart import told_apart
from twin.differences.candidates import Candidate
from twin.differences.everyday import everyday
from twin.differences.proposals import Proposals
from twin.errors import DivergedError
from twin.fitting.fit import Fit
from twin.fitting.model import Model, Test
from twin.motor.network import Network

Floats = NDArray[np.float64]

LEARNT = 3  # sessions, the rest is kept
EFFECT_SEEDS = 500  # after the first seed, those of the effects begin
OFF_LIBRARY_EVERY = 3
QUICK_S = 180.0  # of each session
WANTED = (2.0, 4.0, 7.0, 12.0, 20.0)  # d_true
LEAST_SCALE, MOST_SCALE = 0.2, 6.0
LEAST_FACTOR, MOST_FACTOR = 0.2, 5.0
FACTORS = ("unknown.liner_gap", "unknown.vapour")  # besides every `scale`: sizes that do nothing at 1
HALVINGS = 4
MASKED = ("hold", "stuck", "dropout", "saturation")
READ_WRONG = ("sensor", "clock", "input", "boundary")
BINS = ((0.0, 3.0), (3.0, 5.0), (5.0, 10.0), (10.0, float("inf")))
BOUND = 0.95  # of each Clopper-Pearson bound by itself


# --- Trials -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A specimen and what it hides: a cause at a size that would give the reference `wanted`, or nothing. Its drives
    end after `longest_s` at the latest."""

    seed: int
    layout: str
    cause: str = ""
    wanted: float = 0.0
    longest_s: float = math.inf

    @property
    def name(self) -> str:
        return f"{self.seed}_{self.layout}" + (f"_{self.cause}_{self.wanted:g}" if self.cause else "")


def cases(first: int, healthy: int, effects: int, layout: str) -> list[Case]:
    """Healthy specimens and effects in turn."""
    inside = [h.cause for h in CATALOGUE if not h.cause.startswith("unknown.") and _can_be_seen(h.cause)]
    outside = [h.cause for h in CATALOGUE if h.cause.startswith("unknown.")]
    hidden = []
    for i in range(effects):
        turn, rest = divmod(i, OFF_LIBRARY_EVERY)
        known = turn * (OFF_LIBRARY_EVERY - 1) + rest
        cause = outside[turn % len(outside)] if rest == OFF_LIBRARY_EVERY - 1 else inside[known * 7 % len(inside)]
        hidden.append(Case(first + EFFECT_SEEDS + i, layout, cause, WANTED[(i + i // len(WANTED)) % len(WANTED)]))
    silent = [Case(first + i, layout) for i in range(healthy)]
    both = [case for pair in zip(silent, hidden, strict=False) for case in pair]
    return both + silent[len(hidden) :] + hidden[len(silent) :]


def _can_be_seen(cause: str) -> bool:
    law = cause.rsplit(".", 1)[1]
    return not cause.startswith("ageing.") and law != "session" and law not in MASKED


def _either_way(cause: str) -> tuple[str, frozenset[str], str]:
    """Kind, place and law; the plant writes the ends of a link in another order than the motor file."""
    kind, place, law = [*cause.split(".", 2), "", ""][:3]
    return kind, frozenset(place.split("-")), law


def scaled(effect: Effect, by: float) -> Effect:
    """The effect `by` times as large, on the logarithm where its size is a factor."""
    if effect.law == "scale" or effect.cause in FACTORS:
        return Effect(effect.cause, float(np.clip(effect.size**by, LEAST_FACTOR, MOST_FACTOR)))
    return Effect(effect.cause, effect.size * by)


# --- Campaigns --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Campaign:
    """What a diagnosis is given, the hidden `size`, and what the effect does to the readings without noise: for each
    session, signal -> (N,) K at the steps of its test."""

    network: Network
    tests: tuple[Test, ...]
    candidates: tuple[Candidate, ...]
    size: float
    moved: tuple[dict[str, Floats], ...]


def made(case: Case, effect: Effect | None) -> Campaign:
    """Run, record, write and ingest a specimen with this effect."""
    plant, layout = Plant(case.seed, effect) if effect else Plant(case.seed), case.layout
    plan = planned(plant, case.longest_s)
    truths = [plant.run(drive, number) for number, drive in enumerate(plan)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = write_campaign(folder, plant, [record(plant, truth, layout) for truth in truths], layout=layout)
        setup = prepare(logs, folder / "bench.toml", [folder / "bench.dbc"], for_intake)
        with Store.open(folder / "store", create=True) as store:
            take_in(store, logs, setup, Override())
            known = facts.at(store.ledger)
            sessions = [known.session(log.stem) for log in logs]
            model = common_model(known, sessions)
            read = question.campaign_of(question.Question(store, known, sessions, [], model, "testing"))
    moved = moved_by(plant, plan, layout, read.tests) if effect and effect.kind not in READ_WRONG else ()
    return Campaign(read.network, read.tests, read.candidates, effect.size if effect else 0.0, moved)


def planned(plant: Plant, longest_s: float) -> list[Drive]:
    """The drives of a campaign; points are found on the plant itself."""
    learnt = [points.s1(plant, 6000.0, 30.0, 0), points.s2(plant, 8000.0, 20.0, 1), drives.wltp(1)]
    every = [*learnt, points.s1(plant, 9000.0, 20.0, 3), drives.wltp(1)]
    return [drive.first(longest_s) for drive in every]


def moved_by(plant: Plant, plan: Sequence[Drive], layout: str, tests: Sequence[Test]) -> tuple[dict[str, Floats], ...]:
    """What the effect of a plant does to the readings of the sessions that are learnt from, on the same drives."""
    healthy = Plant(plant.seed)
    return tuple(
        difference(healthy.run(drive, number), plant.run(drive, number), plant, layout, test)
        for number, (drive, test) in enumerate(zip(plan[:LEARNT], tests, strict=False))
    )


def difference(without: Truth, with_it: Truth, plant: Plant, layout: str, test: Test) -> dict[str, Floats]:
    """Signal -> (N,) K: readings with the effect less those without, at the middle of each step."""
    middle = np.arange(len(test.frame.features), dtype=np.float64) * test.frame.step_s + test.frame.step_s / 2
    return {
        sensor.signal: _reading(with_it, plant, sensor, middle) - _reading(without, plant, sensor, middle)
        for sensor in sensors(layout)
    }


def _reading(truth: Truth, plant: Plant, sensor: Sensor, t_s: Floats) -> Floats:
    """What a sensor placed as designed reads, without noise."""
    marks = {"m": plant.mesh.axial // 2, "e": plant.mesh.axial - 1}
    cells = np.array([plant.mesh.index[stem.format(**marks)] for stem, _ in sensor.cells], np.intp)
    place = truth.at(cells, np.array([weight for _, weight in sensor.cells]))
    reading: Floats = np.interp(t_s, truth.t_s, lagged(place, LAG_s, float(truth.t_s[1])))
    return reading


def kept_as(path: Path, make: Callable[[], Any]) -> Any:
    """What was made before, else made now and kept."""
    if not path.exists():
        found = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_bytes(pickle.dumps(found))
        part.replace(path)
    return pickle.loads(path.read_bytes())


# --- How well an effect can be seen -----------------------------------------------------------------------------------


def true_strength(campaign: Campaign, cause: str, base: Fit) -> float | None:
    """d_true at a fit without the cause; None for a swap, and where the cause is no candidate and moves nothing."""
    kind = cause.split(".", 1)[0]
    chosen = [c for c in campaign.candidates if _either_way(str(c.cause)) == _either_way(cause) and not c.discrete]
    proposals = Proposals(base.model, base.beta)
    parts = base.model.linearise(base.beta, [proposals.parameter(c) for c in chosen])
    projector, v, _ = stacked(base, parts)
    if kind in READ_WRONG:
        return float(abs(campaign.size) * np.sqrt(projector.inner(v, v)[0, 0])) if chosen else None
    rows = []
    for part in parts:
        test = base.model.tests[part.series.session]
        channel = next(c for c in test.channels if c.name == part.series.channel)
        x = channel.blocks(test.frame.step_s).measured(campaign.moved[part.series.session][channel.name])
        rows.append(base.model.whitened(part.series, x[:, None])[:, 0])
    x = np.concatenate(rows)
    if not chosen:
        return float(np.sqrt(projector.inner(x, x)))
    return float(abs(projector.inner(v[:, 0], x)) / np.sqrt(projector.inner(v, v)[0, 0]))


def scale_for(case: Case, cache: Path, first: int) -> float:
    """By how much the catalogue's size is multiplied for the wanted d_true, by the reference specimen."""
    reference = Case(first - 1, case.layout, longest_s=case.longest_s)

    def strength() -> float | None:
        healthy, plan, base = fitted(reference, cache)
        effect = _in_catalogue(case.cause)
        plant = Plant(reference.seed, effect)
        moved = () if effect.kind in READ_WRONG else moved_by(plant, plan, case.layout, healthy.tests)
        return true_strength(replace(healthy, size=effect.size, moved=moved), case.cause, base)

    found = kept_as(cache / f"{reference.name}_{case.cause}_d.pickle", strength)
    return float(np.clip(case.wanted / found, LEAST_SCALE, MOST_SCALE)) if found else 1.0


@functools.cache
def fitted(healthy: Case, cache: Path) -> tuple[Campaign, list[Drive], Fit]:
    """A healthy specimen's campaign, its drives, and the fit before any cause enters."""
    campaign: Campaign = kept_as(cache / f"{healthy.name}.pickle", lambda: made(healthy, None))
    plan = planned(Plant(healthy.seed), healthy.longest_s)
    return campaign, plan, search(_model(campaign), campaign.candidates).rounds[0].base


def _in_catalogue(cause: str) -> Effect:
    return next(hidden.effects()[0] for hidden in CATALOGUE if hidden.cause == cause)


def _model(campaign: Campaign) -> Model:
    train = campaign.tests[:LEARNT]
    return Model(campaign.network, train, everyday(campaign.network, train))


# --- Answers ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Result:
    """What a diagnosis said of a case. `named`: cause -> ln BF, the strongest first; `refused`: what the kept sessions
    spoke against; `same`: what the data cannot tell from the first; `is_unknown`: a heat of any course won; `unknown`:
    ln BF of the best free heat; `linear`: of the best candidate before any refit; `leading`: after the first refits."""

    case: Case
    size: float
    d_true: float | None
    named: dict[str, float]
    refused: tuple[str, ...] = ()
    same: tuple[str, ...] = ()
    is_unknown: bool = False
    unknown: float = 0.0
    linear: float = 0.0
    leading: dict[str, float] = field(default_factory=dict)
    improved: bool = False
    seconds: float = 0.0
    diverged: str = ""

    @property
    def answer(self) -> str:
        """`silent`, `unknown`, or the first name."""
        return "unknown" if self.is_unknown else next(iter(self.named), "silent")

    @property
    def verdict(self) -> str:
        """`first`, `class` (not told apart from the first name), `place` (another law there), `wrong` or `silent`; off
        the library `right` is `unknown`."""
        if self.answer == "silent":
            return "silent"
        answer = _either_way(self.answer)
        truth = _either_way("unknown" if self.case.cause.startswith("unknown.") else self.case.cause)
        if answer == truth:
            return "first"
        if truth in [_either_way(cause) for cause in self.same]:
            return "class"
        return "place" if answer[:2] == truth[:2] else "wrong"


def tried(case: Case, campaign: Campaign) -> Result:
    """Diagnose a campaign as `whyhot diagnose` does."""
    started = time.process_time()
    model = _model(campaign)
    swaps = scan(model, campaign.candidates)
    given = question.Campaign(campaign.network, campaign.tests[:LEARNT], campaign.candidates, (), (), (), ())
    found = find(given, model, swaps, list(campaign.tests[LEARNT:]), lambda _: None)
    naming = found.naming
    first, linear = naming.rounds[0], naming.rounds[0].scores.log_bayes_factor
    every = [(str(s.candidate.cause), s.log_bayes_factor) for s in swaps]
    every += [(str(r.candidate.cause), r.log_bayes_factor) for r in naming.accepted]
    return Result(
        case,
        campaign.size,
        true_strength(campaign, case.cause, first.base) if case.cause else 0.0,
        dict(sorted(every, key=lambda one: -one[1])),
        tuple(str(refit.candidate.cause) for refit, _ in found.refused),
        _same(naming),
        naming.is_unknown,
        naming.log_bf_unknown,
        float(linear.max()),
        {str(r.candidate.cause): round(r.log_bayes_factor, 1) for r in first.refits},
        found.kept is not None and found.kept.improved,
        time.process_time() - started,
    )


def _same(naming: Naming) -> tuple[str, ...]:
    """What the data cannot tell from the strongest term."""
    if not naming.accepted:
        return ()
    leader = max(naming.accepted, key=lambda r: r.log_bayes_factor).candidate
    entered = next(found for found in naming.rounds if leader in [r.candidate for r in found.refits])
    return tuple(str(m.candidate.cause) for m in told_apart(entered, leader, naming.log_bf_unknown).others)


# --- Rates ------------------------------------------------------------------------------------------------------------


def bounds(k: int, n: int) -> tuple[float, float]:
    """Clopper and Pearson (Biometrika 26 (1934) 404, DOI 10.1093/biomet/26.4.404): each bound holds with 95 % by
    itself.

    >>> round(bounds(0, 16)[1], 2)
    0.17
    """
    low = float(beta.ppf(1 - BOUND, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(BOUND, k + 1, n - k)) if k < n else 1.0
    return low, high


def rate(k: int, n: int) -> dict[str, Any]:
    low, high = bounds(k, n) if n else (0.0, 1.0)
    return {"of": n, "count": k, "at_least": round(low, 3), "at_most": round(high, 3)}


def summary(results: Sequence[Result]) -> dict[str, Any]:
    """Rates of healthy specimens, of effects by d_true, of swaps and of effects off the library."""
    healthy = [r for r in results if not r.case.cause]
    swaps = [r for r in results if ".swap_" in r.case.cause]
    outside = [r for r in results if r.case.cause.startswith("unknown.")]
    inside = [r for r in results if r.case.cause and r not in swaps and r not in outside]
    verdicts = ("first", "class", "place", "wrong", "silent")

    def counted(some: Sequence[Result]) -> dict[str, Any]:
        return {v: rate(sum(r.verdict == v for r in some), len(some)) for v in verdicts}

    def between(some: Sequence[Result], low: float, high: float) -> list[Result]:
        return [r for r in some if r.d_true is not None and low <= r.d_true < high]

    return {
        "healthy": {
            "named": rate(sum(r.answer != "silent" for r in healthy), len(healthy)),
            "improved": rate(sum(r.improved for r in healthy), len(healthy)),
        },
        "effects": {f"{low:g}-{high:g}": counted(between(inside, low, high)) for low, high in BINS},
        "off_library": {f"{low:g}-{high:g}": counted(between(outside, low, high)) for low, high in BINS},
        "swaps": counted(swaps),
        "wrong": rate(sum(r.verdict == "wrong" for r in inside), len(inside)),
        "diverged": sum(bool(r.diverged) for r in results),
    }


def table(found: dict[str, Any]) -> str:
    """The rates as lines of text."""
    lines = []
    for what, one in found["healthy"].items():
        lines.append(f"healthy {what:<12}{_said(one)}")
    verdicts = ("first", "class", "place", "wrong", "silent")
    lines.append(f"{'d_true':<20}{'of':>4}" + "".join(f"{v:>24}" for v in verdicts))
    rows = {f"effects {k}": v for k, v in found["effects"].items()}
    rows |= {f"off library {k}": v for k, v in found["off_library"].items()} | {"swaps": found["swaps"]}
    for name, row in rows.items():
        lines.append(f"{name:<20}{row['first']['of']:>4}" + "".join(f"{_said(row[v]):>24}" for v in verdicts))
    lines.append(f"wrong names of all effects of the library: {_said(found['wrong'])}")
    return "\n".join(lines)


def _said(one: dict[str, Any]) -> str:
    return f"{one['count']}/{one['of']} [{one['at_least']:.0%}, {one['at_most']:.0%}]" if one["of"] else "-"


# --- Run --------------------------------------------------------------------------------------------------------------


def read_results(path: Path) -> list[Result]:
    """Results that are there already."""
    if not path.exists():
        return []
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [
        Result(**{**row, "case": Case(**row["case"]), "same": tuple(row["same"]), "refused": tuple(row["refused"])})
        for row in rows
    ]


def written(path: Path, result: Result) -> None:
    """Add a result to those that are there."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(result)) + "\n")


def main() -> None:
    """Run what is missing, print and write the rates."""
    parser = asked.parser(__doc__, healthy=(40, 0), effects=(60, 1), first=(1000, 1000))
    parser.add_argument("--layout", choices=("six", "ten"), default="six")
    parser.add_argument("--cache", metavar="FOLDER", type=Path, default=Path(tempfile.gettempdir()) / "whyhot-trials")
    args = parser.parse_args()
    if args.quick:
        with tempfile.TemporaryDirectory() as fresh:
            run(args, Path(fresh), QUICK_S)
    else:
        run(args, args.cache, math.inf)


def run(args: Namespace, cache: Path, longest_s: float) -> None:
    """What is asked, of drives that end after `longest_s`."""
    code = code_of("replay.studies.diagnosis.diagnose")[:12]
    path = cache / f"results-{code}.jsonl"
    done = {r.case: r for r in read_results(path)}
    drawn = cases(args.first, args.healthy, args.effects, args.layout)
    wanted = [replace(case, longest_s=longest_s) for case in drawn]
    for case in wanted:
        if case not in done:
            with threadpool_limits(1, user_api="blas"):  # the matrices are small: more threads only wait for each other
                done[case] = one(case, cache, args.first)
            written(path, done[case])
            shown = done[case]
            d = "" if shown.d_true is None else f"d {shown.d_true:.1f} "
            print(f"{case.name:<70}{d}{shown.verdict:<8}{shown.answer} ({shown.seconds:.0f} s)", flush=True)
    found = summary([done[case] for case in wanted])
    print(table(found))
    asked.keep({"twin": code, "first": args.first, "layout": args.layout, **found}, args.json)


def one(case: Case, cache: Path, first: int) -> Result:
    """One trial, its campaign made or read."""
    campaign = kept_as(cache / f"{case.name}.pickle", lambda: _made_within_limits(case, cache, first))
    try:
        return tried(case, campaign)
    except DivergedError as error:
        return Result(case, campaign.size, None, {}, diverged=str(error))


def _made_within_limits(case: Case, cache: Path, first: int) -> Campaign:
    """The campaign of a case; where the motor with the effect runs away, at half the size, and half again."""
    if not case.cause:
        return made(case, None)
    by = scale_for(case, cache, first)
    for _ in range(HALVINGS):
        try:
            return made(case, scaled(_in_catalogue(case.cause), by))
        except (ArithmeticError, ValueError):
            by /= 2
    raise ValueError(f"{case.name}: the motor runs away at {by:g} times the catalogue's size too: leave this cause out")


if __name__ == "__main__":
    main()
