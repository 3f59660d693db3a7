"""`whyhot diagnose` on the shipped campaign with a hidden effect, what follows from its answer, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import pytest

from ingest.errors import BenchFileError
from ingest.facts import facts as ledger_facts
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from made import can_bench
from plant.hidden_effect import EFFECT, KEEP, LEARN
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.studies.diagnosis import offered
from replay.studies.diagnosis.question import LEAST_S
from twin.errors import DivergedError
from twin.motor.network import Network

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
ANSWER: dict[str, Any] = {
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


def test_no_clock_is_sealed_with_an_answer(diagnosed: Path, answer: Mapping[str, Any]) -> None:
    assert "seconds" not in answer
    with Store.open(diagnosed) as store:
        for event in ledger_facts.at(store.ledger).diagnoses.values():
            assert "seconds" not in json.loads(store.archive.read(event.artefact))


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
    again = said(capsys, store, *ASKED)
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


def test_its_report_is_one_file_that_names_the_cause_and_loads_nothing(
    store: Path, answer: Mapping[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "diagnosis.html"
    told = said(capsys, store, "report", f"d-{answer['diagnosis'][:8]}", "--out", str(page))
    assert told["diagnosis"] == answer["diagnosis"]
    html = page.read_text(encoding="utf-8")
    assert EFFECT.cause in html
    loaded = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)|url\(\s*["']?([^)"']*)|@import""", html)
    assert all(a.startswith(("data:", "#")) or b.startswith(("data:", "#")) for a, b in loaded), loaded
    assert "<svg" in html or "data:image" in html


def test_the_store_is_intact_after_a_diagnosis(diagnosed: Path) -> None:
    assert main(["verify", "--read", "--store", str(diagnosed)]) == 0


# --- Refusals, before anything is computed ---------------------------------------------------------------------------

LONG_S = round(LEAST_S) + 100
SHORT_S = 60


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions of one motor, one of another motor, and one whose bench file observes no node."""
    folder = tmp_path_factory.mktemp("refusals")
    blind = can_bench.BENCH
    for node in ("winding", "yoke", "magnet"):
        blind = blind.replace(f'node = "{node}"', 'role = "ignored"')
    benches = {"1_long": can_bench.BENCH, "2_short": can_bench.BENCH, "3_other": can_bench.BENCH, "4_blind": blind}
    for number, (name, bench) in enumerate(benches.items()):
        own = folder / name
        own.mkdir()
        can_bench.write_files(own)
        (own / "bench.toml").write_text(bench, encoding="utf-8")
        if name == "3_other":
            (own / "bench.toml").write_text(bench.replace("servo-01", "servo-02"), encoding="utf-8")
            motor = can_bench.MOTOR.replace("servo-5kW", "servo-9kW")
            (own / "motor.toml").write_text(motor, encoding="utf-8")
        seconds = LONG_S if name in ("1_long", "4_blind") else SHORT_S
        can_bench.write_log(own / f"{name}.blf", seconds, number, can_bench.START + 86_400 * number)
        words = ["ingest", str(own / f"{name}.blf"), "--bench", str(own / "bench.toml")]
        assert main([*words, "--dbc", str(own / "bench.dbc"), "--store", str(folder / "store")]) == 0
    return folder / "store"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ["--on", "1_long", "2_short", "--hold-out", "2_short"],
            "2_short: learnt from and kept at once: a kept session must be one that --on does not name.",
        ),
        (
            ["--on", "1_lon"],
            "session '1_lon': is not in this store. Nearest: 1_long. `whyhot sessions` lists them",
        ),
        (
            ["--on", "2_short"],
            (
                f"too little to tell: 0 min 59 s to learn from, at least {LEAST_S / 60:.0f} min are needed. "
                "Add an S1 or S2 point or a drive cycle with --on."
            ),
        ),
        (
            ["--on", "1_long", "--hold-out", "3_other"],
            "the sessions' bench files name different motor files (1_long names MODEL, 3_other names MODEL): "
            + "say which one with --model.",
        ),
        (
            ["--on", "4_blind"],
            "session 4_blind: no usable channel of level testing observes a node of servo-5kW: "
            "there is nothing to learn from. " + "Say node = ... in the bench file, or leave the session out.",
        ),
    ],
)
def test_a_question_that_cannot_be_answered_is_refused_in_one_line(
    small: Path, capsys: pytest.CaptureFixture[str], words: list[str], line: str
) -> None:
    before = position(small)
    capsys.readouterr()
    assert main(["diagnose", *words, "--store", str(small)]) == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert re.sub(r"\b[0-9a-f]{12}\b", "MODEL", told) == line
    assert position(small) == before


def test_of_a_file_with_which_nothing_converges_the_node_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    can_bench.write_files(tmp_path)
    crude = can_bench.MOTOR.replace("coefficient = 30.0, speed", "coefficient = 100000.0, speed")
    (tmp_path / "motor.toml").write_text(crude, encoding="utf-8")
    can_bench.write_log(tmp_path / "1.blf", LONG_S, 1)
    words = ["--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
    assert main(["ingest", str(tmp_path / "1.blf"), *words, "--store", str(tmp_path / "store")]) == 0
    capsys.readouterr()
    assert main(["diagnose", "--on", "1", "--store", str(tmp_path / "store")]) == 2
    *_, told = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r'diagnosis with model \w+: node "magnet" runs away: more heat comes in than .*', told)


@pytest.mark.parametrize(
    ("step", "error", "why", "replayed"),
    [
        ("version", BenchFileError("bench.toml: no place"), "bench.toml: no place", {"published"}),
        ("as_recorded", DivergedError("temperatures run away"), "in a replay temperatures run away", set()),
    ],
)
def test_what_no_file_can_say_does_not_lose_the_answer(
    campaign: Campaign,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    step: str,
    error: Exception,
    why: str,
    replayed: set[str],
) -> None:
    def refused(*_: object) -> None:
        raise error

    shutil.copytree(campaign.store, tmp_path / "store")
    monkeypatch.setattr(offered, step, refused)
    asked = ["diagnose", "--on", *LEARN[:2], "--hold-out", KEEP[0], "--store", str(tmp_path / "store")]
    assert main([*asked, "--json", str(tmp_path / "answer.json")]) == 0
    answer = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert answer["why_no_files"] == why
    assert answer["recalibrated_model"] is None and answer["extended_model"] is None
    assert not any(cause["improved"] for cause in answer["causes"])
    assert [gain["mae_recorded_K"].keys() for gain in answer["gain"]] == [replayed] * len(answer["gain"])
    assert why in " ".join(capsys.readouterr().out.split())
