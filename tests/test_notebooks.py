"""The notebooks run from top to bottom, and what they say of the plant is what happened to it."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ageing_campaign import Campaign, ageing_campaign

from plant import drives, points
from replay.cli import main

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
INSULATION, PAPER = NOTEBOOKS / "insulation.py", NOTEBOOKS / "paper.py"
SHARE_PER_100H = -1.0  # of the conductance from winding to teeth, where ageing is hidden
SPECIMENS = {**{f"aged-{seed}": SHARE_PER_100H for seed in (1, 2)}, **{f"healthy-{seed}": 0.0 for seed in (3, 4)}}


@dataclass(frozen=True)
class Stators:
    """A store with two aged and two healthy stators, `<aged|healthy>-<seed>`, and what truly happened to each."""

    store: Path
    true: dict[str, Campaign]


@pytest.fixture(scope="module")
def stators(tmp_path_factory: pytest.TempPathFactory) -> Stators:
    folder = tmp_path_factory.mktemp("stators")
    true = {
        name: ageing_campaign(folder / name, folder / "store", name, int(name.rpartition("-")[2]), share)
        for name, share in SPECIMENS.items()
    }
    return Stators(folder / "store", true)


def ask(store: Path, sql: str, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """The rows that `whyhot sql` answers."""
    capsys.readouterr()
    assert main(["sql", sql, "--store", str(store), "--json"]) == 0
    rows: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["rows"]
    return rows


def run_script(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", str(INSULATION), *words]
    return subprocess.run(command, env=os.environ, capture_output=True, text=True, check=False)


def defined_by(notebook: Path) -> dict[str, Any]:
    """What the cells of a notebook define when all of them have run."""
    spec = importlib.util.spec_from_file_location(notebook.stem, notebook)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    _, defined = module.app.run()
    return dict(defined)


@pytest.fixture(scope="module")
def insulation(stators: Stators) -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WHYHOT_STORE", str(stators.store))
        return defined_by(INSULATION)


def test_oven_hours_and_doses_are_those_of_the_plant(stators: Stators, capsys: pytest.CaptureFixture[str]) -> None:
    cycles = ask(stators.store, "SELECT * FROM cycles ORDER BY start", capsys)
    checks = ask(stators.store, "SELECT * FROM dc_checks ORDER BY start", capsys)
    for specimen, true in stators.true.items():
        hours = [row["hours_above_180degC"] for row in cycles if row["specimen"] == specimen]
        assert hours == pytest.approx(true.hours, abs=0.05)
        doses = [row["dose_h"] for row in checks if row["specimen"] == specimen]
        assert doses == pytest.approx(true.dose_h, abs=0.1)


def test_a_check_gives_the_resistance_of_the_plant_or_says_why_not(
    stators: Stators, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = ask(stators.store, "SELECT * FROM dc_checks ORDER BY specimen, start", capsys)
    assert all((row["resistance_K_per_W"] is None) == (row["why_no_resistance"] is not None) for row in rows)
    assert sum(row["resistance_K_per_W"] is None for row in rows) <= 0.1 * len(rows)
    for specimen, true in stators.true.items():
        found = [row["resistance_K_per_W"] for row in rows if row["specimen"] == specimen]
        first = next(r / t for r, t in zip(found, true.resistance_K_per_W, strict=True) if r is not None)
        assert first == pytest.approx(1.0, abs=0.15)  # a sensor sits at one place of its node
        ratios = [r / t / first for r, t in zip(found, true.resistance_K_per_W, strict=True) if r is not None]
        assert ratios == pytest.approx([1.0] * len(ratios), abs=0.05)  # and stays there: four standard deviations


def test_the_notebook_sees_the_hidden_ageing_and_none_where_none_is_hidden(
    stators: Stators, insulation: dict[str, Any]
) -> None:
    trends = {row["specimen"]: row for row in insulation["trends"]}
    assert set(trends) == set(stators.true)
    for specimen, row in trends.items():
        assert row["repeatability_percent"] < 3.0
        aged = SPECIMENS[specimen] != 0.0
        if aged:  # the sensors see their places, the truth is of whole nodes
            assert row["slope_percent_per_100h"] == pytest.approx(
                stators.true[specimen].slope_percent_per_100h, rel=0.35
            )
        assert (row["low"] > 0) == aged, row["says"]
        assert ("R rises" if aged else "no change beyond repeatability") in row["says"]


def test_the_picture_shows_every_specimen_with_its_line(stators: Stators, insulation: dict[str, Any]) -> None:
    (axes,) = insulation["figure"].axes
    assert axes.get_title() == "R rises in 2 of 4 specimens"
    assert {text.get_text() for text in axes.get_legend().get_texts()} == set(stators.true)
    insulation["figure"].canvas.draw()


def test_as_a_script_it_prints_a_line_a_specimen(stators: Stators) -> None:
    done = run_script("--store", str(stators.store))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert sorted(line.split(":")[0] for line in lines) == sorted(stators.true)


def test_without_a_store_it_says_in_one_line_what_to_do(tmp_path: Path) -> None:
    done = run_script("--store", str(tmp_path / "none"))
    assert (done.returncode, done.stdout) == (2, "")
    advice = "`whyhot ingest FILE...` makes one, --store DIR or WHYHOT_STORE names another"
    assert done.stderr == f"{tmp_path / 'none'}: there is no store here: {advice}\n"


def test_a_store_without_checks_says_so(tmp_path: Path) -> None:
    log = tmp_path / "room.csv"
    log.write_text("t,a\n0,1\n1,2\n", encoding="utf-8")
    assert main(["ingest", str(log), "--store", str(tmp_path / "store")]) == 0
    done = run_script("--store", str(tmp_path / "store"))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("No check with both resistance and dose")


@pytest.fixture(scope="module")
def paper() -> dict[str, Any]:
    """The figures of the paper from one motor, its points and its drive cycle cut short."""
    s1, s2, wltp = points.s1, points.s2, drives.wltp
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(points, "s1", lambda plant, rpm, minutes, number: s1(plant, rpm, min(minutes, 8.0), number))
        patch.setattr(points, "s2", lambda plant, rpm, minutes, number: s2(plant, rpm, min(minutes, 6.0), number))
        patch.setattr(drives, "wltp", lambda cycles: wltp(cycles).first(900.0))
        return defined_by(PAPER)


def test_every_figure_of_the_paper_is_drawn_from_the_plant(paper: dict[str, Any]) -> None:
    assert [number for number, _ in paper["figures"]] == [10, 10, 11, 12, 13, 14]
    for number, figure in paper["figures"]:
        (axes,) = figure.axes
        assert axes.get_title(loc="left").startswith(f"Fig. {number}: ")
        lines = axes.get_lines()
        assert len(lines) == (2 if number == 14 else 3 if number == 10 else 4)
        for line in lines:
            values = np.asarray(line.get_ydata(), dtype=np.float64)
            assert np.isfinite(values).mean() > 0.9
            assert np.ptp(values[np.isfinite(values)]) > (0.0 if number == 14 else 1.0)
        assert axes.get_lines()[0].get_xdata()[-1] == pytest.approx(15.0, abs=0.1)
        figure.canvas.draw()


def test_each_figure_stands_beside_what_the_paper_says_and_whether_it_is_so(paper: dict[str, Any]) -> None:
    statements = paper["statements"]
    assert list(statements) == [10, 11, 12, 13, 14]
    for number in (10, 11, 12, 13):
        assert statements[number].startswith(("met: ", "NOT met: "))
    gains = paper["first"].gains
    asked = gains["endwinding gain"] >= 3 and gains["magnet gain"] >= 10
    assert statements[10].startswith("met: ") == asked
    assert f"hot spot ({gains['endwinding gain']:.1f} K)" in statements[10]
    assert min(gains.values()) > 1.0, "a first guess is made better"
    mean, largest = paper["magnet_mean"], paper["magnet_largest"]
    assert statements[11].startswith("met: ") == (mean < 1.6 and largest < 6)
    assert mean < 0.7 * paper["open_mean"], "the filter finds the magnet loss"


@pytest.mark.parametrize("notebook", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
def test_every_notebook_passes_the_check_of_marimo(notebook: Path) -> None:
    command = [sys.executable, "-m", "marimo", "check", "--strict", str(notebook)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
