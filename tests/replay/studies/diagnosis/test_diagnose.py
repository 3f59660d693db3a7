"""`whyhot diagnose` on the shipped campaign with a hidden effect: its answer, and what the files do that it offers."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench, read_bench
from ingest.facts import facts as ledger_facts
from ingest.facts.cited import _cites
from ingest.facts.events import BenchRegistered, DiagnosisCompleted, ModelPublished, ReplayCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from plant.hidden_effect import EFFECT, KEEP, LEARN
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.engine.results.run import Run
from replay.engine.results.sealed import load_run
from replay.engine.runs.campaign import replay_sessions
from replay.studies.diagnosis import diagnose
from replay.studies.diagnosis.question import Question
from twin.diagnosis.expressible import expressible
from twin.fitting.fit import Fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import Series
from twin.motor.network import Network

Floats = NDArray[np.float64]

ASKED = ("diagnose", "--on", *LEARN, "--hold-out", *KEEP)

NUMBERS, TEXTS = [float], [str]
OR_NONE = type(None)
# Of every key of the answer: a type, a list with the type of its members or the keys of them, or the types that it
# may have.
EVIDENCE: dict[str, Any] = {**dict.fromkeys(("fit", "priors_relieved", "rest"), float), "relieved": dict}
CAUSE: dict[str, Any] = {
    "evidence": EVIDENCE,
    **dict.fromkeys(("id", "says", "unit"), str),
    **dict.fromkeys(("estimate", "largest_effect_K", "log_bayes_factor", "probability", "member_probability"), float),
    **dict.fromkeys(("significant", "identified", "improved"), bool),
    "ci95": NUMBERS,
    "typical_W": (float, OR_NONE),
    "indistinguishable_from": TEXTS,
    "separating_test": (str, OR_NONE),
}
SHOWN: dict[str, Any] = {
    **dict.fromkeys(("session", "channel", "node"), str),
    **dict.fromkeys(("mae_K", "max_K", "bias_K", "floor_K"), float),
    "white": bool,
    "where": dict,
}
GAIN: dict[str, Any] = {
    **dict.fromkeys(("node", "interval"), str),
    **dict.fromkeys(("mae_before_K", "mae_after_K", "published_mae_K", "outside_trained_share"), float),
    "ci95_K": NUMBERS,
}
FINDING: dict[str, Any] = {
    **dict.fromkeys(("about", "when", "kind", "says", "unit", "sharper"), str),
    **dict.fromkeys(("place", "session", "bound"), (str, OR_NONE)),
    **dict.fromkeys(("log_evidence", "estimate"), (float, OR_NONE)),
    "times_usual": float,
    "ci95": NUMBERS,
}
TELLING: dict[str, Any] = {
    **dict.fromkeys(("says", "node"), str),
    **dict.fromkeys(("differ_K", "times_sensor"), float),
    "channel": (str, OR_NONE),
}
TWO_MODELS: dict[str, Any] = {
    "over_kept": bool,
    "relieved": [{"parameter": str, "before_sd": float, "after_sd": float}],
    "inside": [{"node": str, "mean_K": float, "max_K": float, "session": str, "t_s": float}],
    "points": [{"says": str, "at": dict, "node": str, "differ_K": float}],
    "test": TELLING,
    "sensor": TELLING,
}
LAW: dict[str, Any] = {
    **dict.fromkeys(("cause", "place", "unit"), str),
    **dict.fromkeys(("speed_rpm", "published", "recalibrated", "extended", "low", "high"), NUMBERS),
    "at": dict,
    "rivals": dict,
    "trained_rpm": [NUMBERS],
}
FORESEEN: dict[str, Any] = {
    **dict.fromkeys(("says", "channel", "node"), str),
    "floor_K": float,
    "t_s": NUMBERS,
    "reads": dict,
}
ANSWER: dict[str, Any] = {
    "laws": [LAW],
    "foreseen": FORESEEN,
    "findings": [FINDING],
    **dict.fromkeys(("schema", "diagnosis", "model"), str),
    **dict.fromkeys(("train", "held_out"), TEXTS),
    "shown": [SHOWN],
    "causes": [CAUSE],
    "rivals": [{"id": str, "log_bayes_factor": float, "why_not": str}],
    "unknown": [{"node": str, "watts": NUMBERS, "when": dict, "goes_with": TEXTS}],
    "recalibrated_bench": (str, OR_NONE),
    "recalibrated_benches": dict,
    "extended_benches": dict,
    "extended_model": (str, OR_NONE),
    "extended_bench": (str, OR_NONE),
    "gain": [GAIN],
    "two_models": TWO_MODELS,
    "provenance": dict,
}


def assert_is(value: Any, wanted: Any, where: str) -> None:
    """Whether a value has the type, and so on into its members."""
    if isinstance(wanted, dict):
        assert isinstance(value, dict), where
        for key, one in wanted.items():
            assert key in value, f"{where} lacks {key}"
            assert_is(value[key], one, f"{where}.{key}")
    elif isinstance(wanted, list):
        assert isinstance(value, list), where
        for i, one in enumerate(value):
            assert_is(one, wanted[0], f"{where}[{i}]")
    else:
        types = wanted if isinstance(wanted, tuple) else (wanted,)
        assert type(value) in types or (float in types and type(value) is int), f"{where} is {value!r}"


def _no_such_number(text: str) -> float:
    raise AssertionError(f"{text} is no number of JSON")


def said(capsys: pytest.CaptureFixture[str], store: Path, *words: str, code: int = 0) -> dict[str, Any]:
    """The answer of a verb as JSON."""
    capsys.readouterr()
    assert main([*words, "--json", "--store", str(store)]) == code, capsys.readouterr().err
    answer: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=_no_such_number)
    return answer


class Campaign(Protocol):
    """As `conftest` makes it."""

    store: Path
    answer: Mapping[str, Any]
    base: Fit
    final: Fit
    kept: tuple[Test, ...]


# --- The shipped campaign, diagnosed once ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def diagnosed(campaign: Campaign) -> Path:
    """The store after the diagnosis."""
    return campaign.store


@pytest.fixture(scope="module")
def answer(campaign: Campaign) -> Mapping[str, Any]:
    return campaign.answer


@pytest.fixture
def store(diagnosed: Path, tmp_path: Path) -> Path:
    """A copy, for a test that writes."""
    shutil.copytree(diagnosed, tmp_path / "store")
    return tmp_path / "store"


def known(store: Path) -> Facts:
    with Store.open(store) as opened:
        return ledger_facts.at(opened.ledger)


def position(store: Path) -> int:
    with Store.open(store) as opened:
        return opened.ledger.head().position


def network(store: Path, model: str) -> Network:
    with Store.open(store) as opened:
        return read_motor(opened.archive.read(model), "motor.toml")


def test_the_hidden_cause_is_the_only_one_named_and_its_size_is_within_the_interval(answer: Mapping[str, Any]) -> None:
    (cause,) = answer["causes"]
    assert cause["id"] == EFFECT.cause
    assert cause["unit"] == "W/K"
    low, high = cause["ci95"]
    assert low < EFFECT.size < high
    assert low < cause["estimate"] < high < 3 * low
    assert cause["log_bayes_factor"] > 1.5 * answer["threshold"]
    assert cause["probability"] > 0.9
    assert answer["unknown"] == []


def test_kept_sessions_get_better_with_it_and_so_it_enters_an_extended_model(answer: Mapping[str, Any]) -> None:
    (cause,) = answer["causes"]
    assert cause["improved"] is True
    assert answer["extended_model"] not in (None, answer["model"], answer["recalibrated_model"])
    assert answer["extended_bench"] not in (None, answer["recalibrated_bench"])
    gain = {row["node"]: row for row in answer["gain"]}
    for node, row in gain.items():
        assert row["mae_after_K"] < row["mae_before_K"], node
    for node in ("rotor_surface", "magnet"):
        assert gain[node]["mae_after_K"] < 0.1 * gain[node]["published_mae_K"], node
    assert answer["log_score_gain_lower"] > 0


def test_the_answer_has_every_key_with_its_type_and_no_number_that_is_none(answer: Mapping[str, Any]) -> None:
    assert answer["schema"] == "whyhot.diagnosis/1"
    assert_is(dict(answer), ANSWER, "answer")
    assert answer["shown"]
    assert answer["rivals"]
    assert answer["gain"]


def test_an_answer_is_sealed_without_a_clock_and_in_the_order_in_which_it_was_told(
    diagnosed: Path, answer: Mapping[str, Any]
) -> None:
    assert "seconds" not in answer
    with Store.open(diagnosed) as store:
        for event in ledger_facts.at(store.ledger).diagnoses.values():
            sealed = json.loads(store.archive.read(event.artefact))
            assert "seconds" not in sealed
    told = [json.dumps([one[key] for key in ("causes", "rivals", "chain", "laws")]) for one in (sealed, answer)]
    assert told[0] == told[1]


def test_every_ln_bf_after_a_refit_is_the_sum_of_what_it_comes_from(answer: Mapping[str, Any]) -> None:
    refitted = [one for one in (*answer["causes"], *answer["rivals"]) if "evidence" in one]
    assert refitted[0] == answer["causes"][0]
    for one in refitted:
        evidence = one["evidence"]
        total = evidence["fit"] + evidence["priors_relieved"] + evidence["rest"]
        assert total == pytest.approx(one["log_bayes_factor"], abs=1e-6), one["id"]
        untold = evidence["priors_relieved"] - sum(evidence["relieved"].values())
        assert abs(untold) < 0.1 * 20, "families of under 0.1 each are left out"
        assert list(evidence["relieved"].values()) == sorted(evidence["relieved"].values(), reverse=True)


def test_where_recalibration_alone_stood_in_for_it_the_two_models_are_apart(answer: Mapping[str, Any]) -> None:
    """The more air in the gap carries the faster it turns, the less a fit to slower tests knows of it."""
    found = answer["two_models"]
    assert found["over_kept"] is True
    assert 1 <= len(found["relieved"]) <= 3
    for one in found["relieved"]:
        assert abs(one["before_sd"]) - abs(one["after_sd"]) > 0.5
    seen = {row["node"] for row in answer["gain"]}
    assert not seen & {one["node"] for one in found["inside"]}
    assert {one["session"] for one in found["inside"]} <= set(answer["held_out"])
    means = [one["mean_K"] for one in found["inside"]]
    assert means == sorted(means, reverse=True) and all(one["max_K"] >= one["mean_K"] for one in found["inside"])
    furthest = max(found["points"], key=lambda one: abs(one["differ_K"]))
    assert furthest["at"]["speed_rpm"] == max(one["at"]["speed_rpm"] for one in found["points"])
    assert furthest["node"] in ("rotor_surface", "magnet") and furthest["differ_K"] < -3
    assert found["test"]["channel"] in ("RS", "MAG") and found["test"]["times_sensor"] > 3
    assert found["sensor"]["channel"] is None and found["sensor"]["node"] not in seen


def test_the_law_of_the_cause_is_near_that_of_the_files_offered_and_its_band_that_of_its_size(
    diagnosed: Path, answer: Mapping[str, Any]
) -> None:
    (law,), (cause,) = answer["laws"], answer["causes"]
    assert (law["cause"], law["unit"]) == (cause["id"], "W/K")
    last = law["speed_rpm"].index(16000.0)
    low, found, high = (law[key][last] for key in ("low", "extended", "high"))
    assert (found - low, high - found) == pytest.approx(
        (cause["estimate"] - cause["ci95"][0], cause["ci95"][1] - cause["estimate"]), rel=1e-6
    ), "at 16,000 rpm the cause's feature is 1"
    near = {"published": ("model", 1e-6), "recalibrated": ("recalibrated_model", 0.1)}
    near["extended"] = ("extended_model", 0.1)  # files leave out what is too small to be worth a line
    for key, (model, share) in near.items():
        links = network(diagnosed, answer[model]).links
        (link,) = (one for one in links if {one.a, one.b} == {"rotor_surface", "teeth"})
        at_one = sum(term.coefficient for term in link.terms)
        assert law[key][last] == pytest.approx(at_one, rel=share), key
    assert law["trained_rpm"][-1][1] < 16000.0, "no session went there"
    assert set(law["rivals"]) <= {rival["id"] for rival in answer["rivals"]}


def test_the_next_test_is_foreseen_by_the_models_as_they_were_found_apart(answer: Mapping[str, Any]) -> None:
    test, apart = answer["foreseen"], answer["two_models"]["test"]
    assert (test["says"], test["channel"]) == (apart["says"], apart["channel"])
    (cause,) = answer["causes"]
    differ_K = test["reads"][cause["id"]][-1] - test["reads"]["recalibrated"][-1]
    assert differ_K == pytest.approx(apart["differ_K"], rel=0.05), "the other was run in steps of 10 s"
    assert test["floor_K"] == pytest.approx(abs(apart["differ_K"]) / apart["times_sensor"])
    assert set(test["reads"]) - {"recalibrated", cause["id"]} <= {rival["id"] for rival in answer["rivals"]}
    assert all(len(reads) == len(test["t_s"]) for reads in test["reads"].values())


def test_the_sessions_stand_in_the_answer_by_their_ids(diagnosed: Path, answer: Mapping[str, Any]) -> None:
    ids = {session.name: session.session for session in known(diagnosed).sessions}
    assert answer["train"] == [ids[name] for name in LEARN]
    assert answer["held_out"] == [ids[name] for name in KEEP]
    assert {entry["session"] for entry in answer["shown"]} == set(answer["train"])


def test_what_the_model_gets_wrong_is_largest_at_the_rotor(answer: Mapping[str, Any]) -> None:
    worst = max(answer["shown"], key=lambda entry: entry["mae_K"])
    assert worst["node"] in ("rotor_surface", "magnet")
    assert worst["mae_K"] > 5 * worst["floor_K"]
    assert worst["white"] is False


def test_the_same_question_again_reads_the_sealed_answer(
    store: Path, answer: Mapping[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    before = position(store)
    again = said(capsys, store, "diagnose", "--on", *reversed(LEARN), "--hold-out", *reversed(KEEP))
    assert position(store) == before
    assert {k: v for k, v in again.items() if k != "provenance"} == {
        k: v for k, v in answer.items() if k != "provenance"
    }


def test_the_extended_motor_file_holds_the_new_term_and_its_parent_is_recorded(
    diagnosed: Path, answer: Mapping[str, Any]
) -> None:
    published = known(diagnosed).models
    assert published[answer["extended_model"]].parent == answer["model"]
    assert published[answer["recalibrated_model"]].parent == answer["model"]

    def laws(model: str) -> list[float]:
        """Coefficients over speed to the 1.5 between rotor surface and teeth."""
        links = [k for k in network(diagnosed, model).links if {k.a, k.b} == {"rotor_surface", "teeth"}]
        return [t.coefficient for k in links for t in k.terms if dict(t.exponents) == {"speed": 1.5}]

    assert laws(answer["model"]) == laws(answer["recalibrated_model"]) == []
    assert laws(answer["extended_model"]) == [pytest.approx(answer["causes"][0]["estimate"], rel=1e-3)]


def test_once_accepted_a_kept_session_replays_with_the_extended_model_and_better(
    store: Path, answer: Mapping[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    (published,) = said(capsys, store, "replay", KEEP[0])["runs"]
    assert published["model"] == answer["model"]
    accepted = said(capsys, store, "accept", f"d-{answer['diagnosis'][:8]}")
    assert accepted["causes"] == [EFFECT.cause]
    (extended,) = said(capsys, store, "replay", KEEP[0])["runs"]
    assert extended["model"] == answer["extended_model"]
    assert extended["mae_K"]["rotor_surface"] < 0.5 * published["mae_K"]["rotor_surface"]
    assert main(["verify", "--read", "--store", str(store)]) == 0


def test_the_store_is_intact_after_a_diagnosis(diagnosed: Path) -> None:
    assert main(["verify", "--read", "--store", str(diagnosed)]) == 0


def test_files_that_were_tried_and_are_not_offered_stand_in_the_fact(diagnosed: Path) -> None:
    with Store.open(diagnosed) as opened:
        question = Question(opened, known(diagnosed), [], [], "", "testing")
    question.written.extend(["aaaa", "bbbb", "cccc", "cccc", *question.facts.models])
    offered = [
        ModelPublished(model="aaaa", motor="m", file="m.toml", parent=None),
        BenchRegistered(sha256="bbbb", name="bench.toml", motor=None, model=None),
    ]
    assert diagnose._tried(question, [("stream", one) for one in offered]) == ["cccc"]
    done = DiagnosisCompleted(diagnosis="dddd", key={}, artefact="eeee", summary={}, files=["cccc"])
    assert [one.sha256 for one in _cites(done)] == ["eeee", "cccc"]


# --- Replays of the files that it offers ------------------------------------------------------------------------------

RMS_K, MOST_K = 0.2, 0.3  # replay less prediction: a slope with temperature goes with one node, shares have four digits
RECORDED_K = 0.2  # error of a replay less that of the answer: as above, and the sensors' lags
PUBLISHED_OFF_K = 4.0  # the model as published at the rotor: what 0.5 K is to be seen beside
OPENING_S = 300.0  # of a kept session, while the starts of both are forgotten


@pytest.fixture(scope="module")
def folder(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("extension") / "store"
    shutil.copytree(campaign.store, copy)
    return copy


@pytest.fixture(scope="module")
def runs(campaign: Campaign, folder: Path) -> Mapping[str, Mapping[str, Run]]:
    """Model as the answer calls it -> kept session -> its replay, before anything was accepted."""
    answer = campaign.answer
    found: dict[str, dict[str, Run]] = {}
    with Store.open(folder, write=True) as store:
        facts = ledger_facts.at(store.ledger)
        sessions = [facts.session(one) for one in answer["held_out"]]
        for label in ("model", "recalibrated_model", "extended_model"):
            for outcome in replay_sessions(store, sessions, answer[label], "testing"):
                assert outcome.run is not None, outcome.refusal
                run = load_run(store, ledger_facts.at(store.ledger), outcome.run)
                found.setdefault(label, {})[outcome.session.name] = run
    return found


def fitted(campaign: Campaign, which: str) -> Fit:
    """The fit as files can say it; its cause stands behind the healthy differences. No sensor's bus drives the
    model."""
    found: Fit = getattr(campaign, which)
    healthy = len(campaign.base.model.parameters)
    return expressible(found, range(healthy, len(found.model.parameters)), ())


def predicted(fit: Fit, tests: tuple[Test, ...]) -> dict[tuple[str, str], Series]:
    """(session, channel) -> measured less what the fit says of it, nothing of the session itself estimated."""
    shared = [(p, b) for p, b in zip(fit.model.parameters, fit.beta, strict=True) if p.test is None]
    model = Model(fit.model.network, tests, [p for p, _ in shared])
    series = model.residuals(np.array([b for _, b in shared]))
    return {(tests[one.session].name, one.channel): one for one in series}


def replayed(run: Run, channel: str, at_s: Floats) -> Floats:
    """Measured less modelled of a replay, means over 10 s about these times; NaN where there is none."""
    one = next(o for o in run.observed if o.channel == channel)
    t_s, residual = (one.t_ns[one.used] - run.t_ns[0]) / 1e9, one.residual[one.used]
    near = [residual[np.abs(t_s - at) < 5.0] for at in at_s]
    return np.array([own.mean() if own.size else np.nan for own in near])


@pytest.mark.parametrize(("label", "which"), [("extended_model", "final"), ("recalibrated_model", "base")])
def test_a_replay_gives_what_the_diagnosis_gave(
    campaign: Campaign, runs: Mapping[str, Mapping[str, Run]], label: str, which: str
) -> None:
    found = predicted(fitted(campaign, which), tuple(campaign.kept))
    assert {session for session, _ in found} == set(KEEP)
    for (session, channel), series in found.items():
        late = series.t_s > OPENING_S
        off = (replayed(runs[label][session], channel, series.t_s) - series.y)[late]
        off = off[np.isfinite(off)]
        assert off.size > 0.9 * late.sum()
        assert np.sqrt(np.mean(off**2)) < RMS_K, (session, channel)
        assert np.abs(off).max() < MOST_K, (session, channel)


def test_errors_against_readings_as_recorded_are_those_of_a_replay_that_fits_nothing(
    campaign: Campaign, runs: Mapping[str, Mapping[str, Run]]
) -> None:
    answer: Mapping[str, Any] = campaign.answer
    for gain in answer["gain"]:
        moved = []
        for when, label in (("published", "model"), ("before", "recalibrated_model"), ("after", "extended_model")):
            off = []
            for session, run in runs[label].items():
                one = next(o for o in run.observed if o.node == gain["node"])
                as_recorded = next(o for o in runs["model"][session].observed if o.node == gain["node"]).measured
                off.append(np.abs(as_recorded - one.modelled)[one.used])
                moved.append(((one.measured - as_recorded)[one.used]).mean())
            mean_K = float(np.concatenate(off).mean())
            assert gain["mae_recorded_K"][when] == pytest.approx(mean_K, abs=RECORDED_K), (gain["node"], when)
        assert gain["reading_moved_K"] == pytest.approx(np.mean(moved[-len(runs["model"]) :]), abs=RECORDED_K)


def test_no_channel_is_worse_than_as_published(runs: Mapping[str, Mapping[str, Run]]) -> None:
    def rms(label: str) -> dict[str, float]:
        every = [o for run in runs[label].values() for o in run.observed]
        return {
            name: float(np.sqrt(np.mean(np.concatenate([o.residual[o.used] for o in every if o.channel == name]) ** 2)))
            for name in sorted({o.channel for o in every})
        }

    published, extended = rms("model"), rms("extended_model")
    assert published["RS"] > PUBLISHED_OFF_K
    assert published.keys() == extended.keys()
    for channel, off in extended.items():
        assert off <= published[channel], channel
    assert extended["RS"] < 0.2 * published["RS"]
    assert rms("recalibrated_model")["RS"] > extended["RS"]


def test_errors_stand_under_the_same_node_in_all_of_them(runs: Mapping[str, Mapping[str, Run]]) -> None:
    nodes = {label: set(run.summary.mae_K) for label, each in runs.items() for run in each.values()}
    assert nodes["model"] == nodes["recalibrated_model"] == nodes["extended_model"]
    assert "rotor_surface" in nodes["model"]


def test_the_bench_file_says_what_sensors_follow_and_keeps_all_else(campaign: Campaign, folder: Path) -> None:
    with Store.open(folder) as store:
        facts = ledger_facts.at(store.ledger)
        parent = facts.bench_of(facts.session(KEEP[0]))
        assert parent is not None
        before = store.archive.read(parent.sha256)
        after = store.archive.read(campaign.answer["extended_bench"])
    old, new = (read_bench(text, "bench.toml") for text in (before, after))
    lines, kept = before.decode().splitlines(), after.decode().splitlines()
    changed = [(a, b) for a, b in zip(lines, kept, strict=False) if a != b]
    assert changed
    assert all(a.startswith("node = ") and b.startswith("node = {") for a, b in changed)
    assert all(line.startswith(("#", "[[correction]]", "cause = ", "amount = ")) for line in kept[len(lines) :] if line)
    assert _names(old) == _names(new)
    for a, b in zip(old.channels, new.channels, strict=True):
        if b.weights:
            assert max(b.weights, key=lambda node: b.weights[node]) == a.node
    laws = {one.law for one in new.corrections}
    assert laws <= {"gain", "lag", "offset", "drift", "bias"}


def _names(bench: Bench) -> list[tuple[str, str]]:
    return [(channel.name, channel.quantity) for channel in bench.channels]


def test_after_acceptance_each_model_still_replays_with_its_own_bench_file(
    campaign: Campaign, folder: Path, runs: Mapping[str, Mapping[str, Run]], tmp_path: Path
) -> None:
    shutil.copytree(folder, tmp_path / "store")
    (tmp_path / "accepted").mkdir()
    words = ["--store", str(tmp_path / "store")]
    assert main(["accept", f"d-{campaign.answer['diagnosis'][:8]}", *words]) == 0
    with Store.open(tmp_path / "store") as store:
        events = len(store.ledger.events(ReplayCompleted))
    assert main(["replay", KEEP[0], *words]) == 0  # current by now: the extended model
    assert main(["replay", KEEP[0], "--model", campaign.answer["model"], *words]) == 0
    with Store.open(tmp_path / "store") as store:
        facts = ledger_facts.at(store.ledger)
        assert len(store.ledger.events(ReplayCompleted)) == events  # the runs of before, nothing new
        benches = {run.model: run.bench for run in facts.runs.values() if run.session == campaign.answer["held_out"][0]}
    assert benches[campaign.answer["extended_model"]] == campaign.answer["extended_bench"]
    assert benches[campaign.answer["recalibrated_model"]] == campaign.answer["recalibrated_bench"]
    assert benches[campaign.answer["model"]] not in (None, campaign.answer["extended_bench"])
