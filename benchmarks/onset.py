"""Since when a cause acts: motors of `tests/plant` that have one from some session on, and healthy ones, asked as
`whyhot seen` and `whyhot bisect` ask.

    python benchmarks/onset.py [--motors N] [--first SEED] [--sessions N] [--quick] [--json FILE]

Of three motors one is healthy, and two have a cause from a session on that is drawn. All are asked for a cause that is
known from elsewhere at its size (`seen`), then for any cause at all (`bisect`). Stated probabilities stand beside how
often they were right: of each session of each motor, that the cause acts in it; of each motor, that it has it.
"""

from __future__ import annotations

import sys
import tempfile
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.shared import clopper_pearson
from benchmarks.trial.campaigns import Session, drive_of, read
from plant import Effect, Plant, typical, write_campaign
from plant.sensors import record
from twin.diagnosis.onset import AS_KNOWN, KnownSize, from_each_on, weighed
from twin.diagnosis.refined import calibrated

CAUSES = ("loss.magnet.speed2", "conductance.rotor_surface-teeth.speed1.5", "loss.endwinding_a_inner.speed2_current2")
SHARES = (2.0, 4.0, 1.0)  # of the size in the catalogue
DRIVEN: tuple[Session, ...] = (("s2", 0.5, 20.0), ("wltp", 1.0, 20.0))  # in turn
BINS = (0.0, 0.05, 0.5, 0.95, 1.0)
SURE = 0.95
QUICK_S = 310.0


@dataclass(frozen=True)
class Trial:
    """A motor asked for a cause that it has from session `began` on (0: the first), or not at all (None). `in_session`:
    stated probability that the cause acts in each session; `since`: of `bisect`, that whatever began did so at each;
    `anything`: that anything is there."""

    seed: int
    cause: str
    share: float
    began: int | None
    in_session: list[float]
    since: list[float]
    anything: float


def main() -> None:
    """Ask the motors; print and write what was stated and what was true."""
    parser = asked.parser(__doc__, motors=(24, 1), first=(5000, 5000), sessions=(4, 2))
    args = parser.parse_args()
    trials = []
    with threadpool_limits(1, user_api="blas"):
        for i in range(args.motors):
            trials.append(trial(i, args))
            print(line(trials[-1]), flush=True)
            asked.keep([asdict(one) for one in trials], args.json)
    print("\n".join(table(trials)))


def trial(i: int, args: Namespace) -> Trial:
    """The so manyth motor, driven, read and asked."""
    seed, share = args.first + i, SHARES[(i // 3) % len(SHARES)]
    usual = typical(CAUSES[(i + i // 9) % len(CAUSES)])
    effect = Effect(usual.cause, usual.size * share)
    drawn = int(np.random.default_rng([seed, 9]).integers(args.sessions))
    began = None if i % 3 == 2 else drawn
    acts = [began is not None and number >= began for number in range(args.sessions)]
    return answered(seed, effect, share, began, acts, QUICK_S if args.quick else np.inf)


def answered(
    seed: int, effect: Effect, share: float, began: int | None, acts: Sequence[bool], longest_s: float
) -> Trial:
    """A motor whose sessions have the effect where it `acts`, asked both ways."""
    healthy, ill = Plant(seed), Plant(seed, effect)
    drives = [drive_of(healthy, DRIVEN[n % len(DRIVEN)], n).first(longest_s) for n in range(len(acts))]
    runs = [(ill if act else healthy).run(drive, n) for n, (drive, act) in enumerate(zip(drives, acts, strict=True))]
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(Path(folder), healthy, [record(healthy, run) for run in runs])
        campaign = read(Path(folder))
    mode = calibrated(campaign.healthy, campaign.candidates, lambda _: None)
    sets = from_each_on(len(acts))
    known = weighed(mode, campaign.candidates, sets, known={effect.cause: KnownSize(effect.size, AS_KNOWN)})
    free = weighed(mode, campaign.candidates, sets)
    return Trial(
        seed=seed,
        cause=effect.cause,
        share=share,
        began=began,
        in_session=known.in_test(effect.cause).tolist(),
        since=free.by_set().tolist(),
        anything=1.0 - free.none,
    )


def line(one: Trial) -> str:
    """A trial in one line."""
    truth = "healthy" if one.began is None else f"{one.share:g} times usual from session {one.began + 1} on"
    stated = " ".join(f"{p:.2f}" for p in one.in_session)
    since = " ".join(f"{p:.2f}" for p in one.since)
    return f"{one.seed} {one.cause}: {truth}; acts in sessions {stated}; anything {one.anything:.2f}, since {since}"


def table(trials: Sequence[Trial]) -> list[str]:
    """Rates found and false, and stated probabilities against how often they were right."""
    ill, healthy = ([t for t in trials if (t.began is None) is none] for none in (False, True))
    rows = ["seen: the cause that is asked for"]
    rows += [rate("found, begun later", [max(t.in_session) > SURE for t in ill if t.began])]
    rows += [rate("found, from the first session on", [max(t.in_session) > SURE for t in ill if not t.began])]
    rows += [rate("found where there is none", [max(t.in_session) > SURE for t in healthy])]
    rows += [rate("began there, of those found", [_began(t) for t in ill if max(t.in_session) > SURE])]
    rows += ["bisect: any cause"]
    rows += [rate("anything found, begun later", [t.anything > SURE for t in ill if t.began])]
    rows += [rate("anything found, from the first session on", [t.anything > SURE for t in ill if not t.began])]
    rows += [rate("anything found where there is none", [t.anything > SURE for t in healthy])]
    rows += [rate("since told right", [int(np.argmax(t.since)) == t.began for t in ill if t.anything > SURE])]
    states = [(p, t.began is not None and n >= t.began) for t in trials for n, p in enumerate(t.in_session)]
    head = f"{'stated that it acts in a session':>32} {'sessions':>8} {'mean':>6} {'acts':>6}"
    return [*rows, head, *_reliable(states)]


def _began(one: Trial) -> bool:
    """Whether the first session in which the cause more probably acts than not is the true one."""
    return next(n for n, p in enumerate(one.in_session) if p > 0.5) == one.began


def rate(name: str, hits: Sequence[bool]) -> str:
    """A rate with its 95 % bounds."""
    if not hits:
        return f"{name}: none asked"
    low, high = clopper_pearson(sum(hits), len(hits))
    return f"{name}: {sum(hits)} of {len(hits)} ({low:.0%} to {high:.0%})"


def _reliable(states: Sequence[tuple[float, bool]]) -> list[str]:
    rows = []
    for low, high in pairwise(BINS):
        own = [(p, acts) for p, acts in states if low <= p < high or p == high == 1.0]
        if own:
            mean, acts = np.mean(own, axis=0)
            rows.append(f"{f'{low:.2f} to {high:.2f}':>32} {len(own):>8} {mean:>6.2f} {acts:>6.2f}")
    return rows


if __name__ == "__main__":
    main()
