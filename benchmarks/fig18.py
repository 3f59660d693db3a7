"""The paper's Fig. 18 from a stator whose truth is known: what one stator through 21 oven cycles can tell, and what it
cannot.

    python benchmarks/fig18.py [--seeds N] [--first SEED] [--out DIR] [--quick] [--json FILE]

Truth: `tests/plant`, one bare stator of 24 lumps, 20 cycles of 12 h and one of 60 h at 230 degC, a check with 160 A
before the first (four times) and after each, thermocouples in the winding heads only. Its slots' resistance falls over
eight cycles, rises to the fifteenth past its start, then does neither; surfaces darken, the room swings, checks repeat
within 2 %. The first seed's logs go through `whyhot ingest` and `whyhot ageing`, and the figure is drawn (fig18.svg,
fig18.png in DIR). Then as many stators with that course, and the same ones with nothing hidden, are assessed in memory:
what is named from R, and what the same test would have named from the hottest sensor. Takes about 20 s a seed.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else a file beside this one hides a package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analytics.insulation.checks import repeatability
from analytics.insulation.checks.resistance import evaluate_together
from analytics.insulation.courses import forms
from analytics.insulation.courses.forms import Form
from benchmarks import asked
from benchmarks.ageing import rate
from benchmarks.ageing import trace as check_trace
from plant import insulation_campaign
from plant.insulation_campaign import Stator
from plant.timeline import PAPER
from replay.cli import main as whyhot
from replay.show.words.figure import save, style
from replay.show.words.palette import COLOURS, INK, SOFT
from replay.show.words.palette import PAPER as PAGE

Floats = NDArray[np.float64]

HEALTHY = replace(PAPER, forms=("none",))
ROOM_DEGC = 20.0  # the hottest sensor is judged by its rise above this, as whoever looks at a temperature alone would
UNTOLD = (
    "What no number of cycles of one stator can tell: whether others do the same (the spread between stators),",
    "what 230 °C means at 180 °C (one temperature holds no activation energy), and whether the enamel, the resin",
    "or the liner changed: R is their sum.",
)
TURN, END, LATE = 8, 15, 18  # cycles: where it turns, where the rise ends, and well after


@dataclass(frozen=True)
class Course:
    """One stator's checks: `ln_r`, `hottest_degC` (n,) over `cycle` and `dose_h` (n,), and the form that each is
    given."""

    cycle: NDArray[np.int64]
    dose_h: Floats
    ln_r: Floats
    sd: Floats  # of ln R, repeatability in it
    hottest_degC: Floats
    true_ln_r: Floats  # as perfect sensors have it, with what dark surfaces do to it
    by_resistance: Form
    by_hottest: Form

    def change(self, values: Floats, until: int, since: int = 0) -> float:
        """Mean over the checks about cycle `until` less that about `since`, each with the one before and after it."""
        return self._about(values, until) - self._about(values, since)

    def _about(self, values: Floats, cycle: int) -> float:
        near = self.cycle == 0 if cycle == 0 else np.abs(self.cycle - cycle) <= 1
        return float(values[near].mean())


def main() -> None:
    parser = asked.parser(__doc__, seeds=(10, 1), first=(1, 1))
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("build"), help="for the picture (build)")
    args = parser.parse_args()
    document, text = through_the_store(args.first)
    print(text, end="\n\n")
    aged, healthy = [], []
    for seed in range(args.first, args.first + args.seeds):
        aged.append(course(insulation_campaign.run(seed, PAPER).stators[0]))
        healthy.append(course(insulation_campaign.run(seed, HEALTHY).stators[0]))
        print(f"seed {seed}", file=sys.stderr)
    args.out.mkdir(parents=True, exist_ok=True)
    draw(document, aged[0], healthy[0], args.out / "fig18.svg")
    found = findings(aged, healthy)
    print("\n".join(found))
    asked.keep(found, args.json)


def through_the_store(seed: int) -> tuple[dict[str, Any], str]:
    """The logs of a stator into a store, and what `whyhot ageing` says of them: as JSON, and as printed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store = str(folder / "store")
        written = insulation_campaign.write(folder / "logs", seed, PAPER)
        for words in written.ingest:
            _printed([*words, "--store", store])
        text = _printed(["ageing", "--store", store, "--json", str(folder / "ageing.json")])
        document: dict[str, Any] = json.loads((folder / "ageing.json").read_text(encoding="utf-8"))
        return document, text.rstrip()


def _printed(words: Sequence[str]) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as complaints:
        code = whyhot(list(words))
    if code != 0:
        raise SystemExit(f"whyhot {words[0]}: {complaints.getvalue()}")
    return out.getvalue()


def course(stator: Stator) -> Course:
    """A stator's checks evaluated, and both of its courses judged by the same test."""
    found = evaluate_together([check_trace(check) for check in stator.checks])
    rows = [
        (check.cycle, check.dose_h, one.resistance_K_per_W, one.sd_K_per_W or 0.0, one.hottest_degC,
         check.resistance_K_per_W)
        for check, one in zip(stator.checks, found, strict=True)
        if one.resistance_K_per_W is not None and one.hottest_degC is not None
    ]  # fmt: skip
    cycle, dose, resistance, sd, hottest, true = np.array(rows, np.float64).T
    ln_r = np.log(resistance)
    by_resistance, both = _judged(stator.name, dose, ln_r, sd / resistance)
    by_hottest, _ = _judged(stator.name, dose, np.log(hottest - ROOM_DEGC), np.zeros_like(dose))
    return Course(cycle.astype(np.int64), dose, ln_r, both, hottest, np.log(true), by_resistance, by_hottest)


def _judged(name: str, dose_h: Floats, ln_value: Floats, sd: Floats) -> tuple[Form, Floats]:
    repeats = repeatability.estimate([name] * len(dose_h), dose_h, ln_value)
    both = np.hypot(repeats.sd, sd)
    return forms.assess(dose_h, ln_value, both, degrees_of_freedom=repeats.degrees_of_freedom), both


def findings(aged: Sequence[Course], healthy: Sequence[Course]) -> list[str]:
    """What can be concluded from one stator, and what cannot, counted over several."""
    count = len(aged)
    dips = [one for one in aged if one.by_resistance.name == "dip_then_rise"]
    others = Counter(one.by_resistance.name for one in aged if one.by_resistance.name != "dip_then_rise")
    least = min((one.by_resistance.probability for one in dips), default=0.0)
    bands = [one.by_resistance.change_ci95_dose_h or (0.0, 0.0) for one in dips]
    turns = [float(np.interp(TURN, one.cycle, one.dose_h)) for one in dips]
    inside = sum(low <= turn <= high for (low, high), turn in zip(bands, turns, strict=True))
    turned = rate(inside, len(dips))
    width_h = np.median([high - low for low, high in bands])
    slopes = [one.by_resistance.ci95 or (1.0, 1.0) for one in dips]
    past = [100 * float(np.expm1(one.change(one.ln_r, LATE))) for one in aged]
    past_true = [100 * float(np.expm1(one.change(one.true_ln_r, LATE))) for one in aged]
    ended = sum(one.by_resistance.level_probability > 0.95 for one in dips)
    steepness = np.median([b / a for a, b in slopes])
    false_of_r = sum(one.by_resistance.significant for one in healthy)
    dips_of_hottest = sum(one.by_hottest.name == "dip_then_rise" for one in aged)
    false_of_hottest = sum(one.by_hottest.significant for one in healthy)
    as_large_a_fall = f"  half that fall or more, to cycle {TURN}, where nothing is hidden: "
    return [
        f"{count} stators with the paper's course, {count} with nothing hidden; all darken, and the room swings",
        "",
        "From R over the dose, one stator at a time",
        f"  dip, then rise named where it is hidden: {rate(len(dips), count)}, at a probability {_at_least(least)}"
        + "".join(f"; {name} {times} times" for name, times in others.items()),
        f"  the turn is within its interval of 95 %: {turned}; the interval is {width_h:.0f} h wide (median)",
        f"  that the rise has ended is seen (probability above 95 %): {rate(ended, count)}",
        f"  R at cycles {LATE - 1} to {LATE + 1} against the start: {_range(past)} %, truly {_range(past_true)} %",
        f"  slope of the rise: the upper end of its interval is {steepness:.1f} times the lower (median)",
        f"  something named where nothing is hidden: {rate(false_of_r, count)}",
        as_large_a_fall + rate(_as_large("ln_r", aged, healthy), count),
        "",
        "From the hottest sensor over the cycles, by the same test",
        f"  to cycle {TURN}: {_moves(aged, healthy, TURN, 0)}",
        f"  from there to cycle {END}: {_moves(aged, healthy, END, TURN)}",
        f"  dip, then rise named where it is hidden: {rate(dips_of_hottest, count)}",
        f"  something named where nothing is hidden: {rate(false_of_hottest, count)}",
        as_large_a_fall + rate(_as_large("hottest_degC", aged, healthy), count),
        "",
        *UNTOLD,
    ]  # fmt: skip


def _as_large(what: str, aged: Sequence[Course], healthy: Sequence[Course]) -> int:
    """How many of the healthy fall by at least half of what the others fall by (median)."""
    size = float(np.median([one.change(getattr(one, what), TURN) for one in aged]))
    return sum(one.change(getattr(one, what), TURN) <= size / 2.0 for one in healthy)


def _moves(aged: Sequence[Course], healthy: Sequence[Course], until: int, since: int) -> str:
    """By how much the hottest sensor changes between two cycles."""
    with_it, without = ([one.change(one.hottest_degC, until, since) for one in some] for some in (aged, healthy))
    return f"{_range(with_it)} K with the course, {_range(without)} K with nothing hidden"


def _at_least(share: float) -> str:
    return "above 99.9 %" if share > 0.999 else f"of {100 * share:.1f} % or more"


def _range(values: Sequence[float]) -> str:
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    return f"{middle:+.1f} ({low:+.1f} to {high:+.1f})".replace("-", "−")


def draw(document: dict[str, Any], aged: Course, healthy: Course, target: Path) -> None:
    """The paper's figure on the left, what it should have shown on the right: `target` and a .png beside it."""
    (stator,) = document["specimens"]
    checks = [one for one in stator["checks"] if one["dose_h"] is not None and one["resistance_K_per_W"] is not None]
    dose = np.array([one["dose_h"] for one in checks])
    resistance = np.array([one["resistance_K_per_W"] for one in checks])
    repeats = stator["repeatability_percent"] / 100.0
    start = resistance[dose < 1.0].mean()
    spread = 2.0 * np.hypot([one["sd"] / one["resistance_K_per_W"] for one in checks], repeats)
    with style("fig18"):
        figure = Figure(figsize=(10.0, 4.4), facecolor=PAGE[0])
        FigureCanvasAgg(figure)
        left, right = figure.add_axes((0.06, 0.14, 0.40, 0.66)), figure.add_axes((0.55, 0.14, 0.43, 0.66))
        left.plot(
            healthy.cycle, healthy.hottest_degC, color=SOFT[0], marker="o", markersize=3, linewidth=0.8, linestyle="--"
        )
        left.plot(
            aged.cycle,
            [one["hottest_degC"] for one in checks],
            color=COLOURS[0],
            marker="o",
            markersize=3,
            linewidth=1.2,
        )
        left.set_xlabel("oven cycle (the last one 60 h, the others 12 h)")
        left.set_ylabel("hottest sensor at the end of the check [°C]")
        left.set_title("As the paper draws it: 3v over the cycles", loc="left", fontsize=9)
        right.axhspan(100 * np.exp(-spread.mean()), 100 * np.exp(spread.mean()), color=SOFT[0], alpha=0.15, linewidth=0)
        right.plot(
            healthy.dose_h,
            100 * np.exp(healthy.ln_r - healthy.ln_r[healthy.cycle == 0].mean()),
            color=SOFT[0],
            marker="o",
            markersize=2.5,
            linewidth=0.8,
            linestyle="--",
            label="the same stator with nothing hidden",
        )
        right.errorbar(
            dose,
            100 * resistance / start,
            yerr=100 * spread * resistance / start,
            color=COLOURS[0],
            marker="o",
            markersize=3,
            linewidth=1.2,
            elinewidth=0.7,
            capsize=2,
            label="a stator with the paper's course",
        )
        right.plot(
            aged.dose_h,
            100 * np.exp(aged.true_ln_r - aged.true_ln_r[aged.cycle == 0].mean()),
            color=INK[0],
            linewidth=0.9,
            linestyle=":",
            label="its true R",
        )
        if stator["change_at_dose_h"] is not None:
            low, high = aged.by_resistance.change_ci95_dose_h or (stator["change_at_dose_h"],) * 2
            right.axvspan(low, high, color=COLOURS[0], alpha=0.10, linewidth=0)
            right.axvline(stator["change_at_dose_h"], color=COLOURS[0], linewidth=0.7, linestyle="--")
        right.set_xlabel(f"hours above {document['threshold_degC']:g} °C")
        right.set_ylabel("R, % of the start")
        right.set_title(
            f"R over the dose: {stator['form'].replace('_', ' ')}, probability {_percent(stator['form_probability'])}",
            loc="left",
            fontsize=9,
        )
        figure.legend(loc="upper left", bbox_to_anchor=(0.055, 0.925), ncols=3, frameon=False, borderpad=0, fontsize=8)
        fall = healthy.change(healthy.hottest_degC, LATE)
        moves = f"With nothing hidden the hottest sensor still moves by {fall:+.1f} K".replace("-", "−")
        headline = f"{moves}, as surfaces darken and the room changes; R does not"
        figure.text(0.06, 0.96, headline, fontsize=10, fontweight="bold", va="center")
        note = (
            "bars: two standard deviations, repeatability included; grey band: where 95 % of the checks of an unchanged"
            " stator lie; blue band: where R turns, 95 %"
        )
        figure.text(0.06, 0.015, note, fontsize=6.5, color=SOFT[0])
        save(figure, target)


def _percent(share: float) -> str:
    return "above 99.9 %" if share > 0.999 else f"{100 * share:.1f} %"


if __name__ == "__main__":
    main()
