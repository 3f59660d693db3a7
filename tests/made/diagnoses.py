"""Made-up diagnoses of every ending, and runs to go with them, for the tests of what people see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from made.runs import made_run
from replay.engine.results.run import Observed, Run
from replay.studies.diagnosis.answer import (
    ChainStep,
    Diagnosis,
    EvidenceParts,
    ForeseenTest,
    KeptGain,
    LawCourse,
    Masked,
    Named,
    Relieved,
    Rival,
    Shown,
    SteadyPoint,
    Telling,
    TwoModels,
    UnnamedHeat,
    UnseenNode,
    Unusual,
)

TRAIN, KEPT = ("1_s1", "2_s2", "3_wltp"), ("4_s1", "5_wltp")
LEFT: Mapping[str, float] = {
    "published": 1.0,
    "recalibrated": 0.7,
    "extended": 0.1,
}  # share of the rotor's error that stays


def session_id(name: str) -> str:
    """The id that `made_run` gives a session."""
    return f"5e55{name}"


def runs(*models: str, names: tuple[str, ...] = (*TRAIN, *KEPT), steps: int = 2400) -> dict[str, dict[str, Run]]:
    """Session id -> model -> run; the rotor surface's error shrinks from published over recalibrated to extended."""
    wanted = models or tuple(LEFT)
    return {session_id(name): {model: _under(model, made_run(name, steps)) for model in wanted} for name in names}


def _under(model: str, run: Run) -> Run:
    noise = np.random.default_rng(3)
    observed = tuple(_explained(o, LEFT[model], noise.normal(0, 0.1, o.measured.size)) for o in run.observed)
    return replace(run, run=f"{model[0]}5b6c7d8e9f00112", observed=observed)


def _explained(observed: Observed, left: float, noise: Any) -> Observed:
    measured = observed.measured + noise
    if observed.node != "rotor_surface":
        return replace(observed, measured=measured)
    return replace(observed, measured=measured, modelled=observed.modelled + (1 - left) * observed.residual)


def shown(node: str, mae_K: float, session: str = "3_wltp", **more: Any) -> Shown:
    """An entry of `shown` with a floor of 0.4 K."""
    values: dict[str, Any] = {
        "session": session_id(session),
        "session_name": session,
        "channel": f"T_{node.upper()}",
        "node": node,
        "mae_K": mae_K,
        "max_K": 2.8 * mae_K,
        "bias_K": 0.7 * mae_K,
        "floor_K": 0.4,
        "white": mae_K < 0.4,
        "where": {},
    }
    return Shown(**(values | more))


EDDY = Named(
    id="loss.magnet.speed2_current2",
    says="magnet loss grows with speed squared and current squared",
    members=["magnet"],
    estimate=96.0,
    ci95=[88.0, 104.0],
    unit="W",
    typical_W=14.2,
    largest_effect_K=6.3,
    largest_effect_node="magnet",
    largest_effect_session=session_id("3_wltp"),
    largest_effect_t_s=4360.0,
    formula="loss of magnet [W] += 96 (n/16000 rpm)^2 (I/450 A)^2",
    log_bayes_factor=310.2,
    probability=0.97,
    member_probability=0.9,
    indistinguishable_from=[],
    separating_test=None,
    significant=True,
    identified=True,
    improved=True,
    why_not_improved=None,
)
BIAS = replace(
    EDDY,
    id="sensor.endwinding_b_outer.gain",
    says="the sensor at endwinding b outer reads off in proportion",
    members=["endwinding_b_outer"],
    estimate=0.0312,
    ci95=[0.0284, 0.0341],
    unit="1",
    typical_W=None,
    largest_effect_K=-3.4,
    largest_effect_node="endwinding_b_outer",
    formula="reading of endwinding_b_outer = 1.0312 x truth",
    log_bayes_factor=41.0,
    probability=0.92,
)
RIVALS = [
    Rival(
        id="loss.rotor_surface.speed3",
        says="rotor surface loss grows with speed cubed",
        log_bayes_factor=288.2,
        why_not="22 behind in log Bayes factor after both were refitted",
    ),
    Rival(
        id="conductance.rotor_surface-teeth.scale",
        says="the heat path between rotor surface and teeth is off by one factor",
        log_bayes_factor=269.0,
        why_not="41 behind in log Bayes factor after both were refitted",
    ),
    Rival(
        id="sensor.magnet.gain",
        says="the sensor at magnet reads off in proportion",
        log_bayes_factor=250.0,
        why_not="60 behind in log Bayes factor after both were refitted",
    ),
]
SHOWN = [
    shown("rotor_surface", 4.8, "1_s1"),
    shown("endwinding_a_outer", 0.3, "1_s1"),
    shown("magnet", 6.1, where={"speed_rpm": [8012.0, 16000.0], "current_A": [301.0, 450.0]}),
    shown("rotor_surface", 5.6, where={"speed_rpm": [8012.0, 16000.0]}),
    shown("endwinding_a_outer", 0.2),
]


def gain(
    node: str,
    before: float,
    after: float,
    ci: tuple[float, float],
    published: float,
    share: float = 0.08,
    recorded: tuple[float, ...] = (),
    moved: float = 0.0,
) -> KeptGain:
    """An entry of `gain` over few sessions. `recorded`: errors as published, before and after, as far as a file says
    them, against a reading that learnt corrections move by `moved`."""
    return KeptGain(
        node=node,
        mae_before_K=before,
        mae_after_K=after,
        ci95_K=list(ci),
        interval="within these sessions",
        published_mae_K=published,
        outside_trained_share=share,
        rms_inside_K=[1.2 * before, 1.2 * after],
        rms_outside_K=[2 * before, 2 * after] if share else [],
        mae_recorded_K=dict(zip(("published", "before", "after"), recorded, strict=False)),
        reading_moved_K=moved,
    )


GAIN = [
    gain("endwinding_a_outer", 0.33, 0.32, (-0.05, 0.07), 0.6, recorded=(0.5, 0.6, 0.7), moved=0.04),
    gain("magnet", 6.1, 0.9, (4.1, 6.0), 9.0, recorded=(10.1, 6.4, 2.3), moved=-1.7),
    gain("rotor_surface", 5.2, 0.8, (3.4, 5.1), 7.7, recorded=(7.9, 5.3, 1.0)),
]

NO_LOAD = "S1 at 12,000 rpm and 0 A, 60 min"
APART = TwoModels(
    over_kept=True,
    relieved=[
        Relieved(parameter="conductance jacket-coolant", before_sd=-2.3, after_sd=-0.2),
        Relieved(parameter="loss of teeth near 8,000 rpm", before_sd=1.4, after_sd=0.4),
    ],
    inside=[
        UnseenNode(node="rotor_core", mean_K=1.2, max_K=3.4, session=session_id("5_wltp"), t_s=1860.0),
        UnseenNode(node="shaft", mean_K=0.3, max_K=0.9, session=session_id("4_s1"), t_s=600.0),
    ],
    points=[
        SteadyPoint(says="S1 at 3,000 rpm and 0 A, 60 min", at={"speed_rpm": 3000.0}, node="shaft", differ_K=0.2),
        SteadyPoint(says=NO_LOAD, at={"speed_rpm": 12000.0}, node="rotor_core", differ_K=-7.4),
    ],
    test=Telling(says=NO_LOAD, node="magnet", channel="MAG_1", differ_K=-5.9, times_sensor=11.8),
    sensor=Telling(says=NO_LOAD, node="rotor_core", channel=None, differ_K=-7.4, times_sensor=14.8),
)

SPEEDS_RPM = [0.0, 4000.0, 8000.0, 12000.0, 16000.0]


def over_speed(size: float, exponent: float) -> list[float]:
    """A law of speed, `size` at 16,000 rpm."""
    return [size * (rpm / 16000.0) ** exponent for rpm in SPEEDS_RPM]


LAW = LawCourse(
    cause=EDDY.id,
    place="magnet",
    unit="W",
    at={"current_A": 250.0},
    speed_rpm=SPEEDS_RPM,
    published=over_speed(40.0, 1.5),
    recalibrated=over_speed(70.0, 1.5),
    extended=over_speed(136.0, 2.0),
    low=over_speed(128.0, 2.0),
    high=over_speed(144.0, 2.0),
    rivals={RIVALS[0].id: over_speed(60.0, 1.5), RIVALS[1].id: over_speed(75.0, 1.5)},
    trained_rpm=[[0.0, 2000.0], [6000.0, 12000.0]],
)
FORESEEN = ForeseenTest(
    says=NO_LOAD,
    channel="MAG_1",
    node="magnet",
    floor_K=0.5,
    t_s=[0.0, 1800.0, 3600.0],
    reads={RIVALS[0].id: [20.0, 61.0, 64.5], "recalibrated": [20.0, 65.0, 69.9], EDDY.id: [20.0, 60.0, 64.0]},
)

NAMED = Diagnosis(
    diagnosis="7f31beef" * 8,
    motor="reference-150kW",
    level="testing",
    model="9ac1f00d" * 8,
    train=[session_id(name) for name in TRAIN],
    held_out=[session_id(name) for name in KEPT],
    train_names=list(TRAIN),
    held_out_names=list(KEPT),
    opened_before=False,
    shown=SHOWN,
    causes=[EDDY],
    rivals=RIVALS,
    unknown=[],
    masked=[],
    recalibrated_model="1ca11b00" * 8,
    extended_model="e4e4d00d" * 8,
    extended_bench=None,
    gain=GAIN,
    log_score_gain=812.3,
    log_score_gain_lower=640.0,
    few_kept_data=False,
    candidates=213,
    dropped=[],
    steps=68_000,
    null_log_bayes_factor=4.6,
    threshold=8.0,
    next_test=None,
    two_models=APART,
    laws=[LAW],
    foreseen=FORESEEN,
)
NOTHING_ADDED: dict[str, Any] = {
    "laws": [],
    **dict.fromkeys(("extended_model", "log_score_gain", "log_score_gain_lower", "two_models", "foreseen")),
}


def step(number: int, cause: Named | None, better: int, left_out: float, kept: float) -> ChainStep:
    """A step of a chain with errors at two nodes, the second twice the first."""
    return ChainStep(
        step=number,
        id=cause.id if cause else None,
        told_together=[],
        formula=cause.formula if cause else "",
        log_bayes_factor=cause.log_bayes_factor if cause else None,
        sessions_better=better,
        sessions=3,
        left_out_mae_K={"magnet": left_out, "rotor_surface": 2 * left_out},
        kept_mae_K={"magnet": kept, "rotor_surface": 2 * kept} if kept else {},
        model="9ac1f00d" * 8,
        bench=None,
    )


SEVERAL = replace(
    NAMED,
    causes=[EDDY, BIAS],
    chain=[
        step(-1, None, 0, 6.0, 5.0),
        step(0, None, 3, 4.0, 3.4),
        step(1, EDDY, 2, 1.0, 1.2),
        step(2, BIAS, 3, 0.6, 0.8),
    ],
    extended_bench="be4c4000" * 8,
    masked=[
        Masked(
            session=session_id("3_wltp"),
            session_name="3_wltp",
            channel="MAG_1",
            says="MAG_1 holds its last value for 240 s, 6 times",
        )
    ],
    dropped=["loss.magnet.temperature"],
    few_kept_data=True,
    opened_before=True,
)
TOLD_APART = replace(
    NAMED,
    causes=[
        replace(
            EDDY,
            identified=False,
            probability=0.95,
            member_probability=0.41,
            indistinguishable_from=["loss.magnet.speed_current2", "conductance.magnet-rotor_core.scale"],
            separating_test="S2 at 12,000 rpm, 60 s pulses of 300 A, with the magnet sensor",
        )
    ],
)
NOT_IMPROVED = replace(
    NAMED,
    causes=[
        replace(EDDY, improved=False, why_not_improved="the lower bound of the log score's gain is below zero (-3.1)")
    ],
    gain=[
        gain("magnet", 0.61, 0.58, (-0.1, 0.15), 9.0, recorded=(9.2, 0.8, 0.8)),
        gain("rotor_surface", 0.5, 0.62, (-0.2, -0.05), 7.7, recorded=(7.6, 0.5, 0.6)),
    ],
)
TAKEN = replace(
    NOT_IMPROVED,
    gain=[
        gain("magnet", 0.2, 0.2, (-0.1, 0.1), 9.0, recorded=(9.2, 0.2, 0.2)),
        gain("rotor_surface", 0.2, 0.2, (-0.1, 0.1), 6.5, recorded=(6.6, 0.2, 0.2)),
    ],
)
RIVALS_BELOW = [
    replace(rival, log_bayes_factor=value, why_not="below the threshold 8")
    for rival, value in zip(RIVALS, (1.2, 0.4, -1.1), strict=True)
]
SILENT = replace(
    NAMED,
    **NOTHING_ADDED,
    causes=[],
    rivals=RIVALS_BELOW,
    shown=[shown("magnet", 0.3), shown("endwinding_a_outer", 0.2)],
    gain=[gain("magnet", 0.2, 0.2, (0.0, 0.0), 0.3)],
)
ABSORBED = replace(
    SILENT,
    shown=SHOWN,
    gain=[
        gain("magnet", 0.3, 0.3, (0.0, 0.0), 9.0, recorded=(10.1, 1.4), moved=-1.7),
        gain("rotor_surface", 0.2, 0.2, (0.0, 0.0), 7.7, recorded=(7.9, 0.3)),
    ],
)
WORSE = replace(
    ABSORBED,
    recalibrated_model=None,
    gain=[
        gain("rotor", 2.5, 2.5, (0.0, 0.0), 1.4, recorded=(1.6, 2.8), moved=0.11),
        gain("magnet", 0.3, 0.3, (0.0, 0.0), 0.5, recorded=(0.6, 0.4)),
    ],
)
UNKNOWN = replace(
    NAMED,
    **NOTHING_ADDED,
    causes=[],
    rivals=[replace(rival, why_not="free heat at endwinding_b_outer is ahead by more than ln 20") for rival in RIVALS],
    unknown=[
        UnnamedHeat(
            node="endwinding_b_outer",
            watts=[20.0, 45.0],
            when={"endwinding_b_outer_degC": [90.0, 140.0], "speed_rpm": [3012.0, 5990.0]},
            goes_with=["endwinding_b_outer", "current"],
            log_bayes_factor=373.0,
        )
    ],
    gain=[],
    next_test="S2 at 6,000 rpm, 60 s pulses, with a sensor in air_b",
)
TOO_LITTLE = replace(
    ABSORBED,
    rivals=[replace(RIVALS[0], log_bayes_factor=6.1, why_not="below the threshold 8")],
    train=[session_id("3_wltp")],
    train_names=["3_wltp"],
    held_out=[],
    held_out_names=[],
    gain=[],
    next_test="S2 at 6,000 rpm, 60 s pulses of 300 A",
)
IRON = Unusual(
    about="family",
    when="before",
    kind="loss",
    place=None,
    says="form of the losses in iron",
    session=None,
    times_usual=3.14,
    log_evidence=34.2,
    estimate=None,
    ci95=[],
    unit="1",
    bound=None,
    sharper="a no-load speed ladder",
)
PATH = replace(
    IRON,
    about="moved",
    kind="conductance",
    place="endwinding-coolant",
    says="the heat path between endwinding and coolant",
    times_usual=2.13,
    log_evidence=None,
    estimate=0.62,
    ci95=[0.31, 1.0],
    sharper="sensors at both ends",
)
BOUND = replace(
    PATH,
    about="bound",
    place="housing-air",
    says="the heat path between housing and air",
    times_usual=-3.5,
    estimate=-0.75,
    ci95=[-0.8, -0.7],
    bound="a factor of 4",
)
OFFSET = replace(
    PATH,
    kind="sensor",
    place="EW_A_inner",
    says="the offset of EW_A_inner",
    session=session_id("3_wltp"),
    times_usual=-2.2,
    estimate=-1.03,
    ci95=[-1.4, -0.66],
    unit="K",
    sharper="a session at standstill",
)
STRANGE = replace(ABSORBED, findings=[IRON, BOUND, PATH, OFFSET])
EVIDENCE = EvidenceParts(
    fit=120.4, priors_relieved=192.31, rest=-2.51, relieved={"form of the losses in magnet": 150.0, "films": 40.1}
)
EXPLAINED = replace(
    NAMED,
    causes=[replace(EDDY, evidence=EVIDENCE)],
    rivals=[replace(RIVALS[0], evidence=replace(EVIDENCE, relieved={}))],
    findings=[IRON, PATH, OFFSET, *(replace(one, when="after") for one in (BOUND, PATH))],
)
ALL: Mapping[str, Diagnosis] = {
    "named": NAMED,
    "several": SEVERAL,
    "told_apart": TOLD_APART,
    "not_improved": NOT_IMPROVED,
    "taken": TAKEN,
    "silent": SILENT,
    "absorbed": ABSORBED,
    "worse": WORSE,
    "unknown": UNKNOWN,
    "too_little": TOO_LITTLE,
    "strange": STRANGE,
    "explained": EXPLAINED,
}
