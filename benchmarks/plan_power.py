"""What a plan promised and what came: motors of `tests/plant` that hide a cause, the day that `whyhot plan` proposes,
run on them, and the diagnosis with it.

    python benchmarks/plan_power.py [--motors N] [--first SEED] [--hours H] [--quick] [--json FILE]

A trial is a specimen with one hidden cause, three sessions (S1, S2, WLTP) as BLF, ingested and diagnosed; the day that
`whyhot plan` proposes from them, not knowing the cause; that day run on the plant and logged; and the diagnosis of all
four. The promised d is that of the plan for the size that is truly there; what came is d as the diagnosis has it, where
it names the cause or tells it among the rivals. Causes and sizes go in turn, as shares of the plant's catalogue.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
from argparse import Namespace
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
from plant import Effect, Plant, sessions, typical, write_campaign
from plant import __main__ as bench
from replay.cli import main as whyhot
from twin.planning import courses

CAUSES = (
    "loss.magnet.speed2",
    "conductance.rotor_surface-teeth.speed1.5",
    "loss.endwinding_a_inner.speed2_current2",
    "loss.bearing_a.speed",
    "conductance.endwinding_a_outer-jacket.constant",
)
SHARES = (4.0, 8.0, 2.0)  # of the size in the catalogue
AT = (3.0, 5.0, 8.0, 12.0)  # promised d that rates are given at: each trial counts at the nearest
QUICK_S, QUICK_SPEEDS = 310.0, (0.5,)  # of each session; of the menu


@dataclass(frozen=True)
class Trial:
    """A hidden cause with its `size`: `promised` d before the day and with it, `came` where the diagnosis tells it, and
    whether it was `named`, before the day and after."""

    seed: int
    cause: str
    size: float
    promised: tuple[float, float]
    came: float | None
    named: tuple[bool, bool]


def main() -> None:
    """Run the trials; print and write what was promised and what came."""
    parser = asked.parser(__doc__, motors=(20, 1), first=(4000, 4000))
    parser.add_argument("--hours", metavar="H", type=float, default=0.6 if "--quick" in sys.argv else 4.0)
    args = parser.parse_args()
    if args.quick:
        courses.SPEEDS = QUICK_SPEEDS
    trials = []
    for i in range(args.motors):
        with tempfile.TemporaryDirectory() as folder:
            trials.append(trial(args.first + i, hidden(i), args, Path(folder)))
        print(line(trials[-1]), flush=True)
    print("\n".join(table(trials)))
    asked.keep([asdict(one) for one in trials], args.json)


def hidden(i: int) -> Effect:
    """What the so manyth motor hides."""
    effect = typical(CAUSES[i % len(CAUSES)])
    return Effect(effect.cause, effect.size * SHARES[(i + i // len(CAUSES)) % len(SHARES)])


def trial(seed: int, effect: Effect, args: Namespace, folder: Path) -> Trial:
    """The story of one motor: diagnosed, planned, run, diagnosed again."""
    plant = Plant(seed, effect)
    drives = [drive_of(plant, one, n).first(QUICK_S if args.quick else np.inf) for n, one in enumerate(LEARNT[:3])]
    logs = write_campaign(folder / "before", plant, sessions(plant, drives))
    _ingest(folder, logs)
    names = [log.stem for log in logs]
    before = _asked(folder, "diagnose", "--on", *names)
    words = ("--hours", str(args.hours), "--out", str(folder / "day.csv"))
    plan = _asked(folder, "plan", "--sessions", *names, *words)
    day = bench.run(folder / "day.csv", plant, folder / "day", len(names))
    _ingest(folder, [day])
    (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    after = _asked(folder, "diagnose", "--on", *names, day.stem, "--planned", str(folder / "plan.json"))
    came = [one["came_d"] for one in after["planned"]["causes"] if _same(one["id"], effect.cause)]
    return Trial(
        seed,
        effect.cause,
        effect.size,
        _promised(plan, effect),
        came[0] if came else None,
        (_named(before, effect.cause), _named(after, effect.cause)),
    )


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


def _promised(plan: Mapping[str, Any], effect: Effect) -> tuple[float, float]:
    """d of the size that is truly there, before the day and with it."""
    one = next(one for one in plan["candidates"] if _same(one["id"], effect.cause))
    times = effect.size / one["usual_amplitude"]
    return times * one["usual_d"], times * one["usual_d_after"]


def _same(one: str, other: str) -> bool:
    return either_way(one) == either_way(other)


def _named(answer: Mapping[str, Any], cause: str) -> bool:
    """Whether it is named, or not told apart from what is."""
    of = [judged(one["id"], tuple(one["indistinguishable_from"]), cause) for one in answer["causes"]]
    return bool({"first", "class"} & set(of))


def line(one: Trial) -> str:
    """A trial in one line."""
    came = "not told" if one.came is None else f"{one.came:.1f}"
    said = " -> ".join("named" if named else "silent or other" for named in one.named)
    before, after = one.promised
    return f"{one.seed} {one.cause} {one.size:g}: promised {before:.1f}, with the day {after:.1f}; came {came}; {said}"


def table(trials: Sequence[Trial]) -> list[str]:
    """By promised d: how many, what came over what was promised, how many were named."""
    rows = [f"{'promised d':>10} {'motors':>6} {'came over promised':>18} {'share named':>11}"]
    nearest = [int(np.abs(np.log(np.array(AT) / max(one.promised[1], 1e-9))).argmin()) for one in trials]
    for k, d in enumerate(AT):
        own = [one for one, place in zip(trials, nearest, strict=True) if place == k]
        ratios = [one.came / one.promised[1] for one in own if one.came is not None]
        ratio = f"{np.median(ratios):.2f}" if ratios else "-"
        share = f"{np.mean([one.named[1] for one in own]):.0%}" if own else "-"
        rows.append(f"{d:>10g} {len(own):>6} {ratio:>18} {share:>11}")
    silent = [one for one in trials if not one.named[0]]
    rows.append(f"silent before the day: {len(silent)}; of those named with it: {sum(one.named[1] for one in silent)}")
    return rows


if __name__ == "__main__":
    main()
