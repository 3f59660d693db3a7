"""The demo's third part: what heat has done to insulation, of two stators through oven cycles and of a fleet."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.models import for_intake
from replay.shipped import example
from replay.show.reports.ageing_report import write_ageing_report
from replay.show.reports.documents import context
from replay.show.verbs.ageing_plot import picture
from replay.studies.ageing.assess import assess
from replay.studies.ageing.assessment import Assessment, document


def insulation(folder: Path) -> list[dict[str, Any]]:
    """Stores `stators` and `fleet`, a report of each and the picture of the stators afresh under `folder`; both
    assessments as documents. Raises ReplayDataError where the example did not come with the installation."""
    campaign = example("insulation")
    logs = [
        (campaign / name, campaign / f"bench_{kind}.toml", pattern)
        for name in ("S01", "S02")
        for kind, pattern in (("dc", "dc_*.csv.gz"), ("oven", "oven_*.csv.gz"))
    ]
    table = (campaign / "fleet", campaign / "fleet" / "bench.toml", "*.csv.gz")
    stators = _assessed(folder / "stators", logs, folder / "ageing.html")
    picture(stators, folder / "ageing.svg")
    return [document(one, {}) for one in (stators, _assessed(folder / "fleet", [table], folder / "fleet.html"))]


def _assessed(folder: Path, logs: list[tuple[Path, Path, str]], report: Path) -> Assessment:
    shutil.rmtree(folder, ignore_errors=True)
    with Store.open(folder, create=True, write=True) as store:
        for place, bench, pattern in logs:
            paths = sorted(place.glob(pattern))
            named = place.name if bench.parent != place else None
            take_in(store, paths, prepare(paths, bench, [], for_intake), Override(specimen=named))
        found = assess(store, facts.at(store.ledger), None, None)
        store.ledger.seal()
        write_ageing_report(found, report, context(store, f"whyhot ageing --store {folder}"))
    return found
