"""The words of an assessment: what changed, what did not, who stands out, and nothing wider than a terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ingest.facts.archive import Archive
from made.ageing import STILL, WORSE, aged, assessment
from replay.engine.specimen.heat_history import HoursByTemperature
from replay.show.verbs.ageing import ageing_text, answer, course, how_many_change, slope
from replay.studies.ageing.assessment import AgeingLaw, Assessment, Batch, HotHours, StressEffect, document, read
from replay.studies.ageing.tables import Tables


def test_what_changed_is_said_with_its_size_and_what_did_not_by_name() -> None:
    said = answer(assessment(WORSE, STILL))
    assert "S01: R rises steadily, +20.4 % per 100 h (17.0 to 23.0) (probability of this form 93 %)" in said
    assert "S02: no change beyond repeatability" in said
    assert "Not as the others: S01" in said


def test_one_course_has_one_name_in_sentence_and_table() -> None:
    dips = replace(WORSE, form="dip_then_rise", change_at_dose_h=7.0)
    assert "S01: R falls, then rises from 7 h on, +20.4 % per 100 h" in answer(assessment(dips))
    rows = {line[:3]: line for line in ageing_text(assessment(dips, STILL)).splitlines()}
    assert " falls, rises " in rows["S01"] and " no change " in rows["S02"]


def test_a_course_without_change_has_no_slope_of_its_own_beside_that_of_its_fleet() -> None:
    assert course(STILL).startswith("no change beyond repeatability (probability")
    flat_fleet = replace(STILL, fleet_slope_percent_per_100h=-0.02)
    assert slope(flat_fleet) == "0.0 %", "nothing has no sign"


def test_of_too_few_specimens_none_is_said_not_to_stand_out() -> None:
    two = [replace(one, score=None, outlying=False) for one in (WORSE, STILL)]
    assert answer(assessment(*two)).endswith("There are too few specimens to tell whether one stands out.")


def test_what_a_law_is_sure_to_and_what_specimens_differ_by_are_two_things() -> None:
    law = AgeingLaw(percent_per_100h=-1.6, sd=1.8, from_h=0.0, source="fleet", model=None)
    assert "1.6 % less each 100 h (specimens differ by 1.8 %), from the fleet" in flat(
        replace(assessment(WORSE), law=law)
    )
    law = replace(law, source="S01", from_h=7.0)
    assert "each 100 h from 7 h on (sd 1.8 %), from S01" in flat(replace(assessment(WORSE), law=law))


def test_a_batch_like_the_others_is_not_below_them_by_nothing() -> None:
    batch = Batch(batch="B1", specimens=2, slope_percent_per_100h=7.6, score=-0.01, outlying=False)
    text = ageing_text(replace(assessment(WORSE), batches=[batch, replace(batch, batch="B2")]))
    row = next(line for line in text.splitlines() if line.startswith("B1"))
    assert row.endswith(" 0.0 sd"), "nothing has no sign"


def test_one_that_changes_changes() -> None:
    assert how_many_change(assessment(WORSE, STILL).whole).startswith("1 of 2 changes")


def flat(found: Assessment) -> str:
    return " ".join(ageing_text(found).split())


def test_a_falling_course_is_not_called_rising() -> None:
    assert "R falls steadily" in answer(assessment(replace(WORSE, slope_percent_per_100h=-9.0, ci95=None)))


def test_of_a_specimen_with_too_few_checks_no_course_is_said() -> None:
    found = assessment(WORSE, replace(STILL, form_probability=0.5, fitted=None))
    assert "S02: too few checks for a course" in answer(found) and "S02: no change" not in answer(found)
    row = next(line for line in ageing_text(found).splitlines() if line.startswith("S02"))
    assert "none" not in row and "50 %" not in row


def test_where_nobody_stands_out_that_is_said() -> None:
    assert "None stands out from the others (false discovery rate 5 %)" in answer(assessment(STILL))


@pytest.mark.parametrize("count", [1, 40])
def test_the_text_fits_a_terminal_and_a_fleet_is_cut_short(count: int) -> None:
    many = [replace(WORSE, specimen=f"M{k:03d}", score=float(k)) for k in range(count)]
    batches = [
        Batch(batch=f"B{k}", specimens=20, slope_percent_per_100h=3.0, score=k, outlying=k == 1) for k in range(2)
    ]
    lines = ageing_text(assessment(*many, batches=batches)).splitlines()
    assert max(map(len, lines)) <= 110
    assert ("and 28 more" in lines) == (count == 40)
    assert any(line.startswith("B1") and line.endswith("stands out") for line in lines)
    first = next(line for line in lines if line.startswith("M0"))
    assert first.startswith(f"M{count - 1:03d}"), "the one that stands out most is first"


def test_the_tables_keep_to_a_narrow_page_and_name_what_it_has_no_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    lines = ageing_text(assessment(WORSE, STILL)).splitlines()
    assert max(len(line) for line in lines if "whyhot sql" not in line) <= 60
    row = next(line for line in lines if line.startswith("S01"))
    assert "+20.4 %" in row and "93 %" in row
    assert any(line.startswith("not shown, as 60 columns are too few: ") and "life used" in line for line in lines)


def test_stresses_are_said_apart_where_they_are_told_apart_and_as_one_or_other_where_not() -> None:
    heat = StressEffect(
        name="heat", unit="100 h above 180 degC", percent=24.0, sd_percent=2.0, not_told_from=["cycles"]
    )
    cycles = StressEffect(name="cycles", unit="cycle", percent=-2.9, sd_percent=0.3, not_told_from=["heat"])
    discharge = StressEffect(name="discharge", unit="100 h", percent=40.0, sd_percent=9.0, not_told_from=[])
    nothing = StressEffect(name="vibration", unit="h", percent=None, sd_percent=None, not_told_from=[])

    def said(*stress: StressEffect) -> str:
        return flat(replace(assessment(WORSE), stress=list(stress)))

    assert "Stress R +40.0 % ± 9.0 % each 100 h (discharge), all specimens together" in said(heat, cycles, discharge)
    assert (
        "Stress heat and cycles cannot be told apart here: R +24.0 % ± 2.0 % each 100 h above 180 °C or R −2.9 % "
        "± 0.3 % each cycle, "
        "if one alone did it, all specimens together" in said(heat, cycles, nothing)
    )
    assert "Stress" not in said(discharge), "one alone is the slope"
    assert "Stress" not in said()


def test_an_assessment_survives_its_json_and_its_tables_hold_every_check(tmp_path: Path) -> None:
    found = assessment(WORSE, STILL)
    data = document(found, {})
    assert read(data) == found
    assert data["specimens"][0]["checks"][1]["from"] == "iron sensor"
    assert data["fleet"] == {
        "outlying_specimens": [{"specimen": "S01", "batch": "B1", "score": 4.2}],
        "outlying_batches": [],
        "false_discovery_rate": 0.05,
    }
    hours = HotHours(
        "s", "oven_01", "W", HoursByTemperature(np.array([229.0, 230.0, 231.0]), np.array([1.0, 0.0, 11.0]))
    )
    written = Tables(tmp_path)
    for one in found.specimens:
        written.add(one, [hours] if one.specimen == "S01" else [], weighed=True)
    (tmp_path / "archive").mkdir()
    archive = Archive(tmp_path / "archive", tmp_path)
    sealed = written.sealed(archive, found.batches)
    made = {kind: pq.read_table(archive.path(sha256)) for kind, sha256 in sealed.items()}
    assert made["hours"].column("hours").to_pylist() == [1.0, 11.0]
    assert made["checks"].num_rows == 4
    assert made["checks"].column("equivalent_high_h").to_pylist()[1] == 3900.0
    assert made["specimens"].column("life_used_low").to_pylist() == [0.06, 0.06]


@pytest.mark.parametrize("columns", ["60", "80", "100"])
def test_no_course_is_cut_in_a_narrow_terminal(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    dips, same = (replace(one, batch=None) for one in (replace(WORSE, form="dip_then_rise"), STILL))
    lines = ageing_text(assessment(dips, same)).splitlines()
    head, *rows = (line for line in lines if line.startswith(("Specimen", "S0")) and "  " in line)
    assert "falls, rises" in rows[0] and "no change" in rows[1]
    assert "batch" not in head, "no specimen has one"
    assert max(map(len, lines)) <= int(columns)


def test_what_lives_tell_is_of_half_of_the_specimens_and_says_what_its_ranges_are() -> None:
    said = flat(aged())
    assert "half of the specimens reach conductivity −50 % by 6,000 (4,000 to ?) h at 180 °C" in said
    assert "with 1.20 (0.90 to 1.50) eV, in brackets 95 %; three temperatures are needed" in said
