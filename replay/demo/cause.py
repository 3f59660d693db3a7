"""The demo's second half: why. A shipped campaign that hides an effect, taken in and diagnosed."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.models import for_intake
from replay.errors import ViewerError
from replay.shipped import example
from replay.show.plots.compare import picture
from replay.show.reports.documents import write_diagnosis, write_layers
from replay.studies.diagnosis.answer import document
from replay.studies.diagnosis.diagnose import diagnose

LEARN, KEEP = ("1_s1", "2_s2", "3_wltp"), ("4_s1", "5_wltp")


def hidden_effect(folder: Path) -> dict[str, Any]:
    """Store, report, picture and layers of the campaign afresh under `folder`; its diagnosis as a document. Raises
    ReplayDataError where the example did not come with the installation."""
    campaign = example("hidden_effect")
    store_folder = folder / "hidden_effect"
    shutil.rmtree(store_folder, ignore_errors=True)
    logs = sorted(campaign.glob("*.blf"))
    setup = prepare(logs, campaign / "bench.toml", [campaign / "bench.dbc"], for_intake)
    with Store.open(store_folder, create=True, write=True) as store:
        take_in(store, logs, setup, Override())
        known = facts.at(store.ledger)
        train, kept = ([known.session(name) for name in names] for names in (LEARN, KEEP))
        diagnosis = diagnose(store, known, train, kept, None, "testing")
        store.ledger.seal()
        command = f"whyhot diagnose --on {' '.join(LEARN)} --hold-out {' '.join(KEEP)} --store {store_folder}"
        runs = write_diagnosis(store, diagnosis, folder / "why.html", command)
        picture(runs[kept[0].session], folder / "why")
        with suppress(ViewerError):  # rerun is not installed: the demo's first half says so
            write_layers(store, facts.at(store.ledger), KEEP, folder / "layers")
    return document(diagnosis, {})
