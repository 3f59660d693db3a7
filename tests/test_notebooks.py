"""The notebooks run from top to bottom, and what they say of the plant is what happened to it."""

from __future__ import annotations

import ast
import csv
import gzip
import importlib.util
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.errors import not_installed
from ingest.facts import facts
from ingest.facts.events import ModelExtended, ModelPublished
from ingest.facts.store import Store
from made.ageing_campaign import Campaign, ageing_campaign
from made.places import ROOT
from plant import drives, fleet, insulation_campaign, placement, points
from plant.bare_stator import Rig
from plant.timeline import Plan
from replay.cli import main
from replay.engine.files.motor_maps import whole
from replay.show.notebooks import cells, shelf

NOTEBOOKS, MOTOR = ROOT / "notebooks", ROOT / "examples" / "hust_motor"
PAPER = NOTEBOOKS / "paper.py"
OF_A_STORE = ("campaign", "fleet", "insulation", "models")
SHARE_PER_100H = -1.0  # of the conductance from winding to teeth, where ageing is hidden
SPECIMENS = {"aged-1": SHARE_PER_100H, "healthy-3": 0.0}


@dataclass(frozen=True)
class Stators:
    """A store with an aged and a healthy stator, `<aged|healthy>-<seed>`, and what truly happened to each."""

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


def run_script(notebook: str, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", str(NOTEBOOKS / f"{notebook}.py"), *words]
    return subprocess.run(command, env=os.environ, capture_output=True, text=True, check=False)


def said_by_script(notebook: str, store: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """Exit code, output and complaints of a notebook as a script, in this process: what it needs is imported
    already."""
    code = 0
    capsys.readouterr()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [f"{notebook}.py", "--store", str(store)])
        try:
            runpy.run_path(str(NOTEBOOKS / f"{notebook}.py"), run_name="__main__")
        except SystemExit as end:
            code = int(end.code or 0)
    return code, *capsys.readouterr()


def defined_by(notebook: Path) -> dict[str, Any]:
    """What the cells of a notebook define when all of them have run."""
    spec = importlib.util.spec_from_file_location(notebook.stem, notebook)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    _, defined = module.app.run()
    return dict(defined)


def told(store: Path, notebook: str) -> dict[str, Any]:
    """What the cells of a notebook define on a store."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WHYHOT_STORE", str(store))
        return defined_by(NOTEBOOKS / f"{notebook}.py")


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


@dataclass(frozen=True)
class Aged:
    """A store with an assessment, and what was hidden."""

    store: Path
    truth: insulation_campaign.Campaign


@pytest.fixture(scope="module")
def aged(tmp_path_factory: pytest.TempPathFactory) -> Aged:
    """Two stators through eight oven cycles: one gets worse steadily, nothing happens to the other."""
    folder = tmp_path_factory.mktemp("aged")
    plan = Plan(
        stators=2, cycles=8, forms=("monotone", "none"), early_stops=0.0, dead=0.0, electrical=False, cycles_a_log=8,
        period_s=60.0, rig=Rig(step_s=10.0),
    )  # fmt: skip
    written = insulation_campaign.write(folder / "logs", 5, plan)
    store = str(folder / "store")
    for words in written.ingest:
        assert main([*words, "--store", store]) == 0
    assert main(["ageing", "--store", store]) == 0
    return Aged(folder / "store", written.truth)


@pytest.fixture(scope="module")
def motors(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, fleet.Fleet]:
    """A store with checks of a fleet in which one batch ages faster, assessed."""
    folder = tmp_path_factory.mktemp("motors")
    written = fleet.write_checks(folder / "logs", 7, motors=30, checks=(4, 12), batches=3, bad_batches=1)
    logs, store = [str(path) for path in written.tables], str(folder / "store")
    assert main(["ingest", *logs, "--bench", str(written.bench), "--store", store]) == 0
    assert main(["ageing", "--store", store]) == 0
    return folder / "store", written.truth


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of the shipped motor, replayed."""
    store = tmp_path_factory.mktemp("replayed") / "store"
    logs = [str(MOTOR / f"{name}.csv.gz") for name in ("id_1", "id_10")]
    assert main(["ingest", *logs, "--bench", str(MOTOR / "bench.toml"), "--store", str(store)]) == 0
    assert main(["replay", "--store", str(store)]) == 0
    return store


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a log of which nothing is known."""
    folder = tmp_path_factory.mktemp("rows")
    (folder / "room.csv").write_text("t,a\n0,1\n1,2\n", encoding="utf-8")
    assert main(["ingest", str(folder / "room.csv"), "--store", str(folder / "store")]) == 0
    return folder / "store"


def test_the_overview_counts_every_record_and_names_the_hottest_place(replayed: Path) -> None:
    found = told(replayed, "campaign")
    logs = {}
    for name in ("id_1", "id_10"):
        with gzip.open(MOTOR / f"{name}.csv.gz", "rt", encoding="utf-8") as text:
            logs[name] = list(csv.DictReader(text))
    records = sum(len(log) for log in logs.values())
    assert found["answer"][:2] == [
        "2 sessions (other), 2 files",
        f"{records:,} records = {records:,} decoded + 0 unknown id + 0 wrong length + 0 rejected",
    ]
    hottest = max(float(row["endwind_2"]) for row in logs["id_10"])
    assert found["answer"][-1].startswith(f"hottest: endwind_2 {hottest:.1f} °C in hust-ipmsm id_10, after ")
    heat = {(row["session_name"], row["place"]): row for row in found["heats"].to_pylist()}
    for name, log in logs.items():
        values = [float(row["endwind_2"]) for row in log]
        assert heat[name, "endwind_2"]["highest_degC"] == pytest.approx(max(values), abs=1e-3)
        assert heat[name, "endwind_2"]["rise_K"] == pytest.approx(max(values) - values[0], abs=1e-3)


def test_an_overview_of_nothing_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.blf").write_bytes(b"LOGG")
    assert main(["ingest", str(tmp_path / "broken.blf"), "--store", str(tmp_path / "store")]) == 1
    says = "No session in this store yet: whyhot ingest FILE... --bench BENCH.toml takes logs in.\n"
    assert said_by_script("campaign", tmp_path / "store", capsys) == (0, says, "")


def test_the_overview_shows_what_is_wrong_with_the_data(aged: Aged) -> None:
    flags = told(aged.store, "campaign")["flags"].to_pylist()
    assert {(row["specimen"], row["session_name"], row["channel"]) for row in flags} >= {
        (stator.name, "oven_01", "T_winding") for stator in aged.truth.stators
    }
    assert all("no samples for up to" in row["what"] for row in flags)


def test_the_overview_shows_what_is_wrong_with_a_log(tmp_path: Path) -> None:
    (tmp_path / "iso.csv").write_text("t,R_iso\n0,>200\n60,85\n120,90\n", encoding="utf-8")
    store = tmp_path / "store"
    assert main(["ingest", str(tmp_path / "iso.csv"), "--store", str(store)]) == 0
    found = told(store, "campaign")
    (flag,) = found["flags"].to_pylist()
    assert flag["what"].startswith("iso.csv: beyond the range of the meter")
    assert "1 finding about the data" in found["answer"]


def test_the_stator_that_gets_worse_is_told_from_the_one_that_does_not(aged: Aged) -> None:
    found = told(aged.store, "insulation")
    worse, still = aged.truth.stators
    assert [line.split(",")[0].split(" (")[0] for line in found["answer"]] == [
        f"{worse.name}: R rises steadily",
        f"{still.name}: no change beyond repeatability",
    ]
    assert found["picked"].value == worse.name, "the one that changed is shown first"
    checks = found["checks"].to_pylist()
    true = [100 * check.resistance_K_per_W / worse.checks[0].resistance_K_per_W for check in worse.checks]
    assert true[-1] > 110
    assert [row["percent"] for row in checks] == pytest.approx(true, rel=0.05)
    assert [row["dose_h"] for row in checks] == pytest.approx([check.dose_h for check in worse.checks], abs=0.3)
    assert all(row["low"] < row["percent"] < row["high"] for row in checks)


def test_the_dose_is_worth_what_the_rules_say_of_each_cycle(aged: Aged) -> None:
    found = told(aged.store, "insulation")
    cycles = found["cycles"].to_pylist()
    hours = aged.truth.stators[0].hours_above
    assert [row["hours_above_180degC"] for row in cycles] == pytest.approx(hours, abs=0.1)
    kelvin = [row["soak_degC"] + 273.15 for row in cycles]
    faster = [np.exp(1.0 / 8.617333262e-5 * (1 / 453.15 - 1 / T)) for T in kelvin]
    worth = sum(row["hours_above_180degC"] * by for row, by in zip(cycles, faster, strict=True))
    assert found["worth"]["by_activation_h"] == pytest.approx(worth, rel=1e-6)
    doubled = sum(row["hours_above_180degC"] * 2 ** ((row["soak_degC"] - 180) / 10) for row in cycles)
    assert found["worth"]["by_10K_h"] == pytest.approx(doubled, rel=1e-6)


def test_the_batch_that_ages_faster_is_named_in_the_fleet(motors: tuple[Path, fleet.Fleet]) -> None:
    store, truth = motors
    found = told(store, "fleet")
    (bad,) = truth.bad_batches
    assert [line.split(" is not")[0] for line in found["answer"] if "not as the others" in line] == [f"batch {bad}"]
    (other,) = (line for line in found["answer"] if line.startswith("30 specimens in 3 batches"))
    assert f"{len(truth.checks.motor)} checks" in other
    for row in found["motors"].to_pylist():
        assert (row["stands_out"] == "batch") == (row["batch"] == bad)


def test_a_fleet_without_a_batch_has_none_that_stands_out(aged: Aged) -> None:
    answer = told(aged.store, "fleet")["answer"]
    assert answer[0] == "2 specimens in 2 batches, 18 checks; 1 change beyond repeatability"
    assert answer[1] == "none stands out from the others"


def test_the_twins_errors_are_those_of_its_runs(replayed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = told(replayed, "models")
    runs = {row["run"]: row for row in ask(replayed, "SELECT * FROM runs", capsys)}
    assert len(runs) == 2
    errors = {(row["run"], row["node"]): row["mae_K"] for row in found["by_node"]}
    for run, row in runs.items():
        summary = json.loads(row["summary"]) if isinstance(row["summary"], str) else row["summary"]
        for node, mae in summary["mae_K"].items():
            assert errors[run, node] == pytest.approx(mae, rel=1e-3)
    (version,) = found["versions"]
    assert version == "hust-ipmsm, as published"
    mean = sum(row["mae_K"] for row in runs.values()) / 2
    assert found["answer"][0] == f"model {version}: {mean:.1f} K mean absolute error over 2 sessions"
    worst = max(found["by_node"], key=lambda row: row["mae_K"])
    assert found["picked_node"].value == worst["node"]
    assert f"{worst['node']} in {worst['session_name']}" in found["answer"][1]


def test_models_are_called_by_their_role(replayed: Path, tmp_path: Path) -> None:
    """Two more models of the motor, known as a diagnosis leaves them."""
    folder = shutil.copytree(replayed, tmp_path / "store")
    text = (MOTOR / "motor.toml").read_text(encoding="utf-8")
    with Store.open(folder, write=True) as store:
        (first,) = facts.at(store.ledger).models
        for name in ("recalibrated", "extended"):
            (tmp_path / f"{name}.toml").write_text(f"# {name}\n{text}", encoding="utf-8")
            model = store.archive.seal(whole(tmp_path / f"{name}.toml"))
            published = ModelPublished(model=model, motor="hust-ipmsm", file="motor.toml", parent=first)
            store.ledger.append("motor-hust-ipmsm", published)
        extended = ModelExtended(diagnosis="d", parent=first, model=model, parent_bench=None, bench=None)
        store.ledger.append("diagnosis-d", extended)
    for name in ("recalibrated", "extended"):
        assert main(["replay", "id_1", "--model", str(tmp_path / f"{name}.toml"), "--store", str(folder)]) == 0
    found = told(folder, "models")
    assert found["versions"] == ["hust-ipmsm, extended", "hust-ipmsm, recalibrated", "hust-ipmsm, as published"]
    assert first[:8] not in " ".join(found["answer"])


def test_the_map_over_speed_and_current_holds_every_step_of_the_node(
    replayed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = told(replayed, "models")
    node = found["picked_node"].value
    where = f"FROM residuals WHERE used AND node = '{node}'"
    (whole,) = ask(replayed, f"SELECT count(*) AS steps, avg(residual_K) AS bias_K {where}", capsys)
    cells = found["operating"].to_pylist()
    assert len(cells) > 3
    assert sum(cell["steps"] for cell in cells) == whole["steps"]
    bias = sum(cell["steps"] * cell["bias_K"] for cell in cells) / whole["steps"]
    assert bias == pytest.approx(whole["bias_K"], abs=1e-4)


def test_pictures_hold_their_data_and_fetch_nothing(
    aged: Aged, motors: tuple[Path, fleet.Fleet], replayed: Path
) -> None:
    pictures = {
        "campaign": (replayed, ("map_of_heat", "over_time")),
        "insulation": (aged.store, ("chart",)),
        "fleet": (motors[0], ("chart", "per_batch")),
        "models": (replayed, ("error_map", "speed_current", "over_time")),
    }
    for notebook, (store, names) in pictures.items():
        found = told(store, notebook)
        for name in names:
            drawn = found[name].to_dict()
            assert drawn.pop("$schema").startswith("https://vega.github.io/schema/vega-lite/")
            assert "http" not in json.dumps(drawn), f"{notebook}: {name}"
            points = [*drawn.get("datasets", {}).values(), drawn.get("data", {}).get("values", [])]
            assert max(map(len, points)) > 1, f"{notebook}: {name}"


@pytest.mark.parametrize("notebook", OF_A_STORE)
def test_as_a_script_a_notebook_prints_its_answer_alone(
    notebook: str, aged: Aged, motors: tuple[Path, fleet.Fleet], replayed: Path
) -> None:
    store = {"insulation": aged.store, "fleet": motors[0]}.get(notebook, replayed)
    done = run_script(notebook, "--store", str(store))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == told(store, notebook)["answer"]
    assert len(done.stdout.splitlines()) > 1


@pytest.mark.parametrize("notebook", OF_A_STORE)
def test_without_a_store_it_says_in_one_line_what_to_do(
    notebook: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    advice = "`whyhot ingest FILE...` makes one, --store DIR or WHYHOT_STORE names another"
    says = f"{tmp_path / 'none'}: there is no store here: {advice}\n"
    assert said_by_script(notebook, tmp_path / "none", capsys) == (2, "", says)


@pytest.mark.parametrize(
    ("notebook", "says"),
    [
        ("insulation", "No assessment of insulation in this store yet: whyhot ageing --store {} makes one."),
        ("fleet", "No assessment of insulation in this store yet: whyhot ageing --store {} makes one."),
        ("models", "No replay in this store yet: whyhot replay --store {} makes one of each session that has a model."),
    ],
)
def test_a_store_with_nothing_of_the_kind_says_so_in_one_line(
    notebook: str, says: str, rows: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said_by_script(notebook, rows, capsys) == (0, says.format(rows) + "\n", "")


def test_a_sensor_that_went_open_is_not_what_got_hottest(tmp_path: Path) -> None:
    t = np.arange(3600.0)
    noise = np.random.default_rng(1).normal(0.0, 0.05, (2, t.size))
    yoke = np.where((t > 1200) & (t < 1900), 1372.0, 40 + t / 400 + noise[0])
    rows = zip(t, 3000 + 500 * np.sin(t / 90), yoke, 60 + t / 600 + noise[1], strict=True)
    lines = ["t [s],n,T_yoke,T_winding", *(f"{a:.0f},{n:.0f},{y:.3f},{w:.3f}" for a, n, y, w in rows)]
    (tmp_path / "run.csv").write_text("\n".join(lines), encoding="utf-8")
    places = [("n", "speed", "rpm"), ("T_yoke", "temperature", "degC"), ("T_winding", "temperature", "degC")]
    bench = [
        f'[[channel]]\nsignal = "{signal}"\nquantity = "{quantity}"\nunit = "{unit}"\n'
        + f'node = "{signal[2:]}"\n' * signal.startswith("T_")
        for signal, quantity, unit in places
    ]
    (tmp_path / "bench.toml").write_text("".join(bench), encoding="utf-8")
    store = tmp_path / "store"
    words = [str(tmp_path / "run.csv"), "--bench", str(tmp_path / "bench.toml"), "--store", str(store)]
    assert main(["ingest", *words]) == 0
    assert told(store, "campaign")["answer"][-1].startswith("hottest: winding 66.")


def test_heads_are_words_with_units_and_no_hash_is_shown(replayed: Path, aged: Aged, motors: tuple[Path, Any]) -> None:
    tables = {
        "campaign": (replayed, "sessions", ["session"]),
        "models": (replayed, "runs", ["run"]),
        "insulation": (aged.store, "checks", []),
        "fleet": (motors[0], "motors", []),
    }
    for notebook, (store, name, left_out) in tables.items():
        html = cells.tabled(told(store, notebook)[name], *left_out).text
        heads = re.findall("<th>(.*?)</th>", html)
        assert len(heads) > 5
        assert not [head for head in heads if "_" in head], notebook
        assert not re.search(r"[0-9a-f]{32}", html), notebook
        assert not re.search(r"<td>(?:True|False|dip_then_rise|changepoint|monotone)</td>", html), notebook
    assert cells.head("highest_degC") == "highest [°C]"
    assert cells.head("slope_percent_per_100h") == "slope of R [% per 100 h]"


@pytest.mark.parametrize("notebook", OF_A_STORE)
def test_jupyter_runs_each_notebook_and_shows_it_without_a_network(
    notebook: str,
    aged: Aged,
    motors: tuple[Path, fleet.Fleet],
    replayed: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store = {"insulation": aged.store, "fleet": motors[0]}.get(notebook, replayed)
    monkeypatch.setenv("WHYHOT_STORE", str(store))
    target = tmp_path / f"{notebook}.ipynb"
    assert main(["notebook", notebook, "--out", str(target)]) == 0
    shown = _run_by_jupyter(target)
    assert "<h2" in shown
    assert "<table>" in shown
    assert "<svg " in shown
    assert "<marimo-" not in shown, "what only marimo shows"
    assert not re.findall(r'(?:src|href)="http[^"]*"', shown)


def _run_by_jupyter(path: Path) -> str:
    """What the cells of a Jupyter notebook show when all are run from top to bottom, as Jupyter has it: the HTML of
    each last expression."""
    program: list[ast.stmt] = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            *before, last = ast.parse("".join(cell["source"])).body
            shows = isinstance(last, ast.Expr)
            program += [*before, *(ast.parse(f"SHOWN.append({ast.unparse(last)})").body if shows else [last])]
    script, shown = path.with_suffix(".py"), list[Any]()
    script.write_text(ast.unparse(ast.Module(program, [])), encoding="utf-8")
    runpy.run_path(str(script), init_globals={"SHOWN": shown})
    return "".join(value._repr_html_() for value in shown if value is not None)


def test_the_verb_lists_the_notebooks_and_opens_one_in_marimo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["notebook"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == [*sorted([*OF_A_STORE, "paper"]), "next:"]
    assert main(["notebook", "fleat"]) == 2
    assert capsys.readouterr().err == "fleat: there is no such notebook. Nearest: fleet. whyhot notebook lists all\n"
    started: list[list[str]] = []

    def ended(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        started.append(command)
        raise KeyboardInterrupt  # which is how marimo is ended

    monkeypatch.setattr(subprocess, "run", ended)
    assert main(["notebook", "fleet", "--store", str(tmp_path)]) == 0
    words = ["-m", "marimo", "run", str(NOTEBOOKS / "fleet.py"), "--", "--store", str(tmp_path)]
    assert started == [[sys.executable, *words]]


def test_a_notebook_is_written_only_where_it_can_be_read_and_over_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(target: Path) -> str:
        assert main(["notebook", "models", "--out", str(target)]) == 2
        return capsys.readouterr().err.removeprefix(f"{target}: ")

    page = refused(tmp_path / "x.html")
    assert page.startswith(
        "a page made by marimo loads its program from the network and stays empty without it. Write "
    )
    assert page.count("\n") == 1
    assert "x.ipynb and let `jupyter nbconvert --execute --to html` make the page of it" in page
    assert refused(tmp_path / "x.pdf").startswith("a notebook is written as .ipynb for Jupyter or as .py for marimo")
    assert main(["notebook", "models", "--out", str(tmp_path / "x.py")]) == 0
    assert (tmp_path / "x.py").read_bytes() == (NOTEBOOKS / "models.py").read_bytes()
    capsys.readouterr()
    assert refused(tmp_path / "x.py") == "there is a file of this name; give another, or move it away\n"
    monkeypatch.setattr(shelf, "find_spec", lambda name: None if name == "marimo" else object())
    assert main(["notebook", "models"]) == 2
    assert capsys.readouterr().err == f"{not_installed('marimo')}\n"


@pytest.fixture(scope="module")
def paper() -> dict[str, Any]:
    """The figures of the paper from one motor, its points and its drive cycle cut short."""
    s1, s2, wltp = points.s1, points.s2, drives.wltp
    placement.weights("RS")  # from a whole cycle
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
    gains = paper["motor"].gains
    asked = gains["endwinding gain"] >= 3 and gains["magnet gain"] >= 10
    assert statements[10].startswith("met: ") == asked
    assert f"hot spot ({gains['endwinding gain']:.1f} K)" in statements[10]
    assert min(gains.values()) > 1.0, "a first guess is made better"
    mean, largest = paper["magnet_mean"], paper["magnet_largest"]
    assert statements[11].startswith("met: ") == (mean < 1.6 and largest < 6)
    assert mean < 0.7 * paper["open_mean"], "the filter finds the magnet loss"


def test_every_notebook_passes_the_check_of_marimo() -> None:
    notebooks = sorted(NOTEBOOKS.glob("*.py"))
    command = [sys.executable, "-m", "marimo", "check", "--strict", *map(str, notebooks)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {path.stem for path in notebooks} == {*OF_A_STORE, "paper"}
