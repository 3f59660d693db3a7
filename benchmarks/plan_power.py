"""What a plan promised and what came: motors of `tests/plant` that hide a cause, the day that `whyhot plan` proposes,
run on them, and the diagnosis with it.

    python benchmarks/plan_power.py [--motors N] [--first SEED] [--skip N] [--hours H] [--minutes M]
        [--hide CAUSE SIZE] [--cache FOLDER] [--quick] [--json FILE]

A trial is a specimen with one hidden cause, three sessions (S1, S2, WLTP; of `--minutes` at most) as BLF, ingested and
diagnosed; the day that `whyhot plan` proposes from them, not knowing the cause; that day run on the plant and logged;
and the diagnosis of all four. Causes of the plant's catalogue go in turn, each of a size for which the plan of a
healthy specimen promises d of 3, 5, 8 or 12 with the day; with `--hide` every motor hides that one. The promised d of a
trial is that of its own plan for the size that is truly there; what came is d as the diagnosis has it, where it names
the cause or tells it among the rivals. A cause is named where it is first or not told apart from what is; a place,
where what is named is of its kind and at its place.

A long run goes in pieces: `--skip` leaves out the first motors of the series, and with `--cache` finished trials stay
in a folder, under the hashes of the plant's and of our own sources, from which the tables of all that was asked are
made.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import sys
import tempfile
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.trial.answers import judged
from benchmarks.trial.campaigns import LEARNT, drive_of
from benchmarks.trial.cases import either_way
from benchmarks.trial.rates import reliability_table
from benchmarks.trials import plant_code
from plant import Effect, Plant, sessions, typical, write_campaign
from plant import __main__ as bench
from replay.cli import main as whyhot
from replay.engine.runs.sources import code_of
from twin.planning import courses

CAUSES = (
    "loss.magnet.speed2",
    "conductance.endwinding_a_inner-air_a.speed1.5",
    "capacity.endwinding_a_inner.attached",
    "sensor.magnet.drift",
    "loss.yoke.scale",
    "conductance.shaft-coolant.constant",
    "boundary.coolant.bias",
    "loss.endwinding_a_inner.speed2_current2",
    "conductance.rotor_surface-teeth.speed1.5",
    "capacity.magnet.scale",
    "sensor.endwinding_b_inner.stem",
    "loss.magnet.scale",
    "conductance.endwinding_a_outer-jacket.constant",
    "clock.can2.offset",
    "loss.bearing_a.speed",
    "conductance.shaft-ambient.constant",
    "sensor.magnet.bias",
    "loss.magnet.speed2_current2",
    "conductance.jacket-coolant.scale",
    "loss.rotor_surface.speed3",
)
AT = (3.0, 5.0, 8.0, 12.0)  # promised d that sizes are made for; each trial counts at the nearest
WAYS = (("first", "class"), ("place",), ("wrong",))
QUICK_MINUTES, QUICK_SPEEDS = 5.2, (0.5,)  # of each session; of the menu


@dataclass(frozen=True)
class Trial:
    """A hidden cause with its `size`: `promised` d before the day and with it, `came` where the diagnosis tells it,
    what the diagnosis `said` before the day and after: "first", "class", "place", "wrong" or "silent", how many `false`
    names it gave then and then, right ones beside them or not, and how probable it `stated` each name with the day,
    with whether it is true."""

    seed: int
    cause: str
    size: float
    promised: tuple[float, float]
    came: float | None
    said: tuple[str, str]
    false: tuple[int, int]
    stated: tuple[tuple[float, bool], ...]

    @property
    def named(self) -> tuple[bool, bool]:
        """Before the day, and after."""
        before, after = (said in ("first", "class") for said in self.said)
        return before, after


def main() -> None:
    """Run the trials; print and write what was promised and what came."""
    words = parser(__doc__, motors=(20, 1), first=(4000, 4000), skip=(0, 0))
    words.add_argument("--hide", metavar=("CAUSE", "SIZE"), nargs=2, help="the one cause that every motor hides")
    words.add_argument("--cache", metavar="FOLDER", type=Path, help="where finished trials stay")
    args = arguments(words)
    with tempfile.TemporaryDirectory() as fresh:
        kept = Kept.of(args, Path(fresh))
        trials = []
        for i in range(args.skip, args.skip + args.motors):
            trials.append(kept.trial(i) or kept.added(run(i, args, kept)))
            print(line(trials[-1]), flush=True)
    print("\n".join(table(trials)))
    print("\n".join(reliability_table([one for trial in trials for one in trial.stated])))
    asked.keep([asdict(one) for one in trials], args.json)


def run(i: int, args: Namespace, kept: Kept) -> Trial:
    """The so manyth motor of the series."""
    effect = Effect(args.hide[0], float(args.hide[1])) if args.hide else hidden(i, kept.promises(args))
    with tempfile.TemporaryDirectory() as folder:
        return trial(args.first + i, effect, args, Path(folder))


@dataclass(frozen=True)
class Kept:
    """What is finished of one question, in a folder of its own: trials, a line each, and what a plan promises of a
    healthy motor."""

    folder: Path
    trials: dict[int, Trial]  # by seed
    first: int

    @classmethod
    def of(cls, args: Namespace, fresh: Path) -> Kept:
        """What the cache has of this question; nothing without a cache."""
        asks = (args.first, args.hours, args.minutes, args.hide, args.quick)
        doors = ("replay.studies.planning.plan", "replay.studies.diagnosis.diagnose")
        said = repr((asks, plant_code(), [code_of(door) for door in doors]))
        folder = (args.cache or fresh) / hashlib.sha256(said.encode()).hexdigest()[:12]
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "trials.jsonl"
        rows = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        return cls(folder, {(one := read(row)).seed: one for row in rows}, args.first)

    def trial(self, i: int) -> Trial | None:
        return self.trials.get(self.first + i)

    def added(self, one: Trial) -> Trial:
        with (self.folder / "trials.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(one)) + "\n")
        return one

    def promises(self, args: Namespace) -> Mapping[str, float]:
        path = self.folder / "promises.json"
        if not path.exists():
            path.write_text(json.dumps(healthy_promises(args)), encoding="utf-8")
        found: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))
        return found


def read(row: str) -> Trial:
    """A trial from its line."""
    said = json.loads(row)
    pairs = {name: tuple(said[name]) for name in ("promised", "said", "false")}
    return Trial(**{**said, **pairs, "stated": tuple((p, true) for p, true in said["stated"])})


def parser(doc: str | None, **sizes: tuple[int, int]) -> ArgumentParser:
    """What a benchmark of plans may be asked."""
    words, quick = asked.parser(doc, **sizes), "--quick" in sys.argv
    words.add_argument("--hours", metavar="H", type=float, default=0.6 if quick else 4.0, help="of the day")
    says = "of each session at most"
    words.add_argument("--minutes", metavar="M", type=float, default=QUICK_MINUTES if quick else np.inf, help=says)
    return words


def arguments(words: ArgumentParser) -> Namespace:
    """What it is asked; with `--quick` the menu of tests is short."""
    args = words.parse_args()
    if args.quick:
        courses.SPEEDS = QUICK_SPEEDS
    return args


def healthy_promises(args: Namespace) -> Mapping[str, float]:
    """Cause -> d for a unit of its amplitude that a plan for a healthy motor promises with its day."""
    with tempfile.TemporaryDirectory() as folder:
        plan = planned(Path(folder), recorded(Path(folder), Plant(args.first), args), args)
    return {cause: _per_amplitude(plan, cause)[1] for cause in CAUSES}


def hidden(i: int, promises: Mapping[str, float]) -> Effect:
    """What the so manyth motor hides: the causes in turn, each round at the next promised d."""
    cause, d = CAUSES[i % len(CAUSES)], AT[(i + i // len(CAUSES)) % len(AT)]
    size = math.copysign(d / promises[cause], amplitude(typical(cause)))
    return Effect(cause, math.exp(size) if cause.endswith(".scale") else size)


def trial(seed: int, effect: Effect, args: Namespace, folder: Path) -> Trial:
    """The story of one motor: diagnosed, planned, run, diagnosed again."""
    plant = Plant(seed, effect)
    names = recorded(folder, plant, args)
    before = _asked(folder, "diagnose", "--on", *names)
    plan = planned(folder, names, args)
    day = bench.run(folder / "day.csv", plant, folder / "day", len(names))
    _ingest(folder, [day])
    (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    after = _asked(folder, "diagnose", "--on", *names, day.stem, "--planned", str(folder / "plan.json"))
    came = [one["came_d"] for one in after["planned"]["causes"] if same(one["id"], effect.cause)]
    before_day, with_day = (per * abs(amplitude(effect)) for per in _per_amplitude(plan, effect.cause))
    return Trial(
        seed,
        effect.cause,
        effect.size,
        (before_day, with_day),
        came[0] if came else None,
        (_said(before, effect.cause), _said(after, effect.cause)),
        (_false(before, effect.cause), _false(after, effect.cause)),
        _stated(after, effect.cause),
    )


def recorded(folder: Path, plant: Plant, args: Namespace) -> list[str]:
    """The names of three sessions, run, logged and ingested."""
    drives = [drive_of(plant, one, n).first(60.0 * args.minutes) for n, one in enumerate(LEARNT[:3])]
    logs = write_campaign(folder / "before", plant, sessions(plant, drives))
    _ingest(folder, logs)
    return [log.stem for log in logs]


def planned(folder: Path, names: Sequence[str], args: Namespace) -> dict[str, Any]:
    words = ("--hours", str(args.hours), "--out", str(folder / "day.csv"))
    return _asked(folder, "plan", "--sessions", *names, *words)


def _ingest(folder: Path, logs: Sequence[Path]) -> None:
    beside = logs[0].parent
    words = [*map(str, logs), "--bench", str(beside / "bench.toml"), "--dbc", str(beside / "bench.dbc")]
    _asked(folder, "ingest", *words)


def _asked(folder: Path, *words: str) -> dict[str, Any]:
    """What `whyhot` answers, as JSON."""
    target = folder / "answer.json"
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        code = whyhot([*words, "--store", str(folder / "store"), "--json", str(target)])
    if code:
        raise RuntimeError(f"whyhot {' '.join(words)}: {said.getvalue()}")
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


def _per_amplitude(plan: Mapping[str, Any], cause: str) -> tuple[float, float]:
    """d of a unit of its amplitude, before the day and with it."""
    one = next(one for one in plan["candidates"] if same(one["id"], cause))
    return one["usual_d"] / one["usual_amplitude"], one["usual_d_after"] / one["usual_amplitude"]


def amplitude(effect: Effect) -> float:
    """Its size as a candidate's amplitude: of a factor the logarithm."""
    return math.log(effect.size) if effect.law == "scale" else effect.size


def same(one: str, other: str) -> bool:
    return either_way(one) == either_way(other)


def _said(answer: Mapping[str, Any], cause: str) -> str:
    """What the best of the names is of the cause: `first`, `class`, `place`, `wrong`; `silent` where there is none."""
    of = _names(answer, cause)
    return next((said for said in ("first", "class", "place", "wrong") if said in of), "silent")


def _false(answer: Mapping[str, Any], cause: str) -> int:
    """How many of the names are of something else."""
    return _names(answer, cause).count("wrong")


def _names(answer: Mapping[str, Any], cause: str) -> list[str]:
    """What each name is of the cause."""
    of = [judged(one["id"], tuple(one["indistinguishable_from"]), cause) for one in answer["causes"]]
    return [*of, *(["wrong"] if answer["unknown"] else [])]


def _stated(answer: Mapping[str, Any], cause: str) -> tuple[tuple[float, bool], ...]:
    """How probable each name is called with its class, and whether that is true; an exchange has no such number."""
    of = zip(answer["causes"], _names(answer, cause), strict=False)
    return tuple((one["probability"], said in ("first", "class")) for one, said in of if ".swap_" not in one["id"])


def line(one: Trial) -> str:
    """A trial in one line."""
    came = "not told" if one.came is None else f"{one.came:.1f}"
    before, after = one.promised
    promised = f"promised {before:.1f}, with the day {after:.1f}"
    false = f"false names {one.false[0]} -> {one.false[1]}"
    return f"{one.seed} {one.cause} {one.size:.3g}: {promised}; came {came}; {' -> '.join(one.said)}; {false}"


def table(trials: Sequence[Trial]) -> list[str]:
    """By promised d: how many, what came over what was promised, how many were named."""
    rows = [
        f"{'promised d':>10} {'motors':>6} {'came over promised':>18} {'share named':>11} {'place':>6} {'wrong':>6}"
    ]
    nearest = [int(np.abs(np.log(np.array(AT) / max(one.promised[1], 1e-9))).argmin()) for one in trials]
    for k, d in enumerate(AT):
        own = [one for one, place in zip(trials, nearest, strict=True) if place == k]
        ratios = [one.came / one.promised[1] for one in own if one.came is not None]
        ratio = f"{np.median(ratios):.2f}" if ratios else "-"
        shares = [f"{np.mean([one.said[1] in ways for one in own]):.0%}" if own else "-" for ways in WAYS]
        rows.append(f"{d:>10g} {len(own):>6} {ratio:>18} {shares[0]:>11} {shares[1]:>5} {shares[2]:>5}")
    without = [one for one in trials if not one.named[0]]
    silent = sum(one.said[0] == "silent" for one in trials)
    named = sum(one.named[1] for one in without)
    rows.append(
        f"silent before the day: {silent}; not named before it: {len(without)}, of those named with it: {named}"
    )
    false = [sum(one.false[k] > 0 for one in trials) for k in range(2)]
    rows.append(f"motors with a false name before the day: {false[0]}, with it: {false[1]}")
    return rows


if __name__ == "__main__":
    main()
