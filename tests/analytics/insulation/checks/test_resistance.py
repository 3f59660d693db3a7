"""DC checks of the plant's bare stator, whose insulation is known, through each route; and checks that cannot be
evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.resistance import (
    CheckResistance,
    CheckTrace,
    ResistanceEstimate,
    Together,
    evaluate_together,
)
from plant import insulation_campaign
from plant.insulation_campaign import Check, Stator
from plant.timeline import Plan

Floats = NDArray[np.float64]
STILL = Plan(stators=1, cycles=6, repeatability=0.0, early_stops=0.0, dead=0.0, electrical=False)


@cache
def stator(form: str, seed: int = 5) -> Stator:
    """Seven checks, without the checks' own error."""
    return insulation_campaign.run(seed, replace(STILL, forms=(form,))).stators[0]


def trace(check: Check, iron: bool = True) -> CheckTrace:
    values = {column.name: column.values for column in check.log.columns}
    copper = tuple(name for name in values if name.startswith("EW_"))
    irons = tuple(name for name in values if name.startswith("FE_")) if iron else ()
    return CheckTrace(
        t_s=check.log.t_s,
        copper_degC=np.column_stack([values[name] for name in copper]),
        copper_names=copper,
        iron_degC=np.array([values[name] for name in irons]).T.reshape(check.log.t_s.size, len(irons)),
        iron_names=irons,
        ambient_degC=values["T_room"][:, None],
        power_W=values["V_DC"] * values["I_DC"],
        current_A=values["I_DC"],
    )


def evaluate(check: CheckTrace) -> CheckResistance:
    """Of a specimen with one check."""
    return evaluate_together([check])[0]


def rows(whole: CheckTrace, kept: slice) -> CheckTrace:
    return replace(
        whole,
        t_s=whole.t_s[kept],
        copper_degC=whole.copper_degC[kept],
        iron_degC=whole.iron_degC[kept],
        ambient_degC=whole.ambient_degC[kept],
        power_W=whole.power_W[kept],
        current_A=None if whole.current_A is None else whole.current_A[kept],
    )


def until(whole: CheckTrace, seconds: float) -> CheckTrace:
    return rows(whole, slice(0, int(np.searchsorted(whole.t_s, seconds))))


def resistances(found: tuple[CheckResistance, ...]) -> Floats:
    values = [one.resistance_K_per_W for one in found]
    assert all(value is not None for value in values), [one.why for one in found]
    return np.array(values, np.float64)


def course(values: Floats) -> Floats:
    return np.asarray(np.log(values / values[0]))


# ---- an iron sensor ------------------------------------------------------------------------------------------------


def test_with_an_iron_sensor_the_resistance_is_within_1_percent_of_the_plain_mean_of_the_last_10_min() -> None:
    for check in stator("none").checks:
        whole = trace(check)
        last = (whole.t_s > 10_200.0) & (whole.t_s < 10_800.0)
        drop = whole.copper_degC[last].mean() - whole.iron_degC[last].mean()
        found = evaluate(whole)
        assert found.source == "iron sensor"
        assert found.resistance_K_per_W == pytest.approx(drop / whole.power_W[last].mean(), rel=0.015)


def test_with_an_iron_sensor_the_course_is_the_hidden_one() -> None:
    checks = stator("monotone").checks
    truth = course(np.array([check.resistance_K_per_W for check in checks]))
    found = evaluate_together([trace(check) for check in checks])
    assert truth[-1] > 0.05
    assert course(resistances(found)) == pytest.approx(truth, abs=0.006)


def test_with_an_iron_sensor_surfaces_that_darken_make_no_course() -> None:
    checks = [trace(check) for check in stator("none").checks]
    alone = course(np.array([evaluate(check).resistance_K_per_W for check in checks], np.float64))
    together = course(resistances(evaluate_together(checks)))
    assert alone[-1] < -0.005, "else the surfaces hide nothing"
    assert abs(together[-1]) < 0.004


@pytest.mark.parametrize("minutes", [45, 60, 90])
def test_a_check_that_was_stopped_early_gives_the_resistance_of_the_whole(minutes: int) -> None:
    whole = trace(stator("none").checks[2])
    full, cut = evaluate(whole), evaluate(until(whole, 60.0 * minutes))
    assert full.resistance_K_per_W is not None and cut.resistance_K_per_W is not None and cut.sd_K_per_W is not None
    assert cut.source == "iron sensor"
    assert cut.steady != "steady"
    assert cut.resistance_K_per_W == pytest.approx(full.resistance_K_per_W, rel=0.015)
    assert abs(cut.resistance_K_per_W - full.resistance_K_per_W) < 3.0 * cut.sd_K_per_W


def test_the_hottest_sensor_is_named_and_its_end_extrapolated() -> None:
    whole = trace(stator("none").checks[1])
    full, cut = evaluate(whole), evaluate(until(whole, 75.0 * 60.0))
    assert (full.hottest, cut.hottest) == ("EW_A_3v", "EW_A_3v")
    assert cut.steady == "extrapolated"
    assert full.hottest_degC is not None and cut.hottest_degC is not None and cut.hottest_sd_K is not None
    assert until(whole, 75.0 * 60.0).copper_degC.max() < full.hottest_degC - 8.0
    assert abs(cut.hottest_degC - full.hottest_degC) < 3.0 * cut.hottest_sd_K


def test_the_sd_of_an_iron_sensors_resistance_covers_the_noise() -> None:
    whole = trace(stator("none").checks[0])
    random = np.random.default_rng(3)
    found = [
        evaluate(replace(whole, copper_degC=whole.copper_degC + random.normal(0.0, 0.1, whole.copper_degC.shape)))
        for _ in range(8)
    ]
    values = np.array([one.resistance_K_per_W for one in found], np.float64)
    assert values.std() < np.mean([one.sd_K_per_W or 0.0 for one in found])


# ---- no iron sensor ------------------------------------------------------------------------------------------------


def test_without_an_iron_sensor_the_first_minutes_follow_the_hidden_course() -> None:
    checks = stator("monotone").checks
    truth = course(np.array([check.resistance_K_per_W for check in checks]))
    found = evaluate_together([trace(check, iron=False) for check in checks])
    assert {one.source for one in found} == {"first minutes"}
    assert {one.iron_degC for one in found} == {None}
    got = course(resistances(found))
    assert np.corrcoef(got, truth)[0, 1] > 0.98
    assert np.polyfit(truth, got, 1)[0] == pytest.approx(0.95, abs=0.2)


def test_without_an_iron_sensor_surfaces_that_darken_make_no_course() -> None:
    checks = stator("none").checks
    assert checks[-1].head_emissivity > checks[0].head_emissivity + 0.04
    got = course(resistances(evaluate_together([trace(check, iron=False) for check in checks])))
    assert abs(np.polyfit(np.arange(got.size), got, 1)[0]) * got.size < 0.01
    assert got.std() < 0.012


def test_rows_of_three_minutes_leave_the_ambient_route() -> None:
    checks = stator("monotone").checks[::6]
    truth = course(np.array([check.resistance_K_per_W for check in checks]))
    found = evaluate_together([rows(trace(check, iron=False), slice(0, None, 18)) for check in checks])
    assert {one.source for one in found} == {"ambient"}
    assert course(resistances(found))[-1] / truth[-1] == pytest.approx(0.9, abs=0.25)


def test_no_route_says_what_to_add() -> None:
    coarse = rows(trace(stator("none").checks[0], iron=False), slice(0, None, 18))
    alone = replace(coarse, ambient_degC=coarse.ambient_degC[:, :0])
    found = evaluate(alone)
    assert found.resistance_K_per_W is None and found.source is None
    assert found.why == (
        "iron sensor: no iron temperature: no channel of region iron has one; "
        "first minutes: fewer than 20 min recorded after switching on, or samples more than 60 s apart; "
        "first minutes: fewer than 20 min recorded after switching off, or samples more than 60 s apart; "
        "ambient: no ambient temperature; put a thermocouple on the iron"
    )


def test_a_log_that_begins_under_load_and_ends_under_load_has_no_route_without_iron() -> None:
    whole = trace(stator("none").checks[0], iron=False)
    found = evaluate(rows(whole, slice(240, 900)))
    assert found.resistance_K_per_W is None
    assert found.why is not None and "not at rest" in found.why


# ---- routes over all checks ----------------------------------------------------------------------------------------


def test_a_route_over_all_checks_comes_first_and_sees_what_is_left_out() -> None:
    whole = [trace(check) for check in stator("none").checks]
    copper = whole[1].copper_degC.copy()
    copper[:, 0] = np.nan
    seen: list[list[str]] = []

    def estimates(left_out: Sequence[Mapping[str, str]]) -> list[ResistanceEstimate | str]:
        seen.extend(list(one) for one in left_out)
        return [ResistanceEstimate(0.04 + 0.001 * k, 0.0004) for k in range(len(left_out))]

    found = evaluate_together(
        [whole[0], replace(whole[1], copper_degC=copper), *whole[2:]], [Together("by rig", estimates)]
    )
    assert seen == [[whole[0].copper_names[0]]] * len(whole)
    assert {one.source for one in found} == {"by rig"}
    assert resistances(found) == pytest.approx(0.04 + 0.001 * np.arange(len(whole)))
    assert {one.sd_K_per_W for one in found} == {0.0004}
    assert found[0].hottest == "EW_A_3v"


def test_a_route_over_all_checks_that_serves_too_few_leaves_the_others() -> None:
    whole = [trace(check) for check in stator("none").checks]
    some: list[ResistanceEstimate | str] = [
        *[ResistanceEstimate(0.04, 0.0004)] * 5,
        ResistanceEstimate(0.04, 0.004),
        "no load",
    ]
    kept = evaluate_together(whole, [Together("by rig", lambda _: some)])
    assert {one.source for one in kept} == {"iron sensor"}
    most: list[ResistanceEstimate | str] = [*[ResistanceEstimate(0.04, 0.0004)] * 6, ResistanceEstimate(0.04, 0.004)]
    found = evaluate_together(whole, [Together("by rig", lambda _: most)])
    assert [one.source for one in found] == ["by rig"] * 6 + [None]
    assert (found[-1].why or "").startswith("by rig: known to 10 % only, 5 % is allowed")


# ---- sensors and loads that fail -----------------------------------------------------------------------------------


def test_a_dead_thermocouple_is_left_out_and_said() -> None:
    whole = trace(stator("none").checks[0])
    copper = whole.copper_degC.copy()
    copper[500:, 3] = np.nan
    found = evaluate(replace(whole, copper_degC=copper))
    assert found.resistance_K_per_W is not None
    assert [line.split(":")[0] for line in found.left_out] == [whole.copper_names[3]]


@pytest.mark.parametrize("irons", [1, 2])
@pytest.mark.parametrize("how", ["open", "not connected"])
def test_iron_sensors_that_each_fail_in_one_check_take_the_iron_from_no_other(irons: int, how: str) -> None:
    whole = [trace(check) for check in stator("monotone").checks]
    some = [replace(one, iron_degC=one.iron_degC[:, :irons], iron_names=one.iron_names[:irons]) for one in whole]
    failing = list(some)
    for k in range(irons):
        degC, names = failing[2 + k].iron_degC, failing[2 + k].iron_names
        rest = [i for i in range(irons) if i != k]
        lost = {"iron_degC": degC[:, rest], "iron_names": tuple(names[i] for i in rest)}
        opened = {"iron_degC": np.where(np.arange(irons) == k, np.nan, degC)}
        failing[2 + k] = replace(failing[2 + k], **(opened if how == "open" else lost))
    first = [replace(one, iron_degC=one.iron_degC[:, :1], iron_names=one.iron_names[:1]) for one in whole]
    found, expected = evaluate_together(failing), evaluate_together(first)
    assert [one.source for one in found] == ["iron sensor" if k != 2 else None for k in range(len(whole))]
    for k, one in enumerate(found):
        if k != 2:
            assert one.resistance_K_per_W == pytest.approx(expected[k].resistance_K_per_W, rel=0.01)
    assert "no iron temperature" in (found[2].why or "")


def test_a_thermocouple_that_fails_in_one_check_is_left_out_of_all() -> None:
    checks = stator("none").checks
    whole = [trace(check) for check in checks]
    copper = whole[4].copper_degC.copy()
    copper[:, 0] = np.nan
    found = evaluate_together([*whole[:4], replace(whole[4], copper_degC=copper), *whole[5:]])
    assert {line.split(":")[0] for one in found for line in one.left_out} == {whole[0].copper_names[0]}
    assert all(len(one.left_out) == 1 for one in found)
    assert np.abs(np.diff(np.log(resistances(found)))).max() < 0.01


def test_checks_of_one_specimen_never_mix_routes() -> None:
    whole = [trace(check) for check in stator("none").checks]
    lost = replace(whole[3], iron_degC=np.full_like(whole[3].iron_degC, np.nan))
    assert evaluate(lost).source == "first minutes"
    found = evaluate_together([*whole[:3], lost, *whole[4:]])
    assert len({one.source for one in found if one.source is not None}) == 1


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"copper_degC": np.zeros((400, 0)), "copper_names": ()},
            "no copper temperature: no channel of region copper has one"),
        ({"copper_degC": np.full((400, 2), np.nan)}, "no copper temperature can be believed"),
        ({"power_W": np.zeros(400)}, "power is not above zero"),
        ({"power_W": np.full(400, np.nan)}, "power and temperatures are never there together"),
        ({"current_A": np.zeros(400)}, "no load: neither current nor power"),
        ({"current_A": np.where(np.arange(400) % 80 < 60, 160.0, 0.0)},
            "iron sensor: loaded for 10.0 min without a break"),
    ],
)  # fmt: skip
def test_a_check_that_cannot_be_evaluated_says_why(changed: dict[str, object], why: str) -> None:
    t = np.arange(0.0, 4000.0, 10.0)
    copper = 100.0 - 80.0 * np.exp(-t / 900.0)
    sound = CheckTrace(
        t, np.column_stack([copper, copper]), ("A", "B"), copper[:, None] - 20.0, ("I",), np.full((400, 1), 20.0),
        np.full(400, 500.0), np.full(400, 160.0),
    )  # fmt: skip
    found = evaluate(replace(sound, **changed))  # type: ignore[arg-type]
    assert found.resistance_K_per_W is None
    assert found.why is not None and found.why.startswith(why)


def test_copper_that_is_colder_than_iron_has_no_resistance() -> None:
    t = np.arange(0.0, 4000.0, 10.0)
    flat = np.full((400, 1), 60.0)
    found = evaluate(CheckTrace(t, flat, ("A",), flat + 5.0, ("I",), flat, np.full(400, 500.0)))
    assert found.resistance_K_per_W is None
    assert found.why is not None and found.why.startswith("iron sensor: copper is not warmer than iron")
