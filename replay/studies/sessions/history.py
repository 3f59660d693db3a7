"""What a specimen went through before a session: how many of its kind, and how many hours above a temperature."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.catalogue.channels import load
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.specimen.heat_history import trace_of_heat
from twin.motor.ageing_law import HUNDRED_H
from twin.motor.features import above_degC


def course_of(store: Store, facts: Facts, session: SessionRecorded, laws: Sequence[str]) -> dict[str, float]:
    """What the laws across sessions multiply with (`twin.fitting.actions.Course`), law -> number: `session`, how many
    of its kind the specimen had before; `hours_above_<T>degC`, for how many hours it was hotter in all its sessions
    before, in 100 h."""
    if not laws:
        return {}
    before = _before(facts, session)
    limits = {law: degC for law in laws if (degC := above_degC(law)) is not None}
    found = [trace_of_heat(load(store, facts, one)) for one in before] if limits else []
    of_kind = float(sum(one.kind == session.kind for one in before))
    return {
        law: sum(trace.hours_above(limits[law]) for trace in found if trace) / HUNDRED_H if law in limits else of_kind
        for law in laws
    }


def _before(facts: Facts, session: SessionRecorded) -> list[SessionRecorded]:
    """Earlier sessions of the specimen (without absolute time: by their names); where none is named, of the motor."""
    every = list(facts.sessions)
    earlier = every[: [one.session for one in every].index(session.session)]
    return [one for one in earlier if _specimen(facts, one) == _specimen(facts, session)]


def _specimen(facts: Facts, session: SessionRecorded) -> tuple[str | None, str | None]:
    bench = facts.bench_of(session)
    return session.specimen, None if session.specimen or bench is None else bench.motor
