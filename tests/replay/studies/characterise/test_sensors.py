"""`whyhot sensors` on logs of a bench whose truth is known, and its margin against normals written out."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from made import can_bench
from replay.cli import main
from replay.studies.characterise.bands import SessionErrors, banded, widening, widenings
from replay.studies.characterise.sensors import exceeded_by


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensors")
    can_bench.write_files(folder)
    for seed in (1, 2, 3):
        can_bench.write_log(folder / f"{seed}_drive.blf", 900, seed, can_bench.START + seed * 86_400, magnet_loss=90.0)
    logs = [str(folder / f"{seed}_drive.blf") for seed in (1, 2, 3)]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    return folder


def _asked(bench: Path, *words: str) -> dict[str, Any]:
    target = bench / "answer.json"
    command = [
        "sensors",
        "--on",
        "1_drive",
        "2_drive",
        "3_drive",
        *words,
        "--store",
        str(bench / "store"),
        "--json",
        str(target),
    ]
    assert main(command) == 0
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def answer(bench: Path) -> Mapping[str, Any]:
    return _asked(bench)


def _by_node(answer: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {one["node"]: one for one in answer["withheld"]}


def test_every_channel_is_withheld_once(answer: Mapping[str, Any]) -> None:
    assert answer["schema"] == "whyhot.sensors/1"
    assert sorted(_by_node(answer)) == ["magnet", "winding", "yoke"]
    for one in answer["withheld"]:
        assert 0 < one["mae_K"] <= one["max_K"]
        assert one["band_K"] >= one["filter_band_K"] > 0
        assert (one["sessions"], one["widened"]) == (3, True)
        assert 0 <= one["filter_covered"] <= one["covered"] <= 1


def test_the_magnet_whose_loss_is_wrong_is_missed_most(answer: Mapping[str, Any]) -> None:
    """Three times the loss that the file says, and nothing between it and the yoke that would tell a filter."""
    found = _by_node(answer)
    assert found["magnet"]["open_loop_K"] > 1.0
    assert found["magnet"]["mae_K"] == max(one["mae_K"] for one in found.values())


def test_one_after_the_other_is_done_without_least_missed_first(answer: Mapping[str, Any]) -> None:
    order = [one["channel"] for one in answer["done_without"]]
    assert len(order) == len(set(order)) == len(answer["withheld"]) - 1
    first = answer["done_without"][0]
    least = min(answer["withheld"], key=lambda one: one["mae_K"])
    assert (first["channel"], first["worst_mae_K"]) == (least["channel"], least["mae_K"])
    good = [one["channel"] for one in answer["done_without"] if one["worst_mae_K"] <= 2.0]
    assert answer["dispensable"] == good[: len(answer["dispensable"])]


def test_without_a_vehicle_s_channel_there_is_no_margin(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["sensors", "--on", "1_drive", "--store", str(bench / "store")]) == 0
    assert "say which a vehicle has with --vehicle CHANNEL" in " ".join(capsys.readouterr().out.split())


def test_the_margin_from_the_winding_s_own_sensor_is_small_and_from_afar_large(
    bench: Path, answer: Mapping[str, Any]
) -> None:
    assert answer["margin"] is None
    names = {node: one["channel"] for node, one in _by_node(answer).items()}
    near, far = (_asked(bench, "--vehicle", names[node])["margin"] for node in ("winding", "yoke"))
    assert near["hottest"] == far["hottest"] == "winding"
    assert abs(near["from_sensor_K"]) < 2.0
    assert far["from_sensor_K"] > 3.0
    assert far["from_filter_K"] < 0.7 * far["from_sensor_K"]
    bold = _asked(bench, "--vehicle", names["yoke"], "--risk", "0.2")["margin"]
    assert bold["from_sensor_K"] < far["from_sensor_K"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--vehicle", "nothing"], 'no channel "nothing" observes a node in these sessions: name one of '),
        (["--on"], "expected at least one argument"),
    ],
)
def test_wrong_words_are_refused_in_a_line(
    bench: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    command = ["sensors", "--store", str(bench / "store"), *(["--on", "1_drive"] if words[0] != "--on" else []), *words]
    try:
        code = main(command)
    except SystemExit as stop:
        code = int(stop.code or 0)
    assert code == 2
    assert says in capsys.readouterr().err


def test_a_margin_is_exceeded_with_its_risk() -> None:
    mean, sd = np.array([0.0, 5.0, 10.0]), np.array([1.0, 2.0, 0.5])
    m = exceeded_by(mean, sd, 0.1)
    assert norm.sf(m, mean, sd).mean() == pytest.approx(0.1)
    assert exceeded_by(np.zeros(1), np.ones(1), 0.025) == pytest.approx(1.96, abs=0.001)


def test_a_widened_band_holds_the_sessions_that_it_was_not_made_from() -> None:
    """Errors that keep their sign through a session and are five times what the filter says of them."""
    random = np.random.default_rng(3)

    def campaign() -> list[SessionErrors]:
        offsets = random.normal(0.0, 5.0, 4)
        return [SessionErrors(offset + random.normal(0.0, 0.1, 50), np.ones(50)) for offset in offsets]

    drawn = [campaign() for _ in range(2000)]
    before, after = (
        np.mean([banded(a, factors(a))[1] for a in drawn]) for factors in (lambda a: [1.0] * len(a), widenings)
    )
    assert before == pytest.approx(2 * norm.cdf(1.96 / 5) - 1, abs=0.03)
    assert after == pytest.approx(0.95, abs=0.015)


def test_a_band_is_never_narrower_than_the_filter_s_own() -> None:
    quiet = [SessionErrors(np.full(10, 0.01), np.ones(10))] * 5
    assert widening(quiet) == 1.0
    assert widenings(quiet) == [1.0] * 5


def test_the_share_is_counted_within_the_band_that_is_shown() -> None:
    """Three sessions that are 1, 2 and 12 K off, the filter sure to 1 K: each one's band is Student's with 2
    sessions, 4.303, times the root mean square of the two others; the third is not within 4.303 times that of 1 and 2
    K. The last has twice the readings."""
    offsets, counts = (1.0, 2.0, 12.0), (10, 10, 20)
    sessions = [SessionErrors(np.full(n, off), np.ones(n)) for off, n in zip(offsets, counts, strict=True)]
    halves = [4.3027 * math.sqrt((a**2 + b**2) / 2) for a, b in ((2.0, 12.0), (1.0, 12.0), (1.0, 2.0))]
    half, covered = banded(sessions, widenings(sessions))
    assert half == pytest.approx((halves[0] + halves[1] + 2 * halves[2]) / 4, rel=1e-4)
    assert covered == pytest.approx(0.5)


@pytest.mark.parametrize("count", [1, 2])
def test_too_few_sessions_make_no_band(count: int) -> None:
    assert widenings([SessionErrors(np.full(10, 9.0), np.ones(10))] * count) == []


def test_one_session_has_the_filter_s_own_band_and_says_so(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = bench / "one.json"
    assert main(["sensors", "--on", "1_drive", "--store", str(bench / "store"), "--json", str(target)]) == 0
    for one in json.loads(target.read_text(encoding="utf-8"))["withheld"]:
        assert (one["sessions"], one["widened"]) == (1, False)
        assert (one["band_K"], one["covered"]) == (one["filter_band_K"], one["filter_covered"])
    capsys.readouterr()
    assert main(["sensors", "--on", "1_drive", "--store", str(bench / "store")]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Bands the filter's own: they hold noise, and not what the model gets wrong" in text
    assert "need 3 sessions with the channel" in text
    assert " % in 1 session" in text
