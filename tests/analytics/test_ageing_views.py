"""Views over the latest assessment of ageing and over inspections, on tables made by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from analytics import warehouse
from analytics.columns import AGEING
from analytics.query import run
from analytics.rebuild import rebuild
from analytics.reference import examples
from ingest.facts.events import (
    AgeingAssessed,
    CalibrationCompleted,
    CauseNamed,
    DiagnosisCompleted,
    InspectionRecorded,
    SessionRegrouped,
)
from ingest.facts.store import Store
from replay.studies.ageing.tables import schema_of

ASSESSED = ("conductivity_by_cycle", "life_used", "fleet_health", "changepoints", "batches")
START_NS = 1_760_000_000_000_000_000
CONDUCTIVITY = {"S1": (100.0, 101.0, 70.0, 45.0), "S2": (100.0, 99.0, 98.0), "S3": (100.0,)}
DOSE_H = {"S1": (0.0, 24.0, 48.0, 72.0), "S2": (0.0, 24.0, 24.0), "S3": (0.0,)}
Rows = Sequence[Mapping[str, Any]]


def check(specimen: str, number: int, conductivity: float) -> dict[str, Any]:
    dose = DOSE_H[specimen][number]
    return {
        "session": "oven_a-id" if number == 0 else f"later-{number}",
        "session_name": f"dc_{number}",
        "specimen": specimen,
        "batch": "B1",
        "start_ns": START_NS + number * 10**9,
        "number": number,
        "dose_h": dose,
        "equivalent_low_h": 10 * dose,
        "equivalent_high_h": 32 * dose,
        "resistance_K_per_W": 2.0 / conductivity,
        "sd_K_per_W": float("nan"),
        "conductivity_percent": conductivity,
        "source": "iron sensor",
        "state": "steady",
        "why": None,
        "hottest_channel": "EW",
        "hottest_degC": 131.0,
    }


def specimen(name: str, turn_h: float | None, slope: float, score: float) -> dict[str, Any]:
    numbers = {column: 1.0 for column, kind in AGEING["ageing_specimens"].items() if kind == "DOUBLE"}
    return {
        **numbers,
        "specimen": name,
        "batch": "B1",
        "checks": len(CONDUCTIVITY[name]),
        "form": "none" if turn_h is None else "changepoint",
        "change_at_dose_h": turn_h,
        "slope_percent_per_100h": slope,
        "remaining_high_h": float("inf"),
        "score": score,
        "significant": turn_h is not None,
        "outlying": abs(score) > 4,
        "why": None,
    }


CHECKS: Rows = [check(name, number, value) for name, some in CONDUCTIVITY.items() for number, value in enumerate(some)]
SPECIMENS: Rows = [specimen("S1", 96.0, 3.1, 4.1), specimen("S2", None, 0.1, -0.3), specimen("S3", None, 0.2, 0.4)]
BATCHES: Rows = [
    {"batch": name, "specimens": 3, "slope_percent_per_100h": slope, "score": score, "outlying": score > 4}
    for name, slope, score in (("B1", 0.1, -0.2), ("B3", 5.0, 5.2))
]


HOURS: Rows = [
    {
        "specimen": "S1",
        "batch": "B1",
        "session": "oven_a-id",
        "session_name": "oven_a",
        "channel": "EW",
        "degC": degC,
        "hours": hours,
    }
    for degC, hours in ((180.0, 2.0), (190.0, 3.0))
]


def assess(store: Store, name: str, **rows: Rows) -> None:
    """Seal the tables of an assessment and append its event."""
    sealed = {}
    for kind, some in rows.items():
        path = store.work() / f"{kind}.parquet"
        pq.write_table(pa.Table.from_pylist([dict(row) for row in some], None if some else schema_of(kind)), path)
        sealed[kind] = store.archive.seal(path)
    event = AgeingAssessed(
        assessment=name, key={}, answer=store.archive.seal(b"{}"), artefacts=sealed, sessions=["oven_a-id"], digest="d"
    )
    store.ledger.append(f"ageing-{name}", event)


@pytest.fixture
def assessed(store: Store) -> Store:
    assess(store, "a1", checks=CHECKS, specimens=SPECIMENS, batches=BATCHES, hours=HOURS)
    return store


def ask(store: Store, sql: str, as_of: str | None = None) -> list[tuple[Any, ...]]:
    with warehouse.refresh(store, as_of) as opened:
        return run(opened.connection, sql).rows


def inspect(store: Store, number: str, **said: Any) -> None:
    given = {"happened": None, "session": None, "specimen": "stator-07", "finding": "crack"} | said
    event = InspectionRecorded(
        inspection=number, sha256=number * 64, name=f"{number}.jpg", media_type="image/jpeg", size=7, **given
    )
    store.ledger.append(f"inspection-{number}", event)


# ---- the latest assessment -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", ASSESSED)
def test_before_the_first_assessment_a_view_is_empty(shared_store: Store, view: str) -> None:
    assert ask(shared_store, f"FROM {view}") == []


def test_conductivity_is_told_check_after_check(assessed: Store) -> None:
    rows = ask(
        assessed,
        "SELECT specimen, batch, number, session_name, start, dose_h, equivalent_low_h, "
        "equivalent_high_h, conductivity_percent, "
        "resistance_K_per_W, sd_K_per_W, source, hottest_channel, hottest_degC, assessment FROM conductivity_by_cycle",
    )
    assert [row[:3] for row in rows] == [("S1", "B1", n) for n in range(4)] + [("S2", "B1", n) for n in range(3)] + [
        ("S3", "B1", 0)
    ]
    assert rows[0][3:] == (
        *("dc_0", datetime(2025, 10, 9, 8, 53, 20), 0.0, 0.0, 0.0, 100.0, 0.02, None),
        *("iron sensor", "EW", 131.0, "a1"),
    )
    assert rows[1][3] == "dc_1"


def test_specimens_that_stand_out_come_first_and_what_is_not_finite_is_null(assessed: Store) -> None:
    assert ask(assessed, "SELECT specimen, score, outlying, significant FROM fleet_health") == [
        ("S1", 4.1, True, True),
        ("S3", 0.4, False, False),
        ("S2", -0.3, False, False),
    ]
    rows = ask(assessed, "SELECT specimen, dose_h, life_used_high, remaining_low_h, remaining_high_h FROM life_used")
    assert rows == [(name, 1.0, 1.0, 1.0, None) for name in ("S1", "S2", "S3")]


def test_a_changepoint_is_a_form_that_turns(assessed: Store) -> None:
    assert ask(assessed, "SELECT specimen, change_at_dose_h, form FROM changepoints") == [("S1", 96.0, "changepoint")]


def test_batches_that_stand_out_come_first(assessed: Store) -> None:
    assert ask(assessed, "FROM batches") == [("B3", 3, 5.0, 5.2, True, "a1"), ("B1", 3, 0.1, -0.2, False, "a1")]


def test_only_the_latest_assessment_is_shown_and_an_earlier_one_as_of_its_event(assessed: Store) -> None:
    before = str(assessed.ledger.head().position)
    assess(assessed, "a2", checks=CHECKS[:1], specimens=SPECIMENS[:1], batches=[])
    counts = (f"(SELECT count(*) FROM {view})" for view in ("conductivity_by_cycle", "life_used", "batches"))
    latest = f"SELECT {', '.join(counts)}"
    assert ask(assessed, latest) == [(1, 1, 0)]
    assert ask(assessed, latest, before) == [(8, 3, 2)]
    assess(assessed, "a1", checks=CHECKS, specimens=SPECIMENS, batches=BATCHES)  # asked again, it is the latest
    assert ask(assessed, "SELECT DISTINCT assessment FROM fleet_health") == [("a1",)]


def test_a_column_that_an_assessment_lacks_is_null(store: Store) -> None:
    assess(store, "a1", specimens=[{"specimen": "S1", "score": 1.0}])
    assert ask(store, "SELECT specimen, batch, form, slope_low, outlying FROM fleet_health") == [
        ("S1", None, None, None, None)
    ]
    assert ask(store, "FROM conductivity_by_cycle") == []


def test_the_views_are_the_same_after_a_rebuild(assessed: Store) -> None:
    inspect(assessed, "1", session="oven_a-id")
    ask(assessed, "FROM batches")
    assert rebuild(assessed, lambda *_: [], verify=True).differences == ()


# ---- inspections ---------------------------------------------------------------------------------------------------


def test_an_inspection_is_placed_by_what_was_said_else_by_the_end_of_its_session(store: Store) -> None:
    inspect(store, "1", happened="2025-12-24T08:00:00.000000Z")
    inspect(store, "2", session="oven_a-id")
    inspect(store, "3")
    rows = ask(store, "SELECT name, happened, happened_from, session_name, batch, finding FROM inspections")
    assert rows == [
        ("2.jpg", datetime(2025, 10, 9, 8, 53, 24), "end of the session", "oven_a", "B3", "crack"),
        ("1.jpg", datetime(2025, 12, 24, 8), "said", None, None, "crack"),
        ("3.jpg", None, None, None, None, "crack"),
    ]


def test_an_inspection_follows_its_session_into_the_one_that_it_became_part_of(store: Store) -> None:
    inspect(store, "1", session="old-id")
    joined = SessionRegrouped(session="old-id", into="oven_a-id", why="a late file joined")
    store.ledger.append("session-old-id", joined)
    assert ask(store, "SELECT session, session_name FROM inspections") == [("oven_a-id", "oven_a")]


# ---- questions -----------------------------------------------------------------------------------------------------


@pytest.fixture
def questioned(assessed: Store) -> Store:
    """With a calibration, a diagnosis that named ageing, one that did not, and a finding."""
    numbers = {"log_change": 0.1, "sd": 0.02, "prior_sd": 0.4, "held": False}
    parameters = [{"name": "winding-teeth", "unit": "W/K", "before": 40.0, "value": 36.0, **numbers}]
    calibration = CalibrationCompleted(
        calibration="c1", sessions=["1_s1-id"], parent="m" * 64, model="n" * 64, motor="reference", level="testing",
        key={},
        environment={}, converged=True, iterations=3, log_posterior=0.0, parameters=parameters, errors=[],
    )  # fmt: skip
    assessed.ledger.append("calibration-c1", calibration)
    for number, cause in (("d1", "ageing.winding_a-teeth.hours_above_180degC"), ("d2", "loss.magnet.scale")):
        named = CauseNamed(diagnosis=number, cause=cause, estimate=1.0, unit="1", log_bayes_factor=9.0, probability=0.8)
        key = {"train": ["1_s1-id"] if number == "d1" else ["oven_a-id"], "held_out": []}
        assessed.ledger.append(f"diagnosis-{number}", named)
        done = DiagnosisCompleted(diagnosis=number, key=key, artefact="a" * 64, summary={"causes": [cause]})
        assessed.ledger.append(f"diagnosis-{number}", done)
    inspect(assessed, "1", session="oven_a-id")
    return assessed


def answer(store: Store, title: str) -> list[tuple[Any, ...]]:
    (sql,) = [text for text in examples() if title in text.split("\n")[0]]
    return ask(store, sql)


def test_every_example_of_the_page_has_an_answer(questioned: Store) -> None:
    with warehouse.refresh(questioned) as opened:
        silent = [text.split("\n")[0] for text in examples() if not run(opened.connection, text).rows]
    assert silent == []


def test_resistance_by_dose(questioned: Store) -> None:
    rows = answer(questioned, "over the dose")
    assert rows[1] == ("S1", 24.0, 240.0, 768.0, pytest.approx(2.0 / 101.0), 101.0, "iron sensor")


def test_repeatability_is_the_spread_of_checks_at_one_dose(questioned: Store) -> None:
    ((bench, repeats, percent),) = answer(questioned, "How well checks repeat")
    assert (bench, repeats) == (None, 1)
    assert percent == pytest.approx(100 * abs(math.log(99 / 98)) / math.sqrt(2))


def test_units_and_batches_outside_the_band_of_the_fleet(questioned: Store) -> None:
    assert answer(questioned, "stand out") == [("S1", "B1", 3.1, 4.1), (None, "B3", 5.0, 5.2)]


def test_what_the_heat_of_every_specimen_is_worth(questioned: Store) -> None:
    assert answer(questioned, "every specimen's heat") == [("S1", pytest.approx(2.0 + 3.0 * 1.739, abs=0.1), 8.0)]


def test_a_censored_life_table(questioned: Store) -> None:
    assert answer(questioned, "life table") == [("S1", 48.0, 72.0), ("S2", 24.0, None), ("S3", 0.0, None)]


def test_parameters_as_of_a_date(questioned: Store) -> None:
    assert answer(questioned, "as of a date") == [("reference", "winding-teeth", 36.0, pytest.approx(0.72), "W/K")]


def test_sessions_whose_cause_is_ageing(questioned: Store) -> None:
    assert answer(questioned, "ageing was named") == [("1_s1", "ageing.winding_a-teeth.hours_above_180degC", 0.8)]


def test_each_example_says_in_its_first_line_what_it_answers() -> None:
    folder = Path(warehouse.__file__).parent / "sql" / "examples"
    assert all(re.match(r"-- [A-Z].*[^.]\n", path.read_text(encoding="utf-8")) for path in folder.iterdir())
