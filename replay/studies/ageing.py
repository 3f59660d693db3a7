"""What heat has done to the insulation of every specimen in a store: doses, resistances, courses, and who is not as the others."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.errors import DamageError
from ingest.events import AgeingAssessed, SessionRecorded
from ingest.facts import Facts
from ingest.sessions import natural
from ingest.store import Store
from replay.engine.artefacts import to_parquet
from replay.engine.identity import run_id, source_hash
from replay.errors import ReplayDataError
from replay.studies.assessment import Assessment, Batch, Check, OvenCycle, Specimen, document, read, tables
from replay.studies.dc_checks import Evaluated, evaluated, trace_of
from replay.studies.heat_history import CHECKED, Heat, Trace, doses, in_order, trace_of_heat

if TYPE_CHECKING:
    from analytics.insulation.check_resistance import CheckResistance
    from analytics.insulation.forms import Form
    from analytics.insulation.outlying import SpecimenHealth

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

ELSEWHERE = "evaluated elsewhere"
CRITERION = "conductivity -50 %"


@dataclass(frozen=True)
class Result:
    """The answer, and whether the ledger had it already."""

    assessment: Assessment
    known: bool


def assess(store: Store, facts: Facts, motor: str | None, as_of: str | None, tell: Tell = lambda _: None) -> Result:
    """Assess every specimen that has a DC check or a row in a table of evaluated checks.

    The same question again reads the sealed answer; with `as_of` nothing is written. `motor`: a model whose capacities
    help where no iron is measured. Raises ReplayDataError where the store holds no check of a named specimen.
    """
    key = _key(facts, motor)
    identity = run_id(key)
    if identity in facts.assessments:
        again = facts.assessments[identity]
        if as_of is None and again is not list(facts.assessments.values())[-1]:
            store.ledger.append(f"ageing-{identity}", again)  # the last one is what SQL shows
        return Result(read(json.loads(store.archive.read(facts.assessments[identity].answer))), True)
    found = _assessed(store, facts, motor, as_of, identity, tell)
    if as_of is None:
        _keep(store, found, key)
    return Result(found, False)


def _of_ageing(facts: Facts) -> list[SessionRecorded]:
    """Every session of a specimen that has a check: a hot drive ages its insulation too."""
    checked = {session.specimen for session in facts.sessions if _is_check(facts, session)} - {None}
    return [session for session in facts.sessions if session.specimen in checked]


def _is_check(facts: Facts, session: SessionRecorded) -> bool:
    return session.kind == CHECKED or _is_table(facts, session)


def _is_table(facts: Facts, session: SessionRecorded) -> bool:
    """Whether it holds rows of checks that were evaluated elsewhere."""
    return any(
        channel["quantity"] == "thermal_resistance" and channel["role"] != "ignored"
        for file in session.files
        for channel in facts.decodes[file["decode"]].channels
    )


def _key(facts: Facts, motor: str | None) -> dict[str, Any]:
    """Everything that the answer may depend on, but for the environment."""
    import analytics.insulation

    sessions = _of_ageing(facts)
    return {
        "sessions": _hash(
            [s.session, s.batch, s.kind, facts.current(s.bench) if s.bench else None, [f["decode"] for f in s.files]]
            for s in sessions
        ),
        "motor": motor,
        "insulation": source_hash(Path(analytics.insulation.__file__).parent),
        "studies": source_hash(Path(__file__).parent),
    }


def _hash(rows: Iterable[Sequence[Any]]) -> str:
    return sha256(json.dumps(list(rows)).encode()).hexdigest()


@dataclass(frozen=True)
class _Point:
    """A check with its dose; `worth` (4,) as `_worth`, None where not known; `why`: why there is no dose."""

    session: SessionRecorded
    start_ns: int | None
    dose_h: float | None
    worth: Floats | None
    found: CheckResistance | Evaluated
    why: str | None

    @property
    def resistance(self) -> float | None:
        return self.found.resistance_K_per_W

    @property
    def sd(self) -> float | None:
        return None if isinstance(self.found, Evaluated) else self.found.sd_K_per_W

    @property
    def source(self) -> str | None:
        return ELSEWHERE if isinstance(self.found, Evaluated) else self.found.source

    @property
    def usable(self) -> bool:
        return self.dose_h is not None and self.resistance is not None and self.resistance > 0.0


def _assessed(
    store: Store, facts: Facts, motor: str | None, as_of: str | None, identity: str, tell: Tell
) -> Assessment:
    from analytics.insulation import arrhenius, campaign

    points, cycles, notes = _points(store, facts, as_of, tell)
    if not points:
        raise ReplayDataError(
            'no DC check of a named specimen is in this store: ingest logs of checks with kind = "dc_check" and a specimen, or a '
            "table of evaluated checks with the quantities thermal_resistance and dose."
        )
    names = sorted(points, key=natural)
    batch_of = {name: next((p.session.batch for p in points[name] if p.session.batch), None) for name in names}
    tell("weighing the courses")
    rows = [(name, point) for name in names for point in points[name] if point.usable]
    found = campaign.assess(
        [name for name, _ in rows],
        [batch_of[name] for name, _ in rows],
        [point.dose_h or 0.0 for _, point in rows],
        [point.resistance or 0.0 for _, point in rows],
        [point.sd or 0.0 for _, point in rows],
    )
    repeats = found.repeatability
    compared = {one.specimen: one for one in found.fleet.specimens}
    specimens = [
        _specimen(
            name, batch_of[name], points[name], cycles[name], found.forms.get(name), repeats.sd, compared.get(name)
        )
        for name in names
    ]
    return Assessment(
        assessment=identity,
        motor=facts.models[motor].motor if motor else None,
        threshold_degC=arrhenius.THRESHOLD_DEGC,
        criterion=CRITERION,
        activation_energy_eV={
            "value": arrhenius.ASSUMED.eV,
            "ci95": [rule.eV for rule in arrhenius.ASSUMED_BAND],
            "from": "assumed",
        },
        rules=[rule.name for rule in arrhenius.RULES],
        repeatability_from=f"{100 * repeats.sd:.1f} %, from {repeats.source}"
        if repeats.source != "assumed"
        else "3 %, assumed",
        specimens=specimens,
        batches=[
            Batch(
                batch=one.batch,
                specimens=one.specimens,
                slope_percent_per_100h=one.slope_percent_per_100h,
                score=one.score,
                outlying=one.outlying,
            )
            for one in found.fleet.batches
        ],
        false_discovery_rate=found.fleet.false_discovery_rate,
        notes=notes,
    )


# ---- sessions to points --------------------------------------------------------------------------------------------


def _points(
    store: Store, facts: Facts, as_of: str | None, tell: Tell
) -> tuple[dict[str, list[_Point]], Mapping[str, list[OvenCycle]], list[str]]:
    """Specimen -> its checks in order, specimen -> its oven cycles, and what a person should know of sessions left out."""
    by_specimen: dict[str, list[SessionRecorded]] = defaultdict(list)
    unnamed = 0
    for session in facts.sessions:
        if session.specimen is not None:
            by_specimen[session.specimen].append(session)
        elif _is_check(facts, session):
            unnamed += 1
    tables_of: dict[str, list[Evaluated]] = defaultdict(list)
    if any(_is_table(facts, session) for session in facts.sessions):
        tell("reading tables of evaluated checks")
        for row in evaluated(store, as_of):
            tables_of[row.session].append(row)
    notes = (
        [f"{unnamed} checks without a specimen are left out: ingest them again with --specimen S."] if unnamed else []
    )
    points = {}
    cycles: dict[str, list[OvenCycle]] = defaultdict(list)
    for name, sessions in by_specimen.items():
        found = [p for session in sessions for p in _table_points(session, tables_of.get(session.session, []))]
        logs = [session for session in sessions if session.session not in tables_of]
        if any(session.kind == CHECKED for session in logs):
            tell(f"reading the checks of {name}")
            more, cycles[name], said = _log_points(store, facts, logs)
            found += more
            notes += [f"{name}: {line}" for line in said]
        if found:
            points[name] = sorted(found, key=_place)
    return points, cycles, notes


def _place(point: _Point) -> tuple[float, int]:
    return (math.inf if point.dose_h is None else point.dose_h, point.start_ns or 0)


def _table_points(session: SessionRecorded, rows: Iterable[Evaluated]) -> Iterator[_Point]:
    for row in rows:
        worth = None
        if row.dose_h is not None and row.degC is not None:
            worth = _worth(Heat(np.array([row.degC]), np.array([row.dose_h])))
            worth[0] = row.dose_h
        why = "the row holds no dose" if row.dose_h is None else None
        yield _Point(session, row.t_ns, row.dose_h, worth, row, why)


def _log_points(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded]
) -> tuple[list[_Point], list[OvenCycle], list[str]]:
    from analytics.insulation.check_resistance import evaluate_together

    ordered, by_time = in_order(sessions)
    heats: dict[str, Trace | None] = {}
    traces = {}
    notes = []
    for session in ordered:
        try:
            channels = load(store, facts, session)
        except DamageError as error:
            notes.append(str(error))
            continue
        heats[session.session] = trace_of_heat(channels)
        if session.kind == CHECKED:
            traces[session.session] = trace_of(channels)
    dose = doses(ordered, by_time, heats, _worth)
    answers = evaluate_together(list(traces.values()))
    found = dict(zip(traces, answers, strict=True))
    if not by_time:
        notes.append(
            "its logs have no absolute time: checks and oven sessions were put in order by the numbers in their names"
        )
    points = []
    for session in ordered:
        if session.session in found:
            worth = dose[session.session]
            why = None if worth is not None else "an oven session before it has no temperature of the specimen"
            known = None if worth is None else float(worth[0])
            start = session.start_ns if session.absolute else None
            points.append(_Point(session, start, known, worth, found[session.session], why))
    return points, list(_oven_cycles(ordered, heats)), notes


def _oven_cycles(sessions: Iterable[SessionRecorded], heats: Mapping[str, Trace | None]) -> Iterator[OvenCycle]:
    """Every stay above the threshold in the specimen's sessions, counted in their order."""
    from analytics.insulation.oven_cycle import cycles

    stays = (
        (session, trace, (trace.t_ns[0] - session.start_ns) / 1e9, stay)
        for session in sessions
        if (trace := heats.get(session.session)) is not None
        for stay in cycles((trace.t_ns - trace.t_ns[0]) / 1e9, trace.degC)
    )
    for number, (session, trace, begins_s, stay) in enumerate(stays, 1):
        yield OvenCycle(
            session=session.session,
            session_name=session.name,
            channel=trace.channel,
            number=number,
            start_ns=session.start_ns if session.absolute else None,
            highest_degC=stay.highest_degC,
            soak_degC=stay.soak_degC,
            hours_above=stay.hours_above,
            unknown_h=stay.unknown_h,
            heating_from_s=None if stay.heating_from_s is None else stay.heating_from_s + begins_s,
            soak_from_s=stay.soak_from_s + begins_s,
            soak_to_s=stay.soak_to_s + begins_s,
            cooling_to_s=None if stay.cooling_to_s is None else stay.cooling_to_s + begins_s,
        )


def _worth(heat: Heat) -> Floats:
    """(4,): hours above the threshold, then what they are worth at it by each rule."""
    from analytics.insulation.arrhenius import RULES, THRESHOLD_DEGC, equivalent_hours

    above = heat.hours[heat.degC > THRESHOLD_DEGC].sum()
    return np.array([above, *(equivalent_hours(heat.degC, heat.hours, THRESHOLD_DEGC, rule) for rule in RULES)])


# ---- points to the answer ------------------------------------------------------------------------------------------


def _specimen(
    name: str,
    batch: str | None,
    points: Sequence[_Point],
    cycles: list[OvenCycle],
    form: Form | None,
    repeatability: float,
    compared: SpecimenHealth | None,
) -> Specimen:
    from analytics.insulation import forms
    from analytics.insulation.arrhenius import LIFE_H

    form = form or forms.assess([], [], [])
    first = next((point.resistance for point in points if point.usable), None)
    worth = next((point.worth for point in reversed(points) if point.worth is not None), None)
    return Specimen(
        specimen=name,
        batch=batch,
        cycles=cycles,
        checks=[_check(point, i, first) for i, point in enumerate(points)],
        form=form.name,
        form_probability=form.probability,
        change_at_dose_h=form.change_at_dose_h,
        slope_percent_per_100h=form.slope_percent_per_100h,
        ci95=list(form.ci95) if form.ci95 else None,
        repeatability_percent=100 * repeatability,
        significant=form.significant,
        life_used=None if worth is None else _range(worth[1:] / LIFE_H),
        fleet_slope_percent_per_100h=None,
        fleet_slope_sd=None,
        remaining_h=None,
        score=compared.score if compared else None,
        outlying=bool(compared and compared.outlying),
        why=form.why or (compared.why if compared else "") or None,
    )


def _check(point: _Point, number: int, first: float | None) -> Check:
    found, r = point.found, point.resistance
    return Check(
        session=point.session.session,
        session_name=point.session.name,
        start_ns=point.start_ns,
        number=number,
        dose_h=point.dose_h,
        equivalent_h=None if point.worth is None else _range(point.worth[1:]),
        resistance_K_per_W=r,
        sd=point.sd,
        source=point.source,
        state=getattr(found, "steady", None),
        why=point.why or getattr(found, "why", None),
        conductivity_percent=100 * first / r if first and r else None,
        hottest_channel=getattr(found, "hottest", None),
        hottest_degC=getattr(found, "hottest_degC", None),
    )


def _range(values: Floats) -> list[float]:
    return [float(values.min()), float(values.max())]


def _keep(store: Store, found: Assessment, key: dict[str, Any]) -> None:
    """Seal the answer and its tables, and say so in the ledger."""
    answer = json.dumps(document(found, {}), sort_keys=True).encode()
    store.ledger.append(
        f"ageing-{found.assessment}",
        AgeingAssessed(
            assessment=found.assessment,
            key=key,
            answer=store.archive.seal(answer),
            artefacts={name: store.archive.seal(to_parquet(table)) for name, table in tables(found).items()},
            sessions=sorted({check.session for one in found.specimens for check in one.checks}),
            digest=sha256(answer).hexdigest(),
        ),
    )
