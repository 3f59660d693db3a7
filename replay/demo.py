"""The whole way on shipped recordings: ingest, balance, replay, report, layers."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ingest import facts
from ingest.intake import Intake, take_in
from ingest.sessions import Override
from ingest.setup import prepare
from ingest.store import Store
from replay.engine.campaign import replay_sessions
from replay.engine.models import for_intake
from replay.errors import ViewerError
from replay.shipped import example
from replay.show.documents import write_layers, write_replay_report
from replay.show.findings import power_balance
from replay.show.intake import intake_json
from replay.show.overview import overview
from replay.show.plots import picture
from replay.show.terminal import labelled

INTRO = """Five bench recordings of a water-cooled interior-magnet motor, and the thermal network that its authors published for it
(IEEE Trans. Power Electronics 2024, DOI 10.1109/TPEL.2024.3409388; data under MIT licence, examples/hust_motor)."""


@dataclass(frozen=True)
class Demo:
    """What the demo found: text for a person, data for a program, notes for standard error."""

    text: str
    data: dict[str, Any]
    notes: Sequence[str]


def run_demo(folder: Path, store_folder: Path) -> Demo:
    """Everything afresh under `folder`: the store of an earlier demo there is made anew.

    Raises ReplayDataError where the examples did not come with the installation.
    """
    motor = example("hust_motor")
    if store_folder == folder / "store":
        shutil.rmtree(store_folder, ignore_errors=True)
    logs = sorted(motor.glob("*.csv.gz"), key=lambda path: int(path.name.split(".")[0].removeprefix("id_")))
    setup = prepare(logs, motor / "bench.toml", [], for_intake)
    with Store.open(store_folder, create=True, write=True) as store:
        intake = take_in(store, logs, setup, Override())
        outcomes = replay_sessions(store, intake.sessions, None, "testing", 1)
        store.ledger.seal()
        known = facts.at(store.ledger)
        names = [session.name for session in intake.sessions]
        report = folder / "report.html"
        runs = write_replay_report(store, known, names, report, "whyhot demo")
        picture(runs, folder / "picture")
        layers, note = _layers(store, known, names, folder / "layers")
    summaries = [run.summary for run in runs]
    worst = max(summaries, key=lambda summary: max(summary["mae_K"].values()))["session_name"]
    lines = [
        INTRO,
        "",
        *_ingested(intake),
        *(line for text in power_balance(summaries) for line in labelled("Power balance", text)),
    ]
    lines += [
        *overview(summaries),
        "",
        *labelled("Report", f"{report}   (the worst recording as a picture: {folder / 'picture.png'})"),
    ]
    lines += (
        labelled("Layers for rerun", f"{layers[0].parent}/*.rrd   (whyhot view {worst} --store {store_folder})")
        if layers
        else []
    )
    lines += labelled("Next", f"whyhot show {worst} --store {store_folder}")
    data = {
        "schema": "whyhot.demo/1",
        "ingest": intake_json(intake),
        "runs": [{**run.summary, "run": run.run} for run in runs],
        "report": str(report),
        "layers": [str(path) for path in layers],
    }
    return Demo(
        "\n".join(lines), data, [*intake.refusals, *(outcome.refusal for outcome in outcomes if outcome.refusal), *note]
    )


def _ingested(intake: Intake) -> list[str]:
    balances = [one.decode.balance for one in intake.files if one.decode]
    total = {key: sum(balance[key] for balance in balances) for key in balances[0]}
    parts = " + ".join(f"{total[key]:,} {key.replace('_', ' ')}" for key in total if key != "found")
    size = sum(one.size for one in intake.files) / 1e3
    lines = labelled(
        "Ingested",
        f"{len(balances)} recordings, {size:.0f} kB, sealed under their SHA-256. {total['found']:,} rows in the files = {parts}: "
        "the balance holds.",
    )
    return lines + [line for name, flag in intake.flags for line in labelled("", f"{name}: {flag.says}")]


def _layers(store: Store, known: facts.Facts, names: Sequence[str], folder: Path) -> tuple[list[Path], list[str]]:
    try:
        return write_layers(store, known, names, folder), []
    except ViewerError as error:
        return [], [str(error)]
