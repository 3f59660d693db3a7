"""Stators through oven cycles: how often the hidden form is named, and a bad batch found, from logs of DC checks.

    python benchmarks/ageing.py [--seeds N] [--first SEED] [--heads-only] [--quick] [--json FILE]

Truth: `tests/plant`, bare stators of 24 lumps in free air whose surfaces darken and whose room swings; six a campaign,
16 cycles, two batches. Each seed is run as it is and with a bad batch. `--heads-only`: without iron sensors. Prints
what was hidden against what was named, the error of R over a campaign, and how often a batch or a specimen was listed
with and without a bad batch, with Clopper-Pearson bounds (95 %).
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else a file beside this one hides a package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np

from analytics.insulation import campaign
from analytics.insulation.checks.resistance import CheckResistance, CheckTrace, evaluate_together
from benchmarks import asked
from benchmarks.shared import clopper_pearson
from plant import insulation_campaign
from plant.insulation_campaign import Campaign, Check, Stator
from plant.timeline import Plan

FORMS = ("none", "monotone", "dip_then_rise", "changepoint")


def main() -> None:
    parser = asked.parser(__doc__, seeds=(10, 1), first=(1000, 1000))
    parser.add_argument("--heads-only", action="store_true")
    args = parser.parse_args()
    stators, cycles = (2, 3) if args.quick else (6, 16)
    named: Counter[tuple[str, str]] = Counter()
    alarms: Counter[tuple[bool, str]] = Counter()
    errors: list[float] = []
    without = 0
    for seed in range(args.first, args.first + args.seeds):
        for bad in (False, True):
            plan = Plan(
                stators=stators,
                cycles=cycles,
                bad_batch=bad,
                iron=not args.heads_only,
                electrical=False,
                cycles_a_log=cycles,
            )
            truth = insulation_campaign.run(seed, plan)
            checks = {stator.name: evaluate_together([trace(c) for c in stator.checks]) for stator in truth.stators}
            found = _assessed(truth, checks)
            for stator in truth.stators:
                known = [one.resistance_K_per_W for one in checks[stator.name]]
                without += sum(one is None for one in known)
                if not bad:
                    form = found.forms.get(stator.name)
                    named[stator.form.name, form.name if form else "no R"] += 1
                    errors += _errors(stator, checks[stator.name])
            listed = [one.batch for one in found.fleet.batches if one.outlying]
            alarms[bad, "right batch"] += set(listed) == {"B2"}
            alarms[bad, "a batch"] += bool(listed)
            alarms[bad, "a specimen"] += any(one.outlying for one in found.fleet.specimens)
            alarms[bad, "campaigns"] += 1
        print(f"seed {seed}", file=sys.stderr)
    _print(named, alarms, errors, without)
    rows = {f"{hidden} named {said}": count for (hidden, said), count in named.items()}
    rows |= {f"{'bad batch' if bad else 'no bad batch'}: {what}": count for (bad, what), count in alarms.items()}
    asked.keep(rows, args.json)


def _assessed(truth: Campaign, checks: dict[str, tuple[CheckResistance, ...]]) -> campaign.Assessed:
    rows = [
        (stator, check.dose_h, found.resistance_K_per_W, found.sd_K_per_W or 0.0)
        for stator in truth.stators
        for check, found in zip(stator.checks, checks[stator.name], strict=True)
        if found.resistance_K_per_W is not None
    ]
    return campaign.assess(
        [stator.name for stator, *_ in rows],
        [stator.batch for stator, *_ in rows],
        [dose for _, dose, _, _ in rows],
        [resistance for _, _, resistance, _ in rows],
        [sd for *_, sd in rows],
    )


def trace(check: Check) -> CheckTrace:
    """The log as the reader would give it."""
    columns = {column.name: column.values for column in check.log.columns}
    copper = [name for name in columns if name.startswith("EW_")]
    iron = [name for name in columns if name.startswith("FE_")]
    return CheckTrace(
        t_s=check.log.t_s,
        copper_degC=np.column_stack([columns[name] for name in copper]),
        copper_names=tuple(copper),
        iron_degC=np.column_stack([columns[name] for name in iron]) if iron else np.empty((check.log.t_s.size, 0)),
        iron_names=tuple(iron),
        ambient_degC=columns["T_room"][:, None],
        power_W=columns["I_DC"] * columns["V_DC"],
        current_A=columns["I_DC"],
    )


def _errors(stator: Stator, found: tuple[CheckResistance, ...]) -> list[float]:
    """ln R found less ln R true, each less the specimen's mean: what is common to all checks is no trend."""
    off = [
        np.log((one.resistance_K_per_W or np.nan) / check.resistance_K_per_W) - check.factor
        for one, check in zip(found, stator.checks, strict=True)
    ]
    return [float(value) for value in np.array(off) - np.nanmean(off) if np.isfinite(value)]


def _print(
    named: Counter[tuple[str, str]], alarms: Counter[tuple[bool, str]], errors: list[float], without: int
) -> None:
    said = [*FORMS, "no R"]
    print(f"{'hidden':<16}" + "".join(f"{name:>15}" for name in said) + "    named rightly")
    for hidden in FORMS:
        counts = [named[hidden, name] for name in said]
        right, total = named[hidden, hidden], sum(counts)
        if total:
            print(f"{hidden:<16}" + "".join(f"{count:>15}" for count in counts) + f"    {rate(right, total)}")
    print(f"\nerror of ln R over a campaign, one standard deviation: {100 * np.std(errors):.2f} %")
    print(f"checks without R: {without}")
    for bad in (False, True):
        total = alarms[bad, "campaigns"]
        print(f"\n{'with a bad batch' if bad else 'without a bad batch'}, {total} campaigns")
        for what in ("right batch",) if bad else ("a batch", "a specimen"):
            print(f"  {what} listed: {rate(alarms[bad, what], total)}")


def rate(count: int, total: int) -> str:
    low, high = clopper_pearson(count, total)
    return f"{count} of {total} ({100 * low:.0f} to {100 * high:.0f} %)"


if __name__ == "__main__":
    main()
