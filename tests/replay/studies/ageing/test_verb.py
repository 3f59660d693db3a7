"""`whyhot ageing` on the plant's stators and fleets: doses, resistances, forms, who stands out; facts and refusals."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analytics import warehouse
from analytics.insulation.dose.arrhenius import Activation
from ingest.facts import facts
from ingest.facts.events import SessionRecorded
from ingest.facts.store import Store
from made.browser import label_faults
from made.lines_of_damage import damage
from made.onward import followed
from made.places import EXAMPLES
from plant import fleet, insulation_campaign
from plant.bare_stator_motor import motor_toml
from plant.counters import counters, write_counters
from plant.timeline import Plan
from replay.cli import main
from replay.studies.ageing import assess
from replay.studies.ageing import whole as whole_fleet
from replay.studies.ageing.assessment import document, read
from replay.studies.ageing.dc_checks import Evaluated
from replay.studies.ageing.history import History, with_tables

Capture = pytest.CaptureFixture[str]
FORMS = ("none", "dip_then_rise")


def _taken_in(commands: Sequence[Sequence[str]], store: Path) -> None:
    for words in commands:
        assert main([*words, "--store", str(store)]) == 0


def _asked(store: Path, *more: str) -> dict[str, Any]:
    target = store.parent / "answer.json"
    assert main(["ageing", "--store", str(store), "--json", str(target), *more]) == 0
    answer: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return answer


@dataclass(frozen=True)
class Asked:
    store: Path
    truth: insulation_campaign.Campaign
    answer: Mapping[str, Any]

    def of(self, name: str) -> Mapping[str, Any]:
        found: Mapping[str, Any] = next(one for one in self.answer["specimens"] if one["specimen"] == name)
        return found


@pytest.fixture(scope="module")
def stators(tmp_path_factory: pytest.TempPathFactory) -> Asked:
    """Two stators, nine cycles: one whose insulation does nothing, one that cures first and gets worse then."""
    folder = tmp_path_factory.mktemp("stators")
    plan = Plan(stators=2, cycles=9, forms=FORMS, early_stops=0.0, dead=0.0, electrical=False)
    written = insulation_campaign.write(folder / "logs", seed=4, plan=plan)
    _taken_in(written.ingest, folder / "store")
    return Asked(folder / "store", written.truth, _asked(folder / "store"))


def test_doses_are_the_hours_of_the_copper_above_180_degC(stators: Asked) -> None:
    for stator in stators.truth.stators:
        found = [check["dose_h"] for check in stators.of(stator.name)["checks"]]
        assert found == pytest.approx([check.dose_h for check in stator.checks], rel=0.01, abs=0.01)


def test_equivalent_hours_are_a_range_over_rules_and_life_used_is_of_20_000_h(stators: Asked) -> None:
    last = stators.of("S01")["checks"][-1]
    low, high = last["equivalent_h"]
    assert 6 * last["dose_h"] < low < high < 60 * last["dose_h"]
    assert stators.of("S01")["life_used"] == pytest.approx([low / 20_000, high / 20_000], rel=1e-3)


def test_resistances_follow_the_hidden_ones(stators: Asked) -> None:
    for stator in stators.truth.stators:
        checks = stators.of(stator.name)["checks"]
        true = np.array([check.resistance_K_per_W for check in stator.checks])
        found = np.array([check["resistance_K_per_W"] for check in checks])
        assert {check["from"] for check in checks} == {"iron sensor"}
        assert np.log(found / true).std() < 0.02


def test_the_forms_are_named(stators: Asked) -> None:
    healthy, cured = stators.of("S01"), stators.of("S02")
    assert (healthy["form"], healthy["significant"]) == ("none", False)
    assert (cured["form"], cured["significant"]) == ("dip_then_rise", True)
    assert cured["change_at_dose_h"] is not None
    assert cured["ci95"][0] < cured["slope_percent_per_100h"] < cured["ci95"][1]


def test_the_answer_is_a_fact_and_is_read_back(stators: Asked, capsys: Capture) -> None:
    again = _asked(stators.store)
    assert again["specimens"] == stators.answer["specimens"]
    with Store.open(stators.store) as store:
        known = facts.at(store.ledger).assessments
        assert list(known) == [stators.answer["assessment"]]
        assert damage(store) == []
    assert document(read(stators.answer), {})["specimens"] == stators.answer["specimens"]


def test_as_of_an_earlier_time_only_earlier_sessions_count(stators: Asked) -> None:
    with Store.open(stators.store) as store:
        position = next(
            one.position
            for one in store.ledger.events()
            if one.event.TOPIC == "whyhot:SessionRecorded" and getattr(one.event, "specimen", "") == "S02"
        )
    answer = _asked(stators.store, "--as-of", str(position - 1))
    assert [one["specimen"] for one in answer["specimens"]] == ["S01"]


def test_the_views_show_the_latest_assessment(stators: Asked, capsys: Capture) -> None:
    asked = "SELECT specimen, count(*) AS checks, max(dose_h) AS dose FROM conductivity_by_cycle GROUP BY 1 ORDER BY 1"
    assert main(["sql", asked, "--store", str(stators.store), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["specimen"], row["checks"]) for row in rows] == [("S01", 10), ("S02", 10)]
    said = followed([["ageing", "--store", str(stators.store)]], capsys)
    assert len(said["ageing"]) == 2, "what is next runs as it is printed"


def test_with_a_motor_the_law_becomes_a_model_of_it(stators: Asked, tmp_path: Path) -> None:
    motor = tmp_path / "motor.toml"
    motor.write_text(motor_toml(), encoding="utf-8")
    law = _asked(stators.store, "--motor", str(motor))["law"]
    assert law["source"] == "S02", "the only one whose course is beyond repeatability"
    assert law["percent_per_100h"] < -3.0
    with Store.open(stators.store) as store:
        published = facts.at(store.ledger).models[law["model"]]
        text = store.archive.read(law["model"]).decode()
    assert published.parent is not None
    assert "ageing = {above_degC = 180" in text


def test_each_check_leaves_a_state_for_later_sessions(stators: Asked) -> None:
    left = [check["left"]["ln_factor"] for check in stators.of("S02")["checks"]]
    true = [-np.log(check.resistance_K_per_W) for check in stators.truth.stators[1].checks]
    assert np.corrcoef(left, true)[0, 1] > 0.9


def test_the_picture_is_drawn(stators: Asked, tmp_path: Path) -> None:
    _asked(stators.store, "--out", str(tmp_path / "ageing.svg"))
    assert (tmp_path / "ageing.svg").read_text(encoding="utf-8").count("S02") >= 1
    assert (tmp_path / "ageing.png").stat().st_size > 10_000


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """80 motors in a table whose rows are in no order; those of one batch age faster."""
    folder = tmp_path_factory.mktemp("fleet")
    written = fleet.write_checks(folder, seed=5, motors=80, batches=4, bad_batches=1)
    _taken_in(written.ingest, folder / "store")
    (folder / "bad").write_text("\n".join(written.truth.bad_batches), encoding="utf-8")
    return folder


def test_a_bad_batch_is_found_in_a_table_and_nothing_else(tables: Path, capsys: Capture) -> None:
    answer = _asked(tables / "store")
    assert [one["batch"] for one in answer["fleet"]["outlying_batches"]] == (tables / "bad").read_text().split()
    assert len(answer["fleet"]["outlying_specimens"]) <= 1
    assert len(answer["specimens"]) == 80
    check = answer["specimens"][0]["checks"][-1]
    assert (check["from"], check["equivalent_h"]) == ("evaluated elsewhere", None)
    doses = [one["dose_h"] for one in answer["specimens"][0]["checks"]]
    assert doses == sorted(doses)


def test_of_a_large_fleet_the_answer_holds_those_that_stand_out_most_and_counts_all(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    whole = _asked(tables / "store")
    monkeypatch.setattr(assess, "MOST", 10)
    monkeypatch.setattr(whole_fleet, "SAMPLE", 20)
    monkeypatch.setattr(assess, "code_of", lambda _: "another version's")
    capsys.readouterr()
    page, store = tables / "page.html", str(tables / "store")
    assert main(["ageing", "--store", store, "--report", str(page), "--out", str(tables / "fleet.svg")]) == 0
    assert label_faults(tables / "fleet.svg") == []
    said = " ".join(capsys.readouterr().out.split())
    assert "and 70 more" in said and "of 20 that were drawn by chance change beyond repeatability" in said
    answer = _asked(tables / "store")
    by_chance = whole_fleet.drawn(one["specimen"] for one in whole["specimens"])
    forms = Counter(one["form"] for one in whole["specimens"] if one["significant"] and one["specimen"] in by_chance)
    assert answer["whole"] == whole["whole"] | {"weighed": 20, "changed": dict(forms)}
    assert answer["whole"]["specimens"] == 80
    assert answer["whole"]["checks"] == sum(len(one["checks"]) for one in whole["specimens"])
    cells = np.array(answer["whole"]["density"]["checks"])
    assert 0.9 * answer["whole"]["checks"] < cells.sum() <= answer["whole"]["checks"]
    held = [one["specimen"] for one in answer["specimens"]]
    ranked = whole_fleet.rank({one["batch"] for one in whole["fleet"]["outlying_batches"]})
    every = sorted(whole["specimens"], key=lambda one: ranked(one["outlying"], one["batch"], one["score"]))
    assert answer["specimens"] == every[:10]
    with Store.open(tables / "store") as opened:
        known = facts.at(opened.ledger)
        first, last = ([*known.assessments.values()][i] for i in (0, -1))
    assert last.sessions == first.sessions[:10]
    assert last.count == len(first.sessions) > 10
    capsys.readouterr()
    assert main(["lineage", last.assessment, "--store", store]) == 0
    named = capsys.readouterr().out
    assert f"from {last.count} sessions with checks, the first 10 of which follow" in named
    for view in ("fleet_health", "life_used", "changepoints", "batches"):
        assert main(["lineage", f"SELECT * FROM {view} WHERE assessment IS NOT NULL", "--store", store]) == 0, view
        assert capsys.readouterr().out == named
    with warehouse.connect(tables / "store") as connection:
        rows = connection.execute("SELECT specimen, form, slope_low, score, why FROM fleet_health").fetchall()
        ((checks,),) = connection.execute("SELECT count(*) FROM conductivity_by_cycle").fetchall()
    assert checks == answer["whole"]["checks"]
    told = {one["specimen"]: (one["form"], (one["ci95"] or [None])[0]) for one in every}
    weighed = by_chance.union(held)
    assert {row[0]: row[1:3] for row in rows} == {k: of if k in weighed else (None, None) for k, of in told.items()}
    assert {row[0]: row[3] for row in rows} == {one["specimen"]: one["score"] for one in every}
    assert all(("its course was not weighed" in (why or "")) == (name not in weighed) for name, *_, why in rows)
    text = page.read_text(encoding="utf-8")
    assert "The 10 specimens that stand out most</h2>" in text and "LIMIT 100 OFFSET 100" in text
    assert f"All 80 specimens: where their {checks:,} checks lie" in text
    assert f"<code>whyhot lineage --store {tables / 'store'} {last.assessment}</code>" in text


def test_a_density_is_of_a_fleet_whose_courses_cannot_be_told_apart() -> None:
    names = [f"M{k // 2:02d}" for k in range(2 * whole_fleet.LINES + 2)]
    dose = np.tile([0.0, 100.0], whole_fleet.LINES + 1)
    resistance = np.tile([0.02, 0.025], whole_fleet.LINES + 1)
    found = whole_fleet.density(names, dose, resistance)
    assert found is not None
    cells = np.array(found.checks)
    assert cells[:, 0].sum() == cells[:, -1].sum() == whole_fleet.LINES + 1
    place = int(np.flatnonzero(cells[:, -1])[0])
    assert found.percent[place] <= 125.0 <= found.percent[place + 1]
    assert whole_fleet.density(names[2:], dose[2:], resistance[2:]) is None
    assert whole_fleet.density(names, np.zeros(len(dose)), resistance) is None


COUNTERS = """schema = "whyhot.bench/1"
specimen_column = "serial"
batch_column = "batch"
kind = "drive"

[time]
column = "date"
format = "%Y-%m-%d %H:%M"

[[channel]]
signal = "starts"
quantity = "counter"
"""
BIN = """
[[channel]]
signal = "h_{low:.0f}_{high:.0f}"
quantity = "dose"
unit = "h"
bin_degC = [{low}, {high}]
"""


def test_what_vehicles_count_is_a_dose(tmp_path: Path) -> None:
    read_out = counters(3, motors=6, readouts=(2, 3), activation_eV=1.0)
    edges = read_out.edges_degC
    bins = [BIN.format(low=low, high=high) for low, high in pairwise(edges)]
    (tmp_path / "bench.toml").write_text("".join([COUNTERS, *bins]), encoding="utf-8")
    path = write_counters(tmp_path / "counters.csv", read_out, ["B1"] * 6)
    store = tmp_path / "store"
    _taken_in([["ingest", str(path), "--bench", str(tmp_path / "bench.toml")]], store)
    found = {one["specimen"]: one for one in _asked(store)["specimens"]}
    for motor in set(read_out.motor.tolist()):
        last = np.flatnonzero(read_out.motor == motor)[-1]
        one = found[f"M{motor + 1:04d}"]
        above = read_out.hours[last][edges[:-1] >= 180.0].sum()
        assert one["dose_h"] == pytest.approx(above, abs=0.05)
        assert (one["checks"], one["form"], one["significant"]) == ([], "none", False)
        low, high = one["equivalent_h"]
        assert low < read_out.true_equivalent_h[last] < high, "1.0 eV lies between the rules"
        assert one["life_used"] == pytest.approx([low / 20_000, high / 20_000], rel=1e-3)
        assert "3 are needed" in one["why"]


def test_a_check_that_stands_in_two_tables_counts_once_and_two_alike_in_one_are_two() -> None:
    def rows(table: str, resistances: Sequence[float]) -> list[tuple[SessionRecorded, Evaluated]]:
        session = cast(SessionRecorded, SimpleNamespace(session=table, name=table))
        return [(session, Evaluated(table, 0, one, 0.0, None, None)) for one in resistances]

    given = [*rows("march", [0.05, 0.05, 0.06]), *rows("april", [0.05, 0.05, 0.05, 0.06, 0.07])]
    found = with_tables(History(), given)
    assert sorted(one.resistance or 0.0 for one in found.points) == [0.05, 0.05, 0.05, 0.06, 0.07]
    assert found.notes == ["3 rows stand in two tables, with the same time and values: each such check counts once"]
    undated = [(session, replace(row, t_ns=None)) for session, row in given]
    assert (len(with_tables(History(), undated).points), with_tables(History(), undated).notes) == (8, [])


UNTIDY = """serial,batch,dose_h,R_th
B1,X,0,0.100
B1 ,X,50,0.103
B1,X,100,n/a
B2,X,0,0.100
B2,X,-20,0.1
B2,X,50,0
B2,X,,0.1
B3,X,50,n/a
"""


def test_a_row_without_a_usable_resistance_or_dose_is_a_check_that_says_why(tmp_path: Path) -> None:
    (tmp_path / "checks.csv").write_text(UNTIDY, encoding="utf-8")
    store = tmp_path / "store"
    bench = str(EXAMPLES / "insulation" / "fleet" / "bench.toml")
    _taken_in([["ingest", str(tmp_path / "checks.csv"), "--bench", bench]], store)
    asked = _asked(store)
    why = {one["specimen"]: [check["why"] for check in one["checks"]] for one in asked["specimens"]}
    assert why == {
        "B1": [None, None, "its row says no R"],
        "B2": [
            None,
            "its row says an R of 0 K/W, which must be above 0",
            "its row says a dose of -20 h, which cannot be below 0",
            "neither the row nor a counter's readout around it says a dose",
        ],
        "B3": ["its row says no R"],
    }
    assert any(line.startswith("5 of 8 checks say no R or no dose") for line in asked["notes"])


def _refused(capsys: Capture, *words: str) -> str:
    capsys.readouterr()
    assert main(list(words)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize("name", [".", "..", "", "/", "x.pdf"])
def test_a_picture_that_is_no_svg_is_refused_in_one_line(tmp_path: Path, capsys: Capture, name: str) -> None:
    with pytest.raises(SystemExit):
        main(["ageing", "--store", str(tmp_path), "--out", name])
    (line,) = capsys.readouterr().err.splitlines()
    assert f'an SVG is written, and a .png beside it: end "{name}" in .svg' in line


def test_a_store_without_checks_is_refused_in_one_line(tmp_path: Path, capsys: Capture) -> None:
    with Store.open(tmp_path / "store", create=True):
        pass
    line = _refused(capsys, "ageing", "--store", str(tmp_path / "store"))
    assert "no DC check" in line
    assert "thermal_resistance" in line


HOT = """
[[channel]]
signal = "T_age"
quantity = "temperature"
unit = "degC"
node = "winding"
"""


def test_hours_of_different_ovens_and_names_that_differ_in_case_are_told(tmp_path: Path) -> None:
    bench = (EXAMPLES / "insulation" / "fleet" / "bench.toml").read_text(encoding="utf-8")
    (tmp_path / "bench.toml").write_text(bench + HOT, encoding="utf-8")
    rows = [
        f"{name},{oven},{dose},{0.02 + 1e-6 * dose * (oven - 190)},{oven}"
        for name, oven in (("M1", 230), ("M2", 230), ("m 1", 200), ("M4", 200))
        for dose in (0, 50, 100)
    ]
    (tmp_path / "checks.csv").write_text("\n".join(["serial,batch,dose_h,R_th,T_age", *rows, ""]), encoding="utf-8")
    _taken_in([["ingest", str(tmp_path / "checks.csv"), "--bench", str(tmp_path / "bench.toml")]], tmp_path / "store")
    case, heat = _asked(tmp_path / "store")["notes"]
    assert case.startswith("M1 and m 1 are counted as 2 specimens: ")
    one_hour = [float(Activation(0.9).acceleration(degC, 180.0)) for degC in (200.0, 230.0)]
    assert f"was worth {one_hour[0]:.1f} h at 180 °C for M4 and {one_hour[1]:.1f} h for M1." in heat


def test_hours_of_an_oven_that_its_log_does_not_show_are_told(tmp_path: Path) -> None:
    plan = Plan(stators=1, cycles=2, forms=("none",), early_stops=0.0, dead=0.0, electrical=False)
    written = insulation_campaign.write(tmp_path / "logs", seed=4, plan=plan)
    log = tmp_path / "logs" / "S01" / "oven_02.csv"
    lines = log.read_text(encoding="cp1252").splitlines(keepends=True)
    middle = len(lines) // 2
    log.write_text("".join([*lines[: middle - 60], *lines[middle + 60 :]]), encoding="cp1252")
    _taken_in(written.ingest, tmp_path / "store")
    (note,) = _asked(tmp_path / "store")["notes"]
    assert note.startswith("S01: 2.0 h of its oven cycles are in gaps of the logs and count in no dose: ")


def test_a_stator_that_was_varnished_again_fits_no_form_and_is_told(tmp_path: Path) -> None:
    bench = str(EXAMPLES / "insulation" / "fleet" / "bench.toml")
    dose = np.arange(0.0, 200.0, 20.0)
    rest = {f"M{k}": dose for k in range(2, 9)}
    rows = [
        f"{name},B1,{h},{0.02 * np.exp(0.004 * since + 0.01 * (-1) ** k):.6f}"
        for name, hours in {"M1": dose % 100.0, **rest}.items()
        for k, (h, since) in enumerate(zip(dose, hours, strict=True))
    ]
    (tmp_path / "checks.csv").write_text("\n".join(["serial,batch,dose_h,R_th", *rows, ""]), encoding="utf-8")
    _taken_in([["ingest", str(tmp_path / "checks.csv"), "--bench", bench]], tmp_path / "store")
    (note,) = _asked(tmp_path / "store")["notes"]
    assert note.startswith("M1: its checks are off the most probable course by ")
    assert "R changes most, by −29 %, between 80 h and 100 h. If it was repaired there" in note
