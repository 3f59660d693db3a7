"""The trials: what is hidden in whom, how large, what it does without noise, and the rates that come out."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.shared import clopper_pearson
from benchmarks.trial.answers import Result, read_results, written
from benchmarks.trial.audit import Spread
from benchmarks.trial.campaigns import KEPT, LEARNT, difference, kept_as, kept_count
from benchmarks.trial.cases import (
    FEWEST_SESSIONS,
    MOST_SESSIONS,
    OFF_LIBRARY_EVERY,
    Case,
    Hidden,
    cases,
    place_of,
    scaled,
)
from benchmarks.trial.lost import IMPOSSIBLE
from benchmarks.trial.lost import KEPT as BY_KEPT
from benchmarks.trial.one import lumped
from benchmarks.trial.rates import (
    ALL,
    NOT_RATED,
    audits,
    by_entry,
    by_entry_table,
    by_what_hides,
    by_what_hides_table,
    crudeness_table,
    gains,
    gains_table,
    lost_causes,
    lost_table,
    many,
    many_table,
    reliability,
    reliability_table,
    singles,
    singles_table,
    stated_of,
)
from benchmarks.trial.visibility import VISIBLE, Seen
from plant import Effect, Plant, drives
from plant.sensors import sensors

HIDDEN = "loss.magnet.speed2"
ONE = (("jacketed", "fitted"),)
FOUR = tuple((form, rule) for form in ("jacketed", "weakened") for rule in ("fitted", "hand"))


def _hiding(*causes: str, log_bf: float = 20.0, seed: int = 1, motor: tuple[str, str] = ONE[0]) -> Result:
    """A silent answer for a motor that hides these."""
    case = Case(seed, "six", *motor, tuple(Hidden(cause, 4.0) for cause in causes))
    return Result(case, tuple(Seen(cause, 60.0, 4.0, log_bf) for cause in causes))


SILENT = _hiding(HIDDEN)


def _named(cause: str, log_bf: float = 20.0) -> Result:
    return replace(SILENT, named={cause: log_bf}, linear=log_bf)


def test_no_seed_is_used_twice_and_a_third_of_the_effects_is_off_the_library() -> None:
    found = cases(1000, 40, 60, 20, ONE, "six")
    assert len({case.seed for case in found}) == len({case.name for case in found}) == len(found) == 120
    assert Counter(case.kind for case in found) == {"healthy": 40, "single": 60, "many": 20}
    single = [case.hidden[0].cause for case in found if case.kind == "single"]
    assert sum(cause.startswith("unknown.") for cause in single) == 60 // OFF_LIBRARY_EVERY
    assert min(case.seed for case in found) == 1000


def test_every_row_of_the_catalogue_that_can_be_seen_is_drawn_and_every_strength_too() -> None:
    drawn = [case.hidden[0] for case in cases(1000, 0, 120, 0, ONE, "six")]
    found = [hidden for hidden in drawn if not hidden.cause.startswith("unknown.")]
    causes = Counter(hidden.cause for hidden in found)
    assert len(causes) > 30
    assert max(causes.values()) - min(causes.values()) <= 1
    assert len({hidden.wanted for hidden in found}) == 5
    assert not any(word in cause for cause in causes for word in ("ageing", "session", "stuck", "hold"))


def test_every_form_and_rule_has_its_turn_and_none_has_always_the_same_causes() -> None:
    found = cases(1000, 40, 60, 40, FOUR, "six")
    for kind, of_each in (("healthy", 10), ("single", 15), ("many", 10)):
        counts = Counter((case.form, case.rule) for case in found if case.kind == kind)
        assert counts == dict.fromkeys(FOUR, of_each)
    for motor in FOUR:
        own = [case.hidden[0] for case in found if case.kind == "single" and (case.form, case.rule) == motor]
        assert 2 <= sum(hidden.cause.startswith("unknown.") for hidden in own) <= 8
        assert len({hidden.wanted for hidden in own}) == 5


def test_of_many_effects_no_two_are_of_one_family_or_at_one_place() -> None:
    found = cases(1000, 0, 0, 60, ONE, "six")
    assert {len(case.hidden) for case in found} == {3, 4, 5}
    assert {case.sessions for case in found} == set(range(FEWEST_SESSIONS, MOST_SESSIONS + 1))
    for case in found:
        causes = [hidden.cause for hidden in case.hidden]
        assert len({place_of(cause) for cause in causes}) == len(causes)
        assert len({cause.split(".")[0] for cause in causes}) == len(causes)
    kinds = Counter(hidden.cause.split(".")[0] for case in found for hidden in case.hidden)
    assert {"loss", "conductance", "capacity", "sensor", "boundary", "unknown"} <= kinds.keys()


def test_there_are_sessions_enough_to_learn_from_and_to_keep() -> None:
    for sessions in range(FEWEST_SESSIONS, MOST_SESSIONS + 1):
        assert 2 <= kept_count(sessions) <= len(KEPT)
        assert 3 <= sessions - kept_count(sessions) <= len(LEARNT)


def test_a_crude_file_has_sessions_enough_to_leave_each_out() -> None:
    found = cases(1000, 0, 0, 60, (("jacketed", "three_nodes"),), "six")
    assert {case.sessions for case in found} == set(range(8, MOST_SESSIONS + 1))


@pytest.mark.parametrize(
    ("cause", "seven", "three"),
    [
        ("loss.magnet.speed2", "loss.magnet.speed2", "loss.rotor.speed2"),
        (
            "conductance.shaft-ambient.constant",
            "conductance.rotor-ambient.constant",
            "conductance.rotor-ambient.constant",
        ),
        ("conductance.winding-teeth.scale", "conductance.winding-teeth.scale", "conductance.winding-stator.scale"),
        ("conductance.teeth-yoke.scale", "conductance.teeth-yoke.scale", "unknown.inside"),
        ("sensor.teeth.lag", "sensor.teeth.lag", "sensor.stator@TC_teeth.lag"),
        ("boundary.coolant.bias", "boundary.coolant.bias", "boundary.coolant.bias"),
    ],
)
def test_what_hides_is_called_as_its_lump_is(cause: str, seven: str, three: str) -> None:
    for rule, expected in {"fitted": cause, "seven_nodes": seven, "three_nodes": three}.items():
        assert lumped(Effect(cause, 2.0), Case(1, "six", rule=rule)).cause == expected


def test_a_size_grows_in_proportion_and_a_factor_by_its_logarithm() -> None:
    assert scaled(Effect(HIDDEN, 60.0), 3.0).size == 180.0
    assert scaled(Effect("conductance.yoke-jacket.scale", 0.6), 2.0).size == pytest.approx(0.36)
    assert scaled(Effect("loss.magnet.scale", 2.4), 6.0).size == 5.0
    assert scaled(Effect("unknown.vapour", 0.45), 4.0).size == 0.2


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [(0, 16, 0.0, 0.171), (16, 16, 0.829, 1.0), (5, 10, 0.222, 0.778)],  # Clopper and Pearson 1934, 5 % on either side
)
def test_bounds_are_those_of_clopper_and_pearson(k: int, n: int, low: float, high: float) -> None:
    assert clopper_pearson(k, n, 0.9) == pytest.approx((low, high), abs=1e-3)


@pytest.mark.parametrize(
    ("result", "verdict"),
    [
        (SILENT, "silent"),
        (_named(HIDDEN), "first"),
        (replace(_named("loss.magnet.scale"), groups={"loss.magnet.scale": (HIDDEN,)}), "class"),
        (_named("loss.magnet.scale"), "place"),
        (_named("loss.yoke.scale"), "wrong"),
        (
            replace(_hiding("conductance.winding-teeth.scale"), named={"conductance.teeth-winding.scale": 20.0}),
            "first",
        ),
        (replace(SILENT, refused=(HIDDEN,)), "silent"),
        (replace(SILENT, is_unknown=True), "wrong"),
    ],
)
def test_an_answer_is_judged_against_what_was_hidden(result: Result, verdict: str) -> None:
    assert result.verdict == verdict


def test_off_the_library_unknown_is_right_and_a_name_is_wrong() -> None:
    outside = _hiding("unknown.spray")
    assert replace(outside, is_unknown=True).verdict == "first"
    assert replace(outside, named={HIDDEN: 40.0}).verdict == "wrong"


def test_rates_are_counted_by_visibility_and_healthy_motors_apart() -> None:
    healthy = _hiding(seed=2)
    alarm = replace(_hiding(seed=5), named={HIDDEN: 20.0}, improved=True)
    swap = replace(_hiding("sensor.teeth.swap_yoke"), named={"sensor.teeth.swap_yoke": 20.0})
    swap = replace(swap, hidden=(Seen("sensor.teeth.swap_yoke", 1.0),))
    outside = replace(_hiding("unknown.spray", log_bf=4.0), is_unknown=True)
    found = singles([healthy, alarm, swap, outside, _hiding(HIDDEN, log_bf=2.9), _named(HIDDEN)])[ALL]
    assert found["healthy"]["named"]["count"] == found["healthy"]["improved"]["count"] == 1
    assert found["healthy"]["named"]["of"] == 2
    assert found["swaps"]["first"] == {"of": 1, "count": 1, "at_least": 0.05, "at_most": 1.0}
    assert found["off library"]["3 to 8"]["first"]["count"] == 1
    assert found["effects"]["below 3"]["silent"]["count"] == found["effects"][VISIBLE]["first"]["count"] == 1
    assert found["wrong"]["of"] == 2
    assert "healthy named 1/2 [2%, 98%]" in singles_table({ALL: found})[0]


def test_the_worst_form_and_rule_stands_first() -> None:
    good, bad = _named(HIDDEN), _hiding(HIDDEN, motor=FOUR[3])
    assert list(singles([good, bad])) == ["weakened hand", "jacketed fitted", ALL]
    alarm = replace(_hiding(motor=FOUR[1]), named={HIDDEN: 20.0})
    assert list(singles([good, alarm, bad])) == ["weakened hand", "jacketed hand", "jacketed fitted", ALL]


def test_an_effect_without_an_expected_ln_bf_is_counted_apart() -> None:
    found = singles([replace(SILENT, hidden=(Seen(HIDDEN, 60.0),))])[ALL]
    assert found["effects"][NOT_RATED]["silent"]["count"] == 1
    assert any(line.split()[:4] == ["effects", "not", "rated", "1"] for line in singles_table({ALL: found}))


def test_of_many_effects_each_name_and_each_cause_is_counted_once() -> None:
    causes = (HIDDEN, "capacity.teeth.attached", "sensor.teeth.lag", "unknown.spray")
    errors = {"published": 5.0, "recalibrated": 0.3, "extended": 0.2}
    told = replace(
        _hiding(*causes),
        named={"loss.magnet.scale": 30.0, "sensor.yoke.lag": 20.0, "capacity.teeth.scale": 10.0},
        groups={"loss.magnet.scale": (HIDDEN,)},
        beside=True,
        sensors=errors,
        nodes=dict.fromkeys(errors, 2.0),
    )
    found = many([told, _hiding(*causes, log_bf=1.0, seed=2)])["jacketed fitted"]
    assert [found[key] for key in ("motors", "hidden", "named truly", "silent")] == [2, 8, 2, 6]
    assert [found[key] for key in ("visible", "visible told", "other law", "named falsely")] == [4, 2, 1, 1]
    assert found["sensors"] == errors
    assert "5.00 -> 0.30 -> 0.20, 2.00 -> 2.00 -> 2.00" in many_table([told])[1]


def test_a_search_is_told_apart_from_what_no_search_could_find() -> None:
    both = _hiding("loss.magnet.speed2", "boundary.coolant.bias")
    searched_badly = replace(both, truth=30.0, gained=12.0)
    misled_by_the_data = replace(both, truth=28.0, gained=31.0)
    found = many([searched_badly, misled_by_the_data, both])[ALL]
    assert found["truth explains more"] == 1
    assert [line.split() for line in many_table([searched_badly, both])[-1:]] == [["1", "30.0", "12.0"]]


def test_a_gain_is_counted_where_no_sensor_sits_too() -> None:
    better = {"published": 5.0, "recalibrated": 0.5, "extended": 0.2}
    worse = {"published": 5.0, "recalibrated": 1.0, "extended": 1.5}
    offered = replace(_named(HIDDEN), improved=True, sensors=better, nodes=worse)
    ran_away = replace(_named(HIDDEN), sensors=dict.fromkeys(better), nodes={**better, "extended": None})
    found = gains([offered, ran_away, SILENT])
    assert [found[f"single{rows}"]["motors"] for rows in ("", " named", " visible", " improved")] == [3, 2, 2, 1]
    assert found["single named"]["sensors"] == better  # the one that has all three
    assert found["single named"]["better"] == {"sensors": 1, "nodes": 0}
    assert found["many"]["nodes"] == dict.fromkeys(better)
    line = next(line for line in gains_table([offered]) if line.startswith("single improved"))
    assert " ".join(line.split()) == "single improved 1 5.00 -> 0.50 -> 0.20 1 5.00 -> 1.00 -> 1.50 0"


def test_terms_that_enter_late_are_counted_by_themselves() -> None:
    two = _hiding(HIDDEN, "sensor.yoke.bias")
    first = replace(two, named={HIDDEN: 9.0, "loss.magnet.speed3": 20.0}, entered=(HIDDEN, "loss.magnet.speed3"))
    other = replace(two, named={"loss.yoke.speed": 20.0}, entered=("loss.yoke.speed",))
    alone = replace(_named(HIDDEN), entered=(HIDDEN,))
    found = by_entry([first, first, other, alone])
    assert [(row["true"]["count"], row["true"]["of"], row["other law"], row["false"]) for row in found.values()] == [
        (2, 3, 0, 1),
        (0, 2, 2, 0),
    ]
    assert by_entry_table([first])[1].split() == ["1", "1/1", "[5%,", "100%]", "0", "0"]


def test_stated_probabilities_stand_beside_how_often_they_were_right() -> None:
    right, elsewhere = (replace(_named(cause), stated={cause: 0.97}) for cause in (HIDDEN, "loss.yoke.speed2"))
    in_class = replace(elsewhere, groups={"loss.yoke.speed2": (HIDDEN,)})
    (row,) = reliability(stated_of([right, in_class, in_class, elsewhere, SILENT]))
    assert (row["from"], row["to"], row["true"]["count"], row["true"]["of"]) == (0.95, 0.99, 3, 4)
    assert row["stated"] == pytest.approx(0.97)
    sure = replace(elsewhere, stated={"loss.yoke.speed2": 1.0})
    head, low, high = reliability_table(stated_of([right, *[sure] * 5]))
    assert head.split()[-1] == "true"
    assert low.split() == ["0.95", "to", "0.99", "0.970", "1/1", "[5%,", "100%]"]
    assert high.split() == ["0.99", "to", "1.00", "1.000", "0/5", "[0%,", "45%]", "off"]


def test_stated_probabilities_are_told_apart_by_what_hides() -> None:
    right, wrong = (replace(_named(cause), stated={cause: 0.97}) for cause in (HIDDEN, "loss.yoke.speed2"))
    off = replace(wrong, hidden=(Seen("unknown.contact", 1.0, 9.0),))
    several, healthy = replace(right, hidden=(*right.hidden, *off.hidden)), replace(wrong, hidden=())
    found = by_what_hides([right, right, wrong, off, several, healthy, SILENT])
    counts = {kind: (row["true"]["count"], row["true"]["of"]) for kind, row in found.items()}
    assert counts == {
        "one of the library": (2, 3),
        "one off the library": (0, 1),
        "several at once": (1, 1),
        "nothing": (0, 1),
    }
    assert by_what_hides([SILENT]) == {}
    assert by_what_hides_table([off])[1].split() == ["one", "off", "the", "library", "0.970", "0/1", "[0%,", "95%]"]


def test_a_lost_cause_counts_where_it_could_be_seen() -> None:
    lost = replace(SILENT, lost={HIDDEN: IMPOSSIBLE})
    invisible = replace(_hiding(HIDDEN, log_bf=7.9), lost={HIDDEN: BY_KEPT})
    assert lost_causes([lost, lost, invisible, _named(HIDDEN)]) == {IMPOSSIBLE: {HIDDEN: 2}}
    assert f"{IMPOSSIBLE:<16}   2  {HIDDEN} x2" in lost_table([lost, lost])[1]


def test_z_of_healthy_motors_is_that_of_a_right_width_where_it_is_determined() -> None:
    wide, held = Spread(4, 0.5, 2.0, 0.6, "a", 0, 0), Spread(4, 3.5, 2.0, 1.8, "b", 2, 1)
    motors = [replace(_hiding(seed=seed), audit={"lags": one}) for seed, one in ((1, wide), (2, held))]
    found = audits(motors)["jacketed"]["lags"]
    assert wide.ratio == 0.5
    assert found == Spread(8, 4.0, 4.0, 1.8, "b", 2, 1, 2)
    assert found.ratio == 1.0
    assert found.breaks == ["held at a bound"]


@pytest.mark.parametrize(
    ("spread", "breaks"),
    [
        (Spread(40, 25.0, 25.0, 2.0, "a", 0, 0), []),
        (Spread(40, 10.0, 25.0, 2.0, "a", 0, 0), ["width too wide"]),
        (Spread(40, 40.0, 25.0, 4.1, "a", 0, 0), ["width too narrow", "beyond 4"]),
        (Spread(40, 40.0, 19.0, 2.0, "a", 0, 0), []),
        (Spread(40, 25.0, 25.0, 2.0, "a", 1, 1, 50), []),
        (Spread(40, 25.0, 25.0, 2.0, "a", 2, 2, 50), ["held at a bound"]),
    ],
)
def test_a_family_is_told_that_breaks_what_widths_must_be(spread: Spread, breaks: list[str]) -> None:
    assert spread.breaks == breaks


def test_an_effect_moves_the_readings_and_none_moves_nothing() -> None:
    drive = drives.wltp(1).first(120.0)
    plant = Plant(7, Effect("loss.endwinding_a_inner.speed2_current2", 4000.0))
    without, with_it = Plant(7).run(drive), plant.run(drive)
    moved = difference(without, with_it, plant, "six")
    assert moved.keys() == {sensor.signal for sensor in sensors("six")}
    assert moved["EW_A_inner"].shape == (120,)
    assert moved["EW_A_inner"].max() > 10 * np.abs(moved["EW_B_inner"]).max() > 0
    assert not any(np.any(k) for k in difference(without, without, plant, "six").values())


def test_what_was_made_is_made_once(tmp_path: Path) -> None:
    made = []
    for _ in range(2):
        kept_as(tmp_path / "a" / "b.pickle", lambda: made.append(1))
    assert made == [1]


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    healthy = replace(_hiding(), audit={"lags": Spread(4, 0.5, 2.0, 0.6, "a", 0, 0)}, nodes={"published": None})
    grouped = replace(
        _named(HIDDEN), groups={HIDDEN: ("loss.yoke.speed2",)}, stated={HIDDEN: 0.9}, refused=("capacity.yoke.scale",)
    )
    for result in (SILENT, healthy, grouped):
        written(path, result)
    assert read_results(path) == [SILENT, healthy, grouped]


def test_the_crudest_file_stands_last_with_the_best_candidate_and_what_is_named() -> None:
    good = replace(_named(HIDDEN), crudeness=0.5, leading={HIDDEN: 20.0, "loss.magnet.scale": 3.0})
    crude = replace(SILENT, crudeness=2.0, leading={"capacity.rotor.attached": 61.0})
    _, first, last = crudeness_table([crude, replace(SILENT, failed="ValueError"), good])
    assert first.split()[-4:] == ["1", "0.50", "20.0", HIDDEN]
    assert last.split()[-4:] == ["1", "2.00", "61.0", "-"]
