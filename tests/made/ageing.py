"""Made-up assessments of ageing, for the tests of what people see."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from replay.studies.ageing.assessment import (
    AssessedLives,
    Assessment,
    Batch,
    DcCheck,
    FleetCounts,
    LivesLaw,
    OneLife,
    Specimen,
)

CHECK = DcCheck(
    session="s",
    session_name="dc_01",
    start_ns=None,
    number=0,
    dose_h=0.0,
    equivalent_h=[0.0, 0.0],
    resistance_K_per_W=0.02,
    sd=0.0001,
    from_="iron sensor",
    state="steady",
    why=None,
    conductivity_percent=100.0,
    hottest_channel="3v",
    hottest_degC=130.0,
)
LATER = replace(
    CHECK, number=1, dose_h=120.0, equivalent_h=[1200.0, 3900.0], resistance_K_per_W=0.025, conductivity_percent=80.0
)
WORSE = Specimen(
    specimen="S01",
    batch="B1",
    cycles=[],
    checks=[CHECK, LATER],
    dose_h=120.0,
    equivalent_h=[1200.0, 3900.0],
    form="monotone",
    form_probability=0.93,
    change_at_dose_h=None,
    level_from_dose_h=None,
    slope_percent_per_100h=20.4,
    ci95=[17.0, 23.0],
    repeatability_percent=0.8,
    significant=True,
    life_used=[0.06, 0.195],
    fleet_slope_percent_per_100h=None,
    fleet_slope_sd=None,
    remaining_h=None,
    score=4.2,
    outlying=True,
    fitted={
        "dose_h": [0.0, 120.0],
        "resistance_K_per_W": [0.02, 0.025],
        "low": [0.0198, 0.0247],
        "high": [0.0202, 0.0253],
    },
    why=None,
)
STILL = replace(
    WORSE,
    specimen="S02",
    form="none",
    slope_percent_per_100h=-0.3,
    ci95=[-1.0, 0.4],
    significant=False,
    score=-0.2,
    outlying=False,
)


def assessment(*specimens: Specimen, batches: list[Batch] | None = None) -> Assessment:
    return Assessment(
        assessment="a" * 16,
        motor=None,
        threshold_degC=180.0,
        criterion="conductivity -50 %",
        activation_energy_eV={"value": 1.0, "ci95": [0.9, 1.1], "from": "assumed"},
        rules=["0.9 eV", "1.1 eV", "10 K rule"],
        repeatability_from="0.8 %, from repeats",
        specimens=list(specimens),
        whole=FleetCounts(
            specimens=len(specimens),
            checks=sum(len(one.checks) for one in specimens),
            weighed=len(specimens),
            changed=dict(Counter(one.form for one in specimens if one.significant)),
            outlying=sum(one.outlying for one in specimens),
            density=None,
        ),
        law=None,
        life=AssessedLives(
            criterion="conductivity -50 %", lives=[], law=None, why="no specimen has reached the criterion yet"
        ),
        batches=batches or [],
        stress=[],
        false_discovery_rate=0.05,
        notes=[],
    )


LONG = "<b>stator</b>\u202e" + "x" * 200
LIVES = [(230.0, 300.0, 340.0), (230.0, 280.0, 300.0), (210.0, 900.0, 1100.0), (210.0, 1000.0, None)]


def course(
    name: str, percent_per_100h: float, batch: str | None = None, checks: int = 9, hours: float = 160.0
) -> Specimen:
    """A specimen whose R rises evenly, with the form that was fitted to it."""
    dose = np.linspace(0.0, hours, checks)
    r = 0.02 * np.exp(percent_per_100h / 1e4 * dose)
    made = [
        replace(CHECK, number=i, dose_h=float(h), resistance_K_per_W=float(k), sd_percent=1.0)
        for i, (h, k) in enumerate(zip(dose, r, strict=True))
    ]
    fitted = {"dose_h": dose, "resistance_K_per_W": r, "low": 0.99 * r, "high": 1.01 * r}
    return replace(
        WORSE,
        specimen=name,
        batch=batch,
        checks=made,
        significant=percent_per_100h > 5.0,
        outlying=False,
        slope_percent_per_100h=percent_per_100h,
        fleet_slope_percent_per_100h=percent_per_100h,
        fleet_slope_sd=1.5,
        fitted={end: values.tolist() for end, values in fitted.items()},
    )


def aged() -> Assessment:
    """Two batches, one of which stands out, a name that is far too long, one of several words, and lives that tell a
    law."""
    specimens = [course(f"S{i:02}", 2.0 + 20.0 * (i < 4), f"B{i // 4 + 1}") for i in range(8)]
    specimens[5] = replace(specimens[5], specimen=LONG)
    specimens[6] = replace(specimens[6], specimen="rewound_after.second-oven_cycle")
    batches = [
        Batch(batch="B1", specimens=4, slope_percent_per_100h=22.0, score=5.1, outlying=True),
        Batch(batch="B2", specimens=4, slope_percent_per_100h=2.0, score=-1.4, outlying=False),
    ]
    lives = [OneLife(specimen=f"S{i:02}", degC=t, lower_h=low, upper_h=high) for i, (t, low, high) in enumerate(LIVES)]
    law = LivesLaw(
        distribution="lognormal",
        activation_energy_eV={"value": 1.2, "ci95": [0.9, 1.5]},
        median_h_at_180degC={"value": 6000.0, "ci95": [4000.0, None]},
        temperature_index_degC=None,
        halving_interval_K=None,
        why_no_index="three temperatures are needed",
    )
    life = AssessedLives(criterion="conductivity -50 %", lives=lives, law=law, why=None)
    return replace(assessment(*specimens, batches=batches), life=life)
