"""The rows behind the SQL views of an assessment, written specimen by specimen: a fleet's are never in memory
together."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from ingest.facts.archive import Archive
from replay.engine.results.artefacts import table_writer
from replay.studies.ageing.assessment import Batch, DcCheck, HotHours, Specimen

AT_ONCE = 10_000  # rows that wait to be written together
UNTOLD = dict.fromkeys(  # of a course that was not weighed
    ("form", "form_probability", "significant", "change_at_dose_h", "slope_percent_per_100h", "slope_low", "slope_high")
)


class Tables:
    """Tables being written into a folder: hours, cycles, checks, specimens, batches."""

    def __init__(self, folder: Path) -> None:
        from analytics.columns import AGEING

        kinds = [kind.removeprefix("ageing_") for kind in AGEING]
        self._files = {kind: folder / f"{kind}.parquet" for kind in kinds}
        self._schemas = {kind: schema_of(kind) for kind in kinds}
        self._writers = {kind: table_writer(self._files[kind], self._schemas[kind]) for kind in kinds}
        self._waiting: dict[str, list[Mapping[str, Any]]] = {kind: [] for kind in kinds}

    def add(self, one: Specimen, hours: Sequence[HotHours], weighed: bool) -> None:
        """The rows of a specimen; `hours` of its sessions, which are not in the answer: they are many. `weighed`:
        whether its course was; nothing is told of it otherwise."""
        whose = {"specimen": one.specimen, "batch": one.batch}
        self._add("hours", (whose | row for session in hours for row in _hour_rows(session)))
        self._add("cycles", (vars(cycle) | whose for cycle in one.cycles))
        self._add("checks", (_check_row(check) | whose for check in one.checks))
        self._add("specimens", [_specimen_row(one) | ({} if weighed else UNTOLD)])

    def sealed(self, archive: Archive, batches: Iterable[Batch]) -> dict[str, str]:
        """Kind -> SHA-256 of its Parquet file in the archive. Nothing can be added afterwards."""
        self._add("batches", map(vars, batches))
        for kind, writer in self._writers.items():
            self._write(kind)
            writer.close()
        return {kind: archive.seal(file) for kind, file in self._files.items()}

    def _add(self, kind: str, rows: Iterable[Mapping[str, Any]]) -> None:
        self._waiting[kind] += rows
        if len(self._waiting[kind]) >= AT_ONCE:
            self._write(kind)

    def _write(self, kind: str) -> None:
        self._writers[kind].write_table(pa.Table.from_pylist(self._waiting[kind], self._schemas[kind]))
        self._waiting[kind] = []


def schema_of(kind: str) -> pa.Schema:
    """The columns of the table of this kind ("hours", "cycles", ...), as the views read them."""
    from analytics.columns import AGEING

    types = {"VARCHAR": pa.string(), "BIGINT": pa.int64(), "DOUBLE": pa.float64(), "BOOLEAN": pa.bool_()}
    return pa.schema([(name, types[said]) for name, said in AGEING[f"ageing_{kind}"].items()])


def _hour_rows(one: HotHours) -> Iterable[dict[str, Any]]:
    """One row for each temperature at which a session spent any time."""
    there = one.heat.hours > 0.0
    whose = {"session": one.session, "session_name": one.session_name, "channel": one.channel}
    for degC, hours in zip(one.heat.degC[there].tolist(), one.heat.hours[there].tolist(), strict=True):
        yield whose | {"degC": degC, "hours": hours}


def _check_row(check: DcCheck) -> dict[str, Any]:
    left = None if check.left is None else json.dumps(check.left, sort_keys=True)
    own = {"sd_K_per_W": check.sd, "source": check.from_, "left": left}
    return vars(check) | _ends("equivalent_{}_h", check.equivalent_h) | own


def _specimen_row(one: Specimen) -> dict[str, Any]:
    return (
        vars(one)
        | {"checks": len(one.checks)}
        | _ends("equivalent_{}_h", one.equivalent_h)
        | _ends("life_used_{}", one.life_used)
        | _ends("slope_{}", one.ci95)
        | _ends("remaining_{}_h", one.remaining_h)
    )


def _ends(name: str, ends: Sequence[float | None] | None) -> dict[str, float | None]:
    """The ends of a range in columns of their own, their names with "low" and "high" in them."""
    low, high = ends or (None, None)
    return {name.format("low"): low, name.format("high"): high}
