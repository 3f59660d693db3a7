"""`cycles`, `dc_checks` and `insulation_checks` on sessions made by hand, whose hours, doses and resistances are
known."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytics import warehouse
from analytics.insulation.dose.arrhenius import Activation, Doubling
from analytics.insulation.dose.oven_cycle import hours_above
from analytics.query import run
from analytics.reference import examples
from ingest.facts.events import InspectionRecorded
from ingest.facts.store import Store
from made.insulation_logs import Columns, HOUR_s, STEP_s, add_log

STEPS = 241  # 40 min
T_s = np.arange(STEPS) * STEP_s
POWER = ("power", None, np.where(T_s >= 60, 1000.0, 5.0))
COPPER = ("temperature", "winding_a", np.full(STEPS, 100.0))
IRON = ("temperature", "teeth", np.full(STEPS, 60.0))
CHECK: Columns = {"P": POWER, "EW": COPPER, "TC": IRON}
Add = Callable[..., None]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store", create=True) as made:
        yield made


@pytest.fixture
def add(store: Store) -> Add:
    """Append a session of one file."""
    return partial(add_log, store)


def ask(store: Store, sql: str) -> list[tuple[Any, ...]]:
    with warehouse.refresh(store) as opened:
        return run(opened.connection, sql).rows


def oven(*degC: float, node: str = "winding_a") -> Columns:
    """A temperature an hour."""
    return {"EW": ("temperature", node, degC)}


def test_the_resistance_is_the_rise_from_iron_to_copper_over_the_power(store: Store, add: Add) -> None:
    add("check", "dc_check", 0.0, CHECK)
    rows = ask(
        store,
        "SELECT resistance_K_per_W, copper_degC, iron_degC, power_W, drift_percent, load_s, why_no_resistance, "
        "power_from FROM dc_checks",
    )
    assert rows == [(0.04, 100.0, 60.0, 1000.0, 0.0, 2350.0, None, "power")]


def test_copper_and_iron_are_means_of_their_channels_and_other_nodes_and_ignored_ones_do_not_count(
    store: Store, add: Add
) -> None:
    more: Columns = {
        "EW2": ("temperature", "endwinding_b_inner", np.full(STEPS, 120.0)),
        "TC2": ("temperature", "yoke", np.full(STEPS, 50.0)),
        "bad": ("temperature", "winding_b", np.full(STEPS, 900.0)),
        "MAG": ("temperature", "magnet", np.full(STEPS, 800.0)),
        "room": ("temperature", "ambient", np.full(STEPS, 700.0)),
    }
    add("check", "dc_check", 0.0, CHECK | more, ignored=("bad",))
    rows = ask(store, "SELECT copper_degC, iron_degC, resistance_K_per_W, copper_from, iron_from FROM dc_checks")
    assert rows == [(110.0, 55.0, 0.055, "EW, EW2", "TC, TC2")]
    assert ask(store, "SELECT channels FROM sessions") == [(len(CHECK | more) - 1,)], "as the catalogue counts"


def test_only_the_last_ten_minutes_of_load_give_the_numbers(store: Store, add: Add) -> None:
    load = np.where((T_s >= 60) & (T_s <= 2000), 1000.0, 0.0)
    copper = np.where(T_s > 2000, 30.0, np.where(T_s > 1400, 100.2, np.where(T_s > 800, 100.0, 70.0)))
    add("check", "dc_check", 0.0, {"P": ("power", None, load), "EW": ("temperature", "winding", copper), "TC": IRON})
    rows = ask(store, "SELECT copper_degC, round(drift_percent, 3), resistance_K_per_W FROM dc_checks")
    assert rows == [(100.2, 0.5, 0.0402)]


@pytest.mark.parametrize(
    ("volts", "amps"), [("voltage", "current"), ("voltage_dc", "current_dc"), ("voltage", "current_dc")]
)
def test_where_no_power_is_recorded_it_is_voltage_times_current_of_either_sign(
    store: Store, add: Add, volts: str, amps: str
) -> None:
    current = np.where(T_s >= 60, -160.0, 0.0)
    add(
        "check",
        "dc_check",
        0.0,
        {"U": (volts, None, current / 25), "I": (amps, None, current), "EW": COPPER, "TC": IRON},
    )
    rows = ask(store, "SELECT round(power_W, 6), power_from, resistance_K_per_W FROM dc_checks")
    assert rows == [(1024.0, "voltage x current", 0.0390625)]


RISES = ("temperature", "winding", 60 + 40 * (1 - np.exp(-T_s / 600)))
BREAK = ("power", None, np.where((T_s < 60) | (T_s == 1500), 0.0, 1000.0))


@pytest.mark.parametrize(
    ("columns", "why"),
    [
        ({"P": POWER, "TC": IRON}, "no copper temperature: no channel of region copper has one"),
        ({"P": POWER, "EW": COPPER}, "no iron temperature: no channel of region iron has one"),
        ({"EW": COPPER, "TC": IRON}, "no power or current is recorded"),
        (
            {"I": ("current", None, np.full(STEPS, 160.0)), "EW": COPPER, "TC": IRON},
            "neither power nor voltage is recorded",
        ),
        (CHECK | {"P": ("power", None, np.where(T_s >= 1500, 1000.0, 0.0))},
            "loaded for 15.1 min without a break, 20 min are needed"),
        (CHECK | {"P": BREAK}, "loaded for 15.0 min without a break, 20 min are needed"),
        (CHECK | {"EW": RISES}, "not steady: changes by 5.9 % in 10 min, 1 % is allowed"),
        (CHECK | {"EW": ("temperature", "winding", IRON[2])}, "copper is not warmer than iron"),
        (CHECK | {"P": ("power", None, -np.asarray(POWER[2]))}, "power is not above zero"),
        (CHECK | {"P": ("power", None, np.zeros(STEPS))}, "loaded for 0.0 min without a break, 20 min are needed"),
    ],
    ids=lambda value: value[:30] if isinstance(value, str) else "",
)  # fmt: skip
def test_a_check_without_a_resistance_says_why(store: Store, add: Add, columns: Columns, why: str) -> None:
    add("check", "dc_check", 0.0, columns)
    assert ask(store, "SELECT resistance_K_per_W, why_no_resistance FROM dc_checks") == [(None, why)]


def test_hours_are_those_of_the_hottest_copper_channel_above_180_degC(store: Store, add: Add) -> None:
    columns: Columns = {
        "EW": ("temperature", "winding_a", (20, 179, 181, 230, 180, 20)),
        "EW2": ("temperature", "winding_b", (20, 190, 190, 190, 190, 20)),  # longer, but never as hot
        "air": ("temperature", "oven", (20, 240, 240, 240, 240, 20)),
    }
    add("oven", "ageing", 0.0, columns, step_s=HOUR_s)
    rows = ask(
        store,
        "SELECT hours_above_180degC, highest_degC, mean_above_degC, hottest_channel, unknown_h, why_no_hours, "
        """epoch("end" - start) / 3600 FROM cycles""",
    )
    mean = (0.5 * 180.5 + 205.5 + 205.0) / 2.5  # straight lines: half an hour to 181, one to 230, one back to 180
    assert rows == [(2.5, 230.0, pytest.approx(mean), "EW", 0.0, None, 5.0)]


def test_what_a_gap_held_is_not_known_and_counts_nowhere(store: Store, add: Add) -> None:
    soak = np.full(100, 230.0)
    add("oven", "ageing", 0.0, oven(*soak), step_s=600.0, lost=range(40, 60))
    ((hours, unknown),) = ask(store, "SELECT hours_above_180degC, unknown_h FROM cycles")
    assert (hours, unknown) == (pytest.approx(78 / 6), pytest.approx(21 / 6))


def test_equivalent_hours_are_each_by_one_rule(store: Store, add: Add) -> None:
    add("oven", "ageing", 0.0, oven(*np.full(301, 230.0)), step_s=HOUR_s)
    rows = ask(store, "SELECT hours_above_180degC, equivalent_10K_h, equivalent_1eV_h FROM cycles")
    assert rows == [(300.0, 9600.0, pytest.approx(300 * float(Activation(1.0).acceleration(230.0, 180.0))))]


@pytest.mark.parametrize("seed", [1, 2])
def test_hours_are_those_that_an_assessment_counts(store: Store, add: Add, seed: int) -> None:
    random = np.random.default_rng(seed)
    value = 200 + np.cumsum(random.normal(0.0, 4.0, 400))
    lost = [10, 11, *range(200, 240)]
    add("oven", "ageing", 0.0, oven(*value), step_s=60.0, lost=lost)
    ((hours, unknown),) = ask(store, "SELECT hours_above_180degC, unknown_h FROM cycles")
    kept = np.setdiff1d(np.arange(400), lost)
    assert hours == pytest.approx(hours_above(kept * 60.0, value[kept]), abs=1e-6)
    assert unknown == pytest.approx(41 / 60, abs=1e-6)


def test_a_boundary_is_no_place_of_the_specimen_and_a_cycle_without_any_says_so(store: Store, add: Add) -> None:
    add("oven", "ageing", 0.0, oven(230, 230, node="oven"), step_s=HOUR_s)
    rows = ask(store, "SELECT name, hours_above_180degC, hottest_channel, why_no_hours FROM cycles")
    why = "no temperature of the specimen: every channel is of a boundary or ignored"
    assert rows == [("oven", None, None, why)]


def test_without_copper_the_hottest_other_place_counts(store: Store, add: Add) -> None:
    iron: Columns = {
        "TC": ("temperature", "teeth", (228, 228)),
        "Y": ("temperature", "yoke", (229, 229)),
        "air": ("temperature", "oven", (231, 231)),
    }
    add("oven", "ageing", 0.0, iron, step_s=HOUR_s)
    assert ask(store, "SELECT hottest_channel, hours_above_180degC FROM cycles") == [("Y", 1.0)]


def test_the_dose_sums_the_earlier_sessions_of_the_same_specimen_whatever_their_kind(store: Store, add: Add) -> None:
    for name, at_h in (("first", 0.0), ("second", 20.0), ("third", 40.0)):
        add(name, "dc_check", at_h, CHECK)
    add("oven_1", "ageing", 2.0, oven(230, 230, 230), step_s=HOUR_s)
    add("other", "ageing", 3.0, oven(230, 230, 230), step_s=HOUR_s, specimen="stator-08")
    add("hot_drive", "s1", 25.0, oven(185, 185), step_s=HOUR_s)
    add("oven_2", "ageing", 30.0, oven(230, 230, 230, 230), step_s=HOUR_s)
    add("oven_3", "ageing", 50.0, oven(230, 230), step_s=HOUR_s)
    rows = ask(store, "SELECT name, dose_h, why_no_dose FROM dc_checks")
    assert rows == [("first", 0.0, None), ("second", 2.0, None), ("third", 6.0, None)]
    assert ask(store, "SELECT name FROM cycles") == [("oven_1",), ("oven_2",), ("oven_3",), ("other",)]


@pytest.mark.parametrize(
    ("check", "cycle", "why"),
    [
        ({"specimen": None}, {}, "no specimen is named"),
        ({"at_h": None}, {}, "no absolute time"),
        ({}, {"at_h": None}, "an oven session of the specimen has no hours or no absolute time"),
        ({}, {"columns": oven(230, node="oven")}, "an oven session of the specimen has no hours or no absolute time"),
    ],
)
def test_a_dose_that_is_not_known_is_null_and_says_why(
    store: Store, add: Add, check: dict[str, Any], cycle: dict[str, Any], why: str
) -> None:
    add(**{"name": "check", "kind": "dc_check", "at_h": 20.0, "columns": CHECK} | check)
    add(**{"name": "cycle", "kind": "ageing", "at_h": 0.0, "columns": oven(230, 230), "step_s": HOUR_s} | cycle)
    assert ask(store, "SELECT dose_h, why_no_dose, resistance_K_per_W FROM dc_checks") == [(None, why, 0.04)]


def test_a_later_cycle_without_hours_does_not_matter(store: Store, add: Add) -> None:
    add("check", "dc_check", 0.0, CHECK)
    add("oven", "ageing", 9.0, oven(230, 230, node="oven"), step_s=HOUR_s)
    assert ask(store, "SELECT dose_h, why_no_dose FROM dc_checks") == [(0.0, None)]


def test_the_region_that_was_recorded_counts_and_not_the_name(store: Store, add: Add) -> None:
    columns = CHECK | {
        "EW": ("temperature", "phase_u", np.full(STEPS, 100.0)),
        "TC": ("temperature", "lamination", np.full(STEPS, 60.0)),
        "room": ("temperature", "winding_workshop", np.full(STEPS, 20.0)),
    }
    add("check", "dc_check", 0.0, columns, regions={"EW": "copper", "TC": "iron", "room": "boundary"})
    add("oven", "ageing", 9.0, {"EW": columns["EW"]}, regions={"EW": "copper"})
    assert ask(store, "SELECT resistance_K_per_W, copper_from, iron_from FROM dc_checks") == [(0.04, "EW", "TC")]
    assert ask(store, "SELECT hottest_channel FROM cycles") == [("EW",)]
    assert ask(store, "SELECT DISTINCT channel, region FROM samples WHERE region = 'iron'") == [("TC", "iron")]


def test_of_a_decode_that_recorded_no_region_the_name_of_the_node_tells(store: Store, add: Add) -> None:
    add("check", "dc_check", 0.0, CHECK)
    found = ask(store, "SELECT channel, region FROM channels ORDER BY channel")
    assert found == [("EW", "copper"), ("P", None), ("TC", "iron")]


def test_the_example_gives_the_slope_of_each_specimen(store: Store, add: Add) -> None:
    for k in range(3):
        copper = np.full(STEPS, 60.0 + 40.0 * np.exp(0.002 * k))  # 0.2 % more each hour
        add(f"check_{k}", "dc_check", 30.0 * k, CHECK | {"EW": ("temperature", "winding", copper)})
        add(f"oven_{k}", "ageing", 30.0 * k + 2, oven(230, 230), step_s=HOUR_s)
    sql = (Path(warehouse.__file__).parent / "sql" / "examples" / "08_ageing.sql").read_text(encoding="utf-8")
    ((specimen, cycles, hours, checks, slope),) = ask(store, sql)
    assert (specimen, cycles, hours, checks) == ("stator-07", 3, 3.0, 3)
    assert slope == pytest.approx(20.0, rel=1e-4)


def test_findings_stand_after_the_hours_in_the_oven_before_them(store: Store, add: Add) -> None:
    for k in range(3):
        add(f"oven_{k}", "ageing", 24.0 * k, oven(*np.full(13, 230.0)), step_s=HOUR_s)
    second = b"oven_1".hex()
    for number, happened, session in (("a", "2025-10-10T00:00:00Z", None), ("b", None, second), ("c", None, None)):
        event = InspectionRecorded(
            inspection=number, sha256="0" * 64, name="end.jpg", media_type="image/jpeg", size=1, specimen="stator-07",
            happened=happened, session=session, finding=f"finding {number}",
        )  # fmt: skip
        store.ledger.append(f"inspection-{number}", event)
    (sql,) = [text for text in examples() if text.startswith("-- Findings")]
    assert [(row[2], row[4]) for row in ask(store, sql)] == [
        ("finding a", 12.0),
        ("finding b", 24.0),
        ("finding c", None),
    ]


def test_a_table_of_evaluated_checks_is_a_row_a_check(store: Store, add: Add) -> None:
    table: Columns = {
        "R": ("thermal_resistance", None, (0.02, 0.021, np.nan)),
        "D": ("dose", None, (120.0, 24.0, 36.0)),
    }
    add("table", "dc_check", None, table, step_s=1.0)
    add("log", "dc_check", 0.0, CHECK)
    rows = ask(
        store,
        "SELECT name, start IS NULL, dose_h, resistance_K_per_W, why_no_resistance, why_no_dose, "
        "power_from, record FROM dc_checks",
    )
    assert rows == [
        ("log", False, 0.0, 0.04, None, None, "power", None),
        ("table", True, 24.0, 0.021, None, None, "given in a table", 1),
        ("table", True, 120.0, 0.02, None, None, "given in a table", 0),
    ]


def test_a_row_of_a_table_with_absolute_time_has_its_own_time(store: Store, add: Add) -> None:
    add("table", "dc_check", 0.0, {"R": ("thermal_resistance", None, (0.02, 0.021))}, step_s=86_400.0)
    (first, second) = ask(store, "SELECT start, dose_h FROM dc_checks")
    assert (second[0] - first[0]).days == 1
    assert (first[1], second[1]) == (0.0, 0.0)


def test_an_insulation_check_is_one_row_with_the_worst_of_its_channels(store: Store, add: Add) -> None:
    rising = np.array([1e9, 4e9, 5e9])
    columns: Columns = {
        "IR_U": ("insulation_resistance", None, rising),
        "IR_V": ("insulation_resistance", None, rising / 2),
        "PI": ("polarisation_index", None, (np.nan, np.nan, 3.1)),
        "C": ("capacitance", None, (4e-9, 5e-9, 9e-9)),
        "tan_U": ("tan_delta", None, (0.004, 0.005, 0.006)),
        "tan_V": ("tan_delta", None, (0.007, 0.008, 0.02)),
        "PDIV": ("inception_voltage", None, (1200.0, 1500.0, 1300.0)),
        "EW": ("temperature", "winding_a", (24.0, 25.0, 26.0)),
        "old": ("insulation_resistance", None, np.full(3, 1.0)),
    }
    add("oven", "ageing", 0.0, oven(230, 230), step_s=HOUR_s)
    add("megger", "insulation_check", 3.0, columns, step_s=60.0, ignored=("old",))
    rows = ask(
        store,
        "SELECT specimen, dose_h, insulation_resistance_ohm, polarisation_index, capacitance_F, "
        "tan_delta, inception_voltage_V, "
        "temperature_degC, why_no_dose FROM insulation_checks",
    )
    assert rows == [("stator-07", 1.0, 2.5e9, 3.1, 5e-9, 0.008, 1300.0, 25.0, None)]


def test_values_an_hour_apart_are_of_several_checks_each_with_the_dose_before_it(store: Store, add: Add) -> None:
    columns: Columns = {
        "IR": ("insulation_resistance", None, (8e10, 5e10, 1e10)),
        "PDIV": ("inception_voltage", None, (1200.0, np.nan, 900.0)),
    }
    add("list", "insulation_check", 0.0, columns, step_s=100 * HOUR_s)
    add("oven_1", "ageing", 20.0, oven(230, 230, 230), step_s=HOUR_s)
    add("oven_2", "ageing", 120.0, oven(230, 230), step_s=HOUR_s)
    asked = "SELECT start, dose_h, insulation_resistance_ohm, inception_voltage_V FROM insulation_checks"
    rows = ask(store, asked)
    assert [row[1:] for row in rows] == [(0.0, 8e10, 1200.0), (2.0, 5e10, None), (3.0, 1e10, 900.0)]
    assert [(row[0] - rows[0][0]).total_seconds() / HOUR_s for row in rows] == [0, 100, 200]


@pytest.mark.parametrize("kind", ["dc_check", "insulation_check"])
def test_an_oven_log_that_goes_on_counts_up_to_each_check(store: Store, add: Add, kind: str) -> None:
    add("oven", "ageing", 0.0, oven(130, 230, 230, 130, 20, 20, 230, 230, 20), step_s=HOUR_s)
    for name, at_h in (
        ("before", -1.0),
        ("at_the_flank", 0.75),
        ("between", 4.5),
        ("at_the_end", 8.0),
        ("after", 90.0),
    ):
        add(name, kind, at_h, CHECK if kind == "dc_check" else {"PI": ("polarisation_index", None, (3.0,))})
    rows = dict(ask(store, f"SELECT name, dose_h FROM {kind}s"))
    fall = 50 / 210
    whole = 2.0 + (1.0 - 160 / 210) + 1.0 + fall
    assert rows == {
        "before": 0.0,
        "at_the_flank": pytest.approx(0.25),
        "between": pytest.approx(2.0),
        "at_the_end": pytest.approx(whole),
        "after": pytest.approx(whole),
    }


def test_what_was_not_measured_is_null(store: Store, add: Add) -> None:
    add("tan", "insulation_check", None, {"tan": ("tan_delta", None, (0.004,))})
    rows = ask(store, "SELECT tan_delta, capacitance_F, insulation_resistance_ohm, why_no_dose FROM insulation_checks")
    assert rows == [(0.004, None, None, "no absolute time")]


@pytest.mark.parametrize("degC", [20.0, 180.0, 185.5, 230.0])
def test_the_macros_are_the_rules_of_an_assessment(store: Store, degC: float) -> None:
    sql = f"SELECT equivalent_hours({degC}, 12, 180, 1.1), equivalent_hours_10K({degC}, 12, 180)"
    rules = (Activation(1.1), Doubling())
    assert ask(store, sql) == [
        pytest.approx(tuple(12 * float(rule.acceleration(degC, 180.0)) for rule in rules), rel=1e-12)
    ]


def test_the_macros_take_decimals_and_whole_numbers_of_any_type_and_null(store: Store) -> None:
    sql = (
        "SELECT equivalent_hours(230::DECIMAL(6, 2), 300::SMALLINT, 180, 0.9), equivalent_hours_10K(230, 300, 180), "
        "equivalent_hours(NULL, 1, 180, 1)"
    )
    ((arrhenius, rule, nothing),) = ask(store, sql)
    assert (round(arrhenius), rule, nothing) == (2963, 9600.0, None)


def test_the_table_macro_counts_every_temperature_of_a_session(store: Store, add: Add) -> None:
    columns: Columns = {
        "EW": ("temperature", "winding_a", (230, 230, 130)),
        "air": ("temperature", "oven", (240, 240, 140)),
        "I": ("current", None, (1, 2, 3)),
    }
    add("oven", "ageing", 0.0, columns, step_s=HOUR_s)
    rows = ask(store, "FROM equivalent_hours_of('oven', 180, 180, 1.0)")
    assert [(row[1], row[2], row[4], row[5]) for row in rows] == [
        ("air", "oven", 240.0, pytest.approx(1.6)),
        ("EW", "winding_a", 230.0, pytest.approx(1.5)),
    ]
    assert rows[1][7] == pytest.approx(2**5 + 0.5 * 2**2.5)
    assert rows[1][6] == pytest.approx(
        sum(h * float(Activation(1.0).acceleration(d, 180.0)) for d, h in ((230, 1), (205, 0.5)))
    )
    assert ask(store, "FROM equivalent_hours_of('none', 180, 180, 1.0)") == []
