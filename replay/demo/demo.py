"""The whole way on shipped recordings: ingest, replay, report, layers, and why: the cause, or what cannot be told."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from textwrap import wrap
from typing import Any

from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import Intake, take_in
from ingest.intake.setup import prepare
from replay.demo.ageing import insulation
from replay.demo.cause import hidden_effect
from replay.engine.files.models import for_intake
from replay.engine.runs.campaign import replay_sessions
from replay.errors import ViewerError
from replay.shipped import example
from replay.show.plots.plots import picture
from replay.show.reports.diagnosis_text import diagnosis_text
from replay.show.reports.documents import write_diagnosis, write_layers, write_replay_report
from replay.show.verbs.ageing import ageing_text
from replay.show.verbs.intake import intake_json
from replay.show.verbs.overview import overview
from replay.show.words import words
from replay.show.words.findings import power_balance
from replay.show.words.onward import onward
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.ageing import assessment
from replay.studies.diagnosis.answer import Diagnosis, document, read
from replay.studies.diagnosis.diagnose import diagnose

INTRO = (
    "Eleven bench recordings of a water-cooled interior-magnet motor, and the thermal network that its authors "
    "published (IEEE Trans. Power Electronics 2024, DOI 10.1109/TPEL.2024.3409388; data under MIT licence, "
    "examples/hust_motor)."
)
WHY = (
    "Why? Learnt from eight. Kept are those where this network is furthest off at the rotor (id_4), furthest off at "
    "the stator (id_10), and nearest (id_14):"
)
LEARN = ("id_0", "id_1", "id_2", "id_3", "id_6", "id_7", "id_9", "id_12")
KEEP = ("id_4", "id_10", "id_14")

HIDDEN = (
    "And a campaign with a hidden effect: CAN logs of a simulated 150 kW motor that differs from its motor file in one "
    "thing, and in all that a healthy motor differs in (examples/hidden_effect)."
)
AGEING = (
    "And insulation: two simulated stators through oven cycles at 230 °C with a DC check after each, and checks of a "
    "fleet of 30 motors (examples/insulation)."
)


@dataclass(frozen=True)
class Demo:
    """What the demo found: text for a person, data for a program, notes for standard error."""

    text: str
    data: dict[str, Any]
    notes: Sequence[str]


def run_demo(folder: Path, store_folder: Path, tell: Callable[[str], None]) -> Demo:
    """Everything afresh under `folder`; `tell` hears what is being done. Raises ReplayDataError where the examples are
    not installed."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as beside:  # two motors, two processors
        hidden = beside.submit(hidden_effect, folder)
        aged = beside.submit(insulation, folder)
        real = _real_motor(folder, store_folder, lambda line: tell(f"the real motor: {line}"))
        tell("the simulated motor and the insulation, begun beside it")
        found, stators_and_fleet = hidden.result(), aged.result()
    second = [
        "",
        *wrap(HIDDEN, width()),
        "",
        onward(diagnosis_text(read(found)), folder / "hidden_effect"),
        *labelled("Report", f"{folder / 'why.html'}   (a kept session as a picture: {folder / 'why.png'})"),
    ]
    stores = (folder / "stators", folder / "fleet")
    texts = (ageing_text(assessment.read(one)) for one in stators_and_fleet)
    stators, fleet = (onward(text, store) for text, store in zip(texts, stores, strict=True))
    reports = f"{folder / 'ageing.html'}, {folder / 'fleet.html'}   (the stators as a picture: {folder / 'ageing.png'})"
    second += ["", *wrap(AGEING, width()), "", stators, "", fleet, *labelled("Reports", reports)]
    data = {**real.data, "diagnoses": [*real.data["diagnoses"], found], "ageing": stators_and_fleet}
    return Demo("\n".join([real.text, *second]), data, real.notes)


def _real_motor(folder: Path, store_folder: Path, tell: Callable[[str], None]) -> Demo:
    """The first half: eleven recordings of a real motor."""
    motor = example("hust_motor")
    if store_folder == folder / "store":
        shutil.rmtree(store_folder, ignore_errors=True)
    logs = sorted(motor.glob("*.csv.gz"), key=lambda path: int(path.name.split(".")[0].removeprefix("id_")))
    setup = prepare(logs, motor / "bench.toml", [], for_intake)
    with Store.open(store_folder, create=True, write=True) as store:
        intake = take_in(store, logs, setup, Override(), tell)
        outcomes = replay_sessions(store, intake.sessions, None, "testing", tell=tell)
        store.ledger.seal()
        known = facts.at(store.ledger)
        names = [session.name for session in intake.sessions]
        report = folder / "report.html"
        tell("drawing its report")
        runs = write_replay_report(store, known, names, report, "whyhot demo")
        picture(runs, folder / "picture")
        diagnosis = _why(store, known, folder, tell)
        summaries = [run.summary for run in runs]
        worst = max(summaries, key=lambda summary: max(summary.mae_K.values())).session_name
        shown = [*KEEP, *(name for name in (worst,) if name not in KEEP)]
        layers, note = _layers(store, facts.at(store.ledger), shown, folder / "layers")
    lines = [*wrap(INTRO, width()), "", *_ingested(intake)]
    for text in power_balance(summaries):
        lines += labelled("Power balance", text)
    lines += [*overview(summaries), ""]
    lines += labelled("Report", f"{report}   (the worst recording as a picture: {folder / 'picture.png'})")
    if layers:
        says = f"{layers[0].parent}/*.rrd, of both motors   (whyhot view {worst} --store {store_folder})"
        lines += labelled("Layers for rerun", says)
    lines += ["", *wrap(WHY, width()), "", onward(diagnosis_text(diagnosis), store_folder)]
    data = {
        "schema": "whyhot.demo/1",
        "ingest": intake_json(intake),
        "runs": [{**known.runs[run.run].summary, "run": run.run} for run in runs],
        "report": str(report),
        "layers": [str(path) for path in layers],
        "diagnoses": [document(diagnosis, {})],
    }
    refusals = [*intake.refusals, *(outcome.refusal for outcome in outcomes if outcome.refusal)]
    return Demo("\n".join(lines), data, [*refusals, *note])


def _why(store: Store, known: facts.Facts, folder: Path, tell: Callable[[str], None]) -> Diagnosis:
    train, kept = ([known.session(name) for name in names] for names in (LEARN, KEEP))
    diagnosis = diagnose(store, known, train, kept, None, "testing", tell)
    write_diagnosis(store, diagnosis, folder / "why_real_motor.html", "whyhot demo", tell)
    return diagnosis


def _ingested(intake: Intake) -> list[str]:
    balances = [one.decode.balance for one in intake.files if one.decode]
    total = {key: sum(balance[key] for balance in balances) for key in balances[0]}
    parts = " + ".join(f"{total[key]:,} {key.replace('_', ' ')}" for key in total if key != "found")
    size = words.size(sum(one.size for one in intake.files))
    lines = labelled(
        "Ingested",
        f"{len(balances)} recordings, {size}, sealed under their SHA-256. {total['found']:,} rows in the files "
        f"= {parts}: the balance holds.",
    )
    return lines + [line for name, flag in intake.flags for line in labelled("", f"{name}: {flag.says}")]


def _layers(store: Store, known: facts.Facts, names: Sequence[str], folder: Path) -> tuple[list[Path], list[str]]:
    try:
        return write_layers(store, known, names, folder), []
    except ViewerError as error:
        return [], [str(error)]
