"""What each DC check says of the slots' insulation: through the rig's network in the motor file, beside routes that
know no motor.

    python benchmarks/checks.py [--seeds N] [--first SEED] [--quick] [--json FILE]

Truth: `tests/plant`, bare stators of 24 lumps in free air, two of three phases energised, whose surfaces darken from
0.80 to 0.90 and whose room swings; nine checks each without an error of their own. The motor file
(`plant.bare_stator_motor`) has five nodes; no stator is as drawn (conductances 10 %, capacities 4 %), and in every
other seed the file's conductances are off by 30 % besides. Printed by route: how steep the course of ln R is against
that of the slots' resistance, what is left of it, what the surfaces alone make of R where nothing changes, and the
stated sd against the error.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else a file beside this one hides a package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray

from analytics.insulation.checks.resistance import CheckResistance, CheckTrace, evaluate_together
from benchmarks import asked
from plant import bare_stator_motor, dc_check, insulation_campaign
from plant.insulation_campaign import Check
from plant.timeline import Plan
from replay.engine.files.motor_file import read_motor
from replay.studies.ageing.configured_checks import LoggedCheck, Rig
from twin.fitting.recorded import RecordedChannel, Test
from twin.motor.configured import configured
from twin.motor.features import monomials
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

PLAN = Plan(stators=1, cycles=8, repeatability=0.0, early_stops=0.0, dead=0.0, electrical=False)
FORMS = ("none", "monotone", "dip_then_rise")
RIG = "stator_in_air"
FILE_OFF = 0.3
NODES = {t.signal: t.node for t in dc_check.THERMOCOUPLES} | {
    f"FE_{name}": name.split("_")[0] for name in dc_check.IRON
}


def main() -> None:
    args = asked.parser(__doc__, seeds=(6, 1), first=(3000, 3000)).parse_args()
    plan = replace(PLAN, cycles=2) if args.quick else PLAN
    rows: dict[str, list[list[float]]] = defaultdict(list)
    still: dict[str, list[list[float]]] = defaultdict(list)
    for seed in range(args.first, args.first + args.seeds):
        network = _network(seed)
        for form in FORMS:
            (stator,) = insulation_campaign.run(seed, replace(plan, forms=(form,))).stators
            truth = np.log([check.insulation for check in stator.checks])
            for name, answers in _by_route(stator.checks, network).items():
                known = np.array([one.resistance_K_per_W or np.nan for one in answers])
                sd = np.array([one.sd_K_per_W or np.nan for one in answers]) / known
                if np.isfinite(known).all():
                    (still if form == "none" else rows)[name].append(_measured(np.log(known), sd, truth))
        print(f"seed {seed}", file=sys.stderr)
    _print(rows, still)
    said = ("slope", "left_over", "trend", "error_over_sd", "sd")
    found = {
        name: {
            "changing": dict(zip(said, np.mean(some, axis=0).tolist(), strict=True)),
            "surfaces_alone": dict(zip(said[1:], np.mean(still[name], axis=0).tolist()[1:], strict=True)),
        }
        for name, some in rows.items()
    }
    asked.keep(found, args.json)


def _network(seed: int) -> Network:
    """The rig; off in every other seed."""
    text = bare_stator_motor.motor_toml().encode()
    rig = configured(read_motor(text, "motor.toml"), bare_stator_motor.CONFIGURATION)
    random = np.random.default_rng([seed, 91])
    off = FILE_OFF * (seed % 2)
    return replace(
        rig,
        links=tuple(
            replace(
                link,
                terms=tuple(
                    replace(term, coefficient=term.coefficient * float(np.exp(off * random.standard_normal())))
                    for term in link.terms
                ),
            )
            for link in rig.links
        ),
    )


def _by_route(checks: tuple[Check, ...], network: Network) -> dict[str, tuple[CheckResistance, ...]]:
    """Every route, made to answer by itself: with the iron's sensors and with those in the heads alone."""
    found = {}
    for iron, wanted in ((True, ("iron sensor",)), (False, ("first minutes", "ambient"))):
        logged = [LoggedCheck(_trace(check, iron), RIG, network, _test(check, network, iron)) for check in checks]
        traces = [one.trace for one in logged]
        rig = Rig.of(logged)
        assert rig is not None
        for route in rig.routes():
            if route.source.split(",")[0] in wanted:
                found[route.source] = evaluate_together(traces, [route])
        found[wanted[0]] = evaluate_together(traces)
        if not iron:  # rows of three minutes leave no first minutes
            found["ambient"] = evaluate_together([_rows(trace, 18) for trace in traces])
    return found


def _measured(ln_r: Floats, sd: Floats, truth: Floats) -> list[float]:
    """Slope over the truth (NaN where that is level), rms of what a slope of 1 leaves, last check less first of that,
    error in sds."""
    got, true = ln_r - ln_r.mean(), truth - truth.mean()
    left = got - true
    slope = float(got @ true / (true @ true)) if np.ptp(truth) > 0.0 else np.nan
    ends = float(np.polyfit(np.linspace(0.0, 1.0, left.size), left, 1)[0])
    return [slope, float(np.sqrt(np.mean(left**2))), ends, float(np.sqrt(np.mean((left / sd) ** 2))), float(sd.mean())]


def _print(rows: dict[str, list[list[float]]], still: dict[str, list[list[float]]]) -> None:
    print(f"\n{'route':45} slope (least to most)   left over    sd  | surfaces alone: trend, scatter")
    for name, some in rows.items():
        found, alone = np.array(some), np.array(still[name])
        low, mean, high = found[:, 0].min(), found[:, 0].mean(), found[:, 0].max()
        print(
            f"{name:45s} {mean:5.2f} ({low:.2f} to {high:.2f})     {100 * found[:, 1].mean():7.1f} %"
            f" {100 * found[:, 4].mean():5.1f} % | "
            f"{100 * alone[:, 2].mean():+6.2f} %, {100 * alone[:, 1].mean():.2f} % ({alone[:, 3].mean():.1f} of the sd)"
        )


# ---- logs as arrays ------------------------------------------------------------------------------------------------


def _trace(check: Check, iron: bool) -> CheckTrace:
    log = check.log
    copper = [name for name in NODES if name.startswith("EW_")]
    irons = [name for name in NODES if iron and name.startswith("FE_")]
    return CheckTrace(
        t_s=log.t_s,
        copper_degC=np.column_stack([log[name] for name in copper]),
        copper_names=tuple(copper),
        iron_degC=np.column_stack([log[name] for name in irons]) if irons else np.empty((log.t_s.size, 0)),
        iron_names=tuple(irons),
        ambient_degC=log["T_room"][:, None],
        power_W=log["I_DC"] * log["V_DC"],
        current_A=log["I_DC"],
    )


def _rows(trace: CheckTrace, every: int) -> CheckTrace:
    kept = slice(0, None, every)
    return replace(
        trace,
        t_s=trace.t_s[kept],
        copper_degC=trace.copper_degC[kept],
        iron_degC=trace.iron_degC[kept],
        ambient_degC=trace.ambient_degC[kept],
        power_W=trace.power_W[kept],
        current_A=None if trace.current_A is None else trace.current_A[kept],
    )


def _test(check: Check, network: Network, iron: bool) -> Test:
    """The log in its own steps."""
    log = check.log
    current = np.abs(log["I_DC"]) / network.scale["current"]
    features = np.column_stack([np.prod([current**power for _, power in m.powers], axis=0) for m in monomials(network)])
    seen = [name for name in NODES if iron or name.startswith("EW_")]
    steps = np.zeros(log.t_s.size)
    return Test(
        name=log.name,
        kind="dc_check",
        frame=Frame(float(log.t_s[1] - log.t_s[0]), features, log["T_room"][:, None].copy()),
        inputs={"current": current},
        features={m.name: features[:, j] for j, m in enumerate(monomials(network))},
        initial=np.full(len(network.nodes), float(log["T_room"][0])),
        initial_sd=np.ones(len(network.nodes)),
        channels=tuple(
            RecordedChannel(
                Sensor(
                    name,
                    {NODES[name]: 1.0},
                    bus="log",
                    noise=dc_check.NOISE_K,
                    resolution=dc_check.STEP_K,
                    bias_sd=dc_check.OFFSET_K,
                ),
                measured=np.nan_to_num(log[name]),
                samples=np.isfinite(log[name]).astype(np.float64),
                place=steps,
            )
            for name in seen
        ),
    )


if __name__ == "__main__":
    main()
