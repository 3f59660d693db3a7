"""`whyhot protocol` on logs of a bench whose truth is integrated by scipy: its magnets lose three times what the file
says."""

from __future__ import annotations

import json
import math
import re
import shlex
import shutil
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from made.browser import faults
from made.onward import next_commands
from replay.cli import main
from replay.show.verbs.protocol import answer as protocol_answer
from replay.show.verbs.protocol import filter_notes, next_points, protocol_text
from replay.studies.characterise.protocol import Proposal, Protocol, run_protocol
from replay.studies.sessions import recorded
from twin.calibration.influence import influence
from twin.calibration.point_choice import gain_nats, information, prior
from twin.diagnosis.next_tests import as_test, menu

FILES = {"1_point": ("s1", 900, 1), "2_pulses": ("s2", 600, 2), "3_drive": ("wltp", 600, 3)}  # kind, seconds, seed


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("protocol")
    can_bench.write_files(folder)
    for day, (name, (kind, seconds, seed)) in enumerate(FILES.items()):
        log = folder / f"{name}.blf"
        can_bench.write_log(log, seconds, seed, can_bench.START + day * 86_400, magnet_loss=90.0)
        words = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc"), "--kind", kind]
        assert main(["ingest", str(log), *words, "--store", str(folder / "store")]) == 0
    return folder


@pytest.fixture(scope="module")
def answer(bench: Path) -> Mapping[str, Any]:
    target = bench / "answer.json"
    words = ["--on", *FILES, "--report", str(bench / "report.html"), "--store", str(bench / "store")]
    assert main(["protocol", *words, "--json", str(target)]) == 0
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def found(bench: Path, answer: Mapping[str, Any]) -> Protocol:
    assert answer
    with Store.open(bench / "store", write=True) as store:
        known = facts.at(store.ledger)
        return run_protocol(store, known, [known.session(name) for name in FILES], None, "testing", lambda _: None)


def test_points_are_learnt_from_and_drive_cycles_checked(answer: Mapping[str, Any]) -> None:
    assert answer["schema"] == "whyhot.protocol/1"
    assert [one["name"] for one in answer["points"]] == ["1_point", "2_pulses"]
    assert [one["name"] for one in answer["drives"]] == ["3_drive"]
    assert answer["converged"] is True


def test_what_the_magnets_lose_is_influential_and_found(answer: Mapping[str, Any]) -> None:
    magnet = next(one for one in answer["influence"] if one["name"] == "loss.magnet.speed2")
    assert magnet["fitted"]
    assert magnet["per_prior_sd_K"]["magnet"] == max(magnet["per_prior_sd_K"].values())
    assert abs(math.log(magnet["value"] / 90.0)) < 3 * magnet["sd"]
    assert next(iter(answer["influence"]))["fitted"]


def test_what_moves_nothing_on_the_drive_stays_as_the_file_says(answer: Mapping[str, Any]) -> None:
    for one in answer["influence"]:
        assert one["fitted"] == (max(one["per_prior_sd_K"].values()) >= 0.1)
        if not one["fitted"]:
            assert one["value"] == one["before"]


def test_the_drive_is_predicted_better_without_being_learnt_from(answer: Mapping[str, Any]) -> None:
    (checked,) = answer["checked"]
    assert checked["before_mae_K"]["magnet"] > 1.0
    assert checked["after_mae_K"]["magnet"] < 0.3
    assert checked["filtered"]["node"] == "magnet"


def test_every_point_leaves_less_unknown_and_the_next_ones_are_proposed(answer: Mapping[str, Any]) -> None:
    course = [answer["unknown_before_K"], *(one["unknown_after_K"] for one in answer["choice"])]
    assert sorted(one["name"] for one in answer["choice"]) == ["1_point", "2_pulses"]
    for node in answer["unknown_before_K"]:
        assert course[0][node] > course[1][node] > course[2][node] > 0
    gains = [one["gain_nats"] for one in answer["choice"]]
    assert gains == sorted(gains, reverse=True)
    rates = [one["gain_nats"] / one["hours"] for one in answer["proposed"]]
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] > 0


def test_the_proposed_points_are_a_chain_that_goes_on_where_the_recorded_ones_end(answer: Mapping[str, Any]) -> None:
    """Every test of the menu, once."""
    says = [one["says"] for one in answer["proposed"]]
    assert len(says) == len(set(says)) == 6
    course = [answer["choice"][-1]["unknown_after_K"], *(one["unknown_after_K"] for one in answer["proposed"])]
    for before, after in pairwise(course):
        assert all(after[node] < before[node] for node in before)


def test_each_proposed_point_is_weighed_beside_those_before_it(bench: Path, found: Protocol) -> None:
    """Without the recorded and the proposed ones before it, a point teaches more."""
    with Store.open(bench / "store") as store:
        known = facts.at(store.ledger)
        network = found.calibration.calibration.network
        tests = [replace(test, meters=()) for test in found.calibration.tests]
        drives = [recorded.test_of(store, known, session, network, (), "testing") for session in found.drives]
    noise = found.calibration.calibration.fit.model.noise
    precision = prior(influence(network, drives).parameters)
    precision = precision + sum(information(network, test, noise) for test in tests)
    offered = {one.words: as_test(network, tests, one) for one in menu(network, tests)}
    for one in found.proposals:
        own = information(network, offered[one.words], noise)
        assert one.gain == pytest.approx(gain_nats(precision, own), rel=1e-6)
        precision = precision + own


def test_how_many_points_are_worth_running_is_said(found: Protocol) -> None:
    few = [Proposal(name, gain, 0.5, found.proposals[0].known_K) for name, gain in (("A", 6.0), ("B", 3.5), ("C", 0.5))]
    assert next_points(replace(found, proposals=tuple(few))) == "A and B teach 95 % of what all 3 would, in 1.0 h"
    assert next_points(replace(found, proposals=(replace(few[0], gain=99.0), *few[1:]))).startswith("A teaches 96 %")


def test_a_node_that_the_fit_makes_worse_is_said(found: Protocol) -> None:
    (before,) = found.before
    assert "; worse: " not in protocol_answer(found)
    right = replace(before, mae_K=before.mae_K | {"yoke": 0.2})
    off = replace(found.after[0], mae_K=found.after[0].mae_K | {"yoke": 0.7})
    told = protocol_answer(replace(found, before=(right,), after=(off,)))
    assert "; worse: yoke 0.2 -> 0.7 K. " in told


def test_why_a_filter_is_worse_than_the_open_loop_is_said(found: Protocol) -> None:
    (after,) = found.after
    assert after.filtered is not None
    winding = next(name for name in after.filtered.measured if "winding" in name)
    event = found.calibration.event

    def notes(mae_K: float, biases: tuple[float, float]) -> list[str]:
        assert after.filtered is not None
        kept = replace(after.filtered, mae_K=dict.fromkeys(after.filtered.mae_K, mae_K))
        summary = replace(after, filtered=kept)
        errors = [{"channel": winding, "bias_K": bias} for bias in biases]
        calibration = replace(found.calibration, event=replace(event, errors=errors))
        return list(filter_notes(replace(found, after=(summary,), calibration=calibration)))

    open_loop = max(one.mae_K for one in after.channels)
    (_, why) = notes(open_loop + 0.5, (0.6, 0.4))
    assert f"a thermometer that is off (by the calibration {winding} reads 0.5 K too much); a [[correction]]" in why
    (_, why) = notes(open_loop + 0.5, (-0.6, -0.4))
    assert f"{winding} reads 0.5 K too little)" in why
    (_, why) = notes(open_loop + 0.5, (0.6, -0.4))
    assert "a thermometer that is off; a [[correction]]" in why
    assert len(notes(0.0, (0.6, 0.4))) == 1


def test_the_report_asks_for_nothing_and_shows_every_part(bench: Path, answer: Mapping[str, Any]) -> None:
    page = (bench / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    for heading in (
        "What each parameter moves",
        "What each point teaches",
        "Check on drive cycles",
        "Fitted parameters",
    ):
        assert re.search(f"<h2( id=[^>]*)?>{heading}</h2>", page)
    (lineage,) = re.findall("<code>whyhot (lineage [^<]+)</code>", page)
    assert f" --store {bench / 'store'} " in lineage and main(lineage.split()) == 0
    assert answer["model"][:12] in page
    assert page.count("<svg") >= 4


def test_the_report_is_as_it_should_be_however_wide_the_screen_and_whoever_reads_it(
    bench: Path, answer: Mapping[str, Any]
) -> None:
    assert answer["schema"] and faults(bench / "report.html") == []


def test_text_says_the_gain_and_the_next_point(
    bench: Path, found: Protocol, capsys: pytest.CaptureFixture[str]
) -> None:
    """Asked again: no fact is added, and the model is the same one."""
    store = bench / "store"
    with Store.open(store) as opened:
        before = opened.ledger.head().position
    capsys.readouterr()
    assert main(["protocol", "--on", *FILES, "--store", str(store)]) == 0
    text = capsys.readouterr().out
    assert "Fitted to 1_point and 2_pulses, servo-5kW is 0." in text
    assert "Not run yet, each beside all above it" in text
    assert "Next points" in text
    assert all(len(line) <= 110 or str(store) in line for line in text.splitlines()), "commands stand on one line"
    with Store.open(store) as opened:
        assert opened.ledger.head().position == before
    (command,) = next_commands(text)
    assert main(shlex.split(command)[1:]) == 0
    (drive,) = found.drives
    longer = replace(found, drives=(replace(drive, end_ns=drive.start_ns + 900 * 10**9),))
    assert "whyhot diagnose --on 3_drive --model" in protocol_text(longer), "here it would be refused as too short"


def test_the_fitted_model_is_published_with_its_parent(bench: Path, answer: Mapping[str, Any]) -> None:
    with Store.open(bench / "store") as store:
        models = facts.at(store.ledger).models
    assert models[answer["model"]].parent == answer["parent"]


@pytest.mark.parametrize(
    ("named", "says"),
    [
        (["1_point", "2_pulses"], "no drive cycle among those named: add one to check on with --on."),
        (["3_drive"], "no S1 or S2 session among those named: add one to fit to with --on."),
    ],
)
def test_what_is_missing_is_said(bench: Path, capsys: pytest.CaptureFixture[str], named: list[str], says: str) -> None:
    assert main(["protocol", "--on", *named, "--store", str(bench / "store")]) == 2
    assert says in capsys.readouterr().err


def test_a_session_of_another_kind_is_refused(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = tmp_path / "store"
    shutil.copytree(bench / "store", store)
    can_bench.write_log(tmp_path / "4_other.blf", 300, 4, can_bench.START + 9 * 86_400)
    words = ["--bench", str(bench / "bench.toml"), "--dbc", str(bench / "bench.dbc"), "--kind", "other"]
    assert main(["ingest", str(tmp_path / "4_other.blf"), *words, "--store", str(store)]) == 0
    assert main(["protocol", "--on", *FILES, "4_other", "--store", str(store)]) == 2
    assert "4_other: of kind other: the protocol learns from S1 and S2" in capsys.readouterr().err


def test_what_a_check_of_the_motor_file_warns_of_is_said_first(
    bench: Path, answer: Mapping[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert answer["warnings"] == []
    iron = "{coefficient = 90.0, speed = 1.5}"
    assert iron in can_bench.MOTOR
    odd = tmp_path / "odd.toml"
    odd.write_text(can_bench.MOTOR.replace(iron, f"{iron}, {{coefficient = -1.0, current = 1.0}}"), encoding="utf-8")
    store = tmp_path / "store"
    shutil.copytree(bench / "store", store)
    capsys.readouterr()
    assert main(["protocol", "--on", *FILES, "--model", str(odd), "--store", str(store)]) == 0
    first = " ".join(capsys.readouterr().out.split("Answer")[0].split())
    assert first.startswith('Motor file the summed loss of "yoke" falls to -1 W at current 1.0, speed 0.0')


def test_without_a_motor_file_the_template_comes_first(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = str(tmp_path / "store")
    alone = tmp_path / "alone.toml"
    alone.write_text(can_bench.BENCH.replace('motor = "motor.toml"\n', ""), encoding="utf-8")
    for name, (kind, _, _) in FILES.items():
        words = ["--bench", str(alone), "--dbc", str(bench / "bench.dbc"), "--kind", kind, "--store", store]
        assert main(["ingest", str(bench / f"{name}.blf"), *words]) == 0
    capsys.readouterr()
    for more, why in (
        ([], "session 1_point: alone.toml names no motor file: the protocol begins with a template."),
        (["--model", "mine.toml"], "--model mine.toml: there is no such file: the protocol begins with a template."),
    ):
        assert main(["protocol", "--on", *FILES, *more, "--store", store]) == 2
        said = capsys.readouterr().err
        assert why in said
        assert "`whyhot motor new --topology ipm_water_jacket -o motor.toml`" in said
        assert "`whyhot motor check motor.toml`" in said
        assert said.count("\n") == 1
