"""A diagnosis in words: each ending says what was found, what was not, and what to do next."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest

from made.diagnoses import (
    ABSORBED,
    ALL,
    APART,
    BIAS,
    EDDY,
    EXPLAINED,
    GAIN,
    IRON,
    NAMED,
    NO_LOAD,
    NOT_IMPROVED,
    OFFSET,
    PATH,
    RIVALS,
    SEVERAL,
    SILENT,
    STRANGE,
    TAKEN,
    TOLD_APART,
    TOO_LITTLE,
    UNKNOWN,
    WORSE,
    gain,
    session_id,
    shown,
)
from replay.show.reports.beyond_usual import how_many
from replay.show.reports.diagnosis_text import answer_markdown, diagnosis_text, gain_notes
from replay.show.reports.doubts import not_judged
from replay.show.reports.kept_errors import change
from replay.show.reports.sentences import answer, headline
from replay.show.reports.two_models import paragraphs
from replay.show.reports.verdict import Ending, active, comes_from, ending, probability, size, watts
from replay.show.words.width import ELSEWHERE
from replay.studies.diagnosis.answer import Contradicting, Diagnosis, EvidenceParts
from twin.diagnosis.naming import ENOUGH_SESSIONS
from twin.motor.causes import parse, says


def flat(text: str) -> str:
    """The text without its line breaks."""
    return re.sub(r"\s+", " ", text)


@pytest.mark.parametrize("name", ALL)
def test_every_page_begins_with_the_answer_ends_with_the_next_command_and_is_100_columns_wide(name: str) -> None:
    lines = diagnosis_text(ALL[name]).splitlines()
    assert lines[0].startswith("Answer            ")
    assert [line[:18].rstrip() for line in lines if line[0] != " "][1] == "What is wrong"
    assert lines[-1].startswith("Next              whyhot ")
    assert max(map(len, lines)) <= ELSEWHERE


@pytest.mark.parametrize(
    ("diagnosis", "expected"),
    [
        (NAMED, Ending.NAMED),
        (NOT_IMPROVED, Ending.NAMED),
        (UNKNOWN, Ending.UNKNOWN),
        (SILENT, Ending.AGREES),
        (replace(SILENT, unknown=UNKNOWN.unknown), Ending.UNKNOWN),
        (replace(SILENT, unknown=[replace(UNKNOWN.unknown[0], log_bayes_factor=4.8)]), Ending.AGREES),
        (replace(ABSORBED, unknown=[replace(UNKNOWN.unknown[0], log_bayes_factor=4.8)]), Ending.UNKNOWN),
        (ABSORBED, Ending.AGREES),
        (TOO_LITTLE, Ending.CANNOT_TELL),
        (replace(SILENT, shown=[]), Ending.CANNOT_TELL),
        (replace(SILENT, candidates=0), Ending.CANNOT_TELL),
        (replace(ABSORBED, gain=[gain("magnet", 1.9, 1.9, (0, 0), 9.0)]), Ending.CANNOT_TELL),
    ],
)
def test_a_diagnosis_ends_in_one_of_four_ways(diagnosis: Diagnosis, expected: Ending) -> None:
    assert ending(diagnosis) is expected


def test_what_is_wrong_gives_the_worst_node_with_its_place_then_the_others_then_the_floor() -> None:
    assert (
        "magnet 6.1 K off in the mean of the 2 sessions learnt from, 17.1 K at worst, most at 8,000 to 16,000 rpm and "
        "at 300 to 450 A · rotor surface 5.2 K · all else within the sensors' own uncertainty (0.4 K)"
    ) in flat(diagnosis_text(NAMED))


def test_a_named_cause_comes_with_its_id_words_size_formula_and_evidence() -> None:
    text = flat(diagnosis_text(NAMED))
    for part in (
        "Named cause loss.magnet.speed2_current2 probability 97 % (ln BF 310, null 4.6, threshold 8)",
        "magnet loss grows with speed squared and current squared",
        "+96 W (88 to 104); +14.2 W at the typical point; largest effect +6.3 K at the magnet, 3_wltp 1:12:40",
        "loss of magnet [W] += 96 (n/16000 rpm)^2 (I/450 A)^2",
        "Not told apart nothing: every other candidate is more than 3 behind in ln BF (20 times less probable)",
        "loss.rotor_surface.speed3: ln BF 288, 22 behind",
    ):
        assert part in text


def test_a_cause_that_moves_readings_alone_has_no_largest_effect_on_a_temperature() -> None:
    lag = replace(BIAS, largest_effect_K=0.0, largest_effect_node="winding", largest_effect_t_s=0.0, typical_W=None)
    text = flat(diagnosis_text(replace(NAMED, causes=[lag])))
    assert "it moves a reading and no temperature of the motor" in text
    assert "largest effect" not in text


def test_the_family_that_is_relieved_most_is_told_in_whichever_order_an_answer_was_sealed() -> None:
    evidence = EvidenceParts(fit=13.1, priors_relieved=12.7, rest=0.5, relieved={"capacities": 1.4, "films": 3.5})
    assert "12.7 priors relieved (other numbers move less, mostly films: 3.5)" in comes_from(evidence)


def test_the_gain_lists_better_worse_and_unchanged_nodes() -> None:
    text = flat(diagnosis_text(NAMED))
    assert "mean error as published -> recalibrated -> with the cause, replayed, against readings as recorded" in text
    assert (
        "magnet 10.1 -> 6.4 -> 2.3 K (fitted 9.0 -> 6.1 -> 0.9 K, 5.2 better (4.1 to 6.0), reading moved by −1.7 K)"
    ) in text
    assert "unchanged by the cause: endwinding a outer 0.7 K (fitted 0.3 K)" in text
    assert (
        "4_s1 and 5_wltp; 95 % intervals within these sessions; 8 % of the time at operating points that were not "
        "learnt from" in text
    )
    worse = "rotor surface 7.6 -> 0.5 -> 0.6 K (fitted 7.7 -> 0.5 -> 0.6 K, 0.1 worse (0.1 to 0.2))"
    assert worse in flat(diagnosis_text(NOT_IMPROVED))


def test_an_error_that_moves_without_the_interval_saying_so_is_not_called_unchanged() -> None:
    nodes = [
        gain("rotor", 3.7, 2.4, (-0.02, 2.8), 5.0),
        gain("winding", 0.4, 0.5, (-0.3, 0.2), 5.2, recorded=(3, 0.9, 1.3)),
    ]
    text = flat(diagnosis_text(replace(NAMED, gain=nodes)))
    assert "rotor fitted 5.0 -> 3.7 -> 2.4 K, 1.3 better, which may be chance (0.0 to 2.8)" in text
    assert (
        "winding 3.0 -> 0.9 -> 1.3 K (fitted 5.2 -> 0.4 -> 0.5 K, 0.1 worse, which may be chance (−0.2 to 0.3))" in text
    )
    assert "unchanged" not in text


@pytest.mark.parametrize(
    ("ci", "word"), [((0.1, 0.4), "better"), ((-0.1, 0.4), "unchanged"), ((-0.4, -0.1), "worse"), ((0, 0), "unchanged")]
)
def test_a_node_is_better_or_worse_only_where_the_whole_interval_says_so(ci: tuple[float, float], word: str) -> None:
    assert change(gain("magnet", 1.0, 0.8, ci, 2.0)) == word


def test_causes_that_cannot_be_told_apart_are_listed_with_the_test_that_would() -> None:
    text = flat(diagnosis_text(TOLD_APART))
    assert "Not told apart loss.magnet.speed_current2: magnet loss grows with speed and current squared" in text
    assert "conductance.magnet-rotor_core.scale: the heat path between magnet and rotor core" in text
    assert "Test that would: S2 at 12,000 rpm" in text
    told = answer(TOLD_APART)
    assert told.startswith(
        "Magnet loss grows with speed squared and current squared, or 2 other causes: on kept sessions"
    )
    assert "These sessions cannot tell it from: magnet loss grows with speed and current squared; the heat path" in told


def test_a_cause_that_does_not_improve_kept_sessions_says_why_and_its_files_are_offered_all_the_same() -> None:
    text = flat(diagnosis_text(NOT_IMPROVED))
    why = "the lower bound of the log score's gain is below zero (-3.1)"
    assert f"in the extended motor file, which is offered though not improved: {why}" in text
    assert "whyhot accept d-7f31beef" in text
    worse = "With it the kept sessions get worse than recalibrated, most the rotor surface: 0.5 -> 0.6 K (fitted 0.5"
    for told in (answer(NOT_IMPROVED), text):
        assert f"{worse} -> 0.6 K); the extended files are offered all the same." in told
    falls = {"published": 8.0, "before": 0.6, "after": 0.5}
    nearer = replace(NOT_IMPROVED, gain=[replace(one, mae_recorded_K=falls) for one in NOT_IMPROVED.gain])
    assert "recalibrated, most the rotor surface: fitted 0.5 -> 0.6 K; the extended" in answer(nearer)


def test_a_gain_that_recalibration_took_is_said_so() -> None:
    taken = "The sensors see no gain from it, as recalibration alone takes their mean error from 7.9 K to 0.2 K; "
    assert f"{taken}the extended files are offered all the same." in answer(TAKEN)
    assert f"Two models {taken}" in flat(diagnosis_text(TAKEN))
    assert "The sensors see no gain" not in flat(diagnosis_text(ABSORBED) + diagnosis_text(NAMED))
    alone = replace(TAKEN, held_out=[], held_out_names=[], gain=[])
    assert "No session was kept to measure the gain on; the extended files are offered all the same." in answer(alone)
    ran_away = replace(TAKEN, extended_model=None, why_no_files='in a replay node "magnet" runs away')
    assert "to 0.2 K; no file is changed." in answer(ran_away)
    assert 'No extended files were written: in a replay node "magnet" runs away.' in answer(ran_away)


def test_a_calibration_that_is_worse_says_so_first_and_an_extended_model_that_is_worse_too_says_that() -> None:
    rose = [gain("rotor", 2.5, 2.0, (0.3, 0.7), 1.4, recorded=(1.6, 2.8, 2.1), moved=0.11)]
    both = replace(NAMED, recalibrated_model=None, gain=rose)
    says = (
        "recalibration makes the kept sessions worse: rotor 1.6 -> 2.8 K (fitted 1.4 -> 2.5 K, reading moved by +0.1 K)"
    )
    assert headline(both).endswith(f"{says}; its files are not offered.")
    further = (
        "The extended model is further off on the kept sessions than the file as published: 2.1 K instead of 1.6 K"
    )
    assert further in answer(both) and "whyhot accept" in diagnosis_text(both)
    assert further[:40] not in answer(NAMED) + answer(replace(both, extended_model=None))


def test_the_two_models_are_told_apart() -> None:
    assert flat("\n".join(paragraphs(NAMED))) == (
        "numbers that move less with the cause: conductance jacket-coolant −2.3 sd without it, −0.2 sd with it; loss "
        "of teeth near 8,000 rpm +1.4 sd without it, +0.4 sd with it "
        "of the nodes without a sensor they differ most at rotor core: 1.2 K in the mean of the kept sessions, 3.4 K "
        "at most (5_wltp 0:31:00) "
        f"of 2 operating points they differ most at {NO_LOAD}: rotor core −7.4 K with the cause "
        f"would tell which is right: {NO_LOAD}, where MAG_1 reads −5.9 K with the cause, 12 times what it may be off; "
        f"or a sensor at rotor core, 7.4 K apart in {NO_LOAD}, 15 times what one may be off"
    )
    assert paragraphs(ABSORBED) == []
    assert "Two models numbers that move less with the cause" in flat(diagnosis_text(NAMED))
    assert "Two models" not in diagnosis_text(ABSORBED)
    assert "- of the nodes without a sensor they differ most at rotor core" in answer_markdown(NAMED)


def test_two_models_that_agree_say_so() -> None:
    near = [replace(one, mean_K=0.04) for one in APART.inside]
    points = [replace(one, differ_K=0.04) for one in APART.points]
    same = replace(APART, over_kept=False, relieved=[], inside=near, points=points, test=None, sensor=None)
    assert paragraphs(replace(NAMED, two_models=same)) == [
        "the cause relieves no coefficient by half of its sd or more",
        "at nodes without a sensor the two agree within 0.1 K in the mean of the sessions learnt from",
        "at 2 operating points the two agree within 0.1 K",
        "neither an operating point nor one more sensor would tell which is right: "
        + "they differ too little everywhere for what a sensor may be off",
    ]


def test_what_can_be_accepted_is_offered_first() -> None:
    assert diagnosis_text(NAMED).splitlines()[-1] == (
        "Next              whyhot accept d-7f31beef · whyhot view 4_s1 · whyhot report d-7f31beef"
    )
    only_bench = replace(NAMED, causes=[BIAS], extended_model=None, extended_bench="be" * 32)
    assert "whyhot accept d-7f31beef" in diagnosis_text(only_bench)


def test_several_causes_are_each_named_with_what_was_masked_dropped_and_doubtful() -> None:
    text = flat(diagnosis_text(SEVERAL))
    assert text.count("Named cause") == text.count("Not told apart") == 2
    assert "Left out 3_wltp: MAG_1 holds its last value for 240 s, 6 times" in text
    assert "left out because the model became unstable with them: loss.magnet.temperature" in text
    assert "few kept data" in text and "not a first look" in text
    assert answer(SEVERAL).startswith(
        "Magnet loss grows with speed squared and current squared, and 1 more cause: on kept sessions the magnet's"
    )
    assert "current squared, +96 W (88 to 104); the sensor at endwinding b outer reads off" in answer(SEVERAL)
    assert "few kept data" not in flat(diagnosis_text(NAMED)) and "not a first look" not in flat(diagnosis_text(NAMED))


def test_a_motor_that_agrees_is_told_so_with_the_best_candidate_and_the_null() -> None:
    assert answer(SILENT) == (
        "The twin agrees with these sessions within the sensors' own uncertainty: on kept sessions the magnet's error "
        "goes from 0.3 K as published to 0.2 K recalibrated, fitted. 213 candidates tried, best ln BF 1.2 (null 4.6, "
        "threshold 8)."
    )
    assert "nothing: every node is within the sensors' own uncertainty (0.4 K)" in flat(diagnosis_text(SILENT))
    assert "none with evidence (null 4.6, threshold 8)" in answer(replace(SILENT, rivals=[]))


def test_an_error_that_recalibration_takes_away_is_not_called_agreement() -> None:
    assert answer(ABSORBED).startswith(
        "No cause beyond the file's own coefficients is needed: on kept sessions the magnet's error falls from 10.1 K "
        "as published to 1.4 K recalibrated. With start, coolant and readings fitted on the first tenth of each kept "
        "session, the magnet's error is 9.0 -> 0.3 K, its reading moved by −1.7 K by learnt corrections."
    )
    text = flat(diagnosis_text(ABSORBED))
    assert "magnet 10.1 -> 1.4 K (fitted 9.0 -> 0.3 K, reading moved by −1.7 K) · rotor surface 7.9 -> 0.3 K" in text
    assert "is needed" not in answer(replace(ABSORBED, gain=[]))


def test_a_calibration_that_makes_kept_sessions_worse_says_so_first_and_is_never_called_enough() -> None:
    first = (
        "No cause beyond the file's own coefficients has evidence: recalibration makes the kept sessions worse: rotor "
        "1.6 -> 2.8 K (fitted 1.4 -> 2.5 K, reading moved by +0.1 K); its files are not offered."
    )
    assert headline(WORSE) == first
    assert flat(diagnosis_text(WORSE)).startswith(f"Answer {first} What is wrong")
    cause = replace(WORSE, causes=[EDDY], gain=[replace(g, mae_after_K=0.2) for g in WORSE.gain])
    assert "speed squared and current squared: recalibration makes the kept sessions worse: rotor" in answer(cause)
    assert "With the cause: rotor fitted 0.2 K, reading moved by +0.1 K." in answer(cause)


@pytest.mark.parametrize(
    ("rises", "worse"),
    [
        ({"recorded": (2.0, 2.6)}, "2.0 -> 2.6 K (fitted 1.5 -> 1.0 K"),
        ({"recorded": (2.0, 1.9), "before": 1.9}, "2.0 -> 1.9 K (fitted 1.5 -> 1.9 K"),
    ],
)
def test_coefficients_are_not_called_enough_above_an_error_that_rose(rises: Any, worse: str) -> None:
    calm = {"node": "rotor", "before": 1.0, "after": 1.0, "ci": (0, 0), "published": 1.5}
    mixed = replace(ABSORBED, gain=[ABSORBED.gain[0], gain(**(calm | rises))])
    assert headline(mixed).startswith("No cause beyond the file's own coefficients has evidence: on kept sessions the")
    assert f"; worse: rotor {worse})." in headline(mixed)


def test_the_first_sentence_is_short_and_has_no_names_of_code() -> None:
    long = says(parse("conductance.rotor_surface-endwinding_a_outer.speed1.5"))
    others = ["loss.magnet.scale"] * 3
    rose = [*GAIN[1:], gain("endwinding_a_outer", 0.3, 2.0, (-2, -1), 0.3, recorded=(0.4, 0.6, 2.1))]
    longest = replace(NAMED, causes=[replace(EDDY, says=long, indistinguishable_from=others)], gain=rose)
    heat = replace(UNKNOWN.unknown[0], patchwork=["loss.magnet.speed2", "sensor.stator.lag"])
    for diagnosis in (*ALL.values(), longest, replace(UNKNOWN, unknown=[heat], gain=ABSORBED.gain)):
        assert answer(diagnosis).startswith(headline(diagnosis))
        first = headline(diagnosis).split(". ")[0]  # what got worse may be another one
        assert 4 < len(first.split()) < 45, first
        assert not re.search(r"\w+\.\w+\.\w+|ln BF|_", first), first
    assert headline(longest).endswith("with the cause. Worse: endwinding a outer 0.4 -> 2.1 K (fitted 0.3 -> 2.0 K).")
    assert headline(NAMED).endswith("with the cause; worse: endwinding a outer 0.5 -> 0.7 K (fitted 0.6 -> 0.3 K).")


def test_where_the_cause_leaves_the_worst_node_that_is_said_with_where_it_gains() -> None:
    magnet = gain("magnet", 0.7, 0.7, (-0.1, 0.1), 1.6, recorded=(1.57, 0.69, 0.70))
    teeth = gain("teeth", 1.4, 0.5, (0.6, 1.2), 1.5, recorded=(1.5, 1.31, 0.52))
    told = headline(replace(NAMED, gain=[magnet, teeth]))
    left = "the magnet's error falls from 1.6 K as published to 0.7 K recalibrated, where the cause leaves it"
    assert told.endswith(f"{left}; the teeth's falls from 1.3 to 0.5 K with it.")
    assert headline(replace(NAMED, gain=[magnet])).endswith(f"{left}.")


def test_rivals_are_told_strongest_first() -> None:
    weak, strong = (replace(NAMED.rivals[0], id=f"loss.teeth.{n}", log_bayes_factor=n) for n in (8.0, 36.0))
    text = flat(diagnosis_text(replace(NAMED, rivals=[weak, strong])))
    assert text.index(strong.id) < text.index(weak.id)


def test_errors_that_no_file_could_be_replayed_for_say_that_they_are_fitted_and_why_there_is_none() -> None:
    bare = [replace(g, mae_recorded_K={"published": g.mae_recorded_K["published"]}) for g in GAIN]
    lost = replace(NAMED, extended_model=None, recalibrated_model=None, gain=bare, why_no_files="no place for a lag.")
    assert "falls from 9.0 K as published to 6.1 K recalibrated and 0.9 K with the cause, fitted." in headline(lost)
    text = flat(diagnosis_text(lost))
    assert "magnet 10.1 -> – -> – K (fitted 9.0 -> 6.1 -> 0.9 K" in text
    assert text.count("No files were written: no place for a lag.") == 1
    assert answer(lost).endswith("No files were written: no place for a lag.")
    assert "named, but no file is changed for it: no place for a lag." in answer_markdown(lost)
    assert "No files were written" not in diagnosis_text(NAMED) + answer(NAMED)


def test_a_candidate_above_the_threshold_that_was_not_named_is_pointed_at() -> None:
    refused = replace(RIVALS[0], log_bayes_factor=14.6, why_not="it makes the kept sessions worse")
    told = f"best ln BF 14.6 (null 4.6, threshold 8): {refused.id}, which is no cause all the same: see the rivals."
    assert answer(replace(ABSORBED, rivals=[refused])).endswith(told)


def test_an_unknown_heat_says_where_how_many_watts_when_and_what_it_goes_with() -> None:
    text = flat(diagnosis_text(UNKNOWN))
    assert (
        "Unknown Something adds 20 to 45 W at endwinding b outer when it is 90 to 140 °C and speed is 3,000 to 6,000 "
        "rpm; no candidate explains it. It goes with endwinding b outer and current."
    ) in text
    assert "Next test S2 at 6,000 rpm, 60 s pulses, with a sensor in air_b" in text
    assert answer(UNKNOWN).endswith("Most telling next test: S2 at 6,000 rpm, 60 s pulses, with a sensor in air_b.")


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (20.0, 45.0, "adds 20 to 45 W at endwinding b outer"),
        (-45.0, -20.0, "takes 20 to 45 W away from endwinding b outer"),
        (-5.0, 45.0, "takes up to 5 W from and adds up to 45 W to endwinding b outer"),
    ],
)
def test_an_unknown_cooling_is_not_called_a_heat(low: float, high: float, says: str) -> None:
    assert watts(replace(UNKNOWN.unknown[0], watts=[low, high])) == says


def test_an_unknown_heat_where_nothing_varies_says_about() -> None:
    heat = replace(UNKNOWN.unknown[0], when={"speed_rpm": [11_998.0, 12_003.0], "current_A": [170.0, 180.0]})
    assert active(heat) == "when speed is about 12,000 rpm and current is 170 to 180 A"


def test_an_unknown_heat_without_a_range_says_no_when() -> None:
    assert active(replace(UNKNOWN.unknown[0], when={})) == ""


def test_an_unknown_heat_that_is_there_while_the_motor_brakes_says_so() -> None:
    heat = replace(UNKNOWN.unknown[0], goes_with=["braking"], when={"speed_rpm": [372.0, 3778.0]})
    assert active(heat) == "while the motor brakes, when speed is 370 to 3,800 rpm"
    assert active(replace(heat, when={})) == "while the motor brakes"
    assert "It goes with" not in diagnosis_text(replace(UNKNOWN, unknown=[heat])), "it was said"


def test_patchwork_says_what_fits_only_together_and_no_watts() -> None:
    heat = replace(UNKNOWN.unknown[0], patchwork=["loss.magnet.speed2", "loss.rotor_surface.speed"])
    text = flat(diagnosis_text(replace(UNKNOWN, unknown=[heat])))
    assert (
        "Something at endwinding b outer has a form that no candidate has: loss.magnet.speed2 and "
        "loss.rotor_surface.speed fit only together, so none of them is named."
    ) in text
    assert "of the strongest" in text
    assert " W at endwinding b outer" not in text


def test_an_unknown_heat_beside_a_named_cause_is_told_too() -> None:
    both = replace(NAMED, unknown=UNKNOWN.unknown)
    assert "Beside that: something adds 20 to 45 W" in answer(both)
    assert "Unknown           Something adds 20 to 45 W" in diagnosis_text(both)


def test_too_little_data_says_what_is_left_and_which_test_would_tell() -> None:
    assert answer(TOO_LITTLE) == (
        "These sessions cannot tell why. Magnet 6.1 K and rotor surface 5.2 K stay above the sensors' own "
        "uncertainty, and of 213 candidates none stands out: best ln BF 6.1 (null 4.6, threshold 8). 1 session to "
        "learn from and none kept cannot say whether an offset is the sensor's, the coolant's or the start's, what "
        "changes from session to session, whether sessions contradict each other and what the extended model gains. "
        "Most telling next test: S2 at 6,000 rpm, 60 s pulses of 300 A."
    )
    assert "1 session (1 to learn from, 0 kept)" in flat(diagnosis_text(TOO_LITTLE))


@pytest.mark.parametrize(
    ("learnt", "kept", "says"),
    [
        (2, 0, "2 sessions to learn from and none kept cannot say which is wrong where the two disagree, offsets that"),
        (1, 1, "1 session to learn from and 1 kept cannot say whether an offset is the sensor's, the coolant's or the"),
        (2, 1, ""),
        (3, 0, ""),
    ],
)
def test_what_fewer_than_three_sessions_cannot_say_is_said(learnt: int, kept: int, says: str) -> None:
    few = replace(SILENT, train=list("abc")[:learnt], held_out=list("d")[:kept])
    assert not_judged(few).startswith(says) and bool(not_judged(few)) == bool(says)
    assert ("gains" in not_judged(few)) == (bool(says) and not kept)
    assert ("Not judged " in flat(diagnosis_text(few))) == bool(says)


def test_sessions_that_contradict_each_other_are_named_with_the_moments_and_by_how_much() -> None:
    one = Contradicting(
        sessions=[session_id("1_s1"), session_id("3_wltp")],
        t_s=[2400.0, 1200.0],
        at={"speed_rpm": 6000.0, "current_A": 100.0, "flow_lpm": 8.0},
        channel="MAG_1",
        node="magnet",
        differ_K=-8.04,
        sd_K=0.83,
    )
    says = (
        "1_s1 (0:40:00) and 3_wltp (0:20:00) ran alike at 6,000 rpm and at 100 A, but MAG_1 (magnet) reads 8.0 K less "
        "in the first, where 0.8 K (sd) is usual: one recording is wrong, or the motor changed between them."
    )
    more = replace(one, differ_K=8.04)
    found = replace(ABSORBED, contradicting=[one, more])
    assert f"Contradiction {says} 1_s1 (0:40:00)" in flat(diagnosis_text(found))
    assert f"{says} {says.replace('less', 'more')}" in answer(found)
    repeated = replace(ABSORBED, contradicting=[replace(one, at={})])
    assert says.replace("at 6,000 rpm and at 100 A", "from the start on") in answer(repeated)
    assert "Contradiction" not in diagnosis_text(ABSORBED)


def test_without_a_channel_or_a_candidate_nothing_is_claimed() -> None:
    blind = replace(SILENT, shown=[], gain=[])
    assert answer(blind).startswith("Nothing can be named. No channel of these sessions observes a node")
    empty = replace(SILENT, candidates=0, gain=[])
    assert answer(empty) == "Nothing can be named. These sessions leave no candidate that could be tried."


def test_rivals_beyond_five_are_counted() -> None:
    many = replace(NAMED, rivals=[replace(RIVALS[0], id=f"loss.node_{'abcdefgh'[i]}.speed3") for i in range(8)])
    assert "and 3 more in the report" in diagnosis_text(many)
    assert "loss.node_f.speed3" not in diagnosis_text(many)


@pytest.mark.parametrize(
    ("cause", "unit", "estimate", "ci95", "says"),
    [
        ("loss.magnet.speed2_current2", "W", 1234.4, [1180.0, 1290.0], "+1,234 W (1,180 to 1,290)"),
        ("conductance.shaft-rotor_core.constant", "W/K", -0.4, [-0.52, -0.31], "−0.40 W/K (−0.52 to −0.31)"),
        ("loss.magnet.scale", "1", 1.35, [1.21, 1.5], "factor 1.35 (1.21 to 1.50)"),
        ("sensor.magnet.gain", "1", 0.0312, [0.0284, 0.0341], "+3.1 % (2.8 to 3.4)"),
        ("input.flow.bias", "lpm", 0.6, [0.4, 0.8], "+0.6 l/min (0.4 to 0.8)"),
        ("sensor.magnet.swap_teeth", "1", 1.0, [1.0, 1.0], ""),
        ("sensor.magnet.hold", "1", 0.1, [0.1, 0.1], ""),
    ],
)
def test_the_size_of_a_cause_has_sign_unit_and_interval(
    cause: str, unit: str, estimate: float, ci95: list[float], says: str
) -> None:
    assert size(replace(EDDY, id=cause, unit=unit, estimate=estimate, ci95=ci95)) == says


def test_samples_that_were_left_out_are_named_but_no_fit_is_with_them() -> None:
    held = replace(
        EDDY,
        id="sensor.magnet.hold",
        says="the sensor at magnet holds one value for a time",
        formula="",
        log_bayes_factor=2 * EDDY.log_bayes_factor,
        evidence=None,
        sayable=False,
    )
    alone = flat(diagnosis_text(replace(NAMED, causes=[held], log_score_gain=None, two_models=None)))
    assert "Answer The sensor at magnet holds one value for a time, a fault of the record, left out; " in alone
    assert "otherwise no cause beyond the file's own coefficients is needed: on kept sessions" in alone
    two = headline(replace(NAMED, causes=[held, replace(held, id="sensor.yoke.hold")]))
    assert two.startswith("The sensor at magnet holds one value for a time, and 1 more fault of the record, left out")
    assert "Named cause sensor.magnet.hold" in alone and "with the cause" not in alone
    assert " with it" not in how_many(replace(NAMED, causes=[held], findings=[PATH]))
    both = replace(NAMED, causes=[held, EDDY], findings=[PATH])
    assert answer(both).startswith(
        "Magnet loss grows with speed squared and current squared, and 1 more cause: on kept"
    )
    assert "with the cause" in flat(diagnosis_text(both)) and "1 without the cause, 0 with it" in how_many(both)
    unnamed = replace(UNKNOWN, causes=[held])
    assert ending(unnamed) is Ending.UNKNOWN, "what was left out explains no error"
    assert "when it is 90 to 140 °C and speed is 3,000 to 6,000 rpm, beside 1 fault of the record" in answer(unnamed)
    assert "Left out as faults of the record: the sensor at magnet holds one value for a time." in answer(unnamed)
    assert "Named cause sensor.magnet.hold" in flat(diagnosis_text(unnamed))


@pytest.mark.parametrize(("value", "says"), [(0.97, "97 %"), (0.9999, "over 99 %"), (0.0001, "under 1 %")])
def test_a_probability_is_never_called_certain(value: float, says: str) -> None:
    assert probability(value) == says


def test_the_worst_of_several_channels_of_a_node_gives_its_place() -> None:
    two = [shown("magnet", 2.0, channel="A"), shown("magnet", 4.0, channel="B", where={"speed_rpm": [100.0, 900.0]})]
    assert "magnet 3.0 K off in the mean of the session learnt from, 11.2 K at worst, most at 100 to 900 rpm" in flat(
        diagnosis_text(replace(SILENT, shown=two))
    )


def test_the_viewer_s_panel_begins_with_the_answer_and_lists_causes_and_gain() -> None:
    text = answer_markdown(TOLD_APART)
    assert text.startswith(f"**{answer(TOLD_APART)}**\n")
    assert "\n`loss.magnet.speed2_current2`: " in text and "`loss of magnet [W] += 96" in text
    assert (
        "- not told apart from `loss.magnet.speed_current2`" in text and "- test that would: S2 at 12,000 rpm" in text
    )
    assert "**Gain on kept sessions**" in text and "d-7f31beef" in text
    assert "## " not in answer_markdown(UNKNOWN)


def test_a_cause_that_is_larger_than_usual_is_named_and_says_so() -> None:
    larger = flat(diagnosis_text(replace(NAMED, causes=[replace(NAMED.causes[0], times_usual=6.2)])))
    assert "; 6 times as large as such a cause usually is" in larger
    assert "usually is" not in flat(diagnosis_text(replace(NAMED, causes=[replace(NAMED.causes[0], times_usual=3.9)])))


def test_what_is_beyond_usual_is_told_before_any_cause_in_a_few_lines() -> None:
    lines = diagnosis_text(STRANGE).splitlines()
    labels = [line[:18].rstrip() for line in lines if line[0] != " "]
    assert labels[1:4] == ["What is wrong", "Beyond usual", "Named cause"]
    text = flat("\n".join(lines))
    for part in (
        "Form of the losses in iron: 3.1 times as far from the file as usual (ln evidence +34.2). Better known with a",
        "The heat path between housing and air had to shrink by 3.5 sd: −75 % (−80 to −70). It ended at its bound,",
        "a factor of 4. Better known with sensors at both ends and 2 more in the report Numbers of the file,",
        "and its sessions that moved further than usual: 3",
    ):
        assert part in text


def test_what_no_healthy_motor_does_is_in_the_first_sentence_where_no_cause_is_named() -> None:
    needed = "No cause beyond the file's own coefficients is needed"
    far = replace(PATH, times_usual=-9.0)
    with_number = headline(replace(ABSORBED, findings=[IRON, replace(PATH, times_usual=4.1), far]))
    assert with_number.startswith(f"{needed}, but the heat path between endwinding and coolant had to shrink by 9.0 sd")
    family = headline(replace(ABSORBED, findings=[IRON, PATH]))
    assert family.startswith(
        f"{needed}, but with the form of the losses in iron 3.1 times as far from the file as usual"
    )
    assert ", but " not in headline(replace(ABSORBED, findings=[PATH, OFFSET]))
    assert ", but " not in headline(replace(NAMED, findings=[IRON]))
    something = headline(UNKNOWN).rstrip(".")
    beside = headline(replace(UNKNOWN, findings=[far]))
    assert beside.startswith(f"{something}, but the heat path between endwinding and coolant had to shrink by 9.0 sd")


def test_with_a_cause_what_is_left_is_told_and_what_the_cause_took_away() -> None:
    text = flat(diagnosis_text(EXPLAINED))
    assert "endwinding and coolant had to grow by 2.1 sd: +62 % (31 to 100)" in text
    assert text.count("sensors at both ends") == 1, "what sharpens two in a row is said once"
    assert (
        "No longer beyond usual with the cause: form of the losses in iron (3.1 times as far from the file as usual) "
        "and the offset of EW_A_inner in 3_wltp (2.2 sd)"
    ) in text
    assert "that moved further than usual: 2 without the cause, 2 with it" in text
    assert "Beyond usual" not in diagnosis_text(NAMED)


def test_a_ln_bf_is_printed_as_fit_and_priors_relieved() -> None:
    text = flat(diagnosis_text(EXPLAINED))
    assert (
        "of that ln BF 120.4 fit (readings are met more closely), 192.3 priors relieved (other numbers move less, "
        "mostly form of the losses in magnet: 150.0), −2.5 rest"
    ) in text
    assert "loss.rotor_surface.speed3: ln BF 288 (120.4 fit, 192.3 priors relieved), 22 behind" in text
    against = comes_from(EvidenceParts(fit=-1.0, priors_relieved=-4.7, rest=0.0, relieved={"films": 4.0}))
    assert against == (
        "−1.0 fit (readings are met less closely), −4.7 priors relieved (other numbers move further), 0.0 rest"
    )


def test_kept_sessions_that_a_cause_makes_less_probable_are_told_as_such() -> None:
    more, less = (replace(NAMED, log_score_gain=sign * 6.37, log_score_gain_lower=-64.2) for sign in (1, -1))
    assert "more probable with the cause: log score, fitted, 6.37 higher, at least −64.2" in gain_notes(more)[0]
    assert "less probable with the cause: log score, fitted, 6.37 lower, at most 64.2" in gain_notes(less)[0]


def test_the_viewer_tells_what_is_beyond_usual_too() -> None:
    assert "**Beyond usual**\n- Form of the losses in iron" in answer_markdown(STRANGE)


def test_several_terms_are_told_step_by_step() -> None:
    told = flat(diagnosis_text(SEVERAL))
    assert (
        "Step by step evidence alone decides on a term; how well each session is predicted from the others is" in told
    )
    assert "mean error over the nodes, each session as the others predict it; kept: of the kept" in told
    assert "as published: 9.00 K (magnet 6.0, rotor surface 12.0); kept 7.50 K" in told
    assert "recalibrated: 6.00 K (magnet 4.0, rotor surface 8.0), 3 of 3 sessions better; kept 5.10 K" in told
    assert "2 sensor.endwinding_b_outer.gain (ln BF 41): 0.90 K (magnet 0.6, rotor surface 1.2), 3 of 3" in told
    alone = replace(SEVERAL, chain=[replace(one, kept_mae_K={}) for one in SEVERAL.chain])
    assert "as the others predict it as published: 9.00 K" in flat(diagnosis_text(alone))
    assert "Step by step" not in diagnosis_text(replace(SEVERAL, causes=[])), "nothing was let in"


def test_where_kept_errors_stop_falling_is_said() -> None:
    assert "nearest to the kept sessions" not in diagnosis_text(SEVERAL), "they fall to the last step"
    worse = replace(SEVERAL.chain[-1], kept_mae_K={"magnet": 30.0})
    told = flat(diagnosis_text(replace(SEVERAL, chain=[*SEVERAL.chain[:-1], worse])))
    before = SEVERAL.chain[-2]
    assert f"nearest to the kept sessions: 1 {before.id}, " in told
    assert "; --steps 1 of whyhot accept takes no more than that" in told
    falling = [replace(one, kept_mae_K={"magnet": 1.0 + one.step}) for one in SEVERAL.chain]
    assert "nearest to the kept sessions: as published, 0.00 K Gain" in flat(
        diagnosis_text(replace(SEVERAL, chain=falling))
    )


def test_a_crude_file_is_told_with_the_evidence_that_it_asks_for() -> None:
    told = flat(diagnosis_text(replace(SEVERAL, crudeness=2.13)))
    assert "The file is crude: its numbers had to move 2.1 times as far as usual, also with what was found" in told
    assert "What was found may be that, and no kept session confirms it as a cause." in told
    assert "its numbers had to move further than usual" in flat(diagnosis_text(replace(SEVERAL, crudeness=1.02)))
    assert "crude" not in flat(diagnosis_text(SEVERAL))


@pytest.mark.parametrize(
    ("probability", "begins", "label"),
    [(0.06, "Rather what the crude file lacks than a cause", "Stands out"), (0.97, "Magnet loss", "Named cause")],
)
def test_an_unlikely_cause_of_a_crude_file_is_not_said_as_one(probability: float, begins: str, label: str) -> None:
    crude = replace(SEVERAL, crudeness=2.13, causes=[replace(EDDY, probability=probability), BIAS])
    told = headline(crude)
    assert told.startswith(begins) and f"\n{label} " in diagnosis_text(crude)
    assert "magnet loss grows with speed squared and current squared, and 1 more cause" in told.lower()


def test_a_heat_without_a_name_in_a_crude_file_is_said_as_what_the_file_lacks() -> None:
    assert headline(UNKNOWN).startswith("Something ")
    assert headline(replace(UNKNOWN, crudeness=2.13)).startswith("The file is crude and lacks something: something ")


@pytest.mark.parametrize("judge", ["sessions left out", "few sessions"])
def test_what_let_terms_in_is_said_where_it_was_not_evidence_alone(judge: str) -> None:
    told = flat(diagnosis_text(replace(SEVERAL, causes=[EDDY], chain=SEVERAL.chain[:3], judged_by=judge)))
    assert (
        "Step by step what recalibration leaves is far above a lumped model's own error, so the file's form is wrong"
        in told
    )
    assert (f"fewer than {ENOUGH_SESSIONS} sessions" in told) == (judge == "few sessions")


def test_what_two_causes_take_is_not_told_of_one() -> None:
    assert "6.4 K recalibrated and 2.3 K with the causes." in answer(SEVERAL)
    assert "with the causes" not in answer(NAMED)
